use std::fmt::{Arguments, Write};

use crate::view::palette::{GREY, INK, Rgb};

/// An SVG document in the making, painted from back to front.
pub(super) struct Canvas {
    text: String,
}

/// How a text is set.
#[derive(Clone, Copy)]
pub(super) struct Type {
    pub(super) size: f32,
    pub(super) weight: u32,
    pub(super) colour: Rgb,
    /// `start`, `middle` or `end`.
    pub(super) anchor: &'static str,
}

impl Default for Type {
    fn default() -> Self {
        Self {
            size: 13.0,
            weight: 400,
            colour: GREY,
            anchor: "start",
        }
    }
}

impl Canvas {
    pub(super) fn new(width: f32, height: f32) -> Self {
        let mut canvas = Self {
            text: String::new(),
        };
        canvas.push(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width} {height:.0}\" font-family=\"Inter, 'Segoe UI', 'Helvetica Neue', \
             Arial, sans-serif\" fill=\"none\">"
        ));
        canvas.push(format_args!(
            "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"
        ));
        canvas
    }

    /// Adds one line of SVG.
    pub(super) fn push(&mut self, line: Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
    }

    /// Adds the title of a plot, at its upper left.
    pub(super) fn heading(&mut self, title: &str) {
        let set = Type {
            size: 20.0,
            weight: 600,
            colour: INK,
            anchor: "start",
        };
        self.text(24.0, 40.0, set, title);
    }

    /// Adds a text with a white rim, so that it can be read on top of lines.
    pub(super) fn text(&mut self, x: f32, y: f32, set: Type, text: &str) {
        let Type {
            size,
            weight,
            colour,
            anchor,
        } = set;
        self.push(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" font-weight=\"{weight}\" \
             fill=\"{}\" text-anchor=\"{anchor}\" stroke=\"#ffffff\" stroke-width=\"3\" \
             stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>",
            colour.hex(),
            escape(text)
        ));
    }

    /// Adds a five-pointed star with a dark rim.
    pub(super) fn star(&mut self, centre: [f32; 2], radius: f32, fill: Rgb) {
        let points: Vec<String> = (0..10)
            .map(|i| {
                let r = if i % 2 == 0 { radius } else { radius * 0.45 };
                let angle = std::f32::consts::PI * (i as f32 / 5.0 - 0.5);
                format!(
                    "{:.1},{:.1}",
                    centre[0] + r * angle.cos(),
                    centre[1] + r * angle.sin()
                )
            })
            .collect();
        self.push(format_args!(
            "<polygon points=\"{}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.4\" \
             stroke-linejoin=\"round\"/>",
            points.join(" "),
            fill.hex(),
            INK.hex()
        ));
    }

    /// Adds a white circle with a rim.
    pub(super) fn circle(&mut self, [x, y]: [f32; 2], radius: f32, rim: Rgb) {
        self.push(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"#ffffff\" stroke=\"{}\" \
             stroke-width=\"3\"/>",
            rim.hex()
        ));
    }

    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }
}

/// About how wide a text is; the picture is laid out without the font.
pub(super) fn text_width(text: &str, size: f32) -> f32 {
    text.chars().count() as f32 * size * 0.56
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_document() {
        assert_eq!(escape("a<b & c"), "a&lt;b &amp; c");
    }
}
