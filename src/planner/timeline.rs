use std::collections::{BTreeMap, HashSet};

use crate::graph::{NodeId, TopologicalGraph};

/// Where each state of a task lies in the time of a typical demonstration.
///
/// Demonstrations take different times between the same subgoals; each of these stretches is scaled
/// to its median length, so states of different demonstrations that do the same thing get about the
/// same time.
pub(super) struct Timeline {
    /// Steps since the start of a typical demonstration, by node of the task.
    pub(super) time_steps: BTreeMap<NodeId, f32>,
    /// Length of a typical demonstration.
    pub(super) length_steps: f32,
}

impl Timeline {
    pub(super) fn new(graph: &TopologicalGraph, task: &str) -> Self {
        Self::without(graph, task, &HashSet::new())
    }

    /// The same without some states. How long a stretch of a demonstration takes that does not pass what is to be
    /// passed says nothing of those that do.
    pub(super) fn without(
        graph: &TopologicalGraph,
        task: &str,
        unplaced: &HashSet<NodeId>,
    ) -> Self {
        let mut demonstrations: BTreeMap<&str, Vec<NodeId>> = BTreeMap::new();
        let of_task = graph.nodes().filter(|(_, n)| n.task == task);
        for (id, node) in of_task.filter(|(id, _)| !unplaced.contains(id)) {
            demonstrations.entry(&node.trajectory).or_default().push(id);
        }
        // Start and number of states of the stretch with a given progress, by demonstration.
        let stretches: Vec<BTreeMap<u32, (u32, u32)>> = demonstrations
            .values()
            .map(|nodes| stretches(graph, nodes))
            .collect();
        let starts = starts(&stretches);
        let mut time_steps = BTreeMap::new();
        for (nodes, stretches) in demonstrations.values().zip(&stretches) {
            for &id in nodes {
                let node = graph.node(id);
                let (first, count) = stretches[&node.progress];
                let (start, length) = starts[&node.progress];
                let share = (node.step - first) as f32 / count as f32;
                time_steps.insert(id, start + length * share);
            }
        }
        let length_steps = starts.values().next_back().map_or(0.0, |(s, l)| s + l);
        Self {
            time_steps,
            length_steps,
        }
    }
}

fn stretches(graph: &TopologicalGraph, nodes: &[NodeId]) -> BTreeMap<u32, (u32, u32)> {
    let mut stretches: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
    for node in nodes.iter().map(|id| graph.node(*id)) {
        let stretch = stretches.entry(node.progress).or_insert((node.step, 0));
        stretch.0 = stretch.0.min(node.step);
        stretch.1 += 1;
    }
    stretches
}

/// Start and median length of each stretch, by progress.
fn starts(demonstrations: &[BTreeMap<u32, (u32, u32)>]) -> BTreeMap<u32, (f32, f32)> {
    let mut lengths: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (progress, (_, count)) in demonstrations.iter().flatten() {
        lengths.entry(*progress).or_default().push(*count);
    }
    let mut start = 0.0;
    lengths
        .into_iter()
        .map(|(progress, mut lengths)| {
            lengths.sort_unstable();
            let median = lengths[lengths.len() / 2] as f32;
            let here = (progress, (start, median));
            start += median;
            here
        })
        .collect()
}
