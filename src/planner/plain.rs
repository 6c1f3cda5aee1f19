use petgraph::algo::astar;
use petgraph::graph::{DiGraph, NodeIndex};

use super::{LiveDistances, Localisation, PlaceId, Planner};

/// The search that the paper describes, for comparison: at each step the current state joins the graph,
/// and Dijkstra runs from it to a final state (Fu & Finn, section III-D).
///
/// It searches the planner's own layered graph, so that it finds the same costs as
/// [`Planner::next_goal`] with [`Join::Cheapest`](super::Join::Cheapest), which looks them up.
#[derive(Debug)]
pub struct PlainSearch<'a> {
    planner: &'a Planner,
    graph: DiGraph<(), f64, u32>,
}

impl<'a> PlainSearch<'a> {
    /// Copies the planner's layered graph into a petgraph.
    #[must_use]
    pub fn new(planner: &'a Planner) -> Self {
        let mut graph = DiGraph::default();
        for _ in planner.all_places() {
            graph.add_node(());
        }
        for place in planner.all_places() {
            for road in planner.roads.outgoing(place.index()) {
                let [from, to] = [road.from, road.to].map(|at| NodeIndex::new(at as usize));
                graph.add_edge(from, to, road.cost);
            }
        }
        Self { planner, graph }
    }

    /// The least cost from the current state to a final state; `None` when there is no way.
    ///
    /// # Panics
    /// If the distances are of another graph.
    pub fn cost(&mut self, localisation: &Localisation, distances: &LiveDistances) -> Option<f64> {
        let planner = self.planner;
        let live = self.graph.add_node(());
        for place in planner.all_places() {
            if let Some(price) = planner.live_price(localisation, distances, place) {
                let joined = NodeIndex::new(place.index());
                self.graph.add_edge(live, joined, price.cost);
            }
        }
        let is_final =
            |at: NodeIndex| at != live && planner.costs.is_goal(PlaceId(at.index() as u32));
        let found = astar(&self.graph, live, is_final, |road| *road.weight(), |_| 0.0);
        self.graph.remove_node(live);
        found.map(|(cost, _)| cost)
    }
}
