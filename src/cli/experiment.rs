//! `catena experiment`: tables and figures, finished cells kept as files.

mod chaining;
mod commands;
#[cfg(test)]
mod committed;
mod digests;
mod figure5;
mod figure6;
mod given;
mod heeded;
mod hold;
mod ingredients;
mod method;
mod plan;
mod rates;
mod side_by_side;
mod table2;
mod workshop;

use super::arguments::{Arguments, ExperimentCommand};
use super::error::CliError;

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
