//! How commands merge the graphs of tasks.

use indicatif::ProgressBar;

use super::error::CliError;
use crate::composer::Composition;
use crate::graph::{
    CrossTaskCandidates, GraphProgress, MergeOptions, MergeReport, TopologicalGraph, merge,
};
use crate::inference::Model;

/// How far from the end of one task and the start of the next cross-task edges are looked for.
const SEAM_WINDOW_STEPS: u32 = 10;
/// Pairs elsewhere that are scored too, each two tasks and direction, so that the audit of the paper's
/// plan meets the wormholes that are there.
const SAMPLED_PAIRS: u32 = 100_000;

/// How graphs are merged on the command line.
pub(super) fn merge_options() -> MergeOptions {
    MergeOptions {
        candidates: CrossTaskCandidates::SeamAndSample {
            window_steps: SEAM_WINDOW_STEPS,
            pairs: SAMPLED_PAIRS,
            seed: 0,
        },
        ..MergeOptions::default()
    }
}

/// The graphs of a composition's tasks in one.
pub(super) fn merge_all(
    graphs: &[TopologicalGraph],
    composition: &Composition,
    model: &Model,
    bar: &ProgressBar,
) -> Result<(TopologicalGraph, MergeReport), CliError> {
    let follows = composition.follows();
    if let ([graph], true) = (graphs, follows.is_empty()) {
        return Ok((graph.clone(), MergeReport::default()));
    }
    let graphs: Vec<&TopologicalGraph> = graphs.iter().collect();
    let known: Vec<&str> = graphs.iter().flat_map(|graph| graph.tasks()).collect();
    let follows: Vec<(&str, &str)> = follows
        .into_iter()
        .filter(|(from, to)| known.contains(from) && known.contains(to))
        .collect();
    let merged = merge(&graphs, Some(&follows), model, &merge_options(), &|p| {
        show_progress(bar, p);
    })?;
    Ok((merged.graph, merged.report))
}

/// Moves a bar to how far the work is.
pub(super) fn show_progress(bar: &ProgressBar, progress: GraphProgress) {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
}
