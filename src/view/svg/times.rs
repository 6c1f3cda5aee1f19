//! Times as bars on a logarithmic axis.

use std::path::Path;

use super::bars::{self, BEFORE_FIGURE, Bar, MARK, TOP, WIDTH};
use super::canvas::{Canvas, Type, text_width};
use crate::view::palette::{self, CROSS_TASK, GREY, INK};
use crate::view::{ViewError, file};

/// How long something takes in some ways.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// What was timed.
    pub label: String,
    /// Median and 99th percentile in milliseconds, both above 0, in each way that [`times_svg`] is told, in the same order;
    /// none where it was not measured.
    pub times: Vec<Option<[f64; 2]>>,
    /// What it took on the paper's computer, in milliseconds.
    pub published: Option<f64>,
}

/// Beyond the bars, for their figures.
const RIGHT: f32 = 84.0;
const BAR: f32 = 14.0;
/// From a bar to the next one of the same label.
const SLOT: f32 = 18.0;
/// Between the last bar of a label and the first of the next.
const GAP: f32 = 16.0;
/// In the legend, between an entry and the next.
const APART: f32 = 26.0;
const SWATCH: f32 = 20.0;

/// Times as horizontal bars on a logarithmic axis, one for each way below the other, as SVG text: each as long as its median,
/// with a whisker up to its 99th percentile, and below them a mark at what was published. What was not measured in any way is
/// left out. On such an axis, which has no 0, equal lengths are equal factors.
#[must_use]
pub fn times_svg(timings: &[Timing], ways: &[&str], title: &str) -> String {
    let is_measured = |timing: &&Timing| timing.times.iter().any(Option::is_some);
    let rows: Vec<&Timing> = timings.iter().filter(is_measured).collect();
    let bottom = TOP + rows.iter().map(|row| height(row)).sum::<f32>();
    let mut canvas = Canvas::new(WIDTH, bottom + 96.0);
    canvas.heading(title);
    let axis = Axis::of(&rows);
    axis.draw(&mut canvas, bottom);
    let mut top = TOP;
    for row in rows {
        draw(&mut canvas, row, top, &axis);
        top += height(row);
    }
    legend(&mut canvas, ways, bottom + 72.0);
    canvas.finish()
}

/// How many lines a label has: its bars and its mark.
fn slots(timing: &Timing) -> usize {
    timing.times.iter().flatten().count() + usize::from(timing.published.is_some())
}

fn height(timing: &Timing) -> f32 {
    slots(timing) as f32 * SLOT + GAP
}

fn draw(canvas: &mut Canvas, timing: &Timing, top: f32, axis: &Axis) {
    let left = axis.left;
    let middle = top + slots(timing) as f32 * SLOT / 2.0;
    bars::label(canvas, left, middle, &timing.label);
    let mut middle = top + SLOT / 2.0;
    for (way, time) in timing.times.iter().enumerate() {
        let Some([median, percentile]) = *time else {
            continue;
        };
        let (end, figure) = (axis.at(median), format!("{median:.1} ms"));
        let bar = Bar {
            across: [left, end],
            middle,
            height: BAR,
            whisker: [end, axis.at(percentile)],
            colour: palette::task(way),
            figure: &figure,
            mark: None,
        };
        bar.paint(canvas);
        middle += SLOT;
    }
    if let Some(published) = timing.published {
        let x = axis.at(published);
        bars::mark(canvas, x, middle);
        let figure = format!("{published:.0} ms");
        bars::figure(
            canvas,
            x + MARK + BEFORE_FIGURE,
            middle,
            CROSS_TASK,
            &figure,
        );
    }
}

/// What the colours, the whiskers and the marks are.
fn legend(canvas: &mut Canvas, ways: &[&str], y: f32) {
    let set = Type::default();
    let mut x = 24.0;
    for (way, name) in ways.iter().enumerate() {
        canvas.push(format_args!(
            "<path d=\"M{x:.1} {y:.1}h{SWATCH}\" stroke=\"{}\" stroke-width=\"{BAR}\"/>",
            bars::pale(palette::task(way)).hex()
        ));
        canvas.text(x + SWATCH + 8.0, y + 4.5, set, name);
        x += SWATCH + 8.0 + text_width(name, set.size) + APART;
    }
    canvas.push(format_args!(
        "<path d=\"M{x:.1} {y:.1}h{SWATCH}m0 -5v10\" stroke=\"{}\" stroke-width=\"1.6\"/>",
        GREY.mixed(INK, 0.5).hex()
    ));
    let whisker = "from the median to the 99th percentile";
    canvas.text(x + SWATCH + 8.0, y + 4.5, set, whisker);
    x += SWATCH + 8.0 + text_width(whisker, set.size) + APART + MARK;
    bars::mark_told(canvas, x, y, "the paper's, on a NUC");
}

/// Where times lie in the picture.
struct Axis {
    left: f32,
    /// Round numbers, rising: from one below the least time to one that is not below the largest.
    marks: Vec<f64>,
}

impl Axis {
    fn of(rows: &[&Timing]) -> Self {
        let measured = rows.iter().flat_map(|row| row.times.iter().flatten());
        let published = rows.iter().filter_map(|row| row.published);
        let all: Vec<f64> = measured.flatten().copied().chain(published).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = all.iter().copied().fold(0.0, f64::max);
        Self {
            left: bars::left_of(rows.iter().map(|row| row.label.as_str())),
            marks: if all.is_empty() {
                marks(1.0, 10.0)
            } else {
                marks(least, largest)
            },
        }
    }

    fn at(&self, millis: f64) -> f32 {
        let ends = [self.marks.first(), self.marks.last()];
        let [low, high] = ends.map(|mark| mark.map_or(0.0, |millis| f64::ln(*millis)));
        let share = ((millis.max(SHORTEST).ln() - low) / (high - low)) as f32;
        self.left + share * (WIDTH - RIGHT - self.left)
    }

    fn draw(&self, canvas: &mut Canvas, bottom: f32) {
        for mark in &self.marks {
            bars::grid_line(canvas, self.at(*mark), bottom, &told(*mark));
        }
        let set = Type {
            anchor: "end",
            ..Type::default()
        };
        let scale = "milliseconds, on a logarithmic axis";
        canvas.text(WIDTH - RIGHT, bottom + 42.0, set, scale);
    }
}

/// A nanosecond, in milliseconds: times are drawn as this long at least, since no logarithmic axis has 0.
const SHORTEST: f64 = 1e-6;

/// A number of which all digits but the first are 0.
fn told(mark: f64) -> String {
    let decimals = bars::decimals(mark);
    format!("{mark:.decimals$}")
}

/// 1, 2 and 5 times powers of ten, from the last one below `least` to the first that is not below `largest`.
fn marks(least: f64, largest: f64) -> Vec<f64> {
    let (least, largest) = (least.max(SHORTEST), largest.max(SHORTEST));
    let power = |millis: f64| millis.log10().floor() as i32;
    let powers = power(least) - 1..=power(largest) + 1;
    let rounds = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|round| round * 10.0_f64.powi(power)));
    let rounds: Vec<f64> = rounds.collect();
    let below = rounds.iter().filter(|round| **round < least).count();
    let within = rounds.iter().filter(|round| **round < largest).count();
    rounds[below.saturating_sub(1)..=within].to_vec()
}

/// Writes [`times_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
pub fn write_times_svg(
    path: &Path,
    timings: &[Timing],
    ways: &[&str],
    title: &str,
) -> Result<(), ViewError> {
    file::write(path, times_svg(timings, ways, title).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(label: &str, times: &[Option<[f64; 2]>], published: Option<f64>) -> Timing {
        Timing {
            label: label.to_owned(),
            times: times.to_vec(),
            published,
        }
    }

    /// The numbers after `before` in the lines that have `word`, in order.
    fn numbers(svg: &str, word: &str, before: &str) -> Vec<f32> {
        let lines = svg.lines().filter(|line| line.contains(word));
        let number = |line: &str| -> f32 {
            let rest = line.split(before).nth(1).expect("it is there");
            let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.');
            rest[..end.unwrap_or(rest.len())].parse().expect("a number")
        };
        lines.map(number).collect()
    }

    #[test]
    fn a_factor_is_as_long_everywhere() {
        let rows = [
            timing("a", &[Some([2.0, 20.0]), Some([20.0, 40.0])], Some(200.0)),
            timing("b", &[Some([200.0, 400.0]), None], None),
        ];
        let svg = times_svg(&rows, &["fast", "slow"], "times");
        let widths = numbers(&svg, "rx=\"3\"", "\" width=\"");
        assert_eq!(widths.len(), 3, "{svg}");
        let steps = [widths[1] - widths[0], widths[2] - widths[1]];
        assert!(
            (steps[0] - steps[1]).abs() < 0.3 && steps[0] > 100.0,
            "{widths:?}"
        );
        let ends = numbers(&svg, "v10M", "H");
        assert_eq!(ends.len(), 3);
        let bars = bars::left_of(["a", "b"].into_iter());
        assert!(
            (ends[0] - bars - widths[1]).abs() < 0.3,
            "up to the 99th percentile, where the other bar ends"
        );
        let marks = svg.matches("l6 6l6 -6l-6 -6z").count();
        assert_eq!(marks, 2, "one is in the legend");
        for told in ["fast", "slow", "2.0 ms", "200 ms", "99th percentile", "NUC"] {
            assert!(svg.contains(told), "{told} is missing");
        }
    }

    #[test]
    fn what_was_not_measured_takes_no_room() {
        let measured = timing("a", &[Some([2.0, 3.0]), None], None);
        let height =
            |rows: &[Timing]| numbers(&times_svg(rows, &["x", "y"], "t"), "<svg", "height=\"");
        let alone = height(std::slice::from_ref(&measured));
        let missing = timing("not measured", &[None, None], Some(9.0));
        let rows = [measured, missing];
        assert_eq!(height(&rows), alone);
        let svg = times_svg(&rows, &["x", "y"], "t");
        assert!(!svg.contains("not measured") && !svg.contains(">9 ms<"));
        assert_eq!(svg.matches("rx=\"3\"").count(), 1);
    }

    #[test]
    fn the_axis_is_marked_at_round_numbers_around_all_times() {
        let axis = |least: f64, largest: f64| -> Vec<String> {
            marks(least, largest).into_iter().map(told).collect()
        };
        assert_eq!(axis(1.5, 42.7), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(axis(2.0, 10.0), ["1", "2", "5", "10"]);
        assert_eq!(axis(0.06, 0.3), ["0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(axis(120.0, 900.0), ["100", "200", "500", "1000"]);
        assert_eq!(axis(7.0, 7.0), ["5", "10"]);
    }

    #[test]
    fn no_times_and_no_time_at_all_are_drawn_without_a_division_by_zero() {
        let nothing = timing("a", &[Some([0.0, 0.0])], None);
        for rows in [vec![], vec![nothing]] {
            let svg = times_svg(&rows, &["x"], "t");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}
