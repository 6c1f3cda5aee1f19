use std::collections::HashSet;
use std::fmt;

use super::choice::open_final_places;
use super::nearest_pair::nearest_pair;
use super::roads::{Rejection, Roads, road};
use super::source::{crossings, sources_avoiding};
use super::{CostToGo, LiveDistances, Localisation, PlaceId, Planner, Start};
use crate::graph::{EdgeKind, NodeId};
use crate::task::Subgoal;
use crate::wording;

/// The places where a way may begin if these states, and no others, are avoided.
type StartsAvoiding<'a> = &'a dyn Fn(&HashSet<NodeId>) -> Vec<PlaceId>;

/// The place where a route breaks off that would be easiest to mend.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Gap {
    /// An edge is there but may not be planned: too improbable for its cost, or too long a leap.
    Edge {
        /// The state that is left.
        from: NodeId,
        /// The state that is to be reached.
        to: NodeId,
        /// Where it comes from.
        kind: EdgeKind,
        /// Its probability of being passable in fewer than `d_max` steps, 0..=1.
        connected_probability: f32,
        /// Why it was not used.
        reason: String,
    },
    /// There is no edge; these two states have the least distant latents.
    Latents {
        /// A state that can be reached.
        from: NodeId,
        /// A state from which the final state can be reached.
        to: NodeId,
        /// Euclidean distance of their latents.
        distance: f32,
    },
}

impl Gap {
    /// The two states between which a demonstration would help most.
    #[must_use]
    pub fn ends(&self) -> (NodeId, NodeId) {
        match self {
            Self::Edge { from, to, .. } | Self::Latents { from, to, .. } => (*from, *to),
        }
    }
}

/// Why no final state can be reached, and what would help.
#[derive(Clone, Debug, PartialEq)]
pub struct NoPath {
    /// How many subgoals of the composition can be reached.
    pub reachable_stage: usize,
    /// The subgoals that cannot be reached, or whose states do not lead on.
    pub cut_off: Vec<Subgoal>,
    /// The break that would be easiest to mend, if there is anything on both sides of it.
    pub gap: Option<Gap>,
    /// Avoided regions without any one of which there would be a way; all of them where only leaving all
    /// out helps, none where that does not either.
    pub blocked_by: Vec<String>,
    /// The same as words, with the demonstrations and steps of both states.
    pub advice: String,
}

impl fmt::Display for NoPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        let names = self.cut_off.iter();
        let names = names.map(|s| format!("{}.{}", s.task, s.name));
        let cut_off = if self.cut_off.is_empty() {
            "only the end".to_owned()
        } else {
            wording::listed(names, SHOWN)
        };
        let advice = &self.advice;
        write!(f, "no route to a final state; cut off: {cut_off}. {advice}")
    }
}

impl std::error::Error for NoPath {}

/// Why no final state can be reached from where the robot is.
pub(super) fn explain_live(
    planner: &Planner,
    localisation: &Localisation,
    distances: &LiveDistances,
) -> NoPath {
    let starts: Vec<PlaceId> = planner
        .all_places()
        .filter(|id| {
            let place = planner.layout.place(*id);
            planner
                .layout
                .may_enter(&planner.graph, localisation.stage, *id)
                && distances
                    .to(place.node)
                    .is_some_and(|row| planner.options.cost.price(row).is_some())
        })
        .collect();
    let mut why = explain(planner, &starts);
    if starts.is_empty() {
        why.reachable_stage = localisation.stage;
        why.cut_off = planner.layout.subgoals()[localisation.stage..].to_vec();
        why.advice = match distances.nearest() {
            Some((node, probability)) => format!(
                "No state of stage {} seems near; the nearest of all is {} with P(connected) {probability:.3}",
                localisation.stage,
                planner.graph.node(node).place()
            ),
            None => "No distance from the current state is known".to_owned(),
        };
    }
    why
}

/// Why no final state can be reached from any of some places.
pub(super) fn explain(planner: &Planner, starts: &[PlaceId]) -> NoPath {
    explain_avoiding(planner, starts, &|_| starts.to_vec())
}

/// Why no final state can be reached from where the terms say that the robot starts.
pub(super) fn explain_start(planner: &Planner) -> NoPath {
    let starts_avoiding = |avoided: &HashSet<NodeId>| -> Vec<PlaceId> {
        let sources = sources_avoiding(planner, avoided);
        sources.iter().map(|source| source.place).collect()
    };
    let starts = starts_avoiding(&planner.avoided);
    let mut why = explain_avoiding(planner, &starts, &starts_avoiding);
    if starts.is_empty() {
        why.gap = missed_entry(planner);
        if why.blocked_by.is_empty() {
            let missed = why.gap.as_ref().map(|gap| advice(planner, Some(gap)));
            why.advice = missed.unwrap_or_else(|| no_entry(planner));
        }
    }
    why
}

/// The same as [`explain`]; `starts_avoiding` tells which places there would be if other states were avoided.
fn explain_avoiding(
    planner: &Planner,
    starts: &[PlaceId],
    starts_avoiding: StartsAvoiding<'_>,
) -> NoPath {
    let is_reached = reachable(planner, starts);
    let stage_of = |id: &PlaceId| planner.layout.place(*id).stage;
    let reached = planner.all_places().filter(|p| is_reached[p.index()]);
    let reachable_stage = reached.map(|p| stage_of(&p)).max().unwrap_or(0);
    let gap = best_edge(planner, &is_reached).or_else(|| nearest_latents(planner, &is_reached));
    let blocked_by = blocking(planner, starts_avoiding);
    let advice = match blocked_by.as_slice() {
        [] => advice(planner, gap.as_ref()),
        names => format!(
            "There would be a way but for what is to be avoided: {}",
            names.join(", ")
        ),
    };
    NoPath {
        reachable_stage,
        cut_off: planner.layout.subgoals()[reachable_stage..].to_vec(),
        advice,
        gap,
        blocked_by,
    }
}

/// What there is to say of a start from which no edge leads into the composition.
fn no_entry(planner: &Planner) -> String {
    match &planner.terms.start {
        Start::After(task) => format!(
            "No edge leads from an end of task {task} into {}, where the robot is to start. A demonstration \
             from there would bridge it",
            planner
                .automaton
                .tasks()
                .first()
                .map_or("nothing", String::as_str)
        ),
        Start::Stage(stage) => format!("The graph has no state of stage {stage}"),
        Start::Beginning | Start::Anywhere => "The first task has no state to start at".to_owned(),
    }
}

/// Where the robot starts at the end of a task, the most probable edge from there to where a way leads on that
/// may not be planned.
fn missed_entry(planner: &Planner) -> Option<Gap> {
    let Start::After(task) = &planner.terms.start else {
        return None;
    };
    let mut best: Option<(f32, Gap)> = None;
    for crossing in crossings(planner, task) {
        let ends = [crossing.from, crossing.to];
        let is_avoided = ends.iter().any(|n| planner.avoided.contains(n));
        let rejection = match crossing.price {
            Err(rejection) => rejection,
            Ok(_) if is_avoided => Rejection::Avoided,
            Ok(_) => continue,
        };
        let probability = crossing.edge.connected_probability();
        let is_better = best.as_ref().is_none_or(|(p, _)| probability > *p);
        if is_better && planner.costs.cost(crossing.place).is_some() {
            let gap = Gap::Edge {
                from: crossing.from,
                to: crossing.to,
                kind: crossing.edge.kind,
                connected_probability: probability,
                reason: reason(rejection).to_owned(),
            };
            best = Some((probability, gap));
        }
    }
    best.map(|(_, gap)| gap)
}

/// The avoided regions that close the way from some places.
fn blocking(planner: &Planner, starts_avoiding: StartsAvoiding<'_>) -> Vec<String> {
    let regions = &planner.terms.avoid;
    let is_open_without = |left_out: &dyn Fn(usize) -> bool| {
        let avoided = planner.terms.avoided_but(left_out);
        let roads = Roads::new(
            &planner.graph,
            &planner.layout,
            &planner.options,
            &planner.left_out,
            &avoided,
        );
        let costs = CostToGo::new(&roads, &finals_avoiding(planner, &avoided));
        let mut starts = starts_avoiding(&avoided).into_iter();
        starts.any(|start| costs.cost(start).is_some())
    };
    let named = regions.iter().enumerate();
    let alone: Vec<String> = named
        .filter(|(i, _)| is_open_without(&|region| region == *i))
        .map(|(_, region)| region.name.clone())
        .collect();
    if alone.is_empty() && !regions.is_empty() && is_open_without(&|_| true) {
        return regions.iter().map(|region| region.name.clone()).collect();
    }
    alone
}

/// The places at which a plan might end if these states, and no others, were avoided: those at which it may end now,
/// and those that would no longer be avoided.
fn finals_avoiding(planner: &Planner, avoided: &HashSet<NodeId>) -> Vec<PlaceId> {
    let open = open_final_places(
        &planner.graph,
        &planner.automaton,
        &planner.layout,
        &planner.terms.end,
        avoided,
    );
    let may_be_one = |end: &PlaceId| {
        planner.finals.contains(end) || planner.avoided.contains(&planner.layout.place(*end).node)
    };
    let open = open.unwrap_or_default().into_iter();
    open.filter(may_be_one).collect()
}

fn reachable(planner: &Planner, starts: &[PlaceId]) -> Vec<bool> {
    let mut is_reached = vec![false; planner.layout.places().len()];
    let mut open: Vec<PlaceId> = starts.to_vec();
    while let Some(place) = open.pop() {
        if !std::mem::replace(&mut is_reached[place.index()], true) {
            open.extend(
                planner
                    .roads
                    .outgoing(place.index())
                    .iter()
                    .map(|r| PlaceId(r.to)),
            );
        }
    }
    is_reached
}

/// The most probable edge from what can be reached to what leads to a final state.
fn best_edge(planner: &Planner, is_reached: &[bool]) -> Option<Gap> {
    let mut best: Option<(f32, Gap)> = None;
    for (from, to, edge) in planner.graph.edges() {
        let probability = edge.connected_probability();
        if best.as_ref().is_some_and(|(p, _)| *p >= probability) {
            continue;
        }
        for (a, b) in planner.layout.joined(&planner.graph, from, to, edge) {
            let is_left_out = planner.left_out.contains(&(from, to));
            let is_avoided = [from, to].iter().any(|n| planner.avoided.contains(n));
            let rejection = match road(&planner.layout, &planner.options, (a, b), edge) {
                Err(rejection) => rejection,
                Ok(_) if is_left_out => Rejection::LeftOut,
                Ok(_) if is_avoided => Rejection::Avoided,
                Ok(_) => continue,
            };
            if is_reached[a.index()] && planner.costs.cost(b).is_some() {
                let gap = Gap::Edge {
                    from,
                    to,
                    kind: edge.kind,
                    connected_probability: probability,
                    reason: reason(rejection).to_owned(),
                };
                best = Some((probability, gap));
            }
        }
    }
    best.map(|(_, gap)| gap)
}

fn reason(rejection: Rejection) -> &'static str {
    match rejection {
        Rejection::Kind => "learned edges are switched off",
        Rejection::LeftOut => "predicted_edges leaves it out",
        Rejection::Price => "disconnected is its most probable class",
        Rejection::Avoided => "it touches a region that is to be avoided",
        Rejection::Leap => "it leads further ahead than forward_leap_steps allows",
    }
}

/// The two states with the nearest latents between which a plan might go.
fn nearest_latents(planner: &Planner, is_reached: &[bool]) -> Option<Gap> {
    let stage_of = |id: PlaceId| planner.layout.place(id).stage;
    let reached = planner.all_places().filter(|id| is_reached[id.index()]);
    let reached: Vec<PlaceId> = reached.collect();
    let last_stage = reached.iter().map(|id| stage_of(*id)).max()?;
    let near = reached.into_iter().filter(|id| stage_of(*id) == last_stage);
    let far = planner.all_places().filter(|id| {
        !is_reached[id.index()]
            && planner.costs.cost(*id).is_some()
            && planner.layout.may_enter(&planner.graph, last_stage, *id)
    });
    let (near, far) = (states_of(planner, near), states_of(planner, far));
    let (from, to, distance) = nearest_pair(planner.graph.latents(), &near, &far)?;
    Some(Gap::Latents { from, to, distance })
}

/// The states of some places, each once, ascending.
fn states_of(planner: &Planner, places: impl Iterator<Item = PlaceId>) -> Vec<NodeId> {
    let mut states: Vec<NodeId> = places.map(|id| planner.layout.place(id).node).collect();
    states.sort_unstable();
    states.dedup();
    states
}

fn advice(planner: &Planner, gap: Option<&Gap>) -> String {
    let place = |id: NodeId| {
        let node = planner.graph.node(id);
        format!("{} of task {}", node.place(), node.task)
    };
    let Some(gap) = gap else {
        return "Nothing leads towards a final state: record demonstrations that reach it"
            .to_owned();
    };
    let (from, to) = gap.ends();
    let (from, to) = (place(from), place(to));
    match gap {
        Gap::Edge {
            connected_probability,
            reason,
            ..
        } => format!(
            "The nearest miss goes from {from} to {to} with P(connected) {connected_probability:.3}: \
             {reason}. A demonstration from the first to the second would bridge it"
        ),
        Gap::Latents { distance, .. } => format!(
            "No edge crosses; the most similar states are {from} and {to} (latent distance \
             {distance:.3}). A demonstration from the first to the second would bridge it"
        ),
    }
}
