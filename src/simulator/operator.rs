//! A person at a keyboard who knows where everything is, and demonstrates the tasks.
//!
//! Watches the truth before every key press, so what goes wrong is put right; takes one of several
//! routes, overshoots, hesitates, presses the wrong key and misses a grasp now and then.

mod chances;
mod demonstration;
mod grasp;
mod plan;
mod stage;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::primitive::Primitive;
use super::truth::Insight;
use super::variation::BedroomTask;
use super::world::Graspable;
use grasp::{Grasp, Misjudgement};
use stage::Stage;

pub use chances::HabitsError;
pub use demonstration::{Demonstration, LONGEST_STEPS, demonstrate, demonstrate_on};

/// How often the operator is less than perfect. Chances are within 0..=1; [`check`](Self::check) tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Habits {
    /// Chance that a part of the plan has a turn that goes one primitive too far.
    pub overshoot: f64,
    /// Chance that a turn is preceded by one to the wrong side.
    pub hesitation: f64,
    /// Chance that a loose thing is first grasped in the wrong place, too early or beside it.
    pub missed_grasp: f64,
    /// The same for what is taken from above, where the hand hides it.
    pub missed_from_above: f64,
    /// Chance of each retreat with the empty gripper before the miss is noticed.
    pub late_notice: f64,
    /// Chance that the wrong key of the same part of the robot is pressed. Whatever comes of it is put
    /// right, which shows how to come back from a little off the way.
    pub slip: f64,
    /// Chance that a slip is pressed once more before it is noticed.
    pub slip_again: f64,
    /// What the operator practises instead of demonstrating the task as well as possible.
    pub practice: Option<Practice>,
}

/// What an operator may practise with the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Practice {
    /// Only goes through the motions: whatever lies loose is missed, and the empty gripper is carried on as if it held
    /// it.
    Dry,
    /// Takes whatever lies loose beside where it is best taken, so that it is held oddly, if it is.
    Askew,
}

impl Default for Habits {
    /// A practised person.
    fn default() -> Self {
        Self {
            overshoot: 0.08,
            hesitation: 0.015,
            missed_grasp: 0.15,
            missed_from_above: 0.7,
            late_notice: 0.3,
            slip: 0.06,
            slip_again: 0.35,
            practice: None,
        }
    }
}

/// Chooses one primitive after another until the task is done.
pub struct Operator {
    stages: Vec<Stage>,
    current: usize,
    habits: Habits,
    rng: ChaCha8Rng,
    overshoot_due: bool,
    turned: Option<Primitive>,
    misjudged: Option<Misjudgement>,
    is_misled: bool,
    late_retreats: u32,
    retreats_due: u32,
    last: Option<(Primitive, Insight)>,
    blocked_steps: u32,
    escapes_left: u32,
    escape_steps_due: u32,
    slip_due: Option<Primitive>,
    /// What a dry run takes an empty gripper to hold.
    pretends: Option<Graspable>,
}

/// Keys that lie side by side: the base's, and the arm's.
const BASE_KEYS: [Primitive; 4] = [
    Primitive::BaseForward,
    Primitive::BaseBackward,
    Primitive::BaseTurnLeft,
    Primitive::BaseTurnRight,
];
const ARM_KEYS: [Primitive; 6] = [
    Primitive::EndEffectorLeft,
    Primitive::EndEffectorRight,
    Primitive::EndEffectorForward,
    Primitive::EndEffectorBackward,
    Primitive::EndEffectorUp,
    Primitive::EndEffectorDown,
];

impl Operator {
    /// An operator for one task from the state that `insight` shows, whichever that is.
    ///
    /// # Panics
    /// If a habit is no chance: [`Habits::check`] tells before.
    #[must_use]
    pub fn new(task: BedroomTask, insight: &Insight, habits: Habits, seed: u64) -> Self {
        if let Err(fault) = habits.check() {
            panic!("{fault}");
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let stages = plan::stages(task, insight, &mut rng);
        let mut operator = Self {
            stages,
            current: 0,
            habits,
            rng,
            overshoot_due: false,
            turned: None,
            misjudged: None,
            is_misled: false,
            late_retreats: 0,
            retreats_due: 0,
            last: None,
            blocked_steps: 0,
            escapes_left: 3,
            escape_steps_due: 0,
            slip_due: None,
            pretends: None,
        };
        operator.enter_stage();
        operator
    }

    /// The next primitive; [`Primitive::Terminate`] once nothing is left to do.
    pub fn next(&mut self, insight: &Insight) -> Primitive {
        let insight = &self.pretended(insight);
        self.notice_obstacles(insight);
        let primitive = loop {
            if self.escape_steps_due > 0 {
                self.escape_steps_due -= 1;
                break Primitive::BaseBackward;
            }
            let Some(stage) = self.stages.get(self.current).copied() else {
                break Primitive::Terminate;
            };
            if let Some(primitive) = self.within(stage, insight) {
                break primitive;
            }
            self.finish_stage();
        };
        let primitive = self.slipped(primitive);
        self.last = Some((primitive, *insight));
        primitive
    }

    /// What is the case, but for an empty gripper that a dry run takes to hold something.
    fn pretended(&self, insight: &Insight) -> Insight {
        match self.pretends {
            Some(thing) if insight.gripper_shut && insight.held.is_none() => insight.holding(thing),
            _ => *insight,
        }
    }

    /// The key that is pressed instead of the wanted one.
    fn slipped(&mut self, wanted: Primitive) -> Primitive {
        if let Some(again) = self.slip_due.take() {
            return again;
        }
        let keys: &[Primitive] = match wanted {
            _ if BASE_KEYS.contains(&wanted) => &BASE_KEYS,
            _ if ARM_KEYS.contains(&wanted) => &ARM_KEYS,
            _ => return wanted,
        };
        if !self.rng.random_bool(self.habits.slip) {
            return wanted;
        }
        let pressed = keys[self.rng.random_range(0..keys.len())];
        self.slip_due = self
            .rng
            .random_bool(self.habits.slip_again)
            .then_some(pressed);
        pressed
    }

    /// What does not move the robot twice in a row will not do so the third time: a grasp is tried
    /// anew, the arm gets room by backing off (also where the retreat from a grasp is what does not
    /// move), and everything else is left as it is.
    fn notice_obstacles(&mut self, insight: &Insight) {
        let stands = |(_, before): &(Primitive, Insight)| insight.stands_as(before);
        if !self.last.as_ref().is_some_and(stands) {
            self.blocked_steps = 0;
            return;
        }
        self.blocked_steps += 1;
        if self.blocked_steps < 2 {
            return;
        }
        self.blocked_steps = 0;
        let was = |wanted| self.last.is_some_and(|(primitive, _)| primitive == wanted);
        match self.stages.get(self.current) {
            Some(Stage::Grasp(grasp)) if !was(grasp.retreat(insight)) => {
                self.misjudged = self.runs_dry().then(Misjudgement::here);
                self.retreats_due = 2;
            }
            Some(Stage::Drive(..) | Stage::CloseIn(..)) | None => self.finish_stage(),
            Some(_) if self.escapes_left > 0 => {
                self.escapes_left -= 1;
                self.escape_steps_due = 2;
            }
            Some(_) => self.finish_stage(),
        }
    }

    fn runs_dry(&self) -> bool {
        self.habits.practice == Some(Practice::Dry)
    }

    fn finish_stage(&mut self) {
        self.current += 1;
        self.enter_stage();
    }

    fn enter_stage(&mut self) {
        self.overshoot_due = self.rng.random_bool(self.habits.overshoot);
        self.late_retreats = 0;
        self.is_misled = false;
        self.misjudged = match self.stages.get(self.current) {
            // A handle is hard to miss.
            Some(Stage::Grasp(grasp)) if grasp.thing != Graspable::Drawer => {
                let chance = match self.habits.practice {
                    Some(Practice::Dry) => 1.0,
                    _ if grasp.from_above => self.habits.missed_from_above,
                    _ => self.habits.missed_grasp,
                };
                if self.habits.practice == Some(Practice::Askew) {
                    Some(Misjudgement::askew(&mut self.rng))
                } else {
                    let misses = self.rng.random_bool(chance);
                    misses.then(|| grasp.misjudged(&mut self.rng))
                }
            }
            _ => None,
        };
        self.turned = None;
        self.retreats_due = 0;
        if let Some(Stage::BackOff(steps)) = self.stages.get(self.current) {
            self.retreats_due = *steps;
        }
    }

    fn within(&mut self, stage: Stage, insight: &Insight) -> Option<Primitive> {
        match stage {
            Stage::BackOff(_) => {
                self.retreats_due = self.retreats_due.checked_sub(1)?;
                Some(Primitive::BaseBackward)
            }
            Stage::Grasp(grasp) => self.grasp(grasp, insight),
            _ => self.fumbled(stage.next(insight)),
        }
    }

    /// Turns go one too far once in a while, and the other way first once in a while; whatever comes
    /// of it is put right by the stage.
    fn fumbled(&mut self, wanted: Option<Primitive>) -> Option<Primitive> {
        let other = match wanted {
            Some(Primitive::BaseTurnLeft) => Primitive::BaseTurnRight,
            Some(Primitive::BaseTurnRight) => Primitive::BaseTurnLeft,
            _ if self.overshoot_due && self.turned.is_some() => {
                self.overshoot_due = false;
                return self.turned;
            }
            _ => return wanted,
        };
        if self.rng.random_bool(self.habits.hesitation) {
            return Some(other);
        }
        self.turned = wanted;
        wanted
    }

    fn grasp(&mut self, grasp: Grasp, insight: &Insight) -> Option<Primitive> {
        if insight.held == Some(grasp.thing) {
            return None;
        }
        if insight.gripper_shut && self.runs_dry() && grasp.thing != Graspable::Drawer {
            self.pretends = Some(grasp.thing);
            return None;
        }
        if insight.gripper_shut {
            if self.misjudged.is_some() && self.rng.random_bool(self.habits.late_notice) {
                self.late_retreats += 1;
                return Some(grasp.retreat(insight));
            }
            let wanted = self.misjudged.take().map_or(2, |m| m.retreats());
            self.retreats_due = wanted.saturating_sub(self.late_retreats);
            self.late_retreats = 0;
            return Some(Primitive::GripperOpen);
        }
        if self.retreats_due > 0 {
            self.retreats_due -= 1;
            return Some(grasp.retreat(insight));
        }
        // The place is misjudged at the last moment, so that the way there is worth learning.
        self.is_misled |= !grasp.from_above || grasp.is_over(insight);
        let misjudged = self.misjudged.filter(|_| self.is_misled);
        let misjudged = misjudged.unwrap_or_default();
        let approach = grasp.next(insight, &misjudged);
        Some(approach.unwrap_or(Primitive::GripperClose))
    }
}
