use crate::composer::Composition;
use crate::graph::{
    CrossTaskCandidates, GraphError, MergeOptions, MergeReport, Merged, ProgressFn,
    TopologicalGraph, merge,
};
use crate::inference::Model;

/// How far from the end of one task and the start of the next cross-task edges are looked for.
const SEAM_WINDOW_STEPS: u32 = 10;
/// Pairs elsewhere that are scored too, each two tasks and direction, so that the audit of the paper's
/// plan meets the wormholes that are there.
const SAMPLED_PAIRS: u32 = 100_000;

/// How a composition's graphs are merged unless it is said otherwise, on the command line always: cross-task edges are
/// looked for at the seams, within 10 steps, and among 100,000 pairs of states elsewhere, the same each time.
///
/// At the seams are the edges that a plan with all subgoals in order needs. False edges elsewhere, for which the
/// default of [`MergeOptions`] does not look, are what the paper's unconstrained plan skips subgoals by: without the
/// sample an audit of that plan ([`Planner::audit`](crate::planner::Planner::audit)) would find less than there is.
#[must_use]
pub fn merge_options() -> MergeOptions {
    MergeOptions {
        candidates: CrossTaskCandidates::SeamAndSample {
            window_steps: SEAM_WINDOW_STEPS,
            pairs: SAMPLED_PAIRS,
            seed: 0,
        },
        ..MergeOptions::default()
    }
}

/// The graphs of a composition's tasks in one, with the seams that its orders allow.
pub(crate) fn merge_tasks(
    graphs: &[TopologicalGraph],
    composition: &Composition,
    model: &Model,
    options: &MergeOptions,
    progress: ProgressFn<'_>,
) -> Result<Merged, GraphError> {
    let follows = composition.follows();
    if let ([graph], true) = (graphs, follows.is_empty()) {
        return Ok(Merged {
            graph: graph.clone(),
            report: MergeReport::default(),
        });
    }
    let graphs: Vec<&TopologicalGraph> = graphs.iter().collect();
    let known: Vec<&str> = graphs.iter().flat_map(|graph| graph.tasks()).collect();
    let follows: Vec<(&str, &str)> = follows
        .into_iter()
        .filter(|(from, to)| known.contains(from) && known.contains(to))
        .collect();
    merge(&graphs, Some(&follows), model, options, progress)
}
