use super::{FilterOptions, Layout, PlaceId};
use crate::graph::NodeId;
use crate::model::GraspSight;

/// Least likelihood of what is seen of the gripper, so that one wrong look rules nothing out.
const FLOOR: f64 = 0.05;

/// What the gripper does at each place of a composition.
#[derive(Clone, Debug)]
pub(super) struct Grips(Vec<Grip>);

/// What the gripper holds in a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Load {
    Nothing,
    /// It is not known what.
    Something,
    /// The thing of that number.
    Thing(usize),
}

impl Load {
    /// Whether it holds anything.
    pub(super) fn is_held(self) -> bool {
        self != Self::Nothing
    }

    /// Whether a thing of that number may be what it holds.
    pub(super) fn may_be(self, thing: usize) -> bool {
        match self {
            Self::Nothing => false,
            Self::Something => true,
            Self::Thing(own) => own == thing,
        }
    }
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
    /// Learns from the states of demonstrations at which it is closed, and of the thing that each is about where that
    /// is known; says, too, what it holds in each stage: something in those in which it is closed at most states.
    pub(super) fn new(
        layout: &Layout,
        is_closed: impl Fn(NodeId) -> bool,
        thing_of: impl Fn(NodeId) -> Option<usize>,
    ) -> (Self, Vec<Load>) {
        let places = layout.places();
        let closed: Vec<bool> = places.iter().map(|place| is_closed(place.node)).collect();
        let mut votes = vec![0_i64; layout.stage_count()];
        let mut things = vec![None; layout.stage_count()];
        for (id, (place, is_closed)) in (0..).map(PlaceId).zip(places.iter().zip(&closed)) {
            if !layout.is_at_start(id) {
                votes[place.stage] += if *is_closed { 1 } else { -1 };
                things[place.stage] = things[place.stage].or_else(|| thing_of(place.node));
            }
        }
        let loads = votes.iter().zip(things).map(|(votes, thing)| match thing {
            _ if *votes <= 0 => Load::Nothing,
            None => Load::Something,
            Some(thing) => Load::Thing(thing),
        });
        let loads: Vec<Load> = loads.collect();
        let grips = places.iter().zip(closed).map(|(place, is_closed)| {
            if !is_closed {
                Grip::Open
            } else if loads[place.stage].is_held() {
                Grip::Held
            } else {
                Grip::Closed
            }
        });
        (Self(grips.collect()), loads)
    }

    /// How well what is seen of the gripper fits with the robot being at each place.
    pub(super) fn likelihoods(
        &self,
        options: &FilterOptions,
        sight: GraspSight,
    ) -> impl Fn(PlaceId) -> f64 {
        let of = |seen: f64| (FLOOR + seen).powf(options.grasp_weight);
        let (open, closed, held) = (of(sight.open), of(sight.empty + sight.held), of(sight.held));
        move |place| match self.0[place.index()] {
            Grip::Open => open,
            Grip::Closed => closed,
            Grip::Held => held,
        }
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
        let is_closed = |node| node == first || of_stage.contains(&node);
        let loads = |thing| Grips::new(&layout, is_closed, |_| thing).1;
        assert_eq!(loads(None)[..2], [Load::Nothing, Load::Something]);
        assert_eq!(loads(Some(4))[..2], [Load::Nothing, Load::Thing(4)]);
        let (grips, _) = Grips::new(&layout, is_closed, |_| None);
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
                thing: 0,
            };
            let likelihood = grips.likelihoods(&options, sight);
            [open, closed, held].map(|at| likelihood(at) > 0.9)
        });
        let wanted = [
            [true, false, false],
            [false, true, false],
            [false, true, true],
        ];
        assert_eq!(fits, wanted);
    }
}
