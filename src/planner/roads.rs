use std::collections::HashSet;

use super::{EdgeChoice, Layout, PlaceId, PlannerOptions, Price};
use crate::graph::{Edge, EdgeKind, NodeId, TopologicalGraph};

/// A way between two places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Road {
    pub(super) from: u32,
    pub(super) to: u32,
    /// What it costs now: its price and what was added because it failed.
    pub(super) cost: f64,
    pub(super) price: f64,
    pub(super) steps: u32,
    pub(super) kind: EdgeKind,
}

/// All roads, found by either end in constant time (compressed rows).
#[derive(Clone, Debug, Default)]
pub(super) struct Roads {
    /// Sorted by start, then temporal before predicted, then by end.
    sorted: Vec<Road>,
    out_starts: Vec<u32>,
    /// Indices of roads, sorted by end.
    into: Vec<u32>,
    in_starts: Vec<u32>,
}

/// Why an edge of the graph is no road.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rejection {
    /// Learned edges were not asked for.
    Kind,
    /// It is too improbable, has no support, or is one too many of its state.
    LeftOut,
    /// The cost knows no price for it.
    Price,
    /// It leads too far ahead for its steps.
    Leap,
    /// One of its states is to be avoided.
    Avoided,
}

impl Roads {
    pub(super) fn new(
        graph: &TopologicalGraph,
        layout: &Layout,
        options: &PlannerOptions,
        left_out: &HashSet<(NodeId, NodeId)>,
        avoided: &HashSet<NodeId>,
    ) -> Self {
        let mut roads = Vec::new();
        let is_closed = |from: &NodeId, to: &NodeId| {
            left_out.contains(&(*from, *to)) || avoided.contains(from) || avoided.contains(to)
        };
        let edges = graph.edges();
        for (from, to, edge) in edges.filter(|(from, to, _)| !is_closed(from, to)) {
            for (a, b) in layout.joined(graph, from, to, edge) {
                roads.extend(road(layout, options, (a, b), edge).ok());
            }
        }
        Self::from_roads(layout.places().len(), roads)
    }

    pub(super) fn from_roads(places: usize, mut roads: Vec<Road>) -> Self {
        roads.sort_by_key(|r| (r.from, r.kind, r.to));
        let mut into: Vec<u32> = (0..roads.len() as u32).collect();
        into.sort_by_key(|r| (roads[*r as usize].to, *r));
        let out_starts = row_starts(places, roads.iter().map(|r| r.from));
        let in_starts = row_starts(places, into.iter().map(|r| roads[*r as usize].to));
        Self {
            sorted: roads,
            out_starts,
            into,
            in_starts,
        }
    }

    /// The same roads the other way, and one more place from which the first of these lead into them, each
    /// at a cost.
    pub(super) fn reversed_from(&self, sources: &[(PlaceId, f64, u32)]) -> Self {
        let start = self.place_count() as u32;
        let mut roads: Vec<Road> = self.sorted.clone();
        for road in &mut roads {
            (road.from, road.to) = (road.to, road.from);
        }
        roads.extend(sources.iter().map(|(place, cost, steps)| Road {
            from: place.0,
            to: start,
            cost: *cost,
            price: *cost,
            steps: *steps,
            kind: EdgeKind::CrossTask,
        }));
        Self::from_roads(self.place_count() + 1, roads)
    }

    pub(super) fn place_count(&self) -> usize {
        self.out_starts.len() - 1
    }

    pub(super) fn outgoing(&self, place: usize) -> &[Road] {
        &self.sorted[self.out_starts[place] as usize..self.out_starts[place + 1] as usize]
    }

    pub(super) fn incoming(&self, place: usize) -> impl Iterator<Item = &Road> {
        self.into[self.in_starts[place] as usize..self.in_starts[place + 1] as usize]
            .iter()
            .map(|r| &self.sorted[*r as usize])
    }

    /// Sets what going between two places costs beyond its price; `false` when nothing changes.
    pub(super) fn set_extra(&mut self, from: u32, to: u32, extra: f64) -> bool {
        let row =
            self.out_starts[from as usize] as usize..self.out_starts[from as usize + 1] as usize;
        let mut has_changed = false;
        for road in self.sorted[row].iter_mut().filter(|r| r.to == to) {
            let cost = road.price + extra;
            has_changed |= cost.to_bits() != road.cost.to_bits();
            road.cost = cost;
        }
        has_changed
    }
}

/// The road that an edge is between two places, or why it is none.
pub(super) fn road(
    layout: &Layout,
    options: &PlannerOptions,
    (from, to): (PlaceId, PlaceId),
    edge: &Edge,
) -> Result<Road, Rejection> {
    let ahead = || layout.place(to).time_steps - layout.place(from).time_steps;
    let price = road_price(options, edge, ahead)?;
    Ok(Road {
        from: from.0,
        to: to.0,
        cost: price.cost,
        price: price.cost,
        steps: price.steps,
        kind: edge.kind,
    })
}

/// What an edge costs that leads `ahead` steps on in the time of typical demonstrations, or why it is no
/// road.
pub(super) fn road_price(
    options: &PlannerOptions,
    edge: &Edge,
    ahead: impl FnOnce() -> f32,
) -> Result<Price, Rejection> {
    if options.edges == EdgeChoice::TemporalOnly && edge.kind == EdgeKind::Learned {
        return Err(Rejection::Kind);
    }
    let price = options.cost.price_edge(edge).ok_or(Rejection::Price)?;
    if let (Some(slack), true) = (options.forward_leap_steps, edge.kind != EdgeKind::Temporal)
        && ahead() > price.steps.saturating_add(slack) as f32
    {
        return Err(Rejection::Leap);
    }
    Ok(price)
}

/// Where each row begins among sorted keys, and where the last one ends.
fn row_starts(rows: usize, keys: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut starts = vec![0; rows + 1];
    for key in keys {
        starts[key as usize + 1] += 1;
    }
    for row in 0..rows {
        starts[row + 1] += starts[row];
    }
    starts
}
