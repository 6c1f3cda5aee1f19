//! Single values as dots, with their mean.

use std::fmt::Write as _;
use std::path::Path;

use super::bars::{self, TOP, WIDTH};
use super::canvas::{Canvas, Type};
use crate::view::palette::{self, GREY, INK, Rgb};
use crate::view::{ViewError, file};

/// What was measured several times.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// What was measured.
    pub label: String,
    /// Each measurement, 0 or more.
    pub values: Vec<f64>,
    /// Low and high of their mean; none where they do not tell.
    pub interval: Option<[f64; 2]>,
    /// Whether its dots stand out from those that it is compared with.
    pub stands_out: bool,
}

const ROW: f32 = 52.0;
/// Half the height over which the dots of a row are spread.
const SPREAD: f32 = 13.0;
/// Half the height of the mark of a mean.
const MEAN: f32 = 18.0;
const DOT: f32 = 3.4;
/// Beyond the axis, for the means in figures.
const RIGHT: f32 = 70.0;
/// The golden ratio's fractional part: multiples of it lie evenly between 0 and 1, however many there are.
const GOLDEN: f32 = 0.618_034;
/// Lines of the grid beside the first, at most.
const LINES: f64 = 8.0;

/// Single values as dots on an axis from 0, a row for each spread, with a mark at its mean, a whisker over the mean's
/// interval and the mean in figures at the right, as SVG text. `scale` says what the axis is. Heights within a row mean
/// nothing; they keep the dots apart. A row without values has its label alone.
#[must_use]
pub fn spreads_svg(spreads: &[Spread], title: &str, scale: &str) -> String {
    let bottom = TOP + spreads.len() as f32 * ROW;
    let mut canvas = Canvas::new(WIDTH, bottom + 64.0);
    canvas.heading(title);
    let left = bars::left_of(spreads.iter().map(|spread| spread.label.as_str()));
    let step = step(spreads);
    let lines = (largest(spreads) / step).ceil().max(1.0);
    let at = |value: f64| left + (value / (lines * step)) as f32 * (WIDTH - RIGHT - left);
    let decimals = bars::decimals(step);
    for line in 0..=lines as usize {
        let value = line as f64 * step;
        bars::grid_line(
            &mut canvas,
            at(value),
            bottom,
            &format!("{value:.decimals$}"),
        );
    }
    for (row, spread) in spreads.iter().enumerate() {
        let middle = TOP + (row as f32 + 0.5) * ROW;
        bars::label(&mut canvas, left, middle, &spread.label);
        draw(&mut canvas, spread, middle, &at);
    }
    let set = Type {
        anchor: "end",
        ..Type::default()
    };
    canvas.text(WIDTH - RIGHT, bottom + 44.0, set, scale);
    canvas.finish()
}

fn draw(canvas: &mut Canvas, spread: &Spread, middle: f32, at: &dyn Fn(f64) -> f32) {
    let colour = palette::task(if spread.stands_out { 0 } else { 5 });
    for (place, value) in spread.values.iter().enumerate() {
        let height = (place as f32 * GOLDEN).fract() - 0.5;
        canvas.push(format_args!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{DOT}\" fill=\"{}\" fill-opacity=\"0.45\"/>",
            at(*value),
            middle + 2.0 * SPREAD * height,
            colour.hex()
        ));
    }
    let Some(mean) = mean(&spread.values) else {
        return;
    };
    // The white ones below let both be seen on top of dots.
    for (rim, width) in [(Rgb(255, 255, 255), 4.5), (INK, 2.0)] {
        let (x, top) = (at(mean), middle - MEAN);
        let mut lines = format!("M{x:.1} {top:.1}v{:.1}", 2.0 * MEAN);
        if let Some([low, high]) = spread.interval.map(|ends| ends.map(|end| at(end.max(0.0)))) {
            let _ = write!(lines, "M{low:.1} {middle:.1}H{high:.1}");
        }
        canvas.push(format_args!(
            "<path d=\"{lines}\" stroke=\"{}\" stroke-width=\"{width}\"/>",
            rim.hex()
        ));
    }
    let figure = format!("{mean:.2}");
    let colour = INK.mixed(GREY, 0.2);
    bars::figure(canvas, WIDTH - RIGHT + 14.0, middle, colour, &figure);
}

fn mean(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}

/// What the axis must reach.
fn largest(spreads: &[Spread]) -> f64 {
    let values = spreads.iter().flat_map(|spread| &spread.values);
    let ends = spreads
        .iter()
        .flat_map(|spread| spread.interval.iter().map(|ends| &ends[1]));
    values.chain(ends).copied().fold(0.0, f64::max)
}

/// From one line of the grid to the next: the least round number that needs no more lines than there may be.
fn step(spreads: &[Spread]) -> f64 {
    let largest = largest(spreads);
    if largest <= 0.0 {
        return 1.0;
    }
    bars::round_step(largest / LINES)
}

/// Writes [`spreads_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
pub fn write_spreads_svg(
    path: &Path,
    spreads: &[Spread],
    title: &str,
    scale: &str,
) -> Result<(), ViewError> {
    file::write(path, spreads_svg(spreads, title, scale).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(values: &[f64], interval: Option<[f64; 2]>) -> Spread {
        Spread {
            label: "same".to_owned(),
            values: values.to_vec(),
            interval,
            stands_out: true,
        }
    }

    /// The numbers that follow a word in a picture, in order.
    fn numbers(svg: &str, word: &str) -> Vec<f64> {
        let after = svg.split(word).skip(1);
        let is_number = |c: char| c.is_ascii_digit() || c == '.';
        let number = |text: &str| text.split(|c| !is_number(c)).next()?.parse().ok();
        after.map(|text| number(text).expect("a number")).collect()
    }

    #[test]
    fn dots_lie_where_their_values_are_and_the_mean_between_them() {
        let svg = spreads_svg(&[spread(&[0.0, 0.5, 1.0], Some([0.4, 0.6]))], "t", "nats");
        let dots = numbers(&svg, "cx=\"");
        assert_eq!(dots.len(), 3);
        assert!(
            (dots[2] - dots[1] - (dots[1] - dots[0])).abs() < 0.21,
            "{dots:?}"
        );
        let [_, ink] = numbers(&svg, "<path d=\"M")[numbers(&svg, "<path d=\"M").len() - 2..]
        else {
            panic!("two marks of the mean");
        };
        assert!((ink - dots[1]).abs() < 0.11);
        let length = dots[2] - dots[0];
        let ends = ["M", "H"].map(|word| {
            let line = svg
                .lines()
                .rfind(|line| line.contains("v36.0M"))
                .expect("a whisker");
            *numbers(line, word).last().expect("an end")
        });
        assert!((ends[1] - ends[0] - 0.2 * length).abs() < 0.21, "{ends:?}");
        assert!(svg.contains(">0.50<") && svg.contains(">nats<"));
    }

    #[test]
    fn the_axis_reaches_all_and_its_lines_are_round() {
        let told = |largest: f64| {
            let svg = spreads_svg(&[spread(&[largest], None)], "t", "");
            let lines = svg.lines().filter(|line| line.contains("middle"));
            let told = lines.map(|line| line.split(['>', '<']).nth(2).expect("a figure"));
            told.map(str::to_owned).collect::<Vec<_>>()
        };
        let expected = [
            "0.0", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2", "1.4", "1.6",
        ];
        assert_eq!(told(1.45), expected);
        assert_eq!(told(8.0).last().map(String::as_str), Some("8"));
        assert_eq!(told(0.9).len(), 6, "0.0 to 1.0 by 0.2");
        assert_eq!(told(0.0), ["0", "1"]);
    }

    #[test]
    fn what_has_no_values_has_no_mean() {
        let svg = spreads_svg(&[spread(&[], None)], "t", "nats");
        assert!(svg.contains(">same<") && !svg.contains("circle"));
        assert_eq!(numbers(&svg, "stroke-width=\"2\"").len(), 0);
    }
}
