use std::fmt;

use miette::{GraphicalReportHandler, GraphicalTheme};
use serde::Serialize;

use super::diagnostic::{Diagnostic, Faults, Severity};
use crate::wording;

/// How many diagnostics are printed at most; nobody reads more before mending the first.
const MAX_PRINTED: usize = 40;

/// Columns that messages are wrapped at.
const WIDTH_COLUMNS: usize = 100;

/// How diagnostics are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rendering {
    /// Unicode lines and ANSI colours, for terminals.
    Colour,
    /// ASCII without colours, for files and snapshots.
    Plain,
}

/// All faults of a file and of the files that it uses, in the order of their places.
#[derive(Clone, Debug, Serialize)]
#[serde(transparent)]
pub struct Diagnostics {
    list: Vec<Diagnostic>,
}

impl Diagnostics {
    pub(super) fn new(faults: Faults) -> Self {
        Self {
            list: faults.into_sorted(),
        }
    }

    /// Each fault.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.list.iter()
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// All faults with the lines that they stand on, underlined, and a last line that counts them.
    ///
    /// # Panics
    /// Never: writing into a string does not fail.
    #[must_use]
    pub fn render(&self, rendering: Rendering) -> String {
        let theme = match rendering {
            Rendering::Colour => GraphicalTheme::unicode(),
            Rendering::Plain => GraphicalTheme::none(),
        };
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_width(WIDTH_COLUMNS)
            .with_links(false);
        let mut text = String::new();
        for diagnostic in self.list.iter().take(MAX_PRINTED) {
            let mut shown = diagnostic.clone();
            if !shown.has_snippet() {
                // Without a snippet nothing else says where it is.
                shown.message = shown.line();
                shown.place = None;
            }
            handler
                .render_report(&mut text, &shown)
                .expect("a string takes all");
            text.push('\n');
        }
        if let Some(more) = self.list.len().checked_sub(MAX_PRINTED).filter(|m| *m > 0) {
            text.push_str("... and ");
            text.push_str(&more.to_string());
            text.push_str(" more\n");
        }
        text + &self.count()
    }

    /// Such as `2 errors, 1 warning`.
    fn count(&self) -> String {
        let counted = |severity, word: &str| {
            let number = self.list.iter().filter(|d| d.severity == severity).count();
            (number > 0).then(|| wording::counted(number, word))
        };
        [
            counted(Severity::Error, "error"),
            counted(Severity::Warning, "warning"),
        ]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(", ")
    }
}

impl fmt::Display for Diagnostics {
    /// One line each: `file:line:column: message`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.list.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            f.write_str(&diagnostic.line())?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

impl miette::Diagnostic for Diagnostics {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        Some(Box::new(
            self.list.iter().map(|d| d as &dyn miette::Diagnostic),
        ))
    }
}

impl<'a> IntoIterator for &'a Diagnostics {
    type Item = &'a Diagnostic;
    type IntoIter = std::slice::Iter<'a, Diagnostic>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
