//! Small files that commands keep.

use std::fs;
use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::CliError;
use crate::model::indented_json;
use crate::storage::write_file;

/// What is kept in a file as JSON, if it can be read.
pub(super) fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Keeps something in a file as JSON.
pub(super) fn keep(file: &Path, what: &impl Serialize) -> Result<(), CliError> {
    keep_text(file, &indented_json(what)?)
}

/// Keeps a text in a file.
pub(super) fn keep_text(file: &Path, text: &[u8]) -> Result<(), CliError> {
    Ok(write_file(file, |f| f.write_all(text))?)
}
