use std::f64::consts::{PI, TAU};

use crate::simulator::{
    DRIVE_STEP_M, Insight, Primitive, TOOL_STEP_M, TURN_STEP_RAD, Tool, WRIST_STEP_RAD,
};

/// What one primitive moves: the base ahead and around, the gripper, the wrist.
const DRIVE_M: f64 = DRIVE_STEP_M as f64;
const TURN_RAD: f64 = TURN_STEP_RAD as f64;
const TOOL_M: f64 = TOOL_STEP_M as f64;
const WRIST_RAD: f64 = WRIST_STEP_RAD as f64;
/// Turns of the base that come back to the same heading.
const TURNS: i32 = 24;
/// More primitives than any two postures in a room need.
const MOST_STEPS: u32 = 99;

/// Where base, arm and fingers of the simulated robot are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Posture {
    pub(super) base_m: [f64; 2],
    pub(super) heading_rad: f64,
    /// The gripper in the base frame: ahead, left, up, and its tilt.
    pub(super) tool_m: [f64; 3],
    pub(super) pitch_rad: f64,
    pub(super) is_shut: bool,
}

/// What counts as being there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrival {
    /// How far from the goal each part may be, in primitives that move it.
    pub(super) tolerance: f64,
    /// Whether the hand has to be in the same place of the world, as it has to be at a thing; otherwise it is
    /// enough that the arm is held in the same way.
    pub(super) hand_in_world: bool,
}

impl Posture {
    pub(super) fn of(insight: &Insight) -> Self {
        let tool = &insight.tool;
        Self {
            base_m: insight.base_m.map(f64::from),
            heading_rad: f64::from(insight.heading_rad),
            tool_m: [tool.x_m, tool.y_m, tool.z_m].map(f64::from),
            pitch_rad: f64::from(tool.pitch_rad),
            is_shut: insight.gripper_shut,
        }
    }

    /// The same posture elsewhere in the world, higher or lower.
    pub(super) fn shifted(mut self, by_m: [f64; 3]) -> Self {
        self.base_m[0] += by_m[0];
        self.base_m[1] += by_m[1];
        self.tool_m[2] += by_m[2];
        self
    }

    /// The hand in the world.
    pub(super) fn hand_m(&self) -> [f64; 2] {
        let (sine, cosine) = self.heading_rad.sin_cos();
        let [x, y, _] = self.tool_m;
        [
            self.base_m[0] + cosine * x - sine * y,
            self.base_m[1] + sine * x + cosine * y,
        ]
    }

    /// Where the gripper is sent, as the arm's kinematics take it.
    pub(super) fn tool(&self) -> Tool {
        let [x_m, y_m, z_m] = self.tool_m.map(|v| v as f32);
        Tool {
            x_m,
            y_m,
            z_m,
            pitch_rad: self.pitch_rad as f32,
        }
    }

    /// The posture after a primitive if nothing is in the way.
    pub(super) fn after(mut self, primitive: Primitive) -> Self {
        let mut drive_m = 0.0;
        match primitive {
            Primitive::EndEffectorForward => self.tool_m[0] += TOOL_M,
            Primitive::EndEffectorBackward => self.tool_m[0] -= TOOL_M,
            Primitive::EndEffectorLeft => self.tool_m[1] += TOOL_M,
            Primitive::EndEffectorRight => self.tool_m[1] -= TOOL_M,
            Primitive::EndEffectorUp => self.tool_m[2] += TOOL_M,
            Primitive::EndEffectorDown => self.tool_m[2] -= TOOL_M,
            Primitive::WristDown => self.pitch_rad += WRIST_RAD,
            Primitive::WristUp => self.pitch_rad -= WRIST_RAD,
            Primitive::BaseForward => drive_m = DRIVE_M,
            Primitive::BaseBackward => drive_m = -DRIVE_M,
            Primitive::BaseTurnLeft => self.heading_rad += TURN_RAD,
            Primitive::BaseTurnRight => self.heading_rad -= TURN_RAD,
            Primitive::GripperClose => self.is_shut = true,
            Primitive::GripperOpen => self.is_shut = false,
            Primitive::Terminate => {}
        }
        let (sine, cosine) = self.heading_rad.sin_cos();
        self.base_m[0] += drive_m * cosine;
        self.base_m[1] += drive_m * sine;
        self
    }

    /// The least number of primitives to a posture, at most 99, if nothing is in the way.
    ///
    /// Base: turn, drive, turn, drive, turn, with any number of each. Arm: one axis after another.
    /// Ways with more turns between drives are not looked at; they are never shorter where the two postures are
    /// near.
    pub(super) fn steps_to(&self, goal: &Self, arrival: Arrival) -> u32 {
        let fingers = u32::from(self.is_shut != goal.is_shut);
        let tilt = count(
            goal.pitch_rad - self.pitch_rad,
            WRIST_RAD,
            arrival.tolerance,
        );
        let climb = count(goal.tool_m[2] - self.tool_m[2], TOOL_M, arrival.tolerance);
        let route = BaseRoute {
            start: self,
            goal,
            arrival,
        };
        (fingers + tilt + climb + route.least_steps()).min(MOST_STEPS)
    }
}

/// Primitives of `step` until a distance is at most `tolerance` of them.
fn count(distance: f64, step: f64, tolerance: f64) -> u32 {
    const ROUNDING: f64 = 1e-3;
    let steps = distance.abs() / step - tolerance - ROUNDING;
    if steps > 0.0 { steps.ceil() as u32 } else { 0 }
}

fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// Whole numbers around 0, nearest first: 0, 1, -1, 2, -2, ...
fn outwards(most: i32) -> impl Iterator<Item = i32> {
    (0..=2 * most).map(|i| if i % 2 == 1 { (i + 1) / 2 } else { -i / 2 })
}

/// The base's part of the way, and the arm's movement in the plane, which depends on where the base ends.
struct BaseRoute<'a> {
    start: &'a Posture,
    goal: &'a Posture,
    arrival: Arrival,
}

impl BaseRoute<'_> {
    fn least_steps(&self) -> u32 {
        // Ahead and left in the goal's frame.
        let away = self.in_goal_frame([
            self.goal.base_m[0] - self.start.base_m[0],
            self.goal.base_m[1] - self.start.base_m[1],
        ]);
        let heading = wrapped(self.start.heading_rad - self.goal.heading_rad);
        let mut best = MOST_STEPS;
        for first in outwards(TURNS / 2) {
            for second in outwards(TURNS / 2) {
                let turns = first.unsigned_abs() + second.unsigned_abs();
                let headings = [first, first + second].map(|t| heading + f64::from(t) * TURN_RAD);
                let last = self.last_turn(headings[1]);
                let turns = turns + last.0;
                if turns < best {
                    self.drives(away, headings, last.1, turns, &mut best);
                }
            }
        }
        best
    }

    /// Turns at the end, and the heading relative to the goal's that is left.
    fn last_turn(&self, heading: f64) -> (u32, f64) {
        let off = wrapped(heading);
        let turns = count(off, TURN_RAD, self.arrival.tolerance);
        (turns, off - off.signum() * f64::from(turns) * TURN_RAD)
    }

    /// Tries all numbers of drives along two headings that end near enough.
    fn drives(
        &self,
        away: [f64; 2],
        headings: [f64; 2],
        end_heading: f64,
        turns: u32,
        best: &mut u32,
    ) {
        let along = headings.map(|h| [DRIVE_M * h.cos(), DRIVE_M * h.sin()]);
        let is_same = wrapped(headings[1] - headings[0]).abs() < 1e-6;
        let most = (*best - turns).min(40) as i32;
        for n1 in outwards(if is_same { 0 } else { most }) {
            let so_far = turns + n1.unsigned_abs();
            if so_far >= *best {
                break;
            }
            let n1 = f64::from(n1);
            let left = [away[0] - n1 * along[0][0], away[1] - n1 * along[0][1]];
            let Some((low, high)) = self.second_drives(left, along[1]) else {
                continue;
            };
            for n2 in low..=high {
                let base = so_far + n2.unsigned_abs();
                if base < *best {
                    let n2 = f64::from(n2);
                    let rest = [left[0] - n2 * along[1][0], left[1] - n2 * along[1][1]];
                    *best = (*best).min(base + self.arm_steps(rest, end_heading));
                }
            }
        }
    }

    /// How many drives leave at most the tolerance in either direction.
    fn second_drives(&self, left: [f64; 2], along: [f64; 2]) -> Option<(i32, i32)> {
        let slack = self.arrival.tolerance * DRIVE_M + 1e-4;
        let (mut low, mut high) = (-40.0_f64, 40.0_f64);
        for (left, along) in left.into_iter().zip(along) {
            if along.abs() < 1e-9 {
                if left.abs() > slack {
                    return None;
                }
                continue;
            }
            let ends = [(left - slack) / along, (left + slack) / along];
            low = low.max(ends[0].min(ends[1]));
            high = high.min(ends[0].max(ends[1]));
        }
        let (low, high) = (low.ceil() as i32, high.floor() as i32);
        (low <= high).then_some((low, high))
    }

    /// Movements of the hand ahead and aside from a base that stands `rest` before the goal's and is turned by
    /// `heading` relative to it.
    fn arm_steps(&self, rest: [f64; 2], heading: f64) -> u32 {
        let [x, y, _] = self.goal.tool_m;
        let wanted = if self.arrival.hand_in_world {
            let (sine, cosine) = heading.sin_cos();
            let (dx, dy) = (x + rest[0], y + rest[1]);
            [cosine * dx + sine * dy, cosine * dy - sine * dx]
        } else {
            [x, y]
        };
        let tolerance = self.arrival.tolerance;
        count(wanted[0] - self.start.tool_m[0], TOOL_M, tolerance)
            + count(wanted[1] - self.start.tool_m[1], TOOL_M, tolerance)
    }

    fn in_goal_frame(&self, [dx, dy]: [f64; 2]) -> [f64; 2] {
        let (sine, cosine) = self.goal.heading_rad.sin_cos();
        [cosine * dx + sine * dy, cosine * dy - sine * dx]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn start() -> Posture {
        Posture {
            base_m: [0.3, -0.2],
            heading_rad: 0.4,
            tool_m: [0.36, 0.0, 0.36],
            pitch_rad: 0.0,
            is_shut: false,
        }
    }

    fn exactly(hand_in_world: bool) -> Arrival {
        Arrival {
            tolerance: 0.5,
            hand_in_world,
        }
    }

    #[test]
    fn counts_by_hand() {
        let here = start();
        assert_eq!(here.steps_to(&here, exactly(true)), 0);
        let mut there = here;
        there.tool_m = [0.42, 0.03, 0.27];
        there.is_shut = true;
        assert_eq!(here.steps_to(&there, exactly(false)), 2 + 1 + 3 + 1);
        // A metre to the left: turn by 90 degrees, drive, turn back.
        let aside = [FRAC_PI_2.cos(), FRAC_PI_2.sin()];
        let mut there = here;
        let (sine, cosine) = here.heading_rad.sin_cos();
        there.base_m[0] += cosine * aside[0] - sine * aside[1];
        there.base_m[1] += sine * aside[0] + cosine * aside[1];
        let steps = here.steps_to(&there, exactly(false));
        assert!((18..=22).contains(&steps), "{steps}");
    }

    #[test]
    fn half_a_primitive_aside_is_there_and_the_hand_makes_up_for_it_at_a_thing() {
        let here = start();
        let there = here.shifted([0.034, 0.034, 0.0]);
        assert_eq!(here.steps_to(&there, exactly(false)), 0);
        assert!(here.steps_to(&there, exactly(true)) > 0);
    }

    #[test]
    fn no_walk_is_shorter_than_the_least_number_of_primitives() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..300 {
            let mut there = start();
            let length = rng.random_range(1..5);
            for _ in 0..length {
                there = there.after(Primitive::ALL[rng.random_range(0..14)]);
            }
            for hand_in_world in [false, true] {
                for tolerance in [0.5, 1.0] {
                    let arrival = Arrival {
                        tolerance,
                        hand_in_world,
                    };
                    let steps = start().steps_to(&there, arrival);
                    assert!(
                        steps <= length,
                        "{steps} for {length} primitives to {there:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_wider_tolerance_never_takes_more() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..200 {
            let there = start().shifted([0.0; 3].map(|_: f64| rng.random_range(-0.6..0.6)));
            let steps = |tolerance| {
                let arrival = Arrival {
                    tolerance,
                    hand_in_world: false,
                };
                start().steps_to(&there, arrival)
            };
            assert!(steps(1.0) <= steps(0.5));
        }
    }
}
