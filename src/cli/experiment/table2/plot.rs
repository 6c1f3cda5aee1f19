use std::path::Path;

use super::super::method::Method;
use super::super::plan::with_version;
use super::{ENGINES, NAME, TimeCell, published};
use crate::cli::error::CliError;
use crate::view::{Timing, write_times_svg};

const TITLE: &str = "Table II: time that a step takes";

/// Makes the plot of the cells that are there, a group of bars for each of `rows` that has any.
pub(super) fn draw(
    out: &Path,
    rows: &[(Method, usize)],
    cells: &[TimeCell],
) -> Result<(), CliError> {
    let timings = rows
        .iter()
        .map(|(method, demonstrations)| timing(method, *demonstrations, cells));
    let timings: Vec<Timing> = timings.collect();
    let engines = ENGINES.map(|(_, described)| described);
    let file = out.join(format!("{NAME}.svg"));
    let title = with_version(TITLE, cells.iter().any(|cell| cell.is_quick));
    Ok(write_times_svg(&file, &timings, &engines, &title)?)
}

/// What was measured of a method, and what the paper has of it.
fn timing(method: &Method, demonstrations: usize, cells: &[TimeCell]) -> Timing {
    let of_engine = |(engine, _): (&str, &str)| {
        let cell = cells.iter().find(|cell| {
            cell.method == method.name
                && cell.demonstrations == demonstrations
                && cell.engine == engine
        });
        cell.map(|cell| [cell.step_median_ms, cell.step_p99_ms])
    };
    Timing {
        label: format!("{}, {demonstrations} demonstrations", method.described),
        times: ENGINES.into_iter().map(of_engine).collect(),
        published: published(method, demonstrations),
    }
}
