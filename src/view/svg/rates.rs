//! Success rates as bars with their intervals.

use std::path::Path;

use super::canvas::{Canvas, Type, text_width};
use crate::view::palette::{self, GREY, INK};
use crate::view::{ViewError, file};

/// A rate with its interval, both 0..=1.
#[derive(Clone, Debug, PartialEq)]
pub struct Rate {
    /// What was measured.
    pub label: String,
    /// The rate.
    pub rate: f64,
    /// Low and high.
    pub interval: [f64; 2],
    /// Whether its bar stands out from those that it is compared with.
    pub stands_out: bool,
    /// What the paper's robot had, 0..=1.
    pub published: Option<f64>,
}

const WIDTH: f32 = 900.0;
const TOP: f32 = 84.0;
const ROW: f32 = 44.0;
const BAR: f32 = 20.0;
const LABEL_SIZE: f32 = 14.0;
/// Beyond the bars, for their figures.
const RIGHT: f32 = 70.0;
/// From the middle of a published rate's mark to its corners.
const MARK: f32 = 6.0;
/// From the end of a bar or of its interval to its figure.
const BEFORE_FIGURE: f32 = 8.0;
/// From a mark's corner to a figure beside it, on either side.
const BESIDE_MARK: f32 = 4.0;

/// Rates as horizontal bars with their intervals and marks at what was published, and a dashed line at a rate to compare with,
/// as SVG text.
#[must_use]
pub fn rates_svg(rates: &[Rate], title: &str, compared: Option<(&str, f64)>) -> String {
    let bottom = TOP + rates.len() as f32 * ROW;
    let mut canvas = Canvas::new(WIDTH, bottom + 64.0);
    canvas.heading(title);
    let widths = rates.iter().map(|r| text_width(&r.label, LABEL_SIZE));
    let left = 48.0 + widths.fold(0.0, f32::max);
    let at = |share: f64| left + share as f32 * (WIDTH - RIGHT - left);
    for percent in [0, 20, 40, 60, 80, 100] {
        let x = at(f64::from(percent) / 100.0);
        canvas.push(format_args!(
            "<path d=\"M{x:.1} {:.1}V{bottom:.1}\" stroke=\"#e5e7eb\"/>",
            TOP - 8.0
        ));
        let set = Type {
            anchor: "middle",
            ..Type::default()
        };
        canvas.text(x, bottom + 20.0, set, &format!("{percent} %"));
    }
    for (row, rate) in rates.iter().enumerate() {
        bar(&mut canvas, rate, TOP + row as f32 * ROW, left, &at);
    }
    if let Some((label, share)) = compared {
        let x = at(share);
        canvas.push(format_args!(
            "<path d=\"M{x:.1} {:.1}V{bottom:.1}\" stroke=\"{}\" stroke-width=\"1.5\" stroke-dasharray=\"5 4\"/>",
            TOP - 8.0,
            palette::CROSS_TASK.hex()
        ));
        let set = Type {
            colour: palette::CROSS_TASK,
            anchor: "middle",
            ..Type::default()
        };
        canvas.text(x, bottom + 44.0, set, label);
    }
    if rates.iter().any(|rate| rate.published.is_some()) {
        let y = bottom + 40.0;
        mark(&mut canvas, left, y);
        let set = Type {
            colour: palette::CROSS_TASK,
            ..Type::default()
        };
        canvas.text(left + 14.0, y + 4.0, set, "the paper's robot");
    }
    canvas.finish()
}

/// The mark of what was published.
fn mark(canvas: &mut Canvas, x: f32, y: f32) {
    canvas.push(format_args!(
        "<path d=\"M{:.1} {y:.1}l{MARK} {MARK}l{MARK} -{MARK}l-{MARK} -{MARK}z\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1.5\"/>",
        x - MARK,
        palette::CROSS_TASK.hex()
    ));
}

fn bar(canvas: &mut Canvas, rate: &Rate, top: f32, left: f32, at: &dyn Fn(f64) -> f32) {
    let middle = top + BAR / 2.0 + 4.0;
    let colour = if rate.stands_out {
        palette::task(0)
    } else {
        palette::task(5)
    };
    let label = Type {
        size: LABEL_SIZE,
        colour: INK,
        anchor: "end",
        ..Type::default()
    };
    canvas.text(left - 14.0, middle + 5.0, label, &rate.label);
    canvas.push(format_args!(
        "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{BAR}\" rx=\"3\" fill=\"{}\"/>",
        middle - BAR / 2.0,
        at(rate.rate) - left,
        colour.mixed(palette::Rgb(255, 255, 255), 0.35).hex()
    ));
    let [low, high] = rate.interval.map(at);
    canvas.push(format_args!(
        "<path d=\"M{low:.1} {middle:.1}H{high:.1}M{low:.1} {:.1}v10M{high:.1} {:.1}v10\" stroke=\"{}\" stroke-width=\"1.6\"/>",
        middle - 5.0,
        middle - 5.0,
        GREY.mixed(INK, 0.5).hex()
    ));
    let figure = Type {
        size: LABEL_SIZE,
        weight: 600,
        colour: INK,
        ..Type::default()
    };
    let published = rate.published.map(at);
    if let Some(x) = published {
        mark(canvas, x, middle);
    }
    let text = format!("{:.0} %", 100.0 * rate.rate);
    let end = high.max(at(rate.rate));
    // A mark just behind the bar would lie on its figure.
    let start = end + BEFORE_FIGURE;
    let room = end..start + text_width(&text, LABEL_SIZE) + MARK + BESIDE_MARK;
    let beside = published.filter(|mark| room.contains(mark));
    let x = beside.map_or(start, |mark| mark + MARK + BESIDE_MARK);
    canvas.text(x, middle + 5.0, figure, &text);
}

/// Writes [`rates_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
pub fn write_rates_svg(
    path: &Path,
    rates: &[Rate],
    title: &str,
    compared: Option<(&str, f64)>,
) -> Result<(), ViewError> {
    file::write(path, rates_svg(rates, title, compared).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_long_as_its_rate() {
        let rate = |rate: f64| Rate {
            label: "same".to_owned(),
            rate,
            interval: [0.0, 1.0],
            stands_out: true,
            published: None,
        };
        let width = |share: f64| -> f32 {
            let svg = rates_svg(&[rate(share)], "rates", None);
            let bar = svg.lines().find(|l| l.contains("rx=\"3\"")).expect("a bar");
            let width = bar.split("width=\"").nth(1).expect("a width");
            width
                .split('"')
                .next()
                .and_then(|w| w.parse().ok())
                .expect("a number")
        };
        assert!((width(0.5) - 2.0 * width(0.25)).abs() < 0.2);
        assert!(width(0.0).abs() < 0.1 && width(1.0) > 500.0);
    }

    #[test]
    fn what_was_published_is_marked_and_leaves_the_figure_free() {
        let svg = |published: Option<f64>| {
            let rate = Rate {
                label: "same".to_owned(),
                rate: 0.5,
                interval: [0.4, 0.6],
                stands_out: true,
                published,
            };
            rates_svg(&[rate], "rates", None)
        };
        let marks = |svg: &str| svg.matches("l6 6l6 -6l-6 -6z").count();
        let figure_at = |svg: &str| -> f32 {
            let line = svg
                .lines()
                .find(|l| l.contains(">50 %<"))
                .expect("a figure");
            let x = line.split("x=\"").nth(1).expect("a place");
            x.split('"')
                .next()
                .and_then(|x| x.parse().ok())
                .expect("a number")
        };
        let (without, beside, far) = (svg(None), svg(Some(0.62)), svg(Some(0.9)));
        assert_eq!(
            (marks(&without), marks(&beside), marks(&far)),
            (0, 2, 2),
            "in the legend, too"
        );
        assert!(!without.contains("the paper's robot") && far.contains("the paper's robot"));
        assert!((figure_at(&far) - figure_at(&without)).abs() < 0.1);
        assert!(figure_at(&beside) > figure_at(&without) + 10.0);
        // A mark of which only a corner lies on the figure.
        let bars = WIDTH - RIGHT - 48.0 - text_width("same", LABEL_SIZE);
        let behind_px = 8.0 + text_width("50 %", LABEL_SIZE) + MARK / 2.0;
        let touching = svg(Some(0.6 + f64::from(behind_px / bars)));
        assert!(figure_at(&touching) > figure_at(&without) + 10.0);
    }
}
