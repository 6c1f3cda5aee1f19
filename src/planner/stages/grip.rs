use super::super::grips::Load;
use super::Suspicion;
use super::fingers::Fingers;
use crate::model::GraspSight;

/// What is seen of the gripper counts beyond this ...
const DOUBT: f64 = 0.7;
/// ... and together must come to so much.
const CONVINCED: f64 = 0.4;

/// Probability of holding something from which an empty gripper may be on the way to no longer being it.
const HELD: f64 = 0.5;

/// Whether the gripper holds what it should in the stages in which it should.
#[derive(Clone, Debug)]
pub(super) struct Grip {
    /// For each stage, what it should hold.
    loads: Vec<Load>,
    empty: Suspicion,
    held: Suspicion,
    /// Whether it was last seen empty.
    is_empty: bool,
    /// What it was last seen to hold when it was closed, be it nothing; not known before it was.
    carried: Option<Load>,
    /// Whether it was seen open since the stage began ...
    was_open: bool,
    /// ... and then seen to hold what the next stage should hold, and what speaks for that.
    is_taken: bool,
    taken: Suspicion,
    /// What it may be seen to hold instead, and what speaks for nothing.
    other: (usize, Suspicion),
    nothing: Suspicion,
    fingers: Fingers,
}

impl Grip {
    pub(super) fn new(loads: Vec<Load>) -> Self {
        Self {
            loads,
            empty: Suspicion::new(DOUBT, CONVINCED),
            held: Suspicion::new(DOUBT, CONVINCED),
            is_empty: false,
            carried: None,
            was_open: false,
            is_taken: false,
            taken: Suspicion::new(DOUBT, CONVINCED),
            other: (0, Suspicion::new(DOUBT, CONVINCED)),
            nothing: Suspicion::new(DOUBT, CONVINCED),
            fingers: Fingers::default(),
        }
    }

    /// Whether it should hold something in a stage.
    pub(super) fn holds(&self, stage: usize) -> bool {
        self.loads[stage].is_held()
    }

    /// Whether it should hold something in a stage and was seen not to.
    pub(super) fn should_hold_and_is_empty(&self, stage: usize) -> bool {
        self.is_empty && self.holds(stage)
    }

    /// Whether it should hold something in a stage, was seen not to, and is not seen to do so now.
    pub(super) fn is_ruled_out(&self, stage: usize, sight: GraspSight) -> bool {
        self.should_hold_and_is_empty(stage) && sight.held < HELD
    }

    /// Whether what is to be held in the next stage, and not in this one, was seen to be taken.
    pub(super) const fn is_taken(&self) -> bool {
        self.is_taken
    }

    /// Remembers in a stage in which it need not hold anything that it is empty, until it is seen to hold something.
    pub(super) fn stay_empty(&mut self) {
        self.is_empty = true;
    }

    /// Whether it is to hold something in a stage or in the next.
    fn is_to_take(&self, stage: usize) -> bool {
        let mut loads = self.loads.iter().skip(stage).take(2);
        loads.any(|load| load.is_held())
    }

    /// Whether it is seen to let go, in this step, of what it should hold in a stage and not in the next.
    pub(super) fn lets_go(&self, stage: usize) -> bool {
        let next = self.loads.get(stage + 1);
        self.fingers.lets_go() && next.is_some_and(|load| !load.is_held())
    }

    /// Where a stage begins in which nothing is held: the first of the stages in which something was to be held until
    /// then, if the gripper did not shut to take it.
    pub(super) fn never_took(&self, from: usize, to: usize) -> Option<usize> {
        let is_let_go = self.fingers.is_idle() && !self.holds(to);
        let held = (from..to).find(|stage| self.holds(*stage));
        let held = held.filter(|_| is_let_go)?;
        let before = (0..held).rfind(|stage| !self.holds(*stage));
        Some(before.map_or(0, |stage| stage + 1))
    }

    /// Notes what is seen of it in a stage, and where the robot was believed to be a step ago.
    pub(super) fn note(&mut self, stage: usize, believed: usize, sight: GraspSight) {
        let is_due = self.loads[stage].may_be(sight.thing);
        let is_to_take = self.is_to_take(stage.max(believed));
        self.fingers.note(sight, is_due, is_to_take);
        let (thing, seen) = &mut self.other;
        if *thing != sight.thing {
            *thing = sight.thing;
            seen.forget();
        }
        if seen.add(sight.held) {
            self.carried = Some(Load::Thing(sight.thing));
        }
        if self.nothing.add(sight.empty) {
            self.carried = Some(Load::Nothing);
        }
        // What is still held when a stage begins, such as a handle, was not taken in it.
        self.was_open |= sight.open > DOUBT;
        let next = self.loads.get(stage + 1).copied().unwrap_or(Load::Nothing);
        if self.was_open && !self.holds(stage) && next.may_be(sight.thing) {
            self.is_taken |= self.taken.add(sight.held);
        }
        if !self.holds(stage) && !self.is_empty {
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
        self.is_empty && !self.holds(stage)
    }

    /// What a classifier gives each stage, less where the gripper should hold something and is empty or holds something
    /// else, and nothing where it should have let go of what it did not carry.
    pub(super) fn weighed(&self, mut sensed: Vec<f64>, sight: GraspSight) -> Vec<f64> {
        for (stage, value) in sensed.iter_mut().enumerate() {
            let before = stage.checked_sub(1).map(|before| self.loads[before]);
            *value *= match (before, self.loads[stage]) {
                (_, Load::Something) => 1.0 - sight.empty,
                (_, Load::Thing(thing)) if thing == sight.thing => 1.0 - sight.empty,
                (_, Load::Thing(_)) => 1.0 - sight.empty - sight.held,
                (Some(due @ Load::Thing(_)), Load::Nothing) => {
                    f64::from(self.carried.is_none_or(|carried| carried == due))
                }
                (Some(Load::Something), Load::Nothing) => {
                    f64::from(self.carried != Some(Load::Nothing))
                }
                (_, Load::Nothing) => 1.0,
            };
        }
        sensed
    }

    /// Forgets what the gripper was seen to hold, for another episode.
    pub(super) fn forget_what_was_carried(&mut self) {
        self.carried = None;
        self.other.1.forget();
        self.nothing.forget();
        self.fingers = Fingers::default();
    }

    /// Forgets what was seen, for another stage.
    pub(super) fn forget(&mut self) {
        self.empty.forget();
        self.held.forget();
        self.is_empty = false;
        self.taken.forget();
        self.was_open = false;
        self.is_taken = false;
        self.fingers.forget_hold();
    }
}
