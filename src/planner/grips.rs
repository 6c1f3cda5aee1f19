use super::{FilterOptions, Layout, PlaceId};
use crate::graph::NodeId;
use crate::model::GraspSight;

/// Least likelihood of what is seen of the gripper, so that one wrong look rules nothing out.
const FLOOR: f64 = 0.05;

/// What the gripper does at the places of a composition.
#[derive(Clone, Debug)]
pub(super) struct Grips {
    of_places: Vec<Grip>,
    stages_that_hold: Vec<bool>,
}

#[derive(Clone, Copy, Debug)]
enum Grip {
    Open,
    /// It is closed, on whatever.
    Closed,
    /// It is closed on what is carried.
    Held,
}

impl Grips {
    /// Learns from the states of demonstrations at which it is closed.
    pub(super) fn new(layout: &Layout, is_closed: impl Fn(NodeId) -> bool) -> Self {
        let mut votes = vec![0_i64; layout.stage_count()];
        for (id, place) in (0..).map(PlaceId).zip(layout.places()) {
            if !layout.is_at_start(id) {
                votes[place.stage] += if is_closed(place.node) { 1 } else { -1 };
            }
        }
        let stages_that_hold: Vec<bool> = votes.iter().map(|votes| *votes > 0).collect();
        let places = layout.places().iter();
        let of_places = places.map(|place| match is_closed(place.node) {
            false => Grip::Open,
            true if stages_that_hold[place.stage] => Grip::Held,
            true => Grip::Closed,
        });
        Self {
            of_places: of_places.collect(),
            stages_that_hold,
        }
    }

    /// For each stage, whether the gripper holds something there.
    pub(super) fn stages_that_hold(&self) -> &[bool] {
        &self.stages_that_hold
    }

    /// How well what is seen of the gripper fits with the robot being at a place.
    pub(super) fn likelihood(
        &self,
        place: PlaceId,
        options: &FilterOptions,
        sight: GraspSight,
    ) -> f64 {
        let seen = match self.of_places[place.index()] {
            Grip::Open => sight.open,
            Grip::Closed => sight.empty + sight.held,
            Grip::Held => sight.held,
        };
        (FLOOR + seen).powf(options.grasp_weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::tests::layout_of_corridor;

    #[test]
    fn a_place_fits_with_what_the_gripper_does_there_in_demonstrations() {
        let layout = layout_of_corridor();
        // Closed from the first subgoal on, and once before it.
        let places = || (0..).map(PlaceId).zip(layout.places());
        let first = layout.place(PlaceId(0)).node;
        let of_stage: Vec<NodeId> = (layout.places().iter())
            .filter(|p| p.stage == 1)
            .map(|p| p.node)
            .collect();
        let grips = Grips::new(&layout, |node| node == first || of_stage.contains(&node));
        assert!(grips.stages_that_hold()[1] && !grips.stages_that_hold()[0]);
        let place = |stage: usize, closed: bool| {
            let mut of_stage = places().filter(|(_, p)| p.stage == stage);
            of_stage
                .find(|(_, p)| (p.node == first) == closed || stage == 1)
                .map(|(id, _)| id)
                .expect("the stage has such a place")
        };
        let (open, closed, held) = (place(0, false), place(0, true), place(1, true));
        let options = FilterOptions::default();
        let sights = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let fits = sights.map(|[open_, empty, held_]| {
            let sight = GraspSight {
                open: open_,
                empty,
                held: held_,
            };
            [open, closed, held].map(|at| grips.likelihood(at, &options, sight) > 0.9)
        });
        let wanted = [
            [true, false, false],
            [false, true, false],
            [false, true, true],
        ];
        assert_eq!(fits, wanted);
    }
}
