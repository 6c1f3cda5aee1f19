use super::Suspicion;
use crate::model::GraspSight;

/// What is seen of the gripper counts beyond this ...
const DOUBT: f64 = 0.7;
/// ... and together must come to so much.
const CONVINCED: f64 = 0.4;

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

    /// Notes what is seen of it in a stage.
    pub(super) fn note(&mut self, stage: usize, sight: GraspSight) {
        if !self.holds[stage] {
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
