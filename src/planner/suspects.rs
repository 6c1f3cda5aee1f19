use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::AuditedEdge;
use super::timeline::Timeline;
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::task::{Subgoal, Task};

/// A predicted edge that promises to gain far more than it takes.
///
/// One such edge is enough for a shortest path to go through it, whether or not a robot can.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuspectEdge {
    /// The edge.
    pub edge: AuditedEdge,
    /// Steps from the one state to the other in the median time of the demonstrations. Between tasks:
    /// what is left of the first one, and what lies before the state of the second one.
    pub progress_steps: f32,
    /// Subgoals that it would skip, in order.
    pub skipped: Vec<Subgoal>,
}

impl SuspectEdge {
    /// Steps that the edge claims to save.
    #[must_use]
    pub fn gain_steps(&self) -> f32 {
        self.progress_steps - self.edge.steps as f32
    }
}

impl fmt::Display for SuspectEdge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} for {:.0} steps of the demonstrations",
            self.edge, self.progress_steps
        )?;
        let names: Vec<&str> = self.skipped.iter().map(|s| s.name.as_str()).collect();
        if names.is_empty() {
            return Ok(());
        }
        write!(f, ", skips {}", names.join(", "))
    }
}

/// Predicted edges that claim to save at least so many steps, the largest gain first.
///
/// `tasks` names the subgoals of the graph's tasks in their order; a task that is not in it skips none.
#[must_use]
pub fn suspects(
    graph: &TopologicalGraph,
    tasks: &[Task],
    least_gain_steps: f32,
) -> Vec<SuspectEdge> {
    let timelines: BTreeMap<&str, Timeline> = graph
        .tasks()
        .into_iter()
        .map(|task| (task, Timeline::new(graph, task)))
        .collect();
    let progress_steps = |from: NodeId, to: NodeId| {
        let (a, b) = (&graph.node(from).task, &graph.node(to).task);
        let (first, second) = (&timelines[a.as_str()], &timelines[b.as_str()]);
        let (start, end) = (first.time_steps[&from], second.time_steps[&to]);
        if a == b {
            end - start
        } else {
            first.length_steps - start + end
        }
    };
    let mut found: Vec<SuspectEdge> = graph
        .edges()
        .filter(|(_, _, edge)| edge.kind != EdgeKind::Temporal)
        .map(|(from, to, edge)| (from, to, edge, progress_steps(from, to)))
        .filter(|(_, _, edge, progress)| progress - edge.steps as f32 >= least_gain_steps)
        .map(|(from, to, _, progress_steps)| SuspectEdge {
            edge: AuditedEdge::of(graph, from, to),
            progress_steps,
            skipped: skipped(graph, tasks, from, to),
        })
        .collect();
    found.sort_by(|a, b| {
        let ends = |s: &SuspectEdge| (s.edge.from, s.edge.to);
        let order = b.gain_steps().total_cmp(&a.gain_steps());
        order.then(ends(a).cmp(&ends(b)))
    });
    found
}

/// The subgoals between two states that the second one does not reach itself.
fn skipped(graph: &TopologicalGraph, tasks: &[Task], from: NodeId, to: NodeId) -> Vec<Subgoal> {
    let (here, there) = (graph.node(from), graph.node(to));
    let subgoals = |name: &str| {
        let task = tasks.iter().find(|t| t.name == name);
        task.map_or(&[][..], |t| &t.subgoals[..])
    };
    let after = subgoals(&here.task).iter().skip(here.progress as usize);
    let before = subgoals(&there.task).iter().take(there.progress as usize);
    let between: Vec<&Subgoal> = if here.task == there.task {
        before.skip(here.progress as usize).collect()
    } else {
        after.chain(before).collect()
    };
    let is_missed = |s: &&Subgoal| !there.reached.contains(s);
    between.into_iter().filter(is_missed).cloned().collect()
}
