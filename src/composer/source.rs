use std::fmt;
use std::fs;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::NamedSource;
use serde::Serialize;

use super::diagnostic::{Diagnostic, Faults};
use crate::storage::nearest;

/// Files beyond this are refused unread: the largest sensible composition is a hundredth of it.
pub(super) const MAX_FILE_BYTES: u64 = 256 * 1024;

/// Longer lines are not shown: they belong to no file that a person wrote.
const MAX_SHOWN_LINE_BYTES: usize = 400;

/// A file's name and its text. Cloning shares the text.
#[derive(Clone)]
pub struct Source {
    path: PathBuf,
    text: Arc<str>,
    /// The text as it is printed; none when it is unfit for that.
    shown: Option<Arc<NamedSource<String>>>,
}

impl Source {
    /// A text that is shown under this name in diagnostics.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        let path = printable(&path.into());
        let text: String = text.into();
        let is_fit = text.lines().all(|l| l.len() <= MAX_SHOWN_LINE_BYTES);
        let shown = is_fit.then(|| {
            let text: String = text.chars().map(without_control).collect();
            Arc::new(NamedSource::new(path.display().to_string(), text))
        });
        Self {
            path,
            text: text.into(),
            shown,
        }
    }

    /// The file's path as it was given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All of its text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn shown(&self) -> Option<&NamedSource<String>> {
        self.shown.as_deref()
    }

    /// Reads a file; what is wrong with it becomes one fault.
    pub(super) fn read(path: &Path, faults: &mut Faults) -> Option<Self> {
        faults.begin_file(printable(path));
        match read_bounded(path) {
            Err(error) => {
                let meant = neighbour(path).filter(|_| error.kind() == ErrorKind::NotFound);
                let help = meant.map_or_else(
                    || "give the path of a YAML file, relative to the folder you are in".to_owned(),
                    |meant| format!("did you mean '{}'?", printable(&meant).display()),
                );
                let fault = Diagnostic::error(match error.kind() {
                    ErrorKind::NotFound => "there is no such file".to_owned(),
                    ErrorKind::IsADirectory => "this is a folder, not a file".to_owned(),
                    _ => format!("cannot be read: {error}"),
                });
                faults.add(fault.in_file(printable(path)).help(help));
                None
            }
            Ok(bytes) if bytes.len() as u64 > MAX_FILE_BYTES => {
                let message = format!("the file is larger than {} KiB", MAX_FILE_BYTES / 1024);
                let fault = Diagnostic::error(message).in_file(printable(path));
                faults.add(fault.help("tasks and compositions are short; is this the right file?"));
                None
            }
            Ok(bytes) => Self::decode(path, bytes, faults),
        }
    }

    fn decode(path: &Path, bytes: Vec<u8>, faults: &mut Faults) -> Option<Self> {
        match String::from_utf8(bytes) {
            Ok(text) => Some(Self::new(path, text)),
            Err(error) => {
                // What precedes the bad byte is the same in the repaired text, so the place is right.
                let at = error.utf8_error().valid_up_to();
                let bad = error.as_bytes()[at];
                let repaired = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let origin = Origin {
                    source: Self::new(path, repaired),
                    span: at..at + char::REPLACEMENT_CHARACTER.len_utf8(),
                };
                let fault = Diagnostic::error("the file is not UTF-8 text").at(&origin);
                faults.add(
                    fault
                        .label(format!("byte 0x{bad:02x} cannot stand here"))
                        .help("save the file as UTF-8"),
                );
                None
            }
        }
    }
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Source({})", self.path.display())
    }
}

/// Control characters would reach the terminal; others of as many bytes keep all places right.
fn without_control(c: char) -> char {
    match c {
        '\n' | '\r' | '\t' => c,
        _ if c.is_control() && c.len_utf8() == 1 => '?',
        _ if c.is_control() => '¿',
        _ => c,
    }
}

/// The YAML file beside a path that is not there whose name is nearest.
fn neighbour(path: &Path) -> Option<PathBuf> {
    let wanted = path.file_stem()?.to_str()?;
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut files = files_in(folder, &["yaml", "yml"]);
    let is_printable = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default();
        !name.to_string_lossy().contains(char::is_control)
    };
    files.retain(is_printable);
    files.sort_unstable();
    let stem = |file: &PathBuf| Some(file.file_stem()?.to_str()?.to_owned());
    let stems: Vec<String> = files.iter().filter_map(stem).collect();
    let meant = nearest(wanted, stems.iter().map(String::as_str))?;
    let meant = files
        .iter()
        .find(|file| stem(file).as_deref() == Some(meant));
    Some(path.with_file_name(meant?.file_name()?))
}

/// The files of a folder with one of these endings; none when it cannot be read.
pub(super) fn files_in(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    let has_ending = |file: &PathBuf| {
        let ending = file.extension().unwrap_or_default();
        endings.iter().any(|e| ending == *e)
    };
    files.map(|f| f.path()).filter(has_ending).collect()
}

fn read_bounded(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // A bound on the reader rather than on the length that the system tells: pipes have none.
    fs::File::open(path)?
        .take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The path without a leading `./`; `.` itself stays, since nothing would be left of it.
pub(super) fn printable(path: &Path) -> PathBuf {
    let bare = path.strip_prefix(".").ok();
    let bare = bare.filter(|bare| !bare.as_os_str().is_empty());
    bare.unwrap_or(path).to_owned()
}

/// A stretch of a file.
#[derive(Clone)]
pub struct Origin {
    /// The file.
    pub source: Source,
    /// Bytes of its text.
    pub span: Range<usize>,
}

impl Origin {
    /// Where it starts, for people: the part that lies on its first line.
    #[must_use]
    pub fn place(&self) -> Place {
        let text = self.source.text();
        let start = floor_char_boundary(text, self.span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line_end = text[start..]
            .find(['\n', '\r'])
            .map_or(text.len(), |i| start + i);
        let end = floor_char_boundary(text, self.span.end).clamp(start, line_end);
        let covered = text[start..end].trim_end().len();
        Place {
            line: text[..line_start].matches('\n').count() + 1,
            column: text[line_start..start].chars().count() + 1,
            start,
            end: start + covered,
        }
    }
}

impl fmt::Debug for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = self.place();
        write!(
            f,
            "{}:{}:{}",
            self.source.path.display(),
            place.line,
            place.column
        )
    }
}

fn floor_char_boundary(text: &str, at: usize) -> usize {
    (0..=at.min(text.len()))
        .rev()
        .find(|i| text.is_char_boundary(*i))
        .unwrap_or(0)
}

/// Where something stands in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// First byte of the file's text that it covers.
    pub start: usize,
    /// The byte after the last; on the same line.
    pub end: usize,
}

/// A value with the place where it was written; nowhere when it was made in Rust.
#[derive(Clone, Debug)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Where it was written.
    pub origin: Option<Origin>,
}

impl<T> Located<T> {
    /// The value of another type that stands at the same place.
    #[must_use]
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Located<U> {
        Located {
            value: f(self.value),
            origin: self.origin,
        }
    }
}

impl<T> From<T> for Located<T> {
    /// A value that was made in Rust.
    fn from(value: T) -> Self {
        Self {
            value,
            origin: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_named_also_where_it_is_the_present_one() {
        for (given, told) in [(".", "."), ("./a.yaml", "a.yaml"), ("b/../c", "b/../c")] {
            assert_eq!(printable(Path::new(given)), Path::new(told));
        }
        let mut faults = Faults::default();
        assert!(Source::read(Path::new("."), &mut faults).is_none());
        let faults = faults.into_sorted();
        assert!(faults[0].line().starts_with(".: "), "{faults:?}");
    }

    #[test]
    fn a_file_that_is_not_there_is_told_with_the_one_that_is_called_nearly_so() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["sock_then_trash.yaml", "tidy.yml", "sock_then_trsh.txt"] {
            fs::write(folder.path().join(name), "do: [sock]").unwrap();
        }
        let help = |name: &str| {
            let mut faults = Faults::default();
            assert!(Source::read(&folder.path().join(name), &mut faults).is_none());
            faults.into_sorted().remove(0).help.unwrap()
        };
        let meant = folder.path().join("sock_then_trash.yaml");
        let meant = format!("did you mean '{}'?", meant.display());
        assert_eq!(help("sock_then_trsh.yaml"), meant);
        assert!(help("wine.yaml").contains("give the path of a YAML file"));
    }
}
