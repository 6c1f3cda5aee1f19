use std::collections::HashSet;

use super::layout::leads_on;
use super::roads::{Rejection, road_price};
use super::timeline::Timeline;
use super::{PlaceId, Planner, Price, Search, Start};
use crate::graph::{Edge, NodeId};

/// A place at which a plan may begin, and what it takes to get there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Source {
    pub(super) place: PlaceId,
    /// The state before it, at the end of the task after which the robot starts.
    pub(super) before: Option<NodeId>,
    /// What the edge from there costs; 0 without.
    pub(super) cost: f64,
    /// Its predicted steps.
    pub(super) steps: u32,
    /// The probability that it is passable, 0..=1; 1 without.
    pub(super) probability: f64,
}

impl Source {
    fn at(place: PlaceId) -> Self {
        Self {
            place,
            before: None,
            cost: 0.0,
            steps: 0,
            probability: 1.0,
        }
    }
}

/// Where plans from the start may begin, by place.
pub(super) fn sources(planner: &Planner) -> Vec<Source> {
    sources_avoiding(planner, &planner.avoided)
}

/// The same where these states are to be avoided instead.
pub(super) fn sources_avoiding(planner: &Planner, avoided: &HashSet<NodeId>) -> Vec<Source> {
    let place = |id: PlaceId| planner.layout.place(id);
    let is_first = |id: PlaceId| place(id).occurrence == 0;
    let of = |keep: &dyn Fn(PlaceId) -> bool| -> Vec<Source> {
        let kept = planner.all_places().filter(|id| keep(*id));
        kept.map(Source::at).collect()
    };
    match &planner.terms.start {
        Start::Beginning => of(&|id| is_first(id) && planner.graph.node(place(id).node).step == 0),
        Start::Anywhere => {
            let first_stage = planner.layout.first_stage();
            of(&|id| is_first(id) && place(id).stage == first_stage)
        }
        Start::Stage(stage) => {
            let begins = begun_by(planner, *stage);
            let stage = planner.layout.laid_out_stage(&planner.automaton, *stage);
            let begun = of(&|id| place(id).stage == stage && begins(place(id).node));
            if begun.is_empty() {
                of(&|id| place(id).stage == stage)
            } else {
                begun
            }
        }
        Start::After(task) => entries(planner, task, avoided),
    }
}

/// Whether a stage begins at a state: the first one where demonstrations begin, a later one where the subgoal
/// before it is reached.
fn begun_by(planner: &Planner, stage: usize) -> impl Fn(NodeId) -> bool {
    let before = stage
        .checked_sub(1)
        .map(|last| &planner.layout.subgoals()[last]);
    move |node| {
        let node = planner.graph.node(node);
        before.map_or(node.step == 0, |subgoal| node.reached.contains(subgoal))
    }
}

/// An edge from an end state of a task to a place where the composition may begin. Where that is the same task, it is
/// done again: a learned edge leads back within what was done and begins nothing, as between two rounds.
pub(super) struct Crossing<'g> {
    pub(super) from: NodeId,
    pub(super) to: NodeId,
    pub(super) place: PlaceId,
    pub(super) edge: &'g Edge,
    /// What it costs, or why it may not be planned; that one of its states is to be avoided does not count.
    pub(super) price: Result<Price, Rejection>,
}

/// All such edges.
pub(super) fn crossings<'g>(planner: &'g Planner, task: &str) -> Vec<Crossing<'g>> {
    let graph = &planner.graph;
    let timeline = Timeline::new(graph, task);
    let is_flat = planner.layout.search() == Search::Unconstrained;
    let mut found = Vec::new();
    for (from, _) in graph.nodes().filter(|(_, n)| n.task == task && n.is_end) {
        for (to, edge) in graph.edges_from(from) {
            let first = |id: &PlaceId| planner.layout.place(*id).occurrence == 0;
            let Some(place) = planner.layout.places_of(to).find(first) else {
                continue;
            };
            let begins = leads_on(edge, graph.node(to).task == task)
                && planner.layout.may_enter(graph, 0, place);
            if !(is_flat || begins) {
                continue;
            }
            let rest = timeline.length_steps - timeline.time_steps[&from];
            let ahead = || rest + planner.layout.place(place).time_steps;
            let price = if planner.left_out.contains(&(from, to)) {
                Err(Rejection::LeftOut)
            } else {
                road_price(&planner.options, edge, ahead)
            };
            found.push(Crossing {
                from,
                to,
                place,
                edge,
                price,
            });
        }
    }
    found
}

/// The edges from the end states of a task into the first one of the composition.
fn entries(planner: &Planner, task: &str, avoided: &HashSet<NodeId>) -> Vec<Source> {
    let open = crossings(planner, task)
        .into_iter()
        .filter(|crossing| !avoided.contains(&crossing.from) && !avoided.contains(&crossing.to));
    let mut found: Vec<Source> = open
        .filter_map(|crossing| {
            let price = crossing.price.ok()?;
            Some(Source {
                place: crossing.place,
                before: Some(crossing.from),
                cost: price.cost,
                steps: price.steps,
                probability: f64::from(crossing.edge.connected_probability()),
            })
        })
        .collect();
    found.sort_by_key(|source| (source.place, source.before));
    found
}
