use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::PlaceId;
use super::roads::{Road, Roads};

/// What it costs to get from each place to the nearest of the goals.
///
/// Made by one search backwards from the goals (Dijkstra), and repaired when roads change their cost:
/// only places whose cost changes are visited (Ramalingam & Reps, *An incremental algorithm for a
/// generalization of the shortest-path problem*, 1996). A repaired table equals a fresh one to the bit.
#[derive(Clone, Debug)]
pub struct CostToGo {
    costs: Vec<f64>,
    is_goal: Vec<bool>,
}

/// A cost in a queue; costs are never NaN.
#[derive(Clone, Copy, PartialEq)]
struct Queued {
    cost: f64,
    place: u32,
}

impl Eq for Queued {}

impl Ord for Queued {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.cost
            .total_cmp(&other.cost)
            .then(self.place.cmp(&other.place))
    }
}

impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl CostToGo {
    pub(super) fn new(roads: &Roads, goals: &[PlaceId]) -> Self {
        let count = roads.place_count();
        let mut table = Self {
            costs: vec![f64::INFINITY; count],
            is_goal: vec![false; count],
        };
        let mut queue = BinaryHeap::new();
        for goal in goals {
            table.is_goal[goal.index()] = true;
            table.costs[goal.index()] = 0.0;
            queue.push(Reverse(Queued {
                cost: 0.0,
                place: goal.0,
            }));
        }
        while let Some(Reverse(Queued { cost, place })) = queue.pop() {
            if cost > table.costs[place as usize] {
                continue;
            }
            for road in roads.incoming(place as usize) {
                let through = road.cost + cost;
                if through < table.costs[road.from as usize] {
                    table.costs[road.from as usize] = through;
                    queue.push(Reverse(Queued {
                        cost: through,
                        place: road.from,
                    }));
                }
            }
        }
        table
    }

    /// The cost from a place, or `None` when no goal can be reached from it.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn cost(&self, place: PlaceId) -> Option<f64> {
        let cost = self.costs[place.index()];
        cost.is_finite().then_some(cost)
    }

    /// Whether a place is a goal.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn is_goal(&self, place: PlaceId) -> bool {
        self.is_goal[place.index()]
    }

    /// The first road of the cheapest way; a temporal road wins a tie, then the lower place.
    pub(super) fn next<'r>(&self, roads: &'r Roads, place: PlaceId) -> Option<&'r Road> {
        if self.is_goal(place) {
            return None;
        }
        let mut best: Option<(&Road, f64)> = None;
        for road in roads.outgoing(place.index()) {
            let cost = road.cost + self.costs[road.to as usize];
            if cost.is_finite() && best.is_none_or(|(_, b)| cost < b) {
                best = Some((road, cost));
            }
        }
        best.map(|(road, _)| road)
    }

    fn looked_ahead(&self, roads: &Roads, place: u32) -> f64 {
        if self.is_goal[place as usize] {
            return 0.0;
        }
        roads
            .outgoing(place as usize)
            .iter()
            .map(|r| r.cost + self.costs[r.to as usize])
            .fold(f64::INFINITY, f64::min)
    }

    /// Makes the table right again after the roads out of `changed` places changed their costs;
    /// returns how many places were visited.
    pub(super) fn repair(&mut self, roads: &Roads, changed: &[u32]) -> usize {
        let mut queue = BinaryHeap::new();
        for &place in changed {
            self.enqueue(roads, place, &mut queue);
        }
        let mut visited = 0;
        while let Some(Reverse(Queued { cost, place })) = queue.pop() {
            let ahead = self.looked_ahead(roads, place);
            let known = self.costs[place as usize];
            let is_settled = ahead.to_bits() == known.to_bits();
            if is_settled || cost.to_bits() != ahead.min(known).to_bits() {
                continue;
            }
            visited += 1;
            if ahead < known {
                self.costs[place as usize] = ahead;
            } else {
                self.costs[place as usize] = f64::INFINITY;
                self.enqueue(roads, place, &mut queue);
            }
            for road in roads.incoming(place as usize) {
                self.enqueue(roads, road.from, &mut queue);
            }
        }
        visited
    }

    fn enqueue(&self, roads: &Roads, place: u32, queue: &mut BinaryHeap<Reverse<Queued>>) {
        let ahead = self.looked_ahead(roads, place);
        let known = self.costs[place as usize];
        if ahead.to_bits() != known.to_bits() {
            queue.push(Reverse(Queued {
                cost: ahead.min(known),
                place,
            }));
        }
    }
}
