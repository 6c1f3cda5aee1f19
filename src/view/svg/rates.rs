//! Success rates as bars with their intervals.

use std::path::Path;

use super::bars::{self, Bar, TOP, WIDTH};
use super::canvas::{Canvas, Type};
use crate::view::palette;
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

const ROW: f32 = 44.0;
const BAR: f32 = 20.0;
/// Beyond the bars, for their figures.
const RIGHT: f32 = 70.0;

/// Rates as horizontal bars with their intervals and marks at what was published, and a dashed line at a rate to compare with,
/// as SVG text.
#[must_use]
pub fn rates_svg(rates: &[Rate], title: &str, compared: Option<(&str, f64)>) -> String {
    let bottom = TOP + rates.len() as f32 * ROW;
    let mut canvas = Canvas::new(WIDTH, bottom + 64.0);
    canvas.heading(title);
    let left = bars::left_of(rates.iter().map(|r| r.label.as_str()));
    let at = |share: f64| left + share as f32 * (WIDTH - RIGHT - left);
    for percent in [0, 20, 40, 60, 80, 100] {
        let x = at(f64::from(percent) / 100.0);
        bars::grid_line(&mut canvas, x, bottom, &format!("{percent} %"));
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
        bars::mark_told(&mut canvas, left, bottom + 40.0, "the paper's robot");
    }
    canvas.finish()
}

fn bar(canvas: &mut Canvas, rate: &Rate, top: f32, left: f32, at: &dyn Fn(f64) -> f32) {
    let middle = top + BAR / 2.0 + 4.0;
    bars::label(canvas, left, middle, &rate.label);
    let figure = format!("{:.0} %", 100.0 * rate.rate);
    let bar = Bar {
        across: [left, at(rate.rate)],
        middle,
        height: BAR,
        whisker: rate.interval.map(at),
        colour: palette::task(if rate.stands_out { 0 } else { 5 }),
        figure: &figure,
        mark: rate.published.map(at),
    };
    bar.paint(canvas);
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
    use super::super::bars::{LABEL_SIZE, MARK};
    use super::super::canvas::text_width;
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
