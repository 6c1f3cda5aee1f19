//! Small files that commands keep.

use std::fs;
use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::error::CliError;
use crate::model::indented_json;
use crate::storage::write_file;

/// What is kept in a file as JSON, if it can be read.
pub(super) fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Whether what a file holds was made of the same ingredients, so that it need not be made again; says so.
pub(super) fn is_kept<T: DeserializeOwned>(file: &Path, digest: &str) -> bool {
    let same = kept::<Value>(file).filter(|value| value["digest"] == digest);
    let is_kept = same.is_some_and(|value| serde_json::from_value::<T>(value).is_ok());
    if is_kept {
        println!("kept: {}", file.display());
    }
    is_kept
}

/// Keeps something in a file as JSON.
pub(super) fn keep(file: &Path, what: &impl Serialize) -> Result<(), CliError> {
    keep_text(file, &indented_json(what)?)
}

/// Keeps a text in a file.
pub(super) fn keep_text(file: &Path, text: &[u8]) -> Result<(), CliError> {
    Ok(write_file(file, |f| f.write_all(text))?)
}
