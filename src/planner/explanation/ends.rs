use std::collections::BTreeSet;

use super::parts::{Trip, probability};
use super::{EndCandidate, TaskEnds};
use crate::planner::choice::open_final_places;
use crate::planner::layout::{stage_offsets, subgoal_count};
use crate::planner::roads::Roads;
use crate::planner::source::Source;
use crate::planner::{CostToGo, FinalChoice, PlaceId, Planner, Search};

/// Candidates that are listed for each task.
const LISTED: usize = 5;

/// What it costs to get from the start of a plan to every place.
struct Outward {
    sources: Vec<Source>,
    roads: Roads,
    costs: CostToGo,
    start: PlaceId,
}

impl Outward {
    fn new(planner: &Planner) -> Self {
        let sources = planner.sources();
        let entries: Vec<(PlaceId, f64, u32)> = sources
            .iter()
            .map(|source| (source.place, source.cost, source.steps))
            .collect();
        let roads = planner.roads.reversed_from(&entries);
        let start = PlaceId(planner.layout.places().len() as u32);
        let costs = CostToGo::new(&roads, &[start]);
        Self {
            sources,
            roads,
            costs,
            start,
        }
    }

    /// The probability that the cheapest way to a place holds.
    fn probability(&self, planner: &Planner, place: PlaceId) -> f64 {
        let node = |place: PlaceId| planner.layout.place(place).node;
        let (mut here, mut holds) = (place, 1.0);
        while let Some(road) = self.costs.next(&self.roads, here) {
            let before = PlaceId(road.to);
            holds *= if before == self.start {
                let entered = self.sources.iter().filter(|s| s.place == here);
                let cheapest = entered.min_by(|a, b| a.cost.total_cmp(&b.cost));
                cheapest.map_or(1.0, |source| source.probability)
            } else {
                probability(&planner.graph, road.kind, node(before), node(here))
            };
            here = before;
        }
        holds
    }
}

/// The probability that the cheapest way from a place to the final state holds.
fn onward_probability(planner: &Planner, place: PlaceId) -> f64 {
    let places = planner.places_to_goal(place);
    let node = |place: PlaceId| planner.layout.place(place).node;
    let roads = places.windows(2).filter_map(|pair| {
        let road = planner.costs.next(&planner.roads, pair[0])?;
        Some(probability(
            &planner.graph,
            road.kind,
            node(pair[0]),
            node(pair[1]),
        ))
    });
    roads.product()
}

/// How the end of each task was chosen.
pub(super) fn ends(planner: &Planner, trip: &Trip) -> Vec<TaskEnds> {
    let outward = Outward::new(planner);
    let tasks = planner.automaton().tasks();
    let first = trip
        .places
        .first()
        .map(|p| planner.layout.place(*p).occurrence);
    let entered = match planner.layout.search() {
        Search::InOrder => first.unwrap_or(0),
        // Where a plan of the paper leaves a task says nothing of the task's end.
        Search::Unconstrained => tasks.len() - 1,
    };
    (entered..tasks.len())
        .map(|occurrence| {
            let is_last = occurrence + 1 == tasks.len();
            let (placed, due) = placed(planner, occurrence);
            let work = Work {
                planner,
                trip,
                outward: &outward,
                occurrence,
                placed,
                due,
                is_last,
            };
            if is_last { work.last() } else { work.middle() }
        })
        .collect()
}

/// As which occurrence the layout has a task, and the stage at which it is done there: where subgoals have no
/// order, it has each task once, at the stages of the first time that it is done.
fn placed(planner: &Planner, occurrence: usize) -> (usize, usize) {
    let automaton = planner.automaton();
    let tasks = automaton.tasks();
    let task = &tasks[occurrence];
    let (first, placed) = match planner.layout.search() {
        Search::InOrder => (occurrence, occurrence),
        Search::Unconstrained => {
            let first = tasks.iter().position(|t| t == task).unwrap_or(occurrence);
            let before: BTreeSet<&String> = tasks[..first].iter().collect();
            (first, before.len())
        }
    };
    let due = stage_offsets(automaton)[first] + subgoal_count(automaton, task);
    (placed, due)
}

/// What is asked about one task.
struct Work<'a> {
    planner: &'a Planner,
    trip: &'a Trip,
    outward: &'a Outward,
    occurrence: usize,
    /// Which occurrence that is in the layout.
    placed: usize,
    /// The stage at which it is done.
    due: usize,
    /// Whether its end is the end of all.
    is_last: bool,
}

impl Work<'_> {
    /// The places at which the task is done.
    fn done(&self) -> Vec<PlaceId> {
        let is_done = |id: &PlaceId| {
            let place = self.planner.layout.place(*id);
            place.occurrence == self.placed && place.stage >= self.due
        };
        self.planner.all_places().filter(is_done).collect()
    }

    fn is_end(&self, id: PlaceId) -> bool {
        self.planner
            .graph
            .node(self.planner.layout.place(id).node)
            .is_end
    }

    /// Whether an edge leads from a place into the next task.
    fn leads_on(&self, id: PlaceId) -> bool {
        let roads = self.planner.roads.outgoing(id.index()).iter();
        let next = |to: u32| self.planner.layout.place(PlaceId(to)).occurrence > self.occurrence;
        roads.into_iter().any(|road| next(road.to))
    }

    fn candidate(&self, id: PlaceId, is_chosen: bool) -> Option<EndCandidate> {
        let planner = self.planner;
        let there = self.outward.probability(planner, id);
        let (onward, beyond) = if self.is_last {
            (Some(0.0), 1.0)
        } else {
            let onward = planner.costs.cost(id);
            (
                onward,
                onward.map_or(1.0, |_| onward_probability(planner, id)),
            )
        };
        Some(EndCandidate {
            state: planner.graph.node(planner.layout.place(id).node).place(),
            cost_to: self.outward.costs.cost(id)?,
            cost_onward: onward,
            route_probability: there * beyond,
            is_chosen,
        })
    }

    /// The cheapest of some places to get to and on from, and the chosen one.
    fn best(&self, places: &[PlaceId], chosen: Option<PlaceId>) -> Vec<EndCandidate> {
        let costs = &self.outward.costs;
        let total = |id: PlaceId| {
            let onward = if self.is_last {
                0.0
            } else {
                self.planner.costs.cost(id)?
            };
            Some(costs.cost(id)? + onward)
        };
        let mut priced: Vec<(f64, PlaceId)> = places
            .iter()
            .filter_map(|id| Some((total(*id)?, *id)))
            .collect();
        let rank = |id: PlaceId| Some(id) != chosen;
        priced.sort_by(|a, b| {
            a.0.total_cmp(&b.0)
                .then(rank(a.1).cmp(&rank(b.1)))
                .then(a.1.cmp(&b.1))
        });
        let mut seen: Vec<&str> = Vec::new();
        priced.retain(|(_, id)| {
            let node = self.planner.layout.place(*id).node;
            let trajectory = self.planner.graph.node(node).trajectory.as_str();
            let is_new = !seen.contains(&trajectory);
            seen.push(trajectory);
            is_new || Some(*id) == chosen
        });
        let at = priced.iter().position(|(_, id)| Some(*id) == chosen);
        if let Some(at) = at.filter(|at| *at >= LISTED) {
            priced.swap(at, LISTED - 1);
        }
        priced.truncate(LISTED);
        let candidate = |(_, id): (f64, PlaceId)| self.candidate(id, Some(id) == chosen);
        priced.into_iter().filter_map(candidate).collect()
    }

    /// The end state that is cheapest to get to.
    fn nearest(&self, ends: &[PlaceId], chosen: Option<PlaceId>) -> Option<EndCandidate> {
        let priced = ends
            .iter()
            .filter_map(|id| Some((self.outward.costs.cost(*id)?, *id)));
        let (_, nearest) = priced.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        self.candidate(nearest, Some(nearest) == chosen)
    }

    fn middle(&self) -> TaskEnds {
        let done = self.done();
        let leaving: Vec<PlaceId> = done
            .iter()
            .copied()
            .filter(|id| self.leads_on(*id))
            .collect();
        let ends: Vec<PlaceId> = done.iter().copied().filter(|id| self.is_end(*id)).collect();
        let of_task = |id: &&PlaceId| self.planner.layout.place(**id).occurrence == self.occurrence;
        let chosen = self.trip.places.iter().rev().find(of_task).copied();
        TaskEnds {
            task: self.planner.automaton().tasks()[self.occurrence].clone(),
            occurrence: self.occurrence,
            is_last: self.is_last,
            end_states: ends.len(),
            leading_on: ends.iter().filter(|id| self.leads_on(**id)).count(),
            candidates: self.best(&leaving, chosen),
            nearest: self.nearest(&ends, chosen),
            reason: format!(
                "the way up to it and onward from it is cheapest of all {} states at which the task is done \
                 and an edge leads on",
                leaving.len()
            ),
        }
    }

    fn last(&self) -> TaskEnds {
        let planner = self.planner;
        let ends: Vec<PlaceId> = self
            .done()
            .into_iter()
            .filter(|id| self.is_end(*id))
            .collect();
        let open = open_final_places(
            &planner.graph,
            planner.automaton(),
            &planner.layout,
            &FinalChoice::Cheapest,
            &planner.avoided,
        );
        let open = open.unwrap_or_default();
        let chosen = self.trip.places.last().copied();
        let cost = chosen
            .and_then(|c| self.outward.costs.cost(c))
            .unwrap_or(0.0);
        let reason = match &planner.terms.end {
            FinalChoice::Cheapest => {
                "cheapest from the start; another may become cheapest on the way"
            }
            FinalChoice::Nearest => "cheapest from the start, and kept for the whole run",
            FinalChoice::All => "cheapest from the start, but the robot may end at any of them",
            FinalChoice::Demonstration(_) => "the composition names its demonstration",
        };
        TaskEnds {
            task: planner.automaton().tasks()[self.occurrence].clone(),
            occurrence: self.occurrence,
            is_last: self.is_last,
            end_states: ends.len(),
            leading_on: planner
                .finals
                .iter()
                .filter(|id| self.outward.costs.cost(**id).is_some())
                .count(),
            candidates: self.best(&open, chosen),
            nearest: self.nearest(&ends, chosen).filter(|n| n.cost_to < cost),
            reason: reason.to_owned(),
        }
    }
}
