//! `catena experiment`: tables and figures, finished cells kept as files.

mod chaining;
mod figure5;
mod figure6;
mod method;
mod plan;
mod rates;
mod table2;
mod workshop;

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::arguments::{Arguments, ExperimentCommand};
use super::error::CliError;
use crate::storage::write_file;

pub(super) fn experiment(
    command: &ExperimentCommand,
    arguments: &Arguments,
) -> Result<(), CliError> {
    match command {
        ExperimentCommand::Chaining(a) => chaining::chaining(a, arguments),
        ExperimentCommand::Table1(a) => rates::table_1(a, arguments),
        ExperimentCommand::Table2(a) => table2::table_2(a, arguments),
        ExperimentCommand::Table3(a) => rates::table_3(a, arguments),
        ExperimentCommand::Fig5(a) => figure5::figure_5(a, arguments),
        ExperimentCommand::Fig6(a) => figure6::figure_6(a, arguments),
    }
}

/// What is kept in a file, if it can be read.
fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&std::fs::read(file).ok()?).ok()
}

/// Keeps something as JSON in a file.
fn keep(file: &Path, what: &impl Serialize) -> Result<(), CliError> {
    let mut json = serde_json::to_vec_pretty(what)?;
    json.push(b'\n');
    write_text(file, &json)
}

fn write_text(file: &Path, text: &[u8]) -> Result<(), CliError> {
    Ok(write_file(file, |f| std::io::Write::write_all(f, text))?)
}
