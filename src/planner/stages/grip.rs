use super::Suspicion;
use crate::model::GraspSight;

/// What is seen of the gripper counts beyond this ...
const DOUBT: f64 = 0.7;
/// ... and together must come to so much.
const CONVINCED: f64 = 0.4;

/// Probability of holding something from which an empty gripper may be on the way to no longer being it.
const HELD: f64 = 0.5;

/// Whether the gripper holds something in the stages in which it should.
#[derive(Clone, Debug)]
pub(super) struct Grip {
    /// For each stage, whether it should.
    holds: Vec<bool>,
    empty: Suspicion,
    held: Suspicion,
    /// Whether it was last seen empty.
    is_empty: bool,
}

impl Grip {
    pub(super) const fn new(holds: Vec<bool>) -> Self {
        Self {
            holds,
            empty: Suspicion::new(DOUBT, CONVINCED),
            held: Suspicion::new(DOUBT, CONVINCED),
            is_empty: false,
        }
    }

    /// Whether it should hold something in a stage.
    pub(super) fn holds(&self, stage: usize) -> bool {
        self.holds[stage]
    }

    /// Whether it should hold something in a stage and was seen not to.
    pub(super) fn should_hold_and_is_empty(&self, stage: usize) -> bool {
        self.is_empty && self.holds[stage]
    }

    /// Whether it should hold something in a stage, was seen not to, and is not seen to do so now.
    pub(super) fn is_ruled_out(&self, stage: usize, sight: GraspSight) -> bool {
        self.should_hold_and_is_empty(stage) && sight.held < HELD
    }

    /// Remembers in a stage in which it need not hold anything that it is empty, until it is seen to hold something.
    pub(super) fn stay_empty(&mut self) {
        self.is_empty = true;
    }

    /// Notes what is seen of it in a stage.
    pub(super) fn note(&mut self, stage: usize, sight: GraspSight) {
        if !self.holds[stage] && !self.is_empty {
            return;
        }
        if self.empty.add(sight.empty) {
            self.is_empty = true;
        }
        if self.held.add(sight.held) {
            self.is_empty = false;
        }
    }

    /// Whether it was empty when it was to let go of something, upon which a stage begins.
    pub(super) fn lets_go_of_nothing(&self, stage: usize) -> bool {
        self.is_empty && !self.holds[stage]
    }

    /// What a classifier gives each stage, less where it should hold something and is empty.
    pub(super) fn weighed(&self, mut sensed: Vec<f64>, sight: GraspSight) -> Vec<f64> {
        let stages = sensed.iter_mut().zip(&self.holds);
        for (value, _) in stages.filter(|(_, holds)| **holds) {
            *value *= 1.0 - sight.empty;
        }
        sensed
    }

    /// Forgets what was seen, for another stage.
    pub(super) fn forget(&mut self) {
        self.empty.forget();
        self.held.forget();
        self.is_empty = false;
    }
}
