use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, OnceLock};

use super::audit::audit_after;
use super::choice::open_final_places;
use super::no_path::{explain, explain_start};
use super::outset::Outset;
use super::roads::Roads;
use super::source::{Source, sources};
use super::{
    Audit, CostToGo, FilterOptions, FinalChoice, Layout, NoPath, PlaceId, PlannerError,
    PlannerOptions, Search, StageFilter, Start, Terms,
};
use crate::graph::{NodeId, StageClassifier, TopologicalGraph, left_out};
use crate::task::Automaton;

/// A route to a final state.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The states in order, the final state last.
    pub route: Vec<NodeId>,
    /// For each of them, how many subgoals of the composition hold there.
    pub stages: Vec<usize>,
    /// For each of them, after how many predicted time steps it is reached: 0 for the first one. A predicted edge may
    /// take several.
    pub arrival_steps: Vec<u32>,
    /// The cost of all its edges.
    pub cost: f64,
    /// Predicted time steps of the whole route.
    pub steps: u32,
    /// Whether its first state only leads into the composition: the end of the task after which the robot
    /// [starts](Start::After), at which nothing is done yet even where that task is to be done, too.
    pub begins_before: bool,
}

/// Plans on a graph that stays, from wherever the robot is; see the [module](super) for how.
///
/// ```
/// use std::sync::Arc;
/// use catena::graph::{Edge, Node, NodeId, TopologicalGraph};
/// use catena::planner::{FinalChoice, Planner, PlannerOptions};
/// use catena::task::{Automaton, Subgoal, Task};
///
/// let done = Subgoal { task: "tidy".to_owned(), name: "done".to_owned() };
/// let mut graph = TopologicalGraph::new(1, 5);
/// for step in 0..3 {
///     let is_end = step == 2;
///     let node = Node {
///         task: "tidy".to_owned(),
///         trajectory: "tidy_0".to_owned(),
///         step,
///         reached: if is_end { vec![done.clone()] } else { Vec::new() },
///         progress: u32::from(is_end),
///         is_end,
///     };
///     graph.add_node(node, &[step as f32]);
/// }
/// graph.add_edge(NodeId(0), NodeId(1), Edge::temporal(5));
/// graph.add_edge(NodeId(1), NodeId(2), Edge::temporal(5));
///
/// let tidy = Task { name: "tidy".to_owned(), subgoals: vec![done] };
/// let planner = Planner::new(
///     Arc::new(graph),
///     &Automaton::in_order(&[tidy]),
///     &FinalChoice::Cheapest,
///     PlannerOptions::default(),
/// )?;
/// let plan = planner.plan_from_start()?;
/// assert_eq!(plan.route, [NodeId(0), NodeId(1), NodeId(2)]);
/// assert_eq!(plan.arrival_steps, [0, 1, 2]);
/// assert!(planner.audit(&plan).is_clean());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Planner {
    pub(super) graph: Arc<TopologicalGraph>,
    pub(super) automaton: Automaton,
    pub(super) layout: Layout,
    pub(super) options: PlannerOptions,
    /// Predicted edges that the options leave out.
    pub(super) left_out: HashSet<(NodeId, NodeId)>,
    pub(super) roads: Roads,
    pub(super) costs: CostToGo,
    pub(super) terms: Terms,
    /// States of avoided regions.
    pub(super) avoided: HashSet<NodeId>,
    pub(super) finals: Vec<PlaceId>,
    /// What going to a state, or between two states, costs extra because it failed.
    failed_nodes: BTreeMap<NodeId, f64>,
    failed_edges: BTreeMap<(NodeId, NodeId), f64>,
    /// Learnt when it is first asked for, and shared by clones.
    classifier: Arc<OnceLock<Result<Arc<StageClassifier>, PlannerError>>>,
}

impl Planner {
    /// Lays the graph out along the composition and searches the cost-to-go of every place. The terms may
    /// be as little as a [`FinalChoice`].
    ///
    /// # Errors
    /// [`PlannerError`] when the composition does not fit the graph or has no final state. That no
    /// route leads to the final state is no error here: planning says why.
    pub fn new(
        graph: Arc<TopologicalGraph>,
        automaton: &Automaton,
        terms: impl Into<Terms>,
        options: PlannerOptions,
    ) -> Result<Self, PlannerError> {
        let terms = terms.into();
        let layout = Layout::without(&graph, automaton, options.search, &terms.strangers())?;
        terms.start.check(&graph, automaton)?;
        let avoided = terms.avoided();
        let finals = open_final_places(&graph, automaton, &layout, &terms.end, &avoided)?;
        if finals.is_empty() {
            return Err(PlannerError::FinalStatesAvoided {
                task: automaton.tasks().last().cloned().unwrap_or_default(),
                regions: terms.region_names(),
            });
        }
        let left_out = left_out(&graph, &options.predicted_edges);
        let roads = Roads::new(&graph, &layout, &options, &left_out, &avoided);
        let costs = CostToGo::new(&roads, &finals);
        let mut planner = Self {
            graph,
            automaton: automaton.clone(),
            layout,
            options,
            left_out,
            roads,
            costs,
            terms,
            avoided,
            finals,
            failed_nodes: BTreeMap::new(),
            failed_edges: BTreeMap::new(),
            classifier: Arc::default(),
        };
        if planner.terms.end == FinalChoice::Nearest {
            planner.keep_nearest_final();
        }
        Ok(planner)
    }

    fn keep_nearest_final(&mut self) {
        let start = self.cheapest_source();
        if let Some(end) = start.and_then(|s| self.places_to_goal(s.place).last().copied()) {
            self.finals = vec![end];
            self.costs = CostToGo::new(&self.roads, &self.finals);
        }
    }

    /// The graph that is planned on.
    #[must_use]
    pub fn graph(&self) -> &Arc<TopologicalGraph> {
        &self.graph
    }

    /// The subgoals and their order.
    #[must_use]
    pub fn automaton(&self) -> &Automaton {
        &self.automaton
    }

    /// The graph along the composition.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// How it plans.
    #[must_use]
    pub fn options(&self) -> &PlannerOptions {
        &self.options
    }

    /// Where plans start, where they may end, and what they do not pass.
    #[must_use]
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// The cost-to-go of every place.
    #[must_use]
    pub fn costs(&self) -> &CostToGo {
        &self.costs
    }

    /// Whether a plan may go straight from one state to another, at any occurrence of their tasks.
    ///
    /// # Panics
    /// If a node is not in the graph.
    #[must_use]
    pub fn may_use(&self, from: NodeId, to: NodeId) -> bool {
        let is_end = |place: u32| self.layout.place(PlaceId(place)).node == to;
        let mut starts = self.layout.places_of(from);
        starts.any(|p| self.roads.outgoing(p.index()).iter().any(|r| is_end(r.to)))
    }

    /// The states at which plans end.
    #[must_use]
    pub fn final_states(&self) -> Vec<NodeId> {
        self.finals
            .iter()
            .map(|p| self.layout.place(*p).node)
            .collect()
    }

    /// The cheapest plan from where the [terms](Terms::start) say that the robot is: by default from the
    /// first state of a demonstration of the first task.
    ///
    /// # Errors
    /// [`NoPath`] when no final state can be reached from any such state.
    pub fn plan_from_start(&self) -> Result<Plan, NoPath> {
        if let Some(source) = self.cheapest_source() {
            return Ok(self.plan_by(&source));
        }
        Err(explain_start(self))
    }

    /// The plan that begins at a source.
    pub(super) fn plan_by(&self, source: &Source) -> Plan {
        let mut plan = self.plan_at(source.place);
        if let Some(before) = source.before {
            plan.route.insert(0, before);
            plan.stages.insert(0, 0);
            for steps in &mut plan.arrival_steps {
                *steps += source.steps;
            }
            plan.arrival_steps.insert(0, 0);
            plan.cost += source.cost;
            plan.steps += source.steps;
            plan.begins_before = true;
        }
        plan
    }

    /// The plan from a state of the graph, at the first occurrence of its task.
    ///
    /// # Errors
    /// [`NoPath`] when no final state can be reached from it.
    ///
    /// # Panics
    /// If the node is not in the graph.
    pub fn plan_from(&self, node: NodeId) -> Result<Plan, NoPath> {
        match self.layout.places_of(node).next() {
            Some(place) if self.costs.cost(place).is_some() => Ok(self.plan_at(place)),
            place => Err(explain(self, &Vec::from_iter(place))),
        }
    }

    /// Where plans from the start may begin.
    pub(super) fn sources(&self) -> Vec<Source> {
        sources(self)
    }

    pub(super) fn all_places(&self) -> impl Iterator<Item = PlaceId> + use<> {
        (0..self.layout.places().len() as u32).map(PlaceId)
    }

    pub(super) fn cheapest_source(&self) -> Option<Source> {
        let priced = self.sources().into_iter().filter_map(|source| {
            let beyond = self.costs.cost(source.place)?;
            Some((source.cost + beyond, source))
        });
        let cheapest = priced.min_by(|a, b| a.0.total_cmp(&b.0));
        cheapest.map(|(_, source)| source)
    }

    /// The cheapest way from a place, itself first.
    pub(super) fn places_to_goal(&self, start: PlaceId) -> Vec<PlaceId> {
        let mut places = vec![start];
        let mut here = start;
        while let Some(road) = self.costs.next(&self.roads, here) {
            here = PlaceId(road.to);
            places.push(here);
        }
        places
    }

    fn plan_at(&self, start: PlaceId) -> Plan {
        let places = self.places_to_goal(start);
        let roads = places
            .iter()
            .filter_map(|p| self.costs.next(&self.roads, *p));
        let mut steps = 0;
        let mut arrival_steps = vec![steps];
        for road in roads {
            steps += road.steps;
            arrival_steps.push(steps);
        }
        Plan {
            route: places.iter().map(|p| self.layout.place(*p).node).collect(),
            stages: places.iter().map(|p| self.layout.place(*p).stage).collect(),
            arrival_steps,
            cost: self.costs.cost(start).unwrap_or(f64::INFINITY),
            steps,
            begins_before: false,
        }
    }

    /// Which subgoals a plan skips, and by which edges.
    #[must_use]
    pub fn audit(&self, plan: &Plan) -> Audit {
        let (before, route) = match plan.route.split_first() {
            Some((before, route)) if plan.begins_before => (Some(*before), route),
            _ => (None, plan.route.as_slice()),
        };
        let begun = match self.terms.start {
            // Where each task is laid out once, its places do not tell the round.
            Start::Stage(stage) if self.options.search == Search::Unconstrained => Some(stage),
            _ => plan.stages.get(plan.route.len() - route.len()).copied(),
        };
        audit_after(&self.graph, &self.automaton, (before, begun), route)
    }

    /// A filter that says where in the composition the robot is, at the beginning where the
    /// [terms](Terms::start) say that it starts. Options that are out of their ranges are not refused here: with
    /// them it may be left without a belief, or panic.
    ///
    /// # Panics
    /// Never: the composition was laid out on this graph before.
    #[must_use]
    pub fn stage_filter(&self, options: FilterOptions) -> StageFilter {
        let layout = match self.options.search {
            Search::InOrder => self.layout.clone(),
            Search::Unconstrained => Layout::without(
                &self.graph,
                &self.automaton,
                Search::InOrder,
                &self.terms.strangers(),
            )
            .expect("the planner's own layout names the same tasks"),
        };
        StageFilter::beginning(layout, options, self.outset())
    }

    fn outset(&self) -> Outset {
        match &self.terms.start {
            Start::Beginning => Outset::Beginning,
            Start::Anywhere => Outset::Anywhere,
            Start::Stage(stage) => Outset::Stage(*stage),
            Start::After(_) => {
                let sources = self.sources();
                Outset::Places(sources.iter().map(|s| (s.place, s.probability)).collect())
            }
        }
    }

    /// Tells stages of the graph's tasks from a latent alone. It is learnt from the graph at the first call
    /// (about a second), and kept for this planner and its clones.
    ///
    /// # Errors
    /// [`PlannerError::Classifier`] when nothing can be learnt, as where latents are not finite.
    pub fn stage_classifier(&self) -> Result<Arc<StageClassifier>, PlannerError> {
        let fit = || {
            let fitted = StageClassifier::fit(&self.graph);
            let failed = |reason| PlannerError::Classifier { reason };
            fitted.map(Arc::new).map_err(failed)
        };
        self.classifier.get_or_init(fit).clone()
    }

    /// Makes going to a state dearer after it failed: from one state, or from anywhere (also from
    /// the robot's current state). Extras add up until they [recover](Self::recover). The cost-to-go is
    /// repaired; returns how many places that took.
    ///
    /// # Panics
    /// If a node is not in the graph, or `extra_cost` is negative or not finite.
    pub fn penalise(&mut self, from: Option<NodeId>, to: NodeId, extra_cost: f64) -> usize {
        assert!(
            extra_cost >= 0.0 && extra_cost.is_finite(),
            "an extra cost of {extra_cost}"
        );
        match from {
            Some(from) => *self.failed_edges.entry((from, to)).or_insert(0.0) += extra_cost,
            None => *self.failed_nodes.entry(to).or_insert(0.0) += extra_cost,
        }
        self.apply_extras(&[to])
    }

    /// Lets what failed become cheaper again: extras are multiplied by `keep` (0..=1), and forgotten
    /// below a tenth of a step. Returns how many places the repair took.
    pub fn recover(&mut self, keep: f64) -> usize {
        let mut touched: Vec<NodeId> = self.failed_nodes.keys().copied().collect();
        touched.extend(self.failed_edges.keys().map(|(_, to)| *to));
        let fade = |extra: &mut f64| {
            *extra *= keep.clamp(0.0, 1.0);
            *extra >= 0.1
        };
        self.failed_nodes.retain(|_, extra| fade(extra));
        self.failed_edges.retain(|_, extra| fade(extra));
        self.apply_extras(&touched)
    }

    /// What going to a state from anywhere costs extra.
    pub(super) fn extra_cost(&self, to: NodeId) -> f64 {
        self.failed_nodes.get(&to).copied().unwrap_or(0.0)
    }

    fn apply_extras(&mut self, ends: &[NodeId]) -> usize {
        let mut changed = Vec::new();
        for to in ends.iter().flat_map(|n| self.layout.places_of(*n)) {
            let starts: Vec<u32> = self.roads.incoming(to.index()).map(|r| r.from).collect();
            for from in starts {
                let nodes = (
                    self.layout.place(PlaceId(from)).node,
                    self.layout.place(to).node,
                );
                let edge = self.failed_edges.get(&nodes).copied().unwrap_or(0.0);
                let extra = edge + self.extra_cost(nodes.1);
                if self.roads.set_extra(from, to.0, extra) {
                    changed.push(from);
                }
            }
        }
        self.costs.repair(&self.roads, &changed)
    }
}

#[cfg(test)]
impl Planner {
    /// What the repaired table must equal.
    pub(super) fn searched_anew(&self) -> CostToGo {
        CostToGo::new(&self.roads, &self.finals)
    }
}
