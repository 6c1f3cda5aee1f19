//! The parts that a person's way of doing a task is made of. Each looks at what is the case and
//! says what to press next, or that it is done.

use std::f32::consts::{PI, TAU};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::simulator::kinematics::Joints;
use crate::simulator::primitive::{
    DRIVE_STEP_M, Primitive, TOOL_STEP_M, TURN_STEP_RAD, WRIST_STEP_RAD,
};
use crate::simulator::robot::HOME;
use crate::simulator::truth::Insight;
use crate::simulator::world::Graspable;

/// Half a step and a little more, so that nothing is corrected to and fro.
const TURN_TOLERANCE_RAD: f32 = 0.55 * TURN_STEP_RAD;
const TOOL_TOLERANCE_M: f32 = 0.53 * TOOL_STEP_M;

/// How far above a thing the hand is brought over it: near enough to see well what is between the
/// fingers, high enough to pass over it.
const CLOSE_ABOVE_M: f32 = 0.07;
/// How far aside a thing may lie for a hand that is lower than that to come down on it all the same.
const LOW_TOLERANCE_M: f32 = 0.03;

/// A place that a stage is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    Handle,
    Sock,
    Can,
    Tissue,
    Spill,
    Bin,
    Container,
    /// On the floor, this far south of the drawer's handle.
    BeforeDrawer(f32),
}

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

/// One part of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stage {
    /// Turn until the target is ahead.
    Face(Target),
    /// Turn to a heading.
    FaceHeading(f32),
    /// Drive until the target is this far ahead, turning when it drifts aside.
    Drive(Target, f32),
    /// Drive backwards until the base is abreast of the target's x.
    BackAbreast(Target),
    /// Drive backwards so many times.
    BackOff(u32),
    /// Drive backwards until the target is at least this far ahead.
    BackAway(Target, f32),
    /// Bring the gripper to a height.
    Raise(f32),
    /// Bring the gripper at least this near to the base.
    Retract(f32),
    /// Tilt the gripper to this many radians below the horizon.
    Tilt(f32),
    /// Take something.
    Grasp(Grasp),
    /// Drive backwards until the drawer is this far open.
    Pull(f32),
    /// Drive forwards until the target is at most this far ahead.
    CloseIn(Target, f32),
    /// Move what is held over the target, to within this distance.
    Over(Graspable, Target, f32),
    /// Let go.
    Release,
    /// Bring the arm home.
    Home,
}

impl Target {
    pub(super) fn place(self, insight: &Insight) -> [f32; 3] {
        match self {
            Self::Handle => insight.handle_m,
            Self::Sock => insight.sock_m,
            Self::Can => insight.can_m,
            Self::Tissue => insight.tissue_m,
            Self::Spill => insight.spill_m,
            Self::Bin => insight.bin_m,
            Self::Container => insight.container_m,
            Self::BeforeDrawer(distance_m) => {
                let [x, y, _] = insight.handle_m;
                [x, y - distance_m, 0.0]
            }
        }
    }

    fn relative_to_base(self, insight: &Insight) -> [f32; 2] {
        let [x, y, _] = self.place(insight);
        insight.relative_to_base([x, y])
    }
}

impl Stage {
    /// The next primitive of this stage, `None` when it is done.
    pub(super) fn next(self, insight: &Insight) -> Option<Primitive> {
        match self {
            Self::Face(target) => {
                let [ahead, left] = target.relative_to_base(insight);
                turn(left.atan2(ahead))
            }
            Self::FaceHeading(heading) => turn(heading - insight.heading_rad),
            Self::Drive(target, stop_m) => {
                let [ahead, left] = target.relative_to_base(insight);
                if ahead.hypot(left) - stop_m <= 0.5 * DRIVE_STEP_M && ahead > 0.0 {
                    return None;
                }
                if stop_m == 0.0 && ahead.hypot(left) < 1.5 * DRIVE_STEP_M {
                    // A place on the floor need not be met exactly; turning after it would circle.
                    return (ahead > 0.5 * DRIVE_STEP_M).then_some(Primitive::BaseForward);
                }
                turn(left.atan2(ahead)).or(Some(Primitive::BaseForward))
            }
            Self::BackAbreast(target) => {
                let behind =
                    -(target.place(insight)[0] - insight.base_m[0]) * insight.heading_rad.cos();
                (behind > 0.5 * DRIVE_STEP_M).then_some(Primitive::BaseBackward)
            }
            Self::Raise(z_m) => raise(z_m - insight.tool.z_m, insight),
            Self::Retract(x_m) => {
                (insight.tool.x_m > x_m).then_some(Primitive::EndEffectorBackward)
            }
            Self::Tilt(pitch_rad) => {
                let off = pitch_rad - insight.tool.pitch_rad;
                step(
                    off,
                    0.5 * WRIST_STEP_RAD,
                    Primitive::WristDown,
                    Primitive::WristUp,
                )
            }
            Self::Pull(opening_m) => {
                (insight.drawer_opening_m < opening_m).then_some(Primitive::BaseBackward)
            }
            Self::CloseIn(target, ahead_m) => {
                (target.relative_to_base(insight)[0] > ahead_m).then_some(Primitive::BaseForward)
            }
            Self::BackAway(target, ahead_m) => {
                (target.relative_to_base(insight)[0] < ahead_m).then_some(Primitive::BaseBackward)
            }
            Self::Over(thing, target, tolerance_m) => over(thing, target, tolerance_m, insight),
            Self::Release => insight.gripper_shut.then_some(Primitive::GripperOpen),
            Self::Home => home(insight),
            Self::BackOff(_) | Self::Grasp(_) => None,
        }
    }
}

impl Misjudgement {
    /// How many primitives back give room to put it right.
    pub(super) fn retreats(&self, grasp: &Grasp) -> u32 {
        match (self.early_steps > 0, grasp.from_above) {
            (true, _) => 0,
            (false, true) => 2,
            (false, false) => 3,
        }
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
        if !self.from_above || rng.random_bool(0.5) {
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

    /// Whether the hand is over the thing, as far as its steps allow, and not yet low.
    pub(super) fn is_over(&self, insight: &Insight) -> bool {
        let [ahead, left] = self.target.relative_to_base(insight);
        let tool = &insight.tool;
        let off = (ahead - self.short_m - tool.x_m)
            .abs()
            .max((left - tool.y_m).abs());
        let height = tool.z_m - self.target.place(insight)[2] - self.above_m;
        off <= TOOL_TOLERANCE_M
            && (CLOSE_ABOVE_M - TOOL_TOLERANCE_M..=CLOSE_ABOVE_M + TOOL_TOLERANCE_M)
                .contains(&height)
    }

    /// The next primitive of the approach, `None` when it is time to close the gripper.
    pub(super) fn next(&self, insight: &Insight, misjudged: &Misjudgement) -> Option<Primitive> {
        let [ahead, left] = self.target.relative_to_base(insight);
        let tool = &insight.tool;
        let dx = ahead - self.short_m + misjudged.beyond_m - tool.x_m;
        let dy = left + misjudged.left_m - tool.y_m;
        let dz = self.target.place(insight)[2] + self.above_m - tool.z_m;
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

fn over(
    thing: Graspable,
    target: Target,
    tolerance_m: f32,
    insight: &Insight,
) -> Option<Primitive> {
    if insight.held != Some(thing) {
        return None;
    }
    let held = match thing {
        Graspable::Sock => insight.sock_m,
        Graspable::Can => insight.can_m,
        Graspable::Tissue => insight.tissue_m,
        Graspable::Drawer => insight.handle_m,
    };
    let [x, y] = insight.relative_to_base([held[0], held[1]]);
    let [ahead, left] = target.relative_to_base(insight);
    let (dx, dy) = (ahead - x, left - y);
    if dy.abs() > tolerance_m {
        return sideways(dy);
    }
    if dx.abs() > tolerance_m {
        return lengthways(dx, insight);
    }
    None
}

fn home(insight: &Insight) -> Option<Primitive> {
    let tool = &insight.tool;
    Stage::Tilt(HOME.pitch_rad)
        .next(insight)
        .or_else(|| (tool.z_m < HOME.z_m - TOOL_TOLERANCE_M).then_some(Primitive::EndEffectorUp))
        .or_else(|| {
            let off = HOME.x_m - tool.x_m;
            step(
                off,
                TOOL_TOLERANCE_M,
                Primitive::EndEffectorForward,
                Primitive::EndEffectorBackward,
            )
        })
        .or_else(|| sideways(HOME.y_m - tool.y_m))
        .or_else(|| climb(HOME.z_m - tool.z_m))
}

fn step(off: f32, tolerance: f32, more: Primitive, less: Primitive) -> Option<Primitive> {
    if off > tolerance {
        Some(more)
    } else if off < -tolerance {
        Some(less)
    } else {
        None
    }
}

fn turn(off_rad: f32) -> Option<Primitive> {
    let off = (off_rad + PI).rem_euclid(TAU) - PI;
    // Straight behind is the same way round to either side; a person keeps to one.
    let off = if off > PI - 0.1 { off - TAU } else { off };
    step(
        off,
        TURN_TOLERANCE_RAD,
        Primitive::BaseTurnLeft,
        Primitive::BaseTurnRight,
    )
}

fn sideways(off_m: f32) -> Option<Primitive> {
    step(
        off_m,
        TOOL_TOLERANCE_M,
        Primitive::EndEffectorLeft,
        Primitive::EndEffectorRight,
    )
}

fn climb(off_m: f32) -> Option<Primitive> {
    step(
        off_m,
        TOOL_TOLERANCE_M,
        Primitive::EndEffectorUp,
        Primitive::EndEffectorDown,
    )
}

/// To a height, and nearer to the base where the arm does not reach it.
fn raise(off_m: f32, insight: &Insight) -> Option<Primitive> {
    let primitive = climb(off_m)?;
    let mut tool = insight.tool;
    tool.z_m += off_m.signum() * TOOL_STEP_M;
    Some(if Joints::reaching(tool).is_some() {
        primitive
    } else {
        Primitive::EndEffectorBackward
    })
}

/// By the arm, or by the base where the arm does not reach.
fn lengthways(off_m: f32, insight: &Insight) -> Option<Primitive> {
    let primitive = step(
        off_m,
        TOOL_TOLERANCE_M,
        Primitive::EndEffectorForward,
        Primitive::EndEffectorBackward,
    )?;
    let mut tool = insight.tool;
    tool.x_m += off_m.signum() * TOOL_STEP_M;
    if Joints::reaching(tool).is_some() {
        return Some(primitive);
    }
    Some(if off_m > 0.0 {
        Primitive::BaseForward
    } else {
        Primitive::BaseBackward
    })
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
