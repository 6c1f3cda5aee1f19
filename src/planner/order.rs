use std::collections::{BTreeMap, HashSet};

use super::layout::{leads_on, stays_in_round};
use super::roads::{Road, Roads, road_price};
use super::timeline::Timeline;
use super::{CostToGo, FinalChoice, PlaceId, PlannerError, PlannerOptions, Start, Terms};
use crate::graph::{Edge, EdgeKind, NodeId, TopologicalGraph, left_out};
use crate::task::{OrderAutomaton, Task};

/// The cheapest of the orders that an [`OrderAutomaton`] allows, of those that leave the fewest optional parts
/// out.
#[derive(Clone, Debug, PartialEq)]
pub struct SettledOrder {
    /// The tasks in that order.
    pub tasks: Vec<String>,
    /// How many optional parts are left out.
    pub left_out: usize,
    /// What the cheapest plan in that order costs.
    pub cost: f64,
    /// Its predicted time steps.
    pub steps: u32,
}

/// Which order of tasks is cheapest, from where the terms say that the robot starts to an end of its last
/// task: one search over the product of graph and automaton, in which each transition has its own
/// copy of its task's states. Optional parts are done wherever a way leads through them.
///
/// `tasks` are those of the automaton with their subgoals, `final_task` the one whose end is to be the end
/// of all. The plan in the settled order is [`Planner::plan_from_start`](super::Planner::plan_from_start)'s,
/// with the same options; `None` where no order connects.
///
/// # Errors
/// [`PlannerError::UnknownTask`] for a task of the automaton that the graph or `tasks` lack.
pub fn settle_order(
    graph: &TopologicalGraph,
    automaton: &OrderAutomaton,
    tasks: &[Task],
    final_task: Option<&str>,
    (terms, options): (&Terms, &PlannerOptions),
) -> Result<Option<SettledOrder>, PlannerError> {
    let product = Product::new(graph, automaton, tasks, &terms.strangers())?;
    let ways = product.ways(final_task, terms, options);
    let (roads, left_out) = product.roads_leaving_out_least(ways);
    let costs = CostToGo::new(&roads, &[product.goal()]);
    let Some(cost) = costs.cost(product.start()) else {
        return Ok(None);
    };
    let mut settled = SettledOrder {
        tasks: Vec::new(),
        left_out,
        cost,
        steps: 0,
    };
    let (mut here, mut last) = (product.start(), None);
    while let Some(road) = costs.next(&roads, here) {
        settled.steps += road.steps;
        here = PlaceId(road.to);
        let occurrence = product.occurrence_of(here);
        if occurrence.is_some() && occurrence != last {
            settled
                .tasks
                .extend(occurrence.map(|o| product.occurrences[o].task.name.clone()));
            last = occurrence;
        }
    }
    Ok((!settled.tasks.is_empty()).then_some(settled))
}

/// A transition of the automaton with a copy of its task's states.
struct Occurrence<'a> {
    task: &'a Task,
    /// The number of its first place.
    first: u32,
    /// The automaton's states before and after it.
    from: usize,
    to: usize,
}

/// A road, and how many optional parts it leaves out.
#[derive(Clone, Copy)]
struct Way {
    road: Road,
    skips: usize,
}

/// Graph and automaton together: the places of each occurrence, then one start and one goal.
struct Product<'a> {
    graph: &'a TopologicalGraph,
    automaton: &'a OrderAutomaton,
    occurrences: Vec<Occurrence<'a>>,
    timelines: BTreeMap<&'a str, Timeline>,
    /// For each node that has places, its number among those of its task.
    ranks: Vec<u32>,
    places: u32,
}

impl<'a> Product<'a> {
    fn new(
        graph: &'a TopologicalGraph,
        automaton: &'a OrderAutomaton,
        tasks: &'a [Task],
        strangers: &HashSet<NodeId>,
    ) -> Result<Self, PlannerError> {
        let mut product = Self {
            graph,
            automaton,
            occurrences: Vec::new(),
            timelines: BTreeMap::new(),
            ranks: vec![0; graph.node_count()],
            places: 0,
        };
        let known = graph.tasks();
        for transition in automaton.transitions() {
            let Some(name) = &transition.task else {
                continue;
            };
            let task = tasks.iter().find(|t| t.name == *name);
            let Some(task) = task.filter(|t| known.contains(&t.name.as_str())) else {
                return Err(PlannerError::UnknownTask {
                    task: name.clone(),
                    known: known.join(", "),
                });
            };
            let timeline = product
                .timelines
                .entry(&task.name)
                .or_insert_with(|| Timeline::without(graph, &task.name, strangers));
            for (rank, node) in timeline.time_steps.keys().enumerate() {
                product.ranks[node.index()] = rank as u32;
            }
            let count = timeline.time_steps.len() as u32;
            product.occurrences.push(Occurrence {
                task,
                first: product.places,
                from: transition.from,
                to: transition.to,
            });
            product.places += count;
        }
        Ok(product)
    }

    fn start(&self) -> PlaceId {
        PlaceId(self.places)
    }

    fn goal(&self) -> PlaceId {
        PlaceId(self.places + 1)
    }

    fn occurrence_of(&self, place: PlaceId) -> Option<usize> {
        let after = self.occurrences.partition_point(|o| o.first <= place.0);
        (place.0 < self.places).then(|| after - 1)
    }

    fn place(&self, occurrence: usize, node: NodeId) -> u32 {
        self.occurrences[occurrence].first + self.ranks[node.index()]
    }

    /// The occurrences that may come next at a state of the automaton, with how many optional parts are
    /// left out on the way; `None` stands for the end.
    fn next(&self, state: usize) -> Vec<(Option<usize>, usize)> {
        let mut next = Vec::new();
        for (state, skips) in self.automaton.skipped_to(state) {
            if state == self.automaton.last_state() {
                next.push((None, skips));
            }
            let starting = self.occurrences.iter().enumerate();
            let starting = starting.filter(|(_, o)| o.from == state);
            next.extend(starting.map(|(occurrence, _)| (Some(occurrence), skips)));
        }
        next
    }

    /// The roads of those ways on which as few optional parts are left out as is possible from where they
    /// begin, and how many that are from the start. A part is done however dear it is, so no price stands
    /// for leaving it out: what the cheapest of these roads cost is all that is left to be searched.
    fn roads_leaving_out_least(&self, ways: Vec<Way>) -> (Roads, usize) {
        let count = self.places as usize + 2;
        if ways.iter().all(|way| way.skips == 0) {
            let roads = ways.into_iter().map(|way| way.road).collect();
            return (Roads::from_roads(count, roads), 0);
        }
        let skipping = ways.iter().map(|way| Road {
            cost: way.skips as f64,
            ..way.road
        });
        let skipping = Roads::from_roads(count, skipping.collect());
        let fewest = CostToGo::new(&skipping, &[self.goal()]);
        let leaves_out_least = |way: &Way| {
            let [from, to] = [way.road.from, way.road.to].map(|place| fewest.cost(PlaceId(place)));
            from.zip(to)
                .is_some_and(|(from, to)| from == way.skips as f64 + to)
        };
        let kept = ways.into_iter().filter(leaves_out_least);
        let roads = Roads::from_roads(count, kept.map(|way| way.road).collect());
        let left_out = fewest.cost(self.start()).unwrap_or(0.0);
        (roads, left_out as usize)
    }

    /// All ways between places, from the start and to the goal.
    fn ways(&self, final_task: Option<&str>, terms: &Terms, options: &PlannerOptions) -> Vec<Way> {
        let mut ways = Vec::new();
        let left_out = left_out(self.graph, &options.predicted_edges);
        let avoided = terms.avoided();
        let strangers = terms.strangers();
        let is_closed = |from: NodeId, to: NodeId| {
            left_out.contains(&(from, to))
                || avoided.contains(&from)
                || avoided.contains(&to)
                || strangers.contains(&from)
                || strangers.contains(&to)
        };
        for (next, skips) in self.next(0) {
            if let Some(occurrence) = next {
                self.add_starts(&mut ways, (occurrence, skips), terms, options, &is_closed);
            }
        }
        let following: Vec<_> = self.occurrences.iter().map(|o| self.next(o.to)).collect();
        let edges = self.graph.edges();
        for (from, to, edge) in edges.filter(|(from, to, _)| !is_closed(*from, *to)) {
            for (here, there, skips) in self.joined(from, to, edge, &following) {
                let ahead = || self.ahead((from, here), (to, there));
                let Ok(price) = road_price(options, edge, ahead) else {
                    continue;
                };
                let road = Road {
                    from: self.place(here, from),
                    to: self.place(there, to),
                    cost: price.cost,
                    price: price.cost,
                    steps: price.steps,
                    kind: edge.kind,
                };
                ways.push(Way { road, skips });
            }
        }
        for (occurrence, next) in following.iter().enumerate() {
            let end = next.iter().find(|(next, _)| next.is_none());
            let task = self.occurrences[occurrence].task;
            let Some((_, skips)) = end.filter(|_| final_task.is_none_or(|t| t == task.name)) else {
                continue;
            };
            for node in self.timelines[task.name.as_str()].time_steps.keys() {
                let is_open = !avoided.contains(node) && !strangers.contains(node);
                if is_open && self.is_final(*node, task, &terms.end) {
                    ways.push(link(self.place(occurrence, *node), self.goal().0, *skips));
                }
            }
        }
        ways
    }

    /// The ways into an occurrence that may be the first one.
    fn add_starts(
        &self,
        ways: &mut Vec<Way>,
        (occurrence, skips): (usize, usize),
        terms: &Terms,
        options: &PlannerOptions,
        is_closed: &dyn Fn(NodeId, NodeId) -> bool,
    ) {
        let task = self.occurrences[occurrence].task;
        let states = self.timelines[task.name.as_str()]
            .time_steps
            .keys()
            .copied();
        if let Start::After(before) = &terms.start {
            let timeline = Timeline::new(self.graph, before);
            let ends = self
                .graph
                .nodes()
                .filter(|(_, n)| n.task == *before && n.is_end);
            for (end, _) in ends {
                for (to, edge) in self
                    .graph
                    .edges_from(end)
                    .filter(|(to, _)| !is_closed(end, *to))
                {
                    let entered = self.graph.node(to);
                    let due = task.subgoals.get(..entered.progress as usize);
                    let begins = entered.task == task.name
                        && leads_on(edge, entered.task == *before)
                        && due.is_some_and(|due| entered.reaches(due));
                    if !begins {
                        continue;
                    }
                    let rest = timeline.length_steps - timeline.time_steps[&end];
                    let ahead = || rest + self.timelines[task.name.as_str()].time_steps[&to];
                    if let Ok(price) = road_price(options, edge, ahead) {
                        let mut way = link(self.start().0, self.place(occurrence, to), skips);
                        way.road.cost = price.cost;
                        way.road.price = price.cost;
                        way.road.steps = price.steps;
                        ways.push(way);
                    }
                }
            }
            return;
        }
        let progress = |node: NodeId| self.graph.node(node).progress;
        let first = states.clone().map(progress).min();
        let is_start = |node: &NodeId| {
            let node = self.graph.node(*node);
            match terms.start {
                Start::Anywhere => Some(node.progress) == first,
                _ => node.step == 0,
            }
        };
        let starts = states.filter(is_start);
        ways.extend(starts.map(|node| link(self.start().0, self.place(occurrence, node), skips)));
    }

    fn is_final(&self, node: NodeId, task: &Task, choice: &FinalChoice) -> bool {
        let node = self.graph.node(node);
        let is_chosen = match choice {
            FinalChoice::Demonstration(id) => node.trajectory == *id,
            FinalChoice::Cheapest | FinalChoice::Nearest | FinalChoice::All => true,
        };
        node.is_end && node.progress as usize >= task.subgoals.len() && is_chosen
    }

    /// The occurrences between which an edge may be planned, and how many optional parts that leaves out:
    /// within a task it keeps the subgoals or reaches those that are due, and it leads into another one
    /// when all subgoals are reached.
    fn joined(
        &self,
        from: NodeId,
        to: NodeId,
        edge: &Edge,
        following: &[Vec<(Option<usize>, usize)>],
    ) -> Vec<(usize, usize, usize)> {
        let (left, entered) = (self.graph.node(from), self.graph.node(to));
        let mut joined = Vec::new();
        for (here, occurrence) in self.occurrences.iter().enumerate() {
            if occurrence.task.name != left.task {
                continue;
            }
            let reaches = |there: usize, before: usize| {
                let subgoals = &self.occurrences[there].task.subgoals;
                let held = |progress: usize| subgoals.len().min(progress);
                let due = subgoals.get(held(before)..held(entered.progress as usize));
                due.is_some_and(|due| entered.reaches(due))
            };
            let is_same_task = left.task == entered.task;
            if stays_in_round(edge, is_same_task) && reaches(here, left.progress as usize) {
                joined.push((here, here, 0));
            }
            let is_done = left.progress as usize >= occurrence.task.subgoals.len();
            if leads_on(edge, is_same_task) && is_done {
                for (there, skips) in &following[here] {
                    let fits = |t: &usize| self.occurrences[*t].task.name == entered.task;
                    if let Some(there) = there.filter(|t| fits(t) && reaches(*t, 0)) {
                        joined.push((here, there, *skips));
                    }
                }
            }
        }
        joined
    }

    /// How much later a state is than another one, in the time of typical demonstrations.
    fn ahead(&self, from: (NodeId, usize), to: (NodeId, usize)) -> f32 {
        let timeline = |occurrence: usize| {
            let task = &self.occurrences[occurrence].task.name;
            &self.timelines[task.as_str()]
        };
        let time = |(node, occurrence): (NodeId, usize)| timeline(occurrence).time_steps[&node];
        let rest = if from.1 == to.1 {
            0.0
        } else {
            timeline(from.1).length_steps
        };
        rest + time(to) - time(from)
    }
}

/// A way that takes no time: into the first task, or out of the last one.
fn link(from: u32, to: u32, skips: usize) -> Way {
    let road = Road {
        from,
        to,
        cost: 0.0,
        price: 0.0,
        steps: 0,
        kind: EdgeKind::CrossTask,
    };
    Way { road, skips }
}
