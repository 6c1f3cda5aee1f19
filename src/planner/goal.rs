use super::no_path::explain_live;
use super::{
    FinalChoice, Join, LiveDistances, Localisation, NoPath, PlaceId, Planner, Price, Search,
};
use crate::graph::NodeId;

/// What a goal state was chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoalBasis {
    /// The predicted distances from the current state.
    Distances,
    /// The plan goes on from where the filter believes the robot to be: as the options ask, or because
    /// no state that may come next seems near.
    Belief,
}

/// Where the local policy is to go now.
#[derive(Clone, Debug, PartialEq)]
pub struct GoalChoice {
    /// The goal state.
    pub node: NodeId,
    /// Steps that it is predicted to be ahead.
    pub steps: u32,
    /// The cost from the current state to the final state.
    pub cost: f64,
    /// What the choice rests on.
    pub basis: GoalBasis,
    /// Probability that the goal state is fewer than `d_max` steps away, if known.
    pub connected_probability: Option<f32>,
    /// Whether the robot seems to be at the final state: nothing is left to go to.
    pub has_arrived: bool,
    /// From the first state of the plan to the final state; the goal state is on it.
    pub route: Vec<NodeId>,
    /// For each state of the route, how many subgoals of the composition hold there.
    pub stages: Vec<usize>,
}

/// Where a route begins, and what it takes to get there.
struct Entry {
    place: PlaceId,
    price: Price,
    total: f64,
}

impl Planner {
    /// The goal state for now: the best place to join the graph, and from there along the route up to
    /// [`lookahead_steps`](super::PlannerOptions::lookahead_steps), not past a subgoal that is due.
    ///
    /// With [`Join::Believed`] the plan goes on from where the filter believes the robot to be, and a lost
    /// robot is sent to the state of its stage that is most probably near. With [`Join::Cheapest`] a
    /// search in order joins only where the stage allows it and, unless the robot is lost, not further
    /// ahead than the options allow. Where nothing is near enough, it goes on from where the
    /// filter believes the robot to be ([`GoalBasis::Belief`]).
    ///
    /// # Errors
    /// [`NoPath`] when no final state can be reached.
    ///
    /// # Panics
    /// If the distances are of another graph.
    pub fn next_goal(
        &self,
        localisation: &Localisation,
        distances: &LiveDistances,
    ) -> Result<GoalChoice, NoPath> {
        assert_eq!(
            distances.node_count(),
            self.graph.node_count(),
            "distances of another graph"
        );
        let trusts_belief = self.options.join == Join::Believed && !localisation.is_lost;
        if let Some(entry) = self.believed_entry(localisation).filter(|_| trusts_belief) {
            return Ok(self.choose(localisation, distances, &entry, GoalBasis::Belief));
        }
        if self.options.join == Join::Believed
            && let Some(entry) = self.nearest_entry(localisation, distances)
        {
            return Ok(self.choose(localisation, distances, &entry, GoalBasis::Distances));
        }
        if let Some(entry) = self.best_entry(localisation, distances) {
            return Ok(self.choose(localisation, distances, &entry, GoalBasis::Distances));
        }
        match self.believed_entry(localisation) {
            Some(entry) => Ok(self.choose(localisation, distances, &entry, GoalBasis::Belief)),
            None => Err(explain_live(self, localisation, distances)),
        }
    }

    /// The goal state for a robot at `place`, a place of a plan in order: where the route leads from
    /// there. A belief spread over several places gives several goal states, which a policy can be
    /// averaged over; see [`StageFilter::most_probable_places`](super::StageFilter::most_probable_places).
    ///
    /// `None` where no route leads on from the place.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn goal_from(
        &self,
        place: PlaceId,
        localisation: &Localisation,
        distances: &LiveDistances,
    ) -> Option<GoalChoice> {
        let entry = self.entry_at(place)?;
        Some(self.choose(localisation, distances, &entry, GoalBasis::Belief))
    }

    /// The place of the current stage that is most probably near: the way back for a lost robot.
    fn nearest_entry(
        &self,
        localisation: &Localisation,
        distances: &LiveDistances,
    ) -> Option<Entry> {
        let mut best: Option<(f32, PlaceId)> = None;
        for place in self.known_places(distances) {
            let is_of_stage = self.layout.place(place).stage == localisation.stage;
            let near = distances.connected_probability(self.layout.place(place).node);
            if let Some(near) = near.filter(|_| is_of_stage && self.costs.cost(place).is_some())
                && best.is_none_or(|(b, first)| near > b || (near == b && place < first))
            {
                best = Some((near, place));
            }
        }
        let (_, place) = best?;
        let steps = self.options.lookahead_steps;
        Some(Entry {
            place,
            price: Price {
                cost: f64::from(steps),
                steps,
            },
            total: f64::from(steps) + self.costs.cost(place)?,
        })
    }

    /// The place with the least cost from the current state to the final state through it.
    fn best_entry(&self, localisation: &Localisation, distances: &LiveDistances) -> Option<Entry> {
        let mut best: Option<Entry> = None;
        for place in self.known_places(distances) {
            let Some(beyond) = self.costs.cost(place) else {
                continue;
            };
            let Some(price) = self.live_price(localisation, distances, place) else {
                continue;
            };
            let total = price.cost + beyond;
            let is_better = |b: &Entry| total < b.total || (total == b.total && place < b.place);
            if best.as_ref().is_none_or(is_better) {
                best = Some(Entry {
                    place,
                    price,
                    total,
                });
            }
        }
        best
    }

    /// The places of the states that distances are known of.
    fn known_places(&self, distances: &LiveDistances) -> impl Iterator<Item = PlaceId> {
        distances
            .nodes()
            .iter()
            .flat_map(|node| self.layout.places_of(*node))
    }

    /// What going from the current state straight to a place costs, if that may be planned.
    pub(super) fn live_price(
        &self,
        localisation: &Localisation,
        distances: &LiveDistances,
        id: PlaceId,
    ) -> Option<Price> {
        let place = self.layout.place(id);
        if !self.layout.may_enter(&self.graph, localisation.stage, id) {
            return None;
        }
        let row = distances.to(place.node)?;
        if 1.0 - row[row.len() - 1] < self.options.min_live_probability {
            return None;
        }
        let mut price = self.options.cost.price(row)?;
        let is_bounded = self.options.search == Search::InOrder && !localisation.is_lost;
        if let (Some(slack), true) = (self.options.forward_leap_steps, is_bounded) {
            let ahead = place.time_steps - localisation.time_steps;
            if ahead > price.steps.saturating_add(slack) as f32 {
                return None;
            }
        }
        price.cost += self.extra_cost(place.node);
        Some(price)
    }

    fn believed_entry(&self, localisation: &Localisation) -> Option<Entry> {
        let here = |id: &PlaceId| {
            let place = self.layout.place(*id);
            place.occurrence == localisation.occurrence
                || self.options.search == Search::Unconstrained
        };
        let place = self.layout.places_of(localisation.node).find(here)?;
        self.entry_at(place)
    }

    /// The entry of a robot that is at a place already.
    fn entry_at(&self, place: PlaceId) -> Option<Entry> {
        Some(Entry {
            place,
            price: Price {
                cost: 0.0,
                steps: 0,
            },
            total: self.costs.cost(place)?,
        })
    }

    fn choose(
        &self,
        localisation: &Localisation,
        distances: &LiveDistances,
        entry: &Entry,
        basis: GoalBasis,
    ) -> GoalChoice {
        let places = self.places_to_goal(entry.place);
        // A route by belief begins at the robot itself, which need not go there.
        let is_there = basis == GoalBasis::Belief
            || (self.options.lookahead_steps > 0 && self.is_at(distances, entry.place));
        let (goal, steps) = self.look_ahead(localisation, distances, entry, &places, is_there);
        let node = self.layout.place(places[goal]).node;
        GoalChoice {
            node,
            steps,
            cost: entry.total,
            basis,
            connected_probability: distances.connected_probability(node),
            has_arrived: (places.len() == 1 && self.is_at(distances, entry.place))
                || self.is_at_any_end(localisation, distances),
            route: places.iter().map(|p| self.layout.place(*p).node).collect(),
            stages: places.iter().map(|p| self.layout.place(*p).stage).collect(),
        }
    }

    /// Which place of a route to go to, as an index, and its predicted steps from here.
    fn look_ahead(
        &self,
        localisation: &Localisation,
        distances: &LiveDistances,
        entry: &Entry,
        places: &[PlaceId],
        is_there: bool,
    ) -> (usize, u32) {
        let mut steps = if is_there { 0 } else { entry.price.steps };
        let mut goal = 0;
        for (i, pair) in places.windows(2).enumerate() {
            let Some(road) = self.costs.next(&self.roads, pair[0]) else {
                break;
            };
            let must_move = is_there && i == 0;
            let is_due = self.layout.search() == Search::InOrder
                && self.layout.place(pair[0]).stage > localisation.stage;
            let waits = is_due && !self.is_one_step_off(distances, pair[0]);
            let is_far = steps + road.steps > self.options.lookahead_steps;
            if !must_move && (waits || is_far || !self.seems_connected(distances, pair[1])) {
                break;
            }
            steps += road.steps;
            goal = i + 1;
        }
        (goal, steps.max(1))
    }

    /// Whether a place is not known to be out of the local policy's reach.
    fn seems_connected(&self, distances: &LiveDistances, place: PlaceId) -> bool {
        distances
            .connected_probability(self.layout.place(place).node)
            .is_none_or(|p| p >= self.options.min_live_probability)
    }

    fn is_one_step_off(&self, distances: &LiveDistances, place: PlaceId) -> bool {
        let row = distances.to(self.layout.place(place).node);
        row.is_some_and(|r| r[0] > 0.5)
    }

    /// Whether all subgoals are reached and any end will do that the robot seems to be at.
    fn is_at_any_end(&self, localisation: &Localisation, distances: &LiveDistances) -> bool {
        self.terms.end == FinalChoice::All
            && self.automaton.is_accepting(localisation.stage)
            && self.finals.iter().any(|end| self.is_at(distances, *end))
    }

    /// Whether the robot seems to be at a place: one step from it, and the place one step from the
    /// robot, which is how the traversability function says "the same" (Fu & Finn, section III-C).
    fn is_at(&self, distances: &LiveDistances, place: PlaceId) -> bool {
        let back = distances.from(self.layout.place(place).node);
        self.is_one_step_off(distances, place) && back.is_some_and(|r| r[0] > 0.5)
    }
}
