//! What all plots of bars share: grid, labels, bars with whiskers and figures, and marks of what was published.

use super::canvas::{Canvas, Type, text_width};
use crate::view::palette::{self, GREY, INK, Rgb};

pub(super) const WIDTH: f32 = 900.0;
/// Where the rows begin.
pub(super) const TOP: f32 = 84.0;
pub(super) const LABEL_SIZE: f32 = 14.0;
/// From the middle of a published value's mark to its corners.
pub(super) const MARK: f32 = 6.0;
/// From the end of a bar or of its whisker to its figure.
pub(super) const BEFORE_FIGURE: f32 = 8.0;
/// From a mark's corner to a figure beside it, on either side.
const BESIDE_MARK: f32 = 4.0;
/// Half the height of a whisker's ends.
const WHISKER: f32 = 5.0;

/// A horizontal bar, by where it lies in the picture.
pub(super) struct Bar<'a> {
    /// Where it begins and ends.
    pub(super) across: [f32; 2],
    /// Its middle upwards.
    pub(super) middle: f32,
    pub(super) height: f32,
    /// From where to where its whisker reaches.
    pub(super) whisker: [f32; 2],
    pub(super) colour: Rgb,
    /// What stands behind it.
    pub(super) figure: &'a str,
    /// A mark on the same line, which its figure leaves free.
    pub(super) mark: Option<f32>,
}

impl Bar<'_> {
    pub(super) fn paint(&self, canvas: &mut Canvas) {
        let [start, end] = self.across;
        let (middle, height) = (self.middle, self.height);
        canvas.push(format_args!(
            "<rect x=\"{start:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height}\" rx=\"3\" fill=\"{}\"/>",
            middle - height / 2.0,
            end - start,
            pale(self.colour).hex()
        ));
        let [low, high] = self.whisker;
        let (top, length) = (middle - WHISKER, 2.0 * WHISKER);
        canvas.push(format_args!(
            "<path d=\"M{low:.1} {middle:.1}H{high:.1}M{low:.1} {top:.1}v{length}M{high:.1} {top:.1}v{length}\" stroke=\"{}\" stroke-width=\"1.6\"/>",
            GREY.mixed(INK, 0.5).hex()
        ));
        if let Some(x) = self.mark {
            mark(canvas, x, middle);
        }
        figure(canvas, self.figure_at(), middle, INK, self.figure);
    }

    /// A mark just behind the bar would lie on its figure.
    fn figure_at(&self) -> f32 {
        let end = self.whisker[1].max(self.across[1]);
        let start = end + BEFORE_FIGURE;
        let room = end..start + text_width(self.figure, LABEL_SIZE) + MARK + BESIDE_MARK;
        let beside = self.mark.filter(|mark| room.contains(mark));
        beside.map_or(start, |mark| mark + MARK + BESIDE_MARK)
    }
}

/// A colour as bars have it, so that whiskers can be seen on them.
pub(super) fn pale(colour: Rgb) -> Rgb {
    colour.mixed(Rgb(255, 255, 255), 0.35)
}

/// Where bars begin, so that each of these labels fits in front of them.
pub(super) fn left_of<'a>(labels: impl Iterator<Item = &'a str>) -> f32 {
    let widths = labels.map(|label| text_width(label, LABEL_SIZE));
    48.0 + widths.fold(0.0, f32::max)
}

/// A line of the grid with what it stands for below.
pub(super) fn grid_line(canvas: &mut Canvas, x: f32, bottom: f32, told: &str) {
    canvas.push(format_args!(
        "<path d=\"M{x:.1} {:.1}V{bottom:.1}\" stroke=\"#e5e7eb\"/>",
        TOP - 8.0
    ));
    let set = Type {
        anchor: "middle",
        ..Type::default()
    };
    canvas.text(x, bottom + 20.0, set, told);
}

/// The least of 1, 2 and 5 times powers of ten that is not below `wanted`, which is above 0.
pub(super) fn round_step(wanted: f64) -> f64 {
    let power = 10.0_f64.powf(wanted.log10().floor());
    let rounds = [1.0, 2.0, 5.0].map(|round| round * power);
    let fits = rounds.into_iter().find(|step| *step >= wanted);
    fits.unwrap_or(10.0 * power)
}

/// Digits behind the point with which multiples of such a step are written.
pub(super) fn decimals(step: f64) -> usize {
    (-(step.log10() + 1e-9).floor()).max(0.0) as usize
}

/// The label in front of bars that begin at `left`.
pub(super) fn label(canvas: &mut Canvas, left: f32, middle: f32, text: &str) {
    let set = Type {
        size: LABEL_SIZE,
        colour: INK,
        anchor: "end",
        ..Type::default()
    };
    canvas.text(left - 14.0, middle + 5.0, set, text);
}

/// What a bar or a mark stands for, behind it.
pub(super) fn figure(canvas: &mut Canvas, x: f32, middle: f32, colour: Rgb, text: &str) {
    let set = Type {
        size: LABEL_SIZE,
        weight: 600,
        colour,
        ..Type::default()
    };
    canvas.text(x, middle + 5.0, set, text);
}

/// The mark of what was published.
pub(super) fn mark(canvas: &mut Canvas, x: f32, y: f32) {
    canvas.push(format_args!(
        "<path d=\"M{:.1} {y:.1}l{MARK} {MARK}l{MARK} -{MARK}l-{MARK} -{MARK}z\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1.5\"/>",
        x - MARK,
        palette::CROSS_TASK.hex()
    ));
}

/// What the marks are, for the legend.
pub(super) fn mark_told(canvas: &mut Canvas, x: f32, y: f32, text: &str) {
    mark(canvas, x, y);
    let set = Type {
        colour: palette::CROSS_TASK,
        ..Type::default()
    };
    canvas.text(x + 14.0, y + 4.0, set, text);
}
