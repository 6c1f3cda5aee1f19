use super::roads::road_price;
use super::timeline::Timeline;
use super::{PlaceId, Planner, Search, Start};
use crate::graph::NodeId;

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
    let place = |id: PlaceId| planner.layout.place(id);
    let is_flat = planner.layout.search() == Search::Unconstrained;
    let is_first = |id: PlaceId| place(id).occurrence == 0;
    let of = |keep: &dyn Fn(PlaceId) -> bool| -> Vec<Source> {
        let kept = planner.all_places().filter(|id| keep(*id));
        kept.map(Source::at).collect()
    };
    match &planner.terms.start {
        Start::Beginning => of(&|id| is_first(id) && planner.graph.node(place(id).node).step == 0),
        Start::Anywhere => of(&|id| is_first(id) && place(id).stage == 0),
        Start::Stage(stage) => {
            let begins = begun_by(planner, *stage);
            let begun = of(&|id| place(id).stage == *stage && begins(place(id).node));
            if begun.is_empty() {
                of(&|id| place(id).stage == *stage)
            } else {
                begun
            }
        }
        Start::After(task) => entries(planner, task, is_flat),
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

/// The edges from the end states of a task into the first one of the composition.
fn entries(planner: &Planner, task: &str, is_flat: bool) -> Vec<Source> {
    let graph = &planner.graph;
    let timeline = Timeline::new(graph, task);
    let mut found = Vec::new();
    for (end, _) in graph.nodes().filter(|(_, n)| n.task == task && n.is_end) {
        for (to, edge) in graph.edges_from(end) {
            let is_closed = planner.avoided.contains_key(&to)
                || planner.avoided.contains_key(&end)
                || planner.left_out.contains(&(end, to));
            let first = |id: &PlaceId| planner.layout.place(*id).occurrence == 0;
            let Some(place) = planner.layout.places_of(to).find(first) else {
                continue;
            };
            if is_closed || !(is_flat || planner.layout.may_enter(graph, 0, place)) {
                continue;
            }
            let rest = timeline.length_steps - timeline.time_steps[&end];
            let ahead = || rest + planner.layout.place(place).time_steps;
            if let Ok(price) = road_price(&planner.options, edge, ahead) {
                found.push(Source {
                    place,
                    before: Some(end),
                    cost: price.cost,
                    steps: price.steps,
                    probability: f64::from(edge.connected_probability()),
                });
            }
        }
    }
    found.sort_by_key(|source| (source.place, source.before));
    found
}
