use std::collections::HashSet;
use std::ops::Range;

use super::timeline::Timeline;
use super::{PlannerError, Search};
use crate::graph::{Edge, EdgeKind, NodeId, TopologicalGraph};
use crate::task::{Automaton, Subgoal};

/// Index of a place in its layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PlaceId(pub u32);

impl PlaceId {
    /// As an index into per-place tables.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A node at one occurrence of its task in a composition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The node.
    pub node: NodeId,
    /// Which of the composition's tasks, from 0; a task that comes twice has places at both.
    pub occurrence: usize,
    /// How many subgoals of the composition hold here.
    pub stage: usize,
    /// Steps since the start of the composition, in the median time of the demonstrations.
    pub time_steps: f32,
}

/// A graph laid out along a composition: all places, and what a plan may do between them.
///
/// Nodes of tasks that the composition does not name have no place.
#[derive(Clone, Debug)]
pub struct Layout {
    places: Vec<Place>,
    /// For each node, its number among the nodes of its task.
    ranks: Vec<u32>,
    /// For each node, the first place of each of its occurrences: an index into `starts`.
    occurrences: Vec<Vec<usize>>,
    starts: Vec<u32>,
    successors: Vec<Option<PlaceId>>,
    subgoals: Vec<Subgoal>,
    /// For each occurrence, how many subgoals the tasks before it have.
    offsets: Vec<usize>,
    search: Search,
}

impl Layout {
    /// Lays out a graph. [`Search::Unconstrained`] gives every node of the graph one place, and
    /// allows every edge.
    ///
    /// # Errors
    /// [`PlannerError::NoTask`], [`PlannerError::NoStates`], and [`PlannerError::UnknownTask`] for a task that the graph lacks.
    pub fn new(
        graph: &TopologicalGraph,
        automaton: &Automaton,
        search: Search,
    ) -> Result<Self, PlannerError> {
        Self::without(graph, automaton, search, &HashSet::new())
    }

    /// The same without places for some nodes.
    pub(super) fn without(
        graph: &TopologicalGraph,
        automaton: &Automaton,
        search: Search,
        unplaced: &HashSet<NodeId>,
    ) -> Result<Self, PlannerError> {
        check(graph, automaton)?;
        let offsets = stage_offsets(automaton);
        let mut layout = Self {
            places: Vec::new(),
            ranks: vec![0; graph.node_count()],
            occurrences: vec![Vec::new(); graph.node_count()],
            starts: Vec::new(),
            successors: Vec::new(),
            subgoals: automaton.subgoals().to_vec(),
            offsets: offsets.clone(),
            search,
        };
        let mut tasks: Vec<(&str, Range<usize>)> = automaton
            .tasks()
            .iter()
            .zip(offsets)
            .map(|(task, offset)| {
                let done = offset + subgoal_count(automaton, task);
                (task.as_str(), offset..done)
            })
            .collect();
        if search == Search::Unconstrained {
            layout.add_strangers(graph, &mut tasks);
        }
        layout.add_occurrences(graph, &tasks, unplaced);
        layout.find_successors(graph);
        Ok(layout)
    }

    /// The flat layout has each node once: the first occurrence of tasks, and tasks that the
    /// composition does not name behind them.
    fn add_strangers<'g>(
        &self,
        graph: &'g TopologicalGraph,
        tasks: &mut Vec<(&'g str, Range<usize>)>,
    ) where
        Self: 'g,
    {
        let mut once: Vec<(&str, Range<usize>)> = Vec::new();
        let all = self.subgoals.len();
        let strangers = graph.tasks().into_iter().map(|t| (t, all..all));
        for (task, stages) in tasks.iter().cloned().chain(strangers) {
            if !once.iter().any(|(t, _)| *t == task) {
                let task = graph.tasks().into_iter().find(|t| *t == task);
                once.extend(task.map(|t| (t, stages)));
            }
        }
        *tasks = once;
    }

    /// Places for the nodes of each task, with the stages from which and up to which it leads.
    fn add_occurrences(
        &mut self,
        graph: &TopologicalGraph,
        tasks: &[(&str, Range<usize>)],
        unplaced: &HashSet<NodeId>,
    ) {
        let mut start_steps = 0.0;
        for (occurrence, (task, stages)) in tasks.iter().enumerate() {
            let timeline = Timeline::without(graph, task, unplaced);
            self.starts.push(self.places.len() as u32);
            for (rank, (&node, time)) in timeline.time_steps.iter().enumerate() {
                self.ranks[node.index()] = rank as u32;
                self.occurrences[node.index()].push(occurrence);
                self.places.push(Place {
                    node,
                    occurrence,
                    stage: (stages.start + graph.node(node).progress as usize).min(stages.end),
                    time_steps: start_steps + time,
                });
            }
            start_steps += timeline.length_steps;
        }
    }

    fn find_successors(&mut self, graph: &TopologicalGraph) {
        self.successors = vec![None; self.places.len()];
        for (from, to, edge) in graph.edges() {
            if edge.kind == EdgeKind::Temporal {
                for &occurrence in &self.occurrences[from.index()] {
                    if self.occurrences[to.index()].contains(&occurrence) {
                        let (a, b) = (self.at(from, occurrence), self.at(to, occurrence));
                        self.successors[a.index()] = Some(b);
                    }
                }
            }
        }
    }

    fn at(&self, node: NodeId, occurrence: usize) -> PlaceId {
        PlaceId(self.starts[occurrence] + self.ranks[node.index()])
    }

    /// Whether no subgoal of its task holds at a place, and its stage is that of the tasks before. Never so of the
    /// first task.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn is_at_start(&self, place: PlaceId) -> bool {
        let place = self.place(place);
        place.occurrence > 0 && self.offsets.get(place.occurrence) == Some(&place.stage)
    }

    /// The stage at which the first task begins: 0, unless a region that is to be passed holds all its first states.
    pub(super) fn first_stage(&self) -> usize {
        let first = self.places.iter().filter(|p| p.occurrence == 0);
        first.map(|p| p.stage).min().unwrap_or(0)
    }

    /// The stage of the places at which so many subgoals hold, the last of them reached there. A layout that has each task
    /// once has no places of later rounds: those of the first one stand for them.
    pub(super) fn laid_out_stage(&self, automaton: &Automaton, stage: usize) -> usize {
        let last = stage.checked_sub(1);
        let last = last.filter(|_| self.search == Search::Unconstrained);
        let round = last.and_then(|last| self.offsets.iter().rposition(|offset| *offset <= last));
        let Some(round) = round else {
            return stage;
        };
        let tasks = automaton.tasks();
        let first = tasks.iter().position(|task| *task == tasks[round]);
        self.offsets[first.unwrap_or(round)] + stage - self.offsets[round]
    }

    /// The stages at which a later task starts.
    pub(super) fn starts_of_tasks(&self) -> &[usize] {
        self.offsets.get(1..).unwrap_or_default()
    }

    /// All places; a [`PlaceId`] is an index into them.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// One place.
    ///
    /// # Panics
    /// If it is not in the layout.
    #[must_use]
    pub fn place(&self, id: PlaceId) -> &Place {
        &self.places[id.index()]
    }

    /// The places of a node, one for each occurrence of its task.
    ///
    /// # Panics
    /// If the node is not in the graph.
    pub fn places_of(&self, node: NodeId) -> impl Iterator<Item = PlaceId> {
        self.occurrences[node.index()]
            .iter()
            .map(move |o| self.at(node, *o))
    }

    /// The place one step later in the same demonstration; none for its last state.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn successor(&self, id: PlaceId) -> Option<PlaceId> {
        self.successors[id.index()]
    }

    /// Number of stages: one more than the composition has subgoals.
    #[must_use]
    pub fn stage_count(&self) -> usize {
        self.subgoals.len() + 1
    }

    /// The composition's subgoals in order.
    #[must_use]
    pub fn subgoals(&self) -> &[Subgoal] {
        &self.subgoals
    }

    /// What plans may do on this layout.
    #[must_use]
    pub fn search(&self) -> Search {
        self.search
    }

    /// Whether a plan that is at `stage` may go to a place next: the place keeps the stage, or
    /// reaches all that lies between. A task is entered when those before it are done, so that a state
    /// cannot reach the same subgoal of two rounds at once.
    ///
    /// # Panics
    /// If the place is not in the layout, or the layout is of another graph.
    #[must_use]
    pub fn may_enter(&self, graph: &TopologicalGraph, stage: usize, to: PlaceId) -> bool {
        let place = self.place(to);
        self.search == Search::Unconstrained
            || (place.stage >= stage
                && stage >= self.offsets[place.occurrence]
                && graph
                    .node(place.node)
                    .reaches(&self.subgoals[stage..place.stage]))
    }

    /// The pairs of places that an edge of the graph joins in a plan.
    pub(super) fn joined(
        &self,
        graph: &TopologicalGraph,
        from: NodeId,
        to: NodeId,
        edge: &Edge,
    ) -> Vec<(PlaceId, PlaceId)> {
        let mut pairs = Vec::new();
        if self.search == Search::Unconstrained {
            for a in self.places_of(from) {
                pairs.extend(self.places_of(to).map(|b| (a, b)));
            }
            return pairs;
        }
        let is_same_task = graph.node(from).task == graph.node(to).task;
        for &occurrence in &self.occurrences[from.index()] {
            let a = self.at(from, occurrence);
            let stage = self.place(a).stage;
            let same = stays_in_round(edge, is_same_task).then_some(occurrence);
            let next = leads_on(edge, is_same_task).then_some(occurrence + 1);
            for there in same.into_iter().chain(next) {
                if self.occurrences[to.index()].binary_search(&there).is_ok() {
                    let b = self.at(to, there);
                    if self.may_enter(graph, stage, b) {
                        pairs.push((a, b));
                    }
                }
            }
        }
        pairs
    }
}

/// Whether a plan may take an edge without beginning another task or another round of the same one.
pub(super) fn stays_in_round(edge: &Edge, is_same_task: bool) -> bool {
    is_same_task && edge.kind != EdgeKind::CrossTask
}

/// Whether a plan may begin the next task with an edge. From a task into itself only what joins its end to its
/// start does, into another round; a learned edge of a task leads back within it.
pub(super) fn leads_on(edge: &Edge, is_same_task: bool) -> bool {
    match edge.kind {
        EdgeKind::Temporal => false,
        EdgeKind::Learned => !is_same_task,
        EdgeKind::CrossTask => true,
    }
}

fn check(graph: &TopologicalGraph, automaton: &Automaton) -> Result<(), PlannerError> {
    if automaton.tasks().is_empty() {
        return Err(PlannerError::NoTask);
    }
    if graph.node_count() == 0 {
        return Err(PlannerError::NoStates);
    }
    let known = graph.tasks();
    match automaton
        .tasks()
        .iter()
        .find(|t| !known.contains(&t.as_str()))
    {
        Some(task) => Err(PlannerError::UnknownTask {
            task: task.clone(),
            known: known.join(", "),
        }),
        None => Ok(()),
    }
}

/// For each occurrence of a task, how many subgoals the tasks before it have.
pub(super) fn stage_offsets(automaton: &Automaton) -> Vec<usize> {
    let mut offset = 0;
    automaton
        .tasks()
        .iter()
        .map(|task| {
            let here = offset;
            offset += subgoal_count(automaton, task);
            here
        })
        .collect()
}

/// How many subgoals one occurrence of a task has.
pub(super) fn subgoal_count(automaton: &Automaton, task: &str) -> usize {
    let occurrences = automaton.tasks().iter().filter(|t| *t == task).count();
    let subgoals = automaton
        .subgoals()
        .iter()
        .filter(|s| s.task == task)
        .count();
    subgoals / occurrences.max(1)
}
