//! Lines over a common axis, in panels beside each other.

use std::path::Path;

use super::bars;
use super::canvas::{Canvas, Type, text_width};
use crate::view::palette::{self, GREY, INK, Rgb};
use crate::view::{ViewError, file};

/// A panel of [`curves_svg`].
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What is drawn upwards.
    pub label: String,
    /// The lines. A name has the same colour in every panel if the lines have the same order.
    pub lines: Vec<Curve>,
}

/// A line of a [`Panel`].
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// Points `[x, y]` with rising x.
    pub points: Vec<[f64; 2]>,
    /// Thin lines behind it in its colour, such as those that it is the mean of.
    pub behind: Vec<Vec<[f64; 2]>>,
}

const WIDTH: f32 = 460.0;
const HEIGHT: f32 = 300.0;
const TOP: f32 = 84.0;
const BOTTOM: f32 = TOP + HEIGHT;
const LEFT: f32 = 64.0;
const RIGHT: f32 = 20.0;
const LEGEND_ROW: f32 = 22.0;
/// Room beside a name in the legend: for its line, and what is left free.
const LEGEND_FREE: f32 = 64.0;
/// How thick a line is, and one behind it.
const THICK: f32 = 2.2;
const THIN: f32 = 1.0;
/// Marks along an axis, more or less.
const MARKS: f64 = 5.0;

/// Panels of lines as SVG text; `across` names the common axis, `behind` the thin lines behind the others. Upwards, a panel
/// shows what its lines reach beyond their first points, which are often far off.
#[must_use]
pub fn curves_svg(panels: &[Panel], title: &str, across: &str, behind: Option<&str>) -> String {
    let lines = panels.first().map_or(&[][..], |p| &p.lines);
    let entries = entries(lines, behind);
    let widths = (entries.iter()).map(|(name, ..)| text_width(name, Type::default().size));
    let column = LEGEND_FREE + widths.fold(0.0, f32::max);
    let width = WIDTH * panels.len().max(1) as f32;
    let columns = (((width - LEFT) / column) as usize).max(1);
    let height = BOTTOM + 56.0 + LEGEND_ROW * entries.len().div_ceil(columns) as f32;
    let mut canvas = Canvas::new(width, height);
    canvas.heading(title);
    for (index, panel) in panels.iter().enumerate() {
        draw(&mut canvas, panel, index as f32 * WIDTH, across);
    }
    for (index, (name, colour, thickness)) in entries.into_iter().enumerate() {
        let x = LEFT + (index % columns) as f32 * column;
        let y = BOTTOM + 62.0 + (index / columns) as f32 * LEGEND_ROW;
        canvas.push(format_args!(
            "<path d=\"M{x:.1} {y:.1}h26\" stroke=\"{}\" stroke-width=\"{thickness}\"/>",
            colour.hex()
        ));
        canvas.text(x + 34.0, y + 5.0, Type::default(), name);
    }
    canvas.finish()
}

/// The entries of the legend: what is told, and the colour and the thickness of its line.
fn entries<'a>(lines: &'a [Curve], behind: Option<&'a str>) -> Vec<(&'a str, Rgb, f32)> {
    let lines = lines.iter().enumerate();
    let of_lines = lines.map(|(index, line)| (line.name.as_str(), palette::task(index), 3.0));
    let of_behind = behind.map(|behind| (behind, GREY, THIN));
    of_lines.chain(of_behind).collect()
}

fn draw(canvas: &mut Canvas, panel: &Panel, start: f32, across: &str) {
    let axes = Axes::of(panel, start);
    axes.draw(canvas);
    let set = Type {
        weight: 600,
        colour: INK,
        ..Type::default()
    };
    canvas.text(axes.left, TOP - 14.0, set, &panel.label);
    canvas.text(axes.right, BOTTOM + 38.0, anchored("end"), across);
    // No line that stands back covers one that does not.
    for (index, line) in panel.lines.iter().enumerate() {
        let colour = palette::task(index).mixed(Rgb(255, 255, 255), 0.45);
        for points in &line.behind {
            axes.line(canvas, points, colour, THIN);
        }
    }
    for (index, Curve { points, .. }) in panel.lines.iter().enumerate() {
        let colour = palette::task(index);
        axes.line(canvas, points, colour, THICK);
        // A line of one point would not be seen.
        if let Some(last) = points.last() {
            canvas.circle([axes.x(last[0]), axes.y(last[1])], 4.0, colour);
        }
    }
}

fn anchored(anchor: &'static str) -> Type {
    Type {
        anchor,
        ..Type::default()
    }
}

/// Where the values of a panel lie in the picture.
struct Axes {
    left: f32,
    right: f32,
    /// Least and largest value across.
    across: (f64, f64),
    /// Least and largest value upwards.
    upwards: (f64, f64),
}

impl Axes {
    fn of(panel: &Panel, start: f32) -> Self {
        let drawn: Vec<&Vec<[f64; 2]>> = (panel.lines.iter())
            .flat_map(|line| line.behind.iter().chain([&line.points]))
            .collect();
        let settled = drawn.iter().flat_map(|points| {
            let first = usize::from(points.len() > 1);
            points.iter().skip(first)
        });
        let all = drawn.iter().copied().flatten();
        Self {
            left: start + LEFT,
            right: start + WIDTH - RIGHT,
            across: range(all.map(|p| p[0])),
            upwards: range(settled.map(|p| p[1])),
        }
    }

    fn x(&self, value: f64) -> f32 {
        self.left + share(value, self.across) * (self.right - self.left)
    }

    fn y(&self, value: f64) -> f32 {
        let (low, high) = self.upwards;
        BOTTOM - share(value.clamp(low, high), self.upwards) * HEIGHT
    }

    fn line(&self, canvas: &mut Canvas, points: &[[f64; 2]], colour: Rgb, thickness: f32) {
        if points.is_empty() {
            return;
        }
        let at = |p: &[f64; 2]| format!("{:.1} {:.1}", self.x(p[0]), self.y(p[1]));
        let path: Vec<String> = points.iter().map(at).collect();
        canvas.push(format_args!(
            "<path d=\"M{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{thickness}\" stroke-linejoin=\"round\"/>",
            path.join("L"),
            colour.hex()
        ));
    }

    fn draw(&self, canvas: &mut Canvas) {
        let (left, right) = (self.left, self.right);
        for (value, told) in ticks(self.upwards, 0.0) {
            let y = self.y(value);
            canvas.push(format_args!(
                "<path d=\"M{left:.1} {y:.1}H{right:.1}\" stroke=\"#e5e7eb\"/>"
            ));
            canvas.text(left - 8.0, y + 5.0, anchored("end"), &told);
        }
        canvas.push(format_args!(
            "<path d=\"M{left:.1} {BOTTOM:.1}H{right:.1}\" stroke=\"#9ca3af\"/>"
        ));
        for (value, told) in ticks(self.across, 1.0) {
            canvas.text(self.x(value), BOTTOM + 20.0, anchored("middle"), &told);
        }
    }
}

fn share(value: f64, (low, high): (f64, f64)) -> f32 {
    ((value - low) / (high - low)) as f32
}

/// Round numbers from a least to a largest value, some [`MARKS`] of them and none nearer to the next than `nearest`, with
/// how each is written.
fn ticks((first, last): (f64, f64), nearest: f64) -> Vec<(f64, String)> {
    let wanted = ((last - first) / MARKS).max(nearest);
    let step = bars::round_step(wanted);
    let decimals = bars::decimals(step);
    let multiples = (0..).map(|index| ((first / step).ceil() + f64::from(index)) * step);
    // The last one is often the largest value, but for how it is computed.
    let within = multiples.take_while(|value| *value <= last + 1e-9 * step);
    within.map(|v| (v, format!("{v:.decimals$}"))).collect()
}

/// Least and largest; 0 and 1 for no values, and never the same twice.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return (0.0, 1.0);
    }
    (low, if high > low { high } else { low + 1.0 })
}

/// Writes [`curves_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
pub fn write_curves_svg(
    path: &Path,
    panels: &[Panel],
    title: &str,
    across: &str,
    behind: Option<&str>,
) -> Result<(), ViewError> {
    file::write(path, curves_svg(panels, title, across, behind).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(name: &str, points: &[[f64; 2]]) -> Curve {
        Curve {
            name: name.to_owned(),
            points: points.to_vec(),
            behind: Vec::new(),
        }
    }

    #[test]
    fn lines_span_the_panel_and_are_named() {
        let panel = Panel {
            label: "loss".to_owned(),
            lines: vec![
                curve("ours", &[[0.0, 99.0], [50.0, 2.0], [100.0, 1.0]]),
                curve("theirs & others", &[[0.0, 99.0], [100.0, 3.0]]),
            ],
        };
        let svg = curves_svg(&[panel], "Losses", "steps", None);
        let last = format!("L{:.1} {:.1}\"", WIDTH - RIGHT, TOP + HEIGHT);
        assert!(
            svg.contains(&last),
            "the least loss is at the lower right: {svg}"
        );
        let first = format!("M{LEFT:.1} {TOP:.1}L");
        assert!(
            svg.contains(&first),
            "what is beyond the panel stays at its edge"
        );
        assert!(svg.contains("theirs &amp; others") && svg.contains("steps"));
    }

    #[test]
    fn what_a_line_is_the_mean_of_is_thin_behind_all_lines_and_within_the_panel() {
        let of = |losses: [f64; 3]| vec![[0.0, losses[0]], [50.0, losses[1]], [100.0, losses[2]]];
        let mean = |name: &str, behind: Vec<Vec<[f64; 2]>>| Curve {
            behind,
            ..curve(name, &of([9.0, 3.0, 2.0]))
        };
        let behind = vec![of([8.0, 4.0, 3.0]), of([10.0, 2.0, 1.0])];
        let panel = Panel {
            label: "loss".to_owned(),
            lines: vec![mean("ours", Vec::new()), mean("theirs", behind)],
        };
        let svg = curves_svg(&[panel], "Losses", "steps", Some("each seed"));
        let thicknesses: Vec<&str> = (svg.lines())
            .filter(|line| line.contains("fill=\"none\" stroke="))
            .map(|line| {
                if line.contains("stroke-width=\"1\"") {
                    "thin"
                } else {
                    "thick"
                }
            })
            .collect();
        assert_eq!(thicknesses, ["thin", "thin", "thick", "thick"], "{svg}");
        let [high, low] = [TOP, BOTTOM].map(|y| format!("{y:.1}"));
        let right = WIDTH - RIGHT;
        assert!(
            svg.contains(&format!("L{right:.1} {low}\"")),
            "the least of all losses is at the bottom: {svg}"
        );
        let middle = f32::midpoint(LEFT, right);
        assert!(
            svg.contains(&format!("L{middle:.1} {high}L")),
            "the largest beyond the first points is at the top: {svg}"
        );
        let legend = svg.matches("h26").count();
        assert!(legend == 3 && svg.contains(">each seed<"), "{svg}");
    }

    #[test]
    fn an_axis_is_marked_at_round_numbers() {
        let told = |first, last, nearest| -> Vec<String> {
            let marks = ticks((first, last), nearest);
            for (value, told) in &marks {
                assert!((told.parse::<f64>().unwrap() - value).abs() < 1e-9);
            }
            marks.into_iter().map(|(_, told)| told).collect()
        };
        assert_eq!(told(250.0, 4400.0, 1.0), ["1000", "2000", "3000", "4000"]);
        assert_eq!(told(0.0, 10.0, 1.0), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(told(1.0, 2.0, 1.0), ["1", "2"]);
        assert_eq!(told(200.0, 201.0, 1.0), ["200", "201"]);
        assert_eq!(told(0.57, 1.13, 0.0), ["0.6", "0.8", "1.0"]);
        assert_eq!(told(0.58, 1.0, 0.0), ["0.6", "0.7", "0.8", "0.9", "1.0"]);
        assert_eq!(
            told(0.0, 0.05, 0.0),
            ["0.00", "0.01", "0.02", "0.03", "0.04", "0.05"]
        );
    }

    #[test]
    fn a_long_name_leaves_room_for_the_next() {
        let line = |name: &str| curve(name, &[[0.0, 1.0], [1.0, 2.0]]);
        let long = "a network with a long description of what it is";
        let panel = Panel {
            label: "loss".to_owned(),
            lines: vec![line(long), line("other")],
        };
        let starts = |panels: &[Panel]| -> Vec<f32> {
            let svg = curves_svg(panels, "Losses", "steps", None);
            let legend = svg.split("<path d=\"M").filter(|part| part.contains("h26"));
            let start = |part: &str| part.split(' ').next().unwrap().parse().unwrap();
            legend.map(start).collect()
        };
        let below = starts(std::slice::from_ref(&panel));
        assert_eq!(below, [LEFT, LEFT], "one below the other");
        let beside = starts(&[panel.clone(), panel]);
        assert!(
            beside[1] - beside[0] > 7.0 * long.len() as f32,
            "{beside:?}"
        );
    }

    #[test]
    fn no_lines_and_one_point_are_drawn_without_a_division_by_zero() {
        let one = Panel {
            label: "loss".to_owned(),
            lines: vec![curve("ours", &[[1.0, 1.0]])],
        };
        let empty = Panel {
            label: "loss".to_owned(),
            lines: vec![curve("ours", &[])],
        };
        for panels in [vec![], vec![one], vec![empty]] {
            let svg = curves_svg(&panels, "Losses", "steps", None);
            assert!(!svg.contains("NaN") && !svg.contains("d=\"M\""), "{svg}");
        }
    }

    #[test]
    fn lines_of_one_point_are_seen_apart() {
        let line = |name: &str, loss| curve(name, &[[200.0, loss]]);
        let panel = Panel {
            label: "loss".to_owned(),
            lines: vec![line("ours", 2.0), line("theirs", 3.0)],
        };
        let svg = curves_svg(&[panel], "Losses", "steps", None);
        let height = |y: f32| format!("<circle cx=\"{LEFT:.1}\" cy=\"{y:.1}\"");
        assert!(
            svg.contains(&height(TOP + HEIGHT)) && svg.contains(&height(TOP)),
            "{svg}"
        );
    }
}
