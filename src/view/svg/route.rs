use std::fmt::Write;

use super::canvas::{Canvas, Type, text_width};
use super::edges::arc;
use crate::graph::{NodeId, TopologicalGraph};
use crate::view::layout::{GraphLayout, is_cross_task};
use crate::view::palette::{INK, Rgb, STAR};

const WHITE: Rgb = Rgb(255, 255, 255);
const BADGE_RADIUS: f32 = 9.5;
const NUMBER_SIZE: f32 = 11.5;
const STAR_RADIUS: f32 = 13.0;
/// How far above its place, or above the star, a number stands that would touch the star.
const LIFT: f32 = 24.0;
/// What two badges above each other leave free between them.
const BETWEEN: f32 = 2.0;

/// The planned route in bold, numbered where it reaches a subgoal, starred where it ends.
pub(super) fn paint(
    canvas: &mut Canvas,
    graph: &TopologicalGraph,
    layout: &GraphLayout,
    route: &[NodeId],
) {
    let (Some(first), Some(last)) = (route.first(), route.last()) else {
        return;
    };
    let path = path(graph, layout, route);
    for (colour, width) in [(WHITE, 6.5), (INK, 3.0)] {
        canvas.push(format_args!(
            "<path d=\"{path}\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\"/>",
            colour.hex()
        ));
    }
    let [x, y] = layout.at(*first);
    canvas.push(format_args!(
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" fill=\"#ffffff\" stroke=\"{}\" \
         stroke-width=\"3\"/>",
        INK.hex()
    ));
    let mut badges = Vec::new();
    let mut texts = Vec::new();
    for (node, numbers) in stage_ends(graph, route) {
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        let text = numbers.join(", ");
        badges.push((layout.at(node), half_width(&text)));
        texts.push(text);
    }
    for (place, text) in apart(&badges, layout.at(*last)).into_iter().zip(texts) {
        badge(canvas, place, &text);
    }
    canvas.star(layout.at(*last), STAR_RADIUS, STAR);
}

/// Straight along the rows, and along the curves between tasks.
fn path(graph: &TopologicalGraph, layout: &GraphLayout, route: &[NodeId]) -> String {
    let mut path = String::new();
    for pair in route.windows(2) {
        if layout.is_curved(graph, pair[0], pair[1]) {
            path.push_str(&arc(layout, pair[0], pair[1]));
        } else {
            let ([x0, y0], [x1, y1]) = (layout.at(pair[0]), layout.at(pair[1]));
            let _ = write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}");
        }
    }
    path
}

/// The nodes of the route at which further subgoals hold, each with the numbers of these: several where it
/// reaches several at once, or is passed again in a later round.
fn stage_ends(graph: &TopologicalGraph, route: &[NodeId]) -> Vec<(NodeId, Vec<usize>)> {
    let mut ends: Vec<(NodeId, Vec<usize>)> = Vec::new();
    let (mut task, mut held, mut number) = ("", 0, 0);
    for (i, id) in route.iter().enumerate() {
        let node = graph.node(*id);
        // A task that is done again is entered by an edge between tasks too.
        let is_entered = i > 0 && is_cross_task(graph, route[i - 1], *id);
        if node.task != task || is_entered {
            task = &node.task;
            // One that is entered half-way has its first subgoals behind it.
            held = node.progress.saturating_sub(node.reached.len() as u32);
        }
        while held < node.progress {
            held += 1;
            number += 1;
            match ends.iter_mut().find(|(end, _)| end == id) {
                Some((_, numbers)) => numbers.push(number),
                None => ends.push((*id, vec![number])),
            }
        }
    }
    ends
}

/// Where badges stand, given their places and half their widths, so that they cover nothing of each other: of two in
/// neighbouring rows, as in two rounds of a task, the upper one stands higher.
fn apart(badges: &[([f32; 2], f32)], star: [f32; 2]) -> Vec<[f32; 2]> {
    let mut from_below: Vec<usize> = (0..badges.len()).collect();
    from_below.sort_by(|a, b| badges[*b].0[1].total_cmp(&badges[*a].0[1]));
    let mut stand: Vec<Option<[f32; 2]>> = vec![None; badges.len()];
    for badge in from_below {
        let (place, half) = badges[badge];
        let mut place = beside(place, half, star);
        let others = || {
            stand
                .iter()
                .zip(badges)
                .filter_map(|(at, (_, half))| Some(((*at)?, *half)))
        };
        // Each time it comes to stand above another one, and never gets below it again.
        while let Some((other, _)) = others().find(|other| touch((place, half), *other)) {
            let above = other[1] - 2.0 * BADGE_RADIUS - BETWEEN;
            place = beside([place[0], above], half, star);
        }
        stand[badge] = Some(place);
    }
    stand.into_iter().flatten().collect()
}

/// Whether two badges, each with half its width, touch.
fn touch(([x0, y0], half0): ([f32; 2], f32), ([x1, y1], half1): ([f32; 2], f32)) -> bool {
    let straight = half0 + half1 - 2.0 * BADGE_RADIUS;
    let between = ((x0 - x1).abs() - straight).max(0.0);
    between.hypot(y0 - y1) < 2.0 * BADGE_RADIUS
}

/// Where numbers stand so that the star covers nothing of them.
fn beside([x, y]: [f32; 2], half_width: f32, star: [f32; 2]) -> [f32; 2] {
    let apart = ((x - star[0]).abs() - (half_width - BADGE_RADIUS)).max(0.0);
    let touches = apart.hypot(y - star[1]) < BADGE_RADIUS + STAR_RADIUS;
    [x, if touches { y.min(star[1]) - LIFT } else { y }]
}

/// Of the badge around these numbers, which is a circle as long as they fit.
fn half_width(numbers: &str) -> f32 {
    (text_width(numbers, NUMBER_SIZE) / 2.0 + 3.0).max(BADGE_RADIUS)
}

fn badge(canvas: &mut Canvas, [x, y]: [f32; 2], numbers: &str) {
    let half = half_width(numbers);
    let look = format!(
        "fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"2\"/>",
        INK.hex()
    );
    if half > BADGE_RADIUS {
        canvas.push(format_args!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"{BADGE_RADIUS}\" \
             {look}",
            x - half,
            y - BADGE_RADIUS,
            2.0 * half,
            2.0 * BADGE_RADIUS
        ));
    } else {
        canvas.push(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{BADGE_RADIUS}\" {look}"
        ));
    }
    canvas.push(format_args!(
        "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"{NUMBER_SIZE}\" font-weight=\"700\" \
         fill=\"#ffffff\" text-anchor=\"middle\">{numbers}</text>",
        y + 4.1
    ));
}

/// How the route looks, for the legend: a piece of line, a badge and a star.
pub(super) fn sample(canvas: &mut Canvas, x: f32, y: f32) {
    canvas.push(format_args!(
        "<path d=\"M{x:.1} {y:.1}h30\" stroke=\"{}\" stroke-width=\"3\" stroke-linecap=\"round\"/>",
        INK.hex()
    ));
    let set = Type {
        colour: INK,
        ..Type::default()
    };
    canvas.text(x + 40.0, y + 4.5, set, "planned route");
    badge(canvas, [x + 150.0, y], "1");
    canvas.text(x + 166.0, y + 4.5, set, "reaches a subgoal");
    canvas.star([x + 300.0, y], 9.0, STAR);
    canvas.text(x + 316.0, y + 4.5, set, "chosen final state");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_stands_above_its_place_where_the_star_would_cover_it() {
        let star = [200.0, 50.0];
        let beside = |place| beside(place, half_width("7"), star);
        assert_eq!(beside(star), [200.0, 26.0]);
        assert_eq!(beside([184.0, 50.0]), [184.0, 26.0]);
        assert_eq!(beside([170.0, 50.0]), [170.0, 50.0]);
    }

    #[test]
    fn badges_in_neighbouring_rows_stand_apart_and_others_stay() {
        let star = [900.0, 50.0];
        let narrow = half_width("1");
        let places = [[100.0, 50.0], [100.0, 66.0], [100.0, 58.0], [130.0, 60.0]];
        let badges = places.map(|place| (place, narrow));
        let stand = apart(&badges, star);
        assert_eq!(
            stand,
            [[100.0, 24.0], [100.0, 66.0], [100.0, 45.0], [130.0, 60.0]]
        );
        // Beside a wide one there is less room.
        let wide = [
            ([130.0, 60.0], half_width("3, 11, 19")),
            ([100.0, 58.0], narrow),
        ];
        assert_eq!(apart(&wide, star), [[130.0, 60.0], [100.0, 39.0]]);
        // Where it has to go the star is, too.
        let ends = [([200.0, 66.0], narrow), ([200.0, 60.0], narrow)];
        let stand = apart(&ends, [200.0, 50.0]);
        assert_eq!(stand, [[200.0, 26.0], [200.0, 5.0]]);
    }

    #[test]
    fn several_numbers_share_a_wider_badge() {
        let star = [200.0, 50.0];
        assert_eq!(half_width("12"), BADGE_RADIUS);
        let half = half_width("3, 8");
        assert!(half > BADGE_RADIUS);
        assert_eq!(beside([172.0, 50.0], half, star), [172.0, 26.0]);
        let mut canvas = Canvas::new(400.0, 100.0);
        badge(&mut canvas, [170.0, 50.0], "3, 8");
        let drawn = canvas.finish();
        assert!(drawn.contains(">3, 8</text>") && !drawn.contains("<circle"));
    }
}
