use std::fmt;

use serde::{Deserialize, Serialize};

use super::layout::{leads_on, stage_offsets, subgoal_count};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::task::{Automaton, Subgoal};
use crate::wording::counted;

/// An edge of a route, in words that lead back to the recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AuditedEdge {
    /// The state that is left.
    pub from: NodeId,
    /// Its demonstration and step.
    pub from_state: String,
    /// The state that is entered.
    pub to: NodeId,
    /// Its demonstration and step.
    pub to_state: String,
    /// Where the edge comes from; `None` when the graph has no such edge.
    pub kind: Option<EdgeKind>,
    /// Predicted time steps.
    pub steps: u32,
    /// Probability that it is passable in fewer than `d_max` steps, 0..=1.
    pub connected_probability: f32,
}

impl AuditedEdge {
    /// The edge between two states of a graph, whether or not there is one.
    pub(super) fn of(graph: &TopologicalGraph, from: NodeId, to: NodeId) -> Self {
        let edge = graph.edge(from, to);
        Self {
            from,
            from_state: graph.node(from).place(),
            to,
            to_state: graph.node(to).place(),
            kind: edge.map(|e| e.kind),
            steps: edge.map_or(0, |e| e.steps),
            connected_probability: edge.map_or(0.0, crate::graph::Edge::connected_probability),
        }
    }
}

/// Subgoals that a route skips at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shortcut {
    /// The subgoals, in order.
    pub skipped: Vec<Subgoal>,
    /// The edge that skips them.
    pub edge: AuditedEdge,
}

/// What a route does to the subgoals of a composition.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Audit {
    /// Subgoals that the route reaches, in order.
    pub reached: Vec<Subgoal>,
    /// Where it skips subgoals.
    pub shortcuts: Vec<Shortcut>,
    /// Subgoals after the last one that it gets to.
    pub missed: Vec<Subgoal>,
    /// Edges into a state at which fewer subgoals hold than before; the route takes for undone what
    /// was done.
    pub setbacks: Vec<AuditedEdge>,
}

impl Audit {
    /// Whether every subgoal is reached in its order.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.shortcuts.is_empty() && self.missed.is_empty()
    }

    /// All skipped subgoals, in order.
    pub fn skipped(&self) -> impl Iterator<Item = &Subgoal> {
        self.shortcuts.iter().flat_map(|s| &s.skipped)
    }
}

/// Which subgoals of a composition a route reaches, skips and misses, judged by the markers of the
/// demonstrations that its states come from.
///
/// Where the route changes its task, it goes on at the next occurrence of the new one. What holds at
/// the route's first state counts as reached.
///
/// # Panics
/// If a node is not in the graph.
#[must_use]
pub fn audit(graph: &TopologicalGraph, automaton: &Automaton, route: &[NodeId]) -> Audit {
    audit_after(graph, automaton, (None, None), route)
}

/// The same of a route that an edge leads into from a state `before` it: whatever holds there counts for
/// nothing, and what is to count at the route's first state must be reached there. `begun` is the stage at that
/// state, where it is known: of a task that is done several times it says which time.
pub(super) fn audit_after(
    graph: &TopologicalGraph,
    automaton: &Automaton,
    (before, begun): (Option<NodeId>, Option<usize>),
    route: &[NodeId],
) -> Audit {
    let walker = Walker {
        graph,
        automaton,
        offsets: stage_offsets(automaton),
    };
    let mut audit = Audit::default();
    let Some(&first) = route.first() else {
        audit.missed = automaton.subgoals().to_vec();
        return audit;
    };
    let mut occurrence = walker.first_occurrence(first, begun);
    let mut here = walker.stage(occurrence, first);
    let mut furthest = here;
    match before {
        Some(before) => walker.note(&mut audit, (before, first), 0..here),
        None => audit
            .reached
            .extend_from_slice(&automaton.subgoals()[..here]),
    }
    for pair in route.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let is_same_task = graph.node(from).task == graph.node(to).task;
        let begins_round = graph
            .edge(from, to)
            .is_some_and(|e| leads_on(e, is_same_task));
        if !is_same_task || (begins_round && occurrence.is_some()) {
            occurrence = walker.next_occurrence(occurrence.map_or(0, |o| o + 1), to);
        }
        let there = walker.stage(occurrence, to);
        if there < here {
            audit.setbacks.push(AuditedEdge::of(graph, from, to));
        }
        if there > furthest {
            walker.note(&mut audit, (from, to), furthest..there);
            furthest = there;
        }
        here = there;
    }
    audit.missed = automaton.subgoals()[furthest..].to_vec();
    audit
}

struct Walker<'a> {
    graph: &'a TopologicalGraph,
    automaton: &'a Automaton,
    offsets: Vec<usize>,
}

impl Walker<'_> {
    /// The occurrence of the node's task at which it has this stage, else the first one.
    fn first_occurrence(&self, node: NodeId, stage: Option<usize>) -> Option<usize> {
        let tasks = self.automaton.tasks();
        let is_it = |o: &usize| {
            tasks[*o] == self.graph.node(node).task && Some(self.stage(Some(*o), node)) == stage
        };
        (0..tasks.len())
            .find(is_it)
            .or_else(|| self.next_occurrence(0, node))
    }

    /// The first occurrence of the node's task from `from` on, else the first of all.
    fn next_occurrence(&self, from: usize, node: NodeId) -> Option<usize> {
        let tasks = self.automaton.tasks();
        let is_it = |o: &usize| tasks[*o] == self.graph.node(node).task;
        (from..tasks.len())
            .find(is_it)
            .or_else(|| (0..tasks.len()).find(is_it))
    }

    fn stage(&self, occurrence: Option<usize>, node: NodeId) -> usize {
        let node = self.graph.node(node);
        occurrence.map_or(0, |o| {
            let most = subgoal_count(self.automaton, &node.task);
            self.offsets[o] + (node.progress as usize).min(most)
        })
    }

    fn note(&self, audit: &mut Audit, (from, to): (NodeId, NodeId), due: std::ops::Range<usize>) {
        let reached_here = &self.graph.node(to).reached;
        let (reached, skipped): (Vec<_>, Vec<_>) = self.automaton.subgoals()[due]
            .iter()
            .cloned()
            .partition(|s| reached_here.contains(s));
        audit.reached.extend(reached);
        if !skipped.is_empty() {
            audit.shortcuts.push(Shortcut {
                skipped,
                edge: AuditedEdge::of(self.graph, from, to),
            });
        }
    }
}

impl fmt::Display for AuditedEdge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Some(EdgeKind::Temporal) => "temporal edge",
            Some(EdgeKind::Learned) => "learned edge",
            Some(EdgeKind::CrossTask) => "cross-task edge",
            None => "jump without an edge",
        };
        write!(
            f,
            "{kind} {} -> {} ({}, P(connected) {:.3})",
            self.from_state,
            self.to_state,
            counted(self.steps as usize, "step"),
            self.connected_probability
        )
    }
}

impl fmt::Display for Audit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = |subgoals: &[Subgoal]| {
            let names: Vec<&str> = subgoals.iter().map(|s| s.name.as_str()).collect();
            names.join(", ")
        };
        if self.is_clean() {
            write!(f, "all subgoals in order: {}", names(&self.reached))?;
        }
        let mut lines: Vec<String> = self
            .shortcuts
            .iter()
            .map(|s| format!("skips {} by the {}", names(&s.skipped), s.edge))
            .collect();
        if !self.missed.is_empty() {
            lines.push(format!("never gets to {}", names(&self.missed)));
        }
        write!(f, "{}", lines.join("\n"))
    }
}
