use super::{PlanOdds, PlanPart};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::planner::source::Source;
use crate::planner::{AuditedEdge, PlaceId, Plan, Planner, Search};

/// A plan as places and the roads between them.
pub(super) struct Trip {
    pub(super) source: Option<Source>,
    pub(super) places: Vec<PlaceId>,
    hops: Vec<Hop>,
}

/// An edge of a plan.
struct Hop {
    from: NodeId,
    to: NodeId,
    /// The stage that is entered.
    stage: usize,
    cost: f64,
    kind: EdgeKind,
}

impl Trip {
    pub(super) fn new(planner: &Planner, plan: &Plan) -> Self {
        let source = planner.cheapest_source();
        let places = source.map_or_else(Vec::new, |s| planner.places_to_goal(s.place));
        let node = |place: PlaceId| planner.layout.place(place).node;
        let mut hops = Vec::with_capacity(plan.route.len());
        if let Some((source, before)) = source.and_then(|s| Some((s, s.before?))) {
            hops.push(Hop {
                from: before,
                to: node(source.place),
                stage: planner.layout.place(source.place).stage,
                cost: source.cost,
                kind: EdgeKind::CrossTask,
            });
        }
        for place in &places {
            if let Some(road) = planner.costs.next(&planner.roads, *place) {
                hops.push(Hop {
                    from: node(*place),
                    to: node(PlaceId(road.to)),
                    stage: planner.layout.place(PlaceId(road.to)).stage,
                    cost: road.cost,
                    kind: road.kind,
                });
            }
        }
        Self {
            source,
            places,
            hops,
        }
    }

    pub(super) fn odds(&self, planner: &Planner) -> PlanOdds {
        let predicted = self.hops.iter().filter(|h| h.kind != EdgeKind::Temporal);
        PlanOdds {
            probability: self
                .hops
                .iter()
                .map(|h| h.probability(&planner.graph))
                .product(),
            predicted_edges: predicted
                .map(|h| AuditedEdge::of(&planner.graph, h.from, h.to))
                .collect(),
            assumption:
                "predictions err independently of each other, temporal edges hold, and the \
                         probabilities are as the network and its calibration say"
                    .to_owned(),
        }
    }
}

impl Hop {
    fn probability(&self, graph: &TopologicalGraph) -> f64 {
        probability(graph, self.kind, self.from, self.to)
    }
}

/// Probability that an edge of a plan holds; 1 where it was demonstrated.
pub(super) fn probability(
    graph: &TopologicalGraph,
    kind: EdgeKind,
    from: NodeId,
    to: NodeId,
) -> f64 {
    if kind == EdgeKind::Temporal {
        return 1.0;
    }
    let edge = graph.edge(from, to);
    edge.map_or(1.0, |e| f64::from(e.connected_probability()))
}

/// The plan subgoal by subgoal.
pub(super) fn parts(planner: &Planner, plan: &Plan, trip: &Trip) -> Vec<PlanPart> {
    let state = |node: NodeId| planner.graph.node(node).place();
    let Some(first) = trip.places.first().map(|p| *planner.layout.place(*p)) else {
        return Vec::new();
    };
    let subgoals = planner.automaton().subgoals();
    let mut hops = trip.hops.iter().peekable();
    let mut here = hops.peek().map_or(first.node, |hop| hop.from);
    let mut at = first.stage;
    if trip.source.is_some_and(|s| s.before.is_some()) {
        at = 0;
    }
    if planner.layout.search() == Search::Unconstrained {
        // It may reach subgoals in any order or not at all, so that it has no parts.
        at = subgoals.len();
    }
    let mut parts = Vec::new();
    // How many hops are behind.
    let mut passed = 0;
    let begun = at;
    for due in begun..=subgoals.len() {
        let subgoal = subgoals.get(due);
        let mut part = PlanPart {
            task: subgoal
                .or(subgoals.last())
                .map_or(String::new(), |s| s.task.clone()),
            subgoal: subgoal.map(|s| s.name.clone()),
            from: state(here),
            to: String::new(),
            steps: 0,
            cost: 0.0,
            probability: 1.0,
            predicted_edges: 0,
        };
        let left_at = plan.arrival_steps[passed];
        // A subgoal is reached by the edge into its stage; several may be reached by one.
        while at <= due
            && let Some(hop) = hops.next()
        {
            passed += 1;
            part.cost += hop.cost;
            part.probability *= hop.probability(&planner.graph);
            part.predicted_edges += usize::from(hop.kind != EdgeKind::Temporal);
            (here, at) = (hop.to, hop.stage.max(at));
        }
        part.to = state(here);
        part.steps = plan.arrival_steps[passed] - left_at;
        parts.push(part);
    }
    // Where the last subgoal is the final state, nothing leads on from it.
    if parts
        .last()
        .is_some_and(|p| p.from == p.to && parts.len() > 1)
    {
        parts.pop();
    }
    parts
}
