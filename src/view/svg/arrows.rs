//! Arrows between the states of an automaton of orders, each with its task beside it.

use super::canvas::{Canvas, Type, text_width};
use crate::view::palette::{GREY, INK, Rgb};

const SIZE: f32 = 13.0;
/// How far along an arrow its label may stand, the best place first: a third of the way, where arrows that
/// cross in the middle have parted.
const SHARES: [f32; 5] = [0.36, 0.5, 0.64, 0.25, 0.75];
/// Baselines of labels above an arrow and, where all places there are taken, below it.
const BASELINES: [f32; 2] = [-7.0, 16.0];

/// A transition as it is drawn.
pub(super) struct Arrow<'a> {
    pub(super) from: [f32; 2],
    pub(super) to: [f32; 2],
    /// How far its control points stand above its ends.
    pub(super) bend: f32,
    /// `None` where an optional part is left out.
    pub(super) task: Option<&'a str>,
    pub(super) is_planned: bool,
    pub(super) colour: Rgb,
}

/// What a label covers: left, top, right, bottom.
type Area = [f32; 4];

impl Arrow<'_> {
    /// The line alone.
    pub(super) fn paint(&self, canvas: &mut Canvas) {
        let ([x0, y0], [x1, y1]) = (self.from, self.to);
        let reach = (x1 - x0) * 0.35;
        let dashes = if self.task.is_none() {
            " stroke-dasharray=\"5 4\""
        } else {
            ""
        };
        canvas.push(format_args!(
            "<path d=\"M{x0:.1} {y0:.1}C{:.1} {:.1} {:.1} {:.1} {x1:.1} {y1:.1}\" stroke=\"{}\" \
             stroke-width=\"{}\"{dashes}/>",
            x0 + reach,
            y0 - self.bend,
            x1 - reach,
            y1 - self.bend,
            self.colour.hex(),
            if self.is_planned { 4.0 } else { 1.6 }
        ));
    }

    fn name(&self) -> &str {
        self.task.unwrap_or("left out")
    }

    fn set(&self) -> Type {
        Type {
            size: SIZE,
            weight: if self.is_planned { 700 } else { 400 },
            colour: if self.is_planned {
                self.colour.mixed(INK, 0.25)
            } else {
                GREY
            },
            anchor: "middle",
        }
    }

    /// A point of the line.
    fn at(&self, share: f32) -> [f32; 2] {
        let ([x0, y0], [x1, y1]) = (self.from, self.to);
        let smooth = share * share * (3.0 - 2.0 * share);
        let rise = 3.0 * share * (1.0 - share);
        [
            x0 + (x1 - x0) * share,
            y0 + (y1 - y0) * smooth - self.bend * rise,
        ]
    }

    /// Where its label may stand, the best place first.
    fn places(&self) -> impl Iterator<Item = [f32; 2]> {
        BASELINES.into_iter().flat_map(move |baseline| {
            SHARES.into_iter().map(move |share| {
                let [x, y] = self.at(share);
                [x, y + baseline]
            })
        })
    }

    /// What its label covers at a place, with a little room around.
    fn area(&self, [x, y]: [f32; 2]) -> Area {
        let half = text_width(self.name(), SIZE) / 2.0 + 2.0;
        [x - half, y - 11.0, x + half, y + 3.0]
    }

    /// The first place at which its label covers none of the others, else that at which it covers least.
    fn free_place(&self, taken: &[Area]) -> [f32; 2] {
        let covered = |place: &[f32; 2]| {
            let area = self.area(*place);
            taken
                .iter()
                .fold(0.0_f32, |sum, other| sum + shared(area, *other))
        };
        let best = self
            .places()
            .min_by(|a, b| covered(a).total_cmp(&covered(b)));
        best.unwrap_or(self.from)
    }
}

/// Writes the arrows' tasks beside them so that they can be read.
pub(super) fn label(canvas: &mut Canvas, arrows: &[Arrow<'_>]) {
    // Where there are too many, the planned ones lie on top.
    for (arrow, [x, y]) in place(arrows).into_iter().rev() {
        canvas.text(x, y, arrow.set(), arrow.name());
    }
}

/// The places of all labels; those of planned arrows are chosen first.
fn place<'a, 'b>(arrows: &'a [Arrow<'b>]) -> Vec<(&'a Arrow<'b>, [f32; 2])> {
    let mut taken: Vec<Area> = Vec::new();
    let mut placed = Vec::new();
    for is_planned in [true, false] {
        for arrow in arrows.iter().filter(|a| a.is_planned == is_planned) {
            let place = arrow.free_place(&taken);
            taken.push(arrow.area(place));
            placed.push((arrow, place));
        }
    }
    placed
}

/// How much two areas have in common.
fn shared(a: Area, b: Area) -> f32 {
    let width = a[2].min(b[2]) - a[0].max(b[0]);
    let height = a[3].min(b[3]) - a[1].max(b[1]);
    width.max(0.0) * height.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrow(to: [f32; 2], bend: f32, task: Option<&str>, is_planned: bool) -> Arrow<'_> {
        Arrow {
            from: [60.0, 200.0],
            to,
            bend,
            task,
            is_planned,
            colour: INK,
        }
    }

    fn most_covered(arrows: &[Arrow<'_>]) -> f32 {
        let areas: Vec<Area> = place(arrows).iter().map(|(a, at)| a.area(*at)).collect();
        let pairs = areas.iter().enumerate().flat_map(|(i, a)| {
            let later = areas[i + 1..].iter();
            later.map(move |b| shared(*a, *b))
        });
        pairs.fold(0.0, f32::max)
    }

    #[test]
    fn labels_that_are_free_stand_a_third_of_the_way_along() {
        let arrows = [
            arrow([230.0, 154.0], 0.0, Some("sock"), true),
            arrow([230.0, 246.0], 0.0, Some("trash"), false),
        ];
        for (arrow, [x, y]) in place(&arrows) {
            let [at, line] = arrow.at(SHARES[0]);
            assert_eq!([x, y], [at, line + BASELINES[0]]);
        }
    }

    #[test]
    fn what_is_left_out_stands_beside_the_name_of_the_planned_arrow() {
        let arrows = [
            arrow([230.0, 246.0], 46.0, None, false),
            arrow([230.0, 154.0], 0.0, Some("sock"), true),
        ];
        let placed = place(&arrows);
        assert_eq!(
            placed[0].0.task,
            Some("sock"),
            "the planned one chooses first"
        );
        let [x, y] = arrows[1].at(SHARES[0]);
        assert_eq!(placed[0].1, [x, y + BASELINES[0]]);
        assert_eq!(most_covered(&arrows), 0.0);
        let both = arrows.each_ref().map(|a| {
            let [x, y] = a.at(SHARES[0]);
            a.area([x, y + BASELINES[0]])
        });
        assert!(shared(both[0], both[1]) > 0.0, "at the usual place");
    }

    #[test]
    fn labels_go_below_their_arrows_where_there_is_no_room_above() {
        let arrows: Vec<_> = (0..4)
            .map(|_| arrow([230.0, 200.0], 0.0, Some("sock"), false))
            .collect();
        assert_eq!(most_covered(&arrows), 0.0);
        let below = place(&arrows)
            .iter()
            .filter(|(_, [_, y])| *y > 200.0)
            .count();
        assert!(below > 0);
    }
}
