use std::fmt;
use std::path::PathBuf;

use miette::{LabeledSpan, SourceCode};
use serde::Serialize;

use super::source::{Origin, Place, Source};

/// How bad a diagnostic is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Nothing comes of the file until it is mended.
    Error,
    /// The file works, but perhaps not as meant.
    Warning,
}

/// A second place that belongs to a fault, in the same file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SecondPlace {
    /// Where it is.
    pub place: Place,
    /// What it is.
    pub label: String,
}

/// One fault of a file.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// In which file; none for what was built in Rust.
    pub file: Option<PathBuf>,
    /// Where in the file; none when the file as a whole is meant.
    pub place: Option<Place>,
    /// What stands under the underlined place.
    pub label: Option<String>,
    /// Another place that explains it, such as the first of two equal keys.
    pub second: Option<SecondPlace>,
    /// The way out.
    pub help: Option<String>,
    #[serde(skip)]
    source: Option<Source>,
}

impl Diagnostic {
    /// An error without a place.
    #[must_use]
    pub fn error(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            message: printable(&message.into()),
            file: None,
            place: None,
            label: None,
            second: None,
            help: None,
            source: None,
        }
    }

    /// A warning without a place.
    #[must_use]
    pub fn warning(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(message)
        }
    }

    /// The same, at a place of a file.
    #[must_use]
    pub fn at(mut self, origin: &Origin) -> Self {
        self.file = Some(origin.source.path().to_owned());
        self.place = Some(origin.place());
        self.source = Some(origin.source.clone());
        self
    }

    /// The same, at a place of a file if there is one.
    #[must_use]
    pub fn at_any(self, origin: Option<&Origin>) -> Self {
        match origin {
            Some(origin) => self.at(origin),
            None => self,
        }
    }

    /// The same, about a file as a whole.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file = Some(file.into());
        self
    }

    /// The same, with words under the underlined place.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// The same, with a second place of the same file; one of another file is left out.
    #[must_use]
    pub fn second(mut self, origin: Option<&Origin>, label: impl Into<String>) -> Self {
        self.second = origin
            .filter(|o| self.file.as_deref() == Some(o.source.path()))
            .map(|o| SecondPlace {
                place: o.place(),
                label: label.into(),
            });
        self
    }

    /// `file:line:column: message`, as far as they are known.
    #[must_use]
    pub fn line(&self) -> String {
        match (&self.file, self.place) {
            (None, _) => self.message.clone(),
            (Some(file), None) => format!("{}: {}", file.display(), self.message),
            (Some(file), Some(Place { line, column, .. })) => {
                format!("{}:{line}:{column}: {}", file.display(), self.message)
            }
        }
    }

    /// Whether the line that it stands on can be printed below it.
    pub(super) fn has_snippet(&self) -> bool {
        self.place.is_some() && self.source.as_ref().is_some_and(|s| s.shown().is_some())
    }

    /// The same, with the way out.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Messages quote what stands in files: no control characters, and no more than a few lines.
fn printable(message: &str) -> String {
    const MAX_CHARS: usize = 300;
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut text: String = message.chars().take(MAX_CHARS).map(clean).collect();
    if message.chars().nth(MAX_CHARS).is_some() {
        text.push_str("...");
    }
    text
}

impl fmt::Display for Diagnostic {
    /// The message alone: miette prints the rest around it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Diagnostic {}

impl miette::Diagnostic for Diagnostic {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.help.as_ref()?;
        Some(Box::new(help))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(self.source.as_ref()?.shown()?)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.place?;
        let span = |p: Place| (p.start, p.end - p.start);
        let first = LabeledSpan::new_primary_with_span(self.label.clone(), span(place));
        let second = self
            .second
            .iter()
            .map(move |s| LabeledSpan::new_with_span(Some(s.label.clone()), span(s.place)));
        Some(Box::new(std::iter::once(first).chain(second)))
    }
}

/// The faults that have been found so far.
#[derive(Debug, Default)]
pub(super) struct Faults {
    list: Vec<Diagnostic>,
    files: Vec<PathBuf>,
}

impl Faults {
    /// Notes that a file is being read; faults are told file by file in this order.
    pub(super) fn begin_file(&mut self, file: PathBuf) {
        self.files.push(file);
    }

    pub(super) fn add(&mut self, diagnostic: Diagnostic) {
        self.list.push(diagnostic);
    }

    /// Number of errors; warnings do not count.
    pub(super) fn error_count(&self) -> usize {
        let is_error = |d: &&Diagnostic| d.severity == Severity::Error;
        self.list.iter().filter(is_error).count()
    }

    /// In the order of files, then of places.
    pub(super) fn into_sorted(self) -> Vec<Diagnostic> {
        let mut list = self.list;
        list.sort_by_key(|d| {
            let file = d
                .file
                .as_ref()
                .and_then(|f| self.files.iter().position(|g| g == f));
            (file, d.place.map(|p| p.start))
        });
        list
    }
}
