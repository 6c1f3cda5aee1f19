//! The parts that a person's way of doing a task is made of. Each looks at what is the case and
//! says what to press next, or that it is done.

use std::f32::consts::{PI, TAU};

use super::grasp::Grasp;
use crate::simulator::kinematics::Joints;
use crate::simulator::primitive::{
    DRIVE_STEP_M, Primitive, TOOL_STEP_M, TURN_STEP_RAD, WRIST_STEP_RAD,
};
use crate::simulator::robot::HOME;
use crate::simulator::truth::Insight;
use crate::simulator::world::Graspable;

/// Half a step and a little more, so that nothing is corrected to and fro.
const TURN_TOLERANCE_RAD: f32 = 0.55 * TURN_STEP_RAD;
pub(super) const TOOL_TOLERANCE_M: f32 = 0.53 * TOOL_STEP_M;

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

    pub(super) fn relative_to_base(self, insight: &Insight) -> [f32; 2] {
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

pub(super) fn sideways(off_m: f32) -> Option<Primitive> {
    step(
        off_m,
        TOOL_TOLERANCE_M,
        Primitive::EndEffectorLeft,
        Primitive::EndEffectorRight,
    )
}

pub(super) fn climb(off_m: f32) -> Option<Primitive> {
    step(
        off_m,
        TOOL_TOLERANCE_M,
        Primitive::EndEffectorUp,
        Primitive::EndEffectorDown,
    )
}

/// To a height, and nearer to the base where the arm does not reach it.
pub(super) fn raise(off_m: f32, insight: &Insight) -> Option<Primitive> {
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
pub(super) fn lengthways(off_m: f32, insight: &Insight) -> Option<Primitive> {
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
