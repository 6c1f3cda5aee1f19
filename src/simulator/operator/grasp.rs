//! How a person takes a thing, and how they miss it.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::stage::{TOOL_TOLERANCE_M, Target, climb, lengthways, raise, sideways};
use crate::simulator::primitive::{Primitive, TOOL_STEP_M};
use crate::simulator::truth::Insight;
use crate::simulator::world::Graspable;

/// How far above a thing the hand is brought over it: near enough to see well what is between the
/// fingers, high enough to pass over it.
const CLOSE_ABOVE_M: f32 = 0.07;
/// How far aside a thing may lie for a hand that is lower than that to come down on it all the same.
const LOW_TOLERANCE_M: f32 = 0.03;

/// Chance that what is missed from above is missed by closing too early; otherwise the hand comes down
/// beside it, and must go up and line up again.
const EARLY_FROM_ABOVE: f64 = 0.3;

/// How far before or behind the place of a grasp an askew one may be, and how far beside it: as far as it still holds,
/// and a little farther.
const ASKEW_AHEAD_M: f32 = 2.5 * TOOL_STEP_M;
const ASKEW_ASIDE_M: f32 = 1.3 * TOOL_STEP_M;

/// How a thing is taken: from which side, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grasp {
    pub thing: Graspable,
    pub target: Target,
    /// Where to take it, above the target's middle.
    pub above_m: f32,
    /// How far before the middle the hand is to be: what is a little ahead is seen better.
    pub short_m: f32,
    /// Come down on it; otherwise come from ahead.
    pub from_above: bool,
}

/// How far from the right place a grasp is tried.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Misjudgement {
    /// The gripper is closed so many steps before it gets there.
    early_steps: u8,
    /// Beyond the thing, by so much.
    beyond_m: f32,
    /// To the left of the thing, by so much.
    left_m: f32,
}

impl Misjudgement {
    /// Closes the gripper as soon as it is in line, however far away.
    pub(super) const fn here() -> Self {
        Self {
            early_steps: u8::MAX,
            beyond_m: 0.0,
            left_m: 0.0,
        }
    }

    /// Takes the thing oddly, or misses it.
    pub(super) fn askew(rng: &mut ChaCha8Rng) -> Self {
        Self {
            early_steps: 0,
            beyond_m: rng.random_range(-ASKEW_AHEAD_M..=ASKEW_AHEAD_M),
            left_m: rng.random_range(-ASKEW_ASIDE_M..=ASKEW_ASIDE_M),
        }
    }

    /// How many primitives back give room to put it right.
    pub(super) const fn retreats(&self) -> u32 {
        if self.early_steps > 0 { 0 } else { 2 }
    }
}

impl Grasp {
    /// The way out after a grasp that failed.
    pub(super) fn retreat(&self, insight: &Insight) -> Primitive {
        let back = Primitive::EndEffectorBackward;
        if self.from_above {
            raise(TOOL_STEP_M, insight).unwrap_or(back)
        } else {
            back
        }
    }

    /// How to try it so that it fails.
    pub(super) fn misjudged(&self, rng: &mut ChaCha8Rng) -> Misjudgement {
        let right = Misjudgement::default();
        if !self.from_above || rng.random_bool(EARLY_FROM_ABOVE) {
            let early_steps = rng.random_range(2..=3);
            return Misjudgement {
                early_steps,
                ..right
            };
        }
        let aside_m = 2.0 * TOOL_STEP_M;
        let off_m = if rng.random_bool(0.5) {
            aside_m
        } else {
            -aside_m
        };
        if rng.random_bool(0.5) {
            let left_m = off_m;
            Misjudgement { left_m, ..right }
        } else {
            let beyond_m = off_m;
            Misjudgement { beyond_m, ..right }
        }
    }

    /// How far the hand still is from the place of the grasp: ahead, left and up.
    fn offset(&self, insight: &Insight) -> [f32; 3] {
        let [ahead, left] = self.target.relative_to_base(insight);
        let tool = &insight.tool;
        let up = self.target.place(insight)[2] + self.above_m;
        [
            ahead - self.short_m - tool.x_m,
            left - tool.y_m,
            up - tool.z_m,
        ]
    }

    /// Whether the hand is over the thing, as far as its steps allow, and not yet low.
    pub(super) fn is_over(&self, insight: &Insight) -> bool {
        let [dx, dy, dz] = self.offset(insight);
        let (off, height) = (dx.abs().max(dy.abs()), -dz);
        off <= TOOL_TOLERANCE_M
            && (CLOSE_ABOVE_M - TOOL_TOLERANCE_M..=CLOSE_ABOVE_M + TOOL_TOLERANCE_M)
                .contains(&height)
    }

    /// The next primitive of the approach, `None` when it is time to close the gripper.
    pub(super) fn next(&self, insight: &Insight, misjudged: &Misjudgement) -> Option<Primitive> {
        let [dx, dy, dz] = self.offset(insight);
        let (dx, dy) = (dx + misjudged.beyond_m, dy + misjudged.left_m);
        let slack_m = f32::from(misjudged.early_steps) * TOOL_STEP_M;
        if self.from_above {
            let down = |above_m: f32| {
                (-dz > TOOL_TOLERANCE_M + above_m).then_some(Primitive::EndEffectorDown)
            };
            // What lies loose is pushed along by a hand that moves in it: up first, then across.
            if -dz < CLOSE_ABOVE_M - TOOL_TOLERANCE_M {
                let is_off = dx.abs().max(dy.abs()) > LOW_TOLERANCE_M;
                return if is_off {
                    Some(self.retreat(insight))
                } else {
                    down(slack_m)
                };
            }
            return down(CLOSE_ABOVE_M)
                .or_else(|| sideways(dy))
                .or_else(|| lengthways(dx, insight))
                .or_else(|| down(slack_m));
        }
        sideways(dy).or_else(|| climb(dz)).or_else(|| {
            if dx > TOOL_TOLERANCE_M + slack_m {
                lengthways(dx, insight)
            } else {
                None
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::bedroom::{Bedroom, BedroomConfig};
    use crate::simulator::variation::BedroomTask;

    #[test]
    fn a_hand_that_is_low_beside_a_sock_rises_before_it_goes_across() {
        let grasp = Grasp {
            thing: Graspable::Sock,
            target: Target::Sock,
            above_m: 0.0,
            short_m: 0.0,
            from_above: true,
        };
        let next = |ahead_m: f32, height_m: f32| {
            let mut insight = Bedroom::new(BedroomConfig::paper(BedroomTask::Sock)).insight();
            (insight.base_m, insight.heading_rad) = ([0.0, 0.0], 0.0);
            insight.sock_m = [0.45 + ahead_m, 0.0, 0.3];
            (insight.tool.x_m, insight.tool.y_m) = (0.45, 0.0);
            insight.tool.z_m = 0.3 + height_m;
            grasp.next(&insight, &Misjudgement::default())
        };
        assert_eq!(next(0.06, 0.03), Some(Primitive::EndEffectorUp));
        assert_eq!(next(0.06, 0.06), Some(Primitive::EndEffectorForward));
        assert_eq!(next(0.06, 0.12), Some(Primitive::EndEffectorDown));
        assert_eq!(next(0.02, 0.03), Some(Primitive::EndEffectorDown));
        assert_eq!(next(0.02, 0.0), None, "near enough to close");
    }
}
