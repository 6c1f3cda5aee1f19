//! A mapping file to a sound mapping, or the first fault with its place.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde_yaml::Spanned;

use super::spec::{ActionsSpec, MappingSpec, Size};
use super::{Mapping, StorageError, nearest};

/// Mapping files are short; a larger file is some other one.
const MAX_FILE_BYTES: u64 = 256 * 1024;
const MAX_NODES: usize = 10_000;
pub const MAX_BINS: usize = 4096;
const MAX_IMAGE_PIXELS: u32 = 8192;
const MAX_EVERY: usize = 10_000;
const MAX_RATE_HZ: f64 = 10_000.0;

/// Where the format is described.
const PAGE: &str = "docs/your-own-robot.md shows a mapping file with all keys";

pub(super) fn fault(
    path: &Path,
    place: Option<(u64, u64)>,
    message: impl Into<String>,
    help: impl Into<String>,
) -> StorageError {
    StorageError::Mapping {
        path: path.to_owned(),
        place: place.map_or_else(String::new, |(line, column)| format!(":{line}:{column}")),
        message: message.into(),
        help: help.into(),
    }
}

impl Mapping {
    /// Reads and checks a mapping file. Its paths are relative to the folder that it lies in.
    pub fn load(path: &Path) -> Result<Self, StorageError> {
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|f| f.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes))
            .map_err(StorageError::io("read", path))?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            let message = format!("the file is larger than {} KiB", MAX_FILE_BYTES / 1024);
            return Err(fault(path, None, message, "Is this a mapping file?"));
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            let at = e.utf8_error().valid_up_to();
            let message = format!("byte {at} of the file is no UTF-8 text");
            fault(path, None, message, "Save the file as UTF-8")
        })?;
        Self::parse(path, &text)
    }

    /// The same from text; `path` says where it stands.
    pub fn parse(path: &Path, text: &str) -> Result<Self, StorageError> {
        let mut options = serde_yaml::Options::default();
        options.with_snippet = false;
        if let Some(budget) = &mut options.budget {
            budget.max_nodes = MAX_NODES;
        }
        let spec: MappingSpec = serde_yaml::from_str_with_options(text, options).map_err(|e| {
            let place = e.location().map(|l| (l.line(), l.column()));
            let told = e.without_snippet().to_string();
            // The reader says the place once more.
            let told = one_line(told.split(" at line ").next().unwrap_or_default());
            let written = place.map_or("", |place| word_at(text, place));
            let (message, help) = explained(&told, written);
            fault(path, place, message, help)
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let recordings = spec.recordings.value.0.iter();
        let mapping = Self {
            path: path.to_owned(),
            recordings: recordings.map(|r| folder.join(r)).collect(),
            spec,
        };
        mapping.check()?;
        Ok(mapping)
    }

    fn check(&self) -> Result<(), StorageError> {
        let spec = &self.spec;
        if self.recordings.is_empty() {
            let help = "Name a folder or files: 'recordings: recordings/cup'";
            return Err(self.fault(&spec.recordings, "recordings is an empty list", help));
        }
        for path in &self.recordings {
            if !path.exists() {
                let message = format!("there is no {}", path.display());
                let help = "Paths of a mapping file are relative to the folder that it lies in";
                return Err(self.fault(&spec.recordings, message, help));
            }
            if super::is_mapping(path) {
                let message = format!("{} is a mapping file itself", path.display());
                let help = "Name recordings, folders of them, or LeRobot datasets";
                return Err(self.fault(&spec.recordings, message, help));
            }
        }
        if let Some(task) = spec.task.as_ref().filter(|t| t.value.trim().is_empty()) {
            return Err(self.fault(task, "task is empty", "Name it, or leave the key out"));
        }
        self.check_cameras()?;
        self.check_steps()?;
        self.check_actions(&spec.actions)
    }

    fn check_cameras(&self) -> Result<(), StorageError> {
        let spec = &self.spec;
        let empty = BTreeMap::new();
        let cameras = spec.topics.cameras.as_ref().unwrap_or(&empty);
        let mut seen: BTreeMap<&str, &str> = BTreeMap::new();
        for (name, topic) in cameras {
            if name.is_empty() || name.contains(['/', '\\']) {
                let message = format!("'{name}' cannot be the name of a camera");
                return Err(self.fault(topic, message, "Use letters, digits and '_'"));
            }
            if let Some(other) = seen.insert(&topic.value, name) {
                let message = format!("'{}' is camera '{other}' and camera '{name}'", topic.value);
                return Err(self.fault(topic, message, "Give each camera a topic of its own"));
            }
        }
        let sizes = spec.image_sizes.iter().flatten();
        for (name, size) in sizes.clone() {
            if spec.topics.cameras.is_some() && !cameras.contains_key(name) {
                let known: Vec<&str> = cameras.keys().map(String::as_str).collect();
                let message =
                    format!("image_sizes names '{name}', which is no camera of this file");
                return Err(self.fault(size, message, super::suggestion("camera", name, &known)));
            }
        }
        for size in sizes.map(|(_, size)| size).chain(&spec.image_size) {
            let Size { height, width } = size.value;
            if [height, width]
                .iter()
                .any(|n| !(1..=MAX_IMAGE_PIXELS).contains(n))
            {
                let message = format!("an image of {height}x{width} pixels is out of range");
                let help = format!("Give a height and a width within 1..={MAX_IMAGE_PIXELS}");
                return Err(self.fault(size, message, help));
            }
        }
        Ok(())
    }

    fn check_steps(&self) -> Result<(), StorageError> {
        let spec = &self.spec;
        if let (Some(rate), Some(_)) = (&spec.rate_hz, &spec.every) {
            let message = "both rate_hz and every say which steps are taken";
            return Err(self.fault(rate, message, "Keep one of them"));
        }
        if let Some(rate) = &spec.rate_hz
            && !(rate.value > 0.0 && rate.value <= MAX_RATE_HZ)
        {
            let message = format!("rate_hz is {}, out of range", rate.value);
            let help = format!("Give the steps a second, above 0 and at most {MAX_RATE_HZ}");
            return Err(self.fault(rate, message, help));
        }
        if let Some(every) = &spec.every
            && !(1..=MAX_EVERY).contains(&every.value)
        {
            let message = format!("every is {}, out of range", every.value);
            let help = format!("Give a number within 1..={MAX_EVERY}; 1 takes every action");
            return Err(self.fault(every, message, help));
        }
        Ok(())
    }

    fn check_actions(&self, actions: &ActionsSpec) -> Result<(), StorageError> {
        for list in [&actions.names, &actions.keep].into_iter().flatten() {
            if let Some(name) = repeated(&list.value) {
                let message = format!("the dimension '{name}' is named twice");
                return Err(self.fault(list, message, "Name each dimension once"));
            }
            if list.value.is_empty() {
                let message = "a list of dimensions is empty";
                return Err(self.fault(list, message, "Name some, or leave the key out"));
            }
        }
        if let Some(bins) = &actions.bins {
            self.check_bins(bins, bins.value)?;
        }
        for (name, dimension) in &actions.dimensions {
            let spec = &dimension.value;
            if let Some(bins) = spec.bins {
                self.check_bins(dimension, bins)?;
            }
            let bounds = [spec.low, spec.high].into_iter().flatten();
            if let Some(bad) = bounds.clone().find(|v| !v.is_finite()) {
                let message = format!("the range of '{name}' ends at {bad}");
                return Err(self.fault(dimension, message, "Give finite numbers"));
            }
            if let (Some(low), Some(high)) = (spec.low, spec.high)
                && low >= high
            {
                let message = format!("the range of '{name}' is empty: {low} to {high}");
                return Err(self.fault(dimension, message, "low must be below high"));
            }
        }
        Ok(())
    }

    fn check_bins<T>(&self, place: &Spanned<T>, bins: usize) -> Result<(), StorageError> {
        if (1..=MAX_BINS).contains(&bins) {
            return Ok(());
        }
        let message = format!("{bins} bins are out of range");
        let help = format!("Give a number within 1..={MAX_BINS}; 11 to 31 suit most robots");
        Err(self.fault(place, message, help))
    }
}

fn repeated(names: &[String]) -> Option<&String> {
    names
        .iter()
        .enumerate()
        .find(|(i, name)| names[..*i].contains(name))
        .map(|(_, name)| name)
}

/// The word that stands at a place, as far as it is one.
fn word_at(text: &str, (line, column): (u64, u64)) -> &str {
    const MAX_CHARS: usize = 40;
    let line = text.lines().nth(line.saturating_sub(1) as usize);
    let start = line.and_then(|l| {
        let at = l.char_indices().nth(column.saturating_sub(1) as usize)?.0;
        l.get(at..)
    });
    let rest = start.unwrap_or_default();
    let end = rest
        .char_indices()
        .enumerate()
        .find(|(count, (_, c))| *count == MAX_CHARS || matches!(c, ',' | '}' | ']' | '#' | ':'));
    rest[..end.map_or(rest.len(), |(_, (at, _))| at)].trim()
}

/// What the reader says, in words of this format, and the way out.
fn explained(told: &str, written: &str) -> (String, String) {
    let page = || PAGE.to_owned();
    let choice = told
        .strip_prefix("unknown field `")
        .or_else(|| told.strip_prefix("unknown variant `"))
        .and_then(|rest| rest.split_once("`, expected "));
    if let Some((found, known)) = choice {
        let known = known.trim_start_matches("one of ").replace('`', "");
        let names: Vec<&str> = known.split(", ").collect();
        let near = nearest(found, names.iter().copied());
        let near = near.map_or_else(String::new, |n| format!("Did you mean '{n}'? "));
        return if told.starts_with("unknown field") {
            let message = format!("there is no key '{found}' here");
            (message, format!("{near}The keys are {known}; {PAGE}"))
        } else {
            let message = format!("'{found}' is none of {known}");
            (message, format!("{near}Write one of them"))
        };
    }
    if let Some(key) = told.strip_prefix("duplicate mapping key: ") {
        let key = key.split(',').next().unwrap_or_default();
        return (
            format!("the key '{key}' is given twice"),
            "Keep one of them".to_owned(),
        );
    }
    if let Some(key) = told.strip_prefix("missing field ") {
        return (
            format!("the key {} is missing", key.replace('`', "'")),
            page(),
        );
    }
    match told {
        "invalid floating point" => (format!("'{written}' is no number"), page()),
        told if told.starts_with("invalid u") => (
            format!("'{written}' is no whole number of at least 0"),
            page(),
        ),
        "expected mapping start" => ("keys are expected here, 'key: value'".to_owned(), page()),
        "unexpected end of input" => ("the file says nothing".to_owned(), page()),
        _ => (told.to_owned(), page()),
    }
}

fn one_line(text: &str) -> String {
    const MAX_CHARS: usize = 300;
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.trim_end_matches([':', '.'])
        .chars()
        .take(MAX_CHARS)
        .collect()
}
