use std::fmt::Write;

use super::canvas::{Canvas, Type};
use super::edges::arc;
use crate::graph::{NodeId, TopologicalGraph};
use crate::view::layout::GraphLayout;
use crate::view::palette::{INK, Rgb, STAR};

const WHITE: Rgb = Rgb(255, 255, 255);
const BADGE_RADIUS: f32 = 9.5;
const STAR_RADIUS: f32 = 13.0;
/// How far above its place a number stands that would touch the star.
const LIFT: f32 = 24.0;

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
    let mut path = String::new();
    for pair in route.windows(2) {
        if layout.block_of[pair[0].index()] == layout.block_of[pair[1].index()] {
            let ([x0, y0], [x1, y1]) = (layout.at(pair[0]), layout.at(pair[1]));
            let _ = write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}");
        } else {
            path.push_str(&arc(layout, pair[0], pair[1]));
        }
    }
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
    for (number, node) in stage_ends(graph, route).into_iter().enumerate() {
        badge(
            canvas,
            beside(layout.at(node), layout.at(*last)),
            number + 1,
        );
    }
    canvas.star(layout.at(*last), STAR_RADIUS, STAR);
}

/// The first node of the route at which each further subgoal holds, in order.
fn stage_ends(graph: &TopologicalGraph, route: &[NodeId]) -> Vec<NodeId> {
    let mut ends = Vec::new();
    let mut done: Vec<(&str, u32)> = Vec::new();
    for id in route {
        let node = graph.node(*id);
        let known = done.iter().position(|(task, _)| *task == node.task);
        let task = known.unwrap_or_else(|| {
            // A task that is entered half-way has its first subgoals behind it.
            let before = node.progress.saturating_sub(node.reached.len() as u32);
            done.push((&node.task, before));
            done.len() - 1
        });
        let held = &mut done[task].1;
        while *held < node.progress {
            *held += 1;
            ends.push(*id);
        }
    }
    ends
}

/// Where a number stands so that the star covers nothing of it.
fn beside([x, y]: [f32; 2], star: [f32; 2]) -> [f32; 2] {
    let touches = (x - star[0]).hypot(y - star[1]) < BADGE_RADIUS + STAR_RADIUS;
    [x, if touches { y - LIFT } else { y }]
}

fn badge(canvas: &mut Canvas, [x, y]: [f32; 2], number: usize) {
    canvas.push(format_args!(
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{BADGE_RADIUS}\" fill=\"{}\" stroke=\"#ffffff\" \
         stroke-width=\"2\"/>",
        INK.hex()
    ));
    canvas.push(format_args!(
        "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"11.5\" font-weight=\"700\" fill=\"#ffffff\" \
         text-anchor=\"middle\">{number}</text>",
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
    badge(canvas, [x + 150.0, y], 1);
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
        assert_eq!(beside(star, star), [200.0, 26.0]);
        assert_eq!(beside([184.0, 50.0], star), [184.0, 26.0]);
        assert_eq!(beside([170.0, 50.0], star), [170.0, 50.0]);
    }
}
