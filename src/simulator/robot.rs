//! The robot: a base on wheels, an arm and a gripper, moved by primitives.

use nalgebra::{Isometry3, Vector3};

use super::kinematics::{Joints, Tool, shift, spin};
use super::primitive::{DRIVE_STEP_M, Primitive, TOOL_STEP_M, TURN_STEP_RAD, WRIST_STEP_RAD};

/// Where the gripper is carried between jobs; every task starts and ends with it.
pub const HOME: Tool = Tool {
    x_m: 0.36,
    y_m: 0.0,
    z_m: 0.36,
    pitch_rad: 0.0,
};

/// Head camera in the base frame: on top of the mast, tilted down.
const HEAD_CAMERA_M: [f32; 3] = [0.047, 0.0, 0.591];
const HEAD_TILT_RAD: f32 = 22.0 * std::f32::consts::PI / 180.0;
/// Vertical field of view of the head camera (a `RealSense` D435).
pub const HEAD_FOV_RAD: f32 = 42.0 * std::f32::consts::PI / 180.0;
/// Wrist camera in the palm's frame: above the gripper, looking along it and down to the tips.
const WRIST_CAMERA_M: [f32; 3] = [0.0, 0.0, 0.07];
const WRIST_TILT_RAD: f32 = 20.0 * std::f32::consts::PI / 180.0;
/// Vertical field of view of the wrist camera; wide, so that the finger tips are in the picture.
pub const WRIST_FOV_RAD: f32 = 60.0 * std::f32::consts::PI / 180.0;

/// Where base and arm are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// x and y of the middle of the base in the world.
    pub position_m: [f32; 2],
    /// Heading of the base; 0 is east, counter-clockwise.
    pub heading_rad: f32,
    /// The arm.
    pub joints: Joints,
}

impl Stance {
    /// A robot with its arm at [`HOME`].
    ///
    /// # Panics
    /// Never: the arm reaches its home.
    #[must_use]
    pub fn at_home(position_m: [f32; 2], heading_rad: f32) -> Self {
        let joints = Joints::reaching(HOME).expect("the arm reaches its home");
        Self {
            position_m,
            heading_rad,
            joints,
        }
    }

    /// Pose of the base's frame in the world.
    #[must_use]
    pub fn world_from_base(&self) -> Isometry3<f32> {
        shift(self.position_m[0], self.position_m[1], 0.0) * spin(Vector3::z(), self.heading_rad)
    }

    /// Poses of the arm's links in the world.
    #[must_use]
    pub fn world_from_links(&self) -> [Isometry3<f32>; 5] {
        let base = self.world_from_base();
        self.joints.links().map(|link| base * link)
    }

    /// Pose of the head camera in the world.
    #[must_use]
    pub fn world_from_head_camera(&self) -> Isometry3<f32> {
        let [x, y, z] = HEAD_CAMERA_M;
        self.world_from_base() * shift(x, y, z) * spin(Vector3::y(), HEAD_TILT_RAD)
    }

    /// Pose of the wrist camera in the world.
    #[must_use]
    pub fn world_from_wrist_camera(&self) -> Isometry3<f32> {
        let [x, y, z] = WRIST_CAMERA_M;
        self.world_from_links()[4] * shift(x, y, z) * spin(Vector3::y(), WRIST_TILT_RAD)
    }

    /// The stance on the way to `goal`; 0 is here, 1 is there.
    #[must_use]
    pub fn towards(&self, goal: &Self, part: f32) -> Self {
        let mix = |a: f32, b: f32| a + part * (b - a);
        Self {
            position_m: [
                mix(self.position_m[0], goal.position_m[0]),
                mix(self.position_m[1], goal.position_m[1]),
            ],
            heading_rad: mix(self.heading_rad, goal.heading_rad),
            joints: self.joints.towards(&goal.joints, part),
        }
    }
}

/// The robot as it is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// Where it is.
    pub stance: Stance,
    /// Where the gripper was last sent; equals the stance's within a rounding error, and keeps the
    /// grid of the primitives free of drift.
    pub tool: Tool,
    /// Whether the fingers are commanded together.
    pub gripper_shut: bool,
}

impl Robot {
    /// A robot with its arm at [`HOME`] and open fingers.
    #[must_use]
    pub fn at_home(position_m: [f32; 2], heading_rad: f32) -> Self {
        Self {
            stance: Stance::at_home(position_m, heading_rad),
            tool: HOME,
            gripper_shut: false,
        }
    }

    /// The robot as it would be after `primitive` if nothing is in the way; the same robot where the
    /// arm does not reach the place or nothing moves.
    #[must_use]
    pub fn after(&self, primitive: Primitive) -> Self {
        let mut next = *self;
        let mut drive = 0.0;
        let tool = &mut next.tool;
        match primitive {
            Primitive::EndEffectorLeft => tool.y_m += TOOL_STEP_M,
            Primitive::EndEffectorRight => tool.y_m -= TOOL_STEP_M,
            Primitive::EndEffectorForward => tool.x_m += TOOL_STEP_M,
            Primitive::EndEffectorBackward => tool.x_m -= TOOL_STEP_M,
            Primitive::EndEffectorUp => tool.z_m += TOOL_STEP_M,
            Primitive::EndEffectorDown => tool.z_m -= TOOL_STEP_M,
            Primitive::WristUp => tool.pitch_rad -= WRIST_STEP_RAD,
            Primitive::WristDown => tool.pitch_rad += WRIST_STEP_RAD,
            Primitive::BaseForward => drive = DRIVE_STEP_M,
            Primitive::BaseBackward => drive = -DRIVE_STEP_M,
            Primitive::BaseTurnLeft => next.stance.heading_rad += TURN_STEP_RAD,
            Primitive::BaseTurnRight => next.stance.heading_rad -= TURN_STEP_RAD,
            Primitive::GripperClose => next.gripper_shut = true,
            Primitive::GripperOpen => next.gripper_shut = false,
            Primitive::Terminate => {}
        }
        if next.tool != self.tool {
            let Some(joints) = Joints::reaching(next.tool) else {
                return *self;
            };
            next.stance.joints = joints;
        }
        let (sine, cosine) = self.stance.heading_rad.sin_cos();
        next.stance.position_m[0] += drive * cosine;
        next.stance.position_m[1] += drive * sine;
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_primitives_return_to_the_start() {
        let start = Robot::at_home([0.1, -0.2], 0.7);
        for (go, back) in [
            (Primitive::EndEffectorLeft, Primitive::EndEffectorRight),
            (
                Primitive::EndEffectorForward,
                Primitive::EndEffectorBackward,
            ),
            (Primitive::EndEffectorUp, Primitive::EndEffectorDown),
            (Primitive::BaseForward, Primitive::BaseBackward),
            (Primitive::BaseTurnLeft, Primitive::BaseTurnRight),
            (Primitive::WristDown, Primitive::WristUp),
        ] {
            let there = start.after(go);
            assert_ne!(there, start, "{go:?} moves nothing");
            let home = there.after(back);
            for (a, b) in home
                .stance
                .joints
                .angles_rad
                .iter()
                .zip(start.stance.joints.angles_rad)
            {
                assert!((a - b).abs() < 1e-4, "{go:?} then {back:?}");
            }
        }
    }

    #[test]
    fn unreachable_target_leaves_the_arm() {
        let mut robot = Robot::at_home([0.0, 0.0], 0.0);
        for _ in 0..40 {
            robot = robot.after(Primitive::EndEffectorForward);
        }
        assert!(robot.tool.x_m < 0.70);
        assert_eq!(robot.after(Primitive::EndEffectorForward), robot);
    }

    #[test]
    fn described_robot_moves_and_sees_as_this_one_does() {
        use crate::trajectory::{CameraSpec, RobotGeometry};
        use nalgebra::Point3;

        let described = RobotGeometry::locobot();
        let mut robot = Robot::at_home([0.0, 0.0], 0.0);
        let mut posture = described.at_start();
        let place = Point3::new(0.8, 0.1, 0.3);
        let moves = [
            Primitive::BaseForward,
            Primitive::EndEffectorUp,
            Primitive::EndEffectorLeft,
            Primitive::EndEffectorLeft,
            Primitive::WristDown,
            Primitive::BaseTurnLeft,
            Primitive::EndEffectorBackward,
            Primitive::EndEffectorDown,
            Primitive::WristUp,
            Primitive::BaseTurnRight,
            Primitive::BaseTurnRight,
            Primitive::BaseBackward,
            Primitive::EndEffectorRight,
            Primitive::EndEffectorForward,
        ];
        let mut seen = 0;
        for primitive in moves {
            robot = robot.after(primitive);
            posture = described.after(&posture, primitive.name());
            let stance = robot.stance;
            for (name, pose, fov) in [
                ("head", stance.world_from_head_camera(), HEAD_FOV_RAD),
                ("wrist", stance.world_from_wrist_camera(), WRIST_FOV_RAD),
            ] {
                let (name, height, width) = (name.to_owned(), 90, 160);
                let camera = CameraSpec {
                    name,
                    height,
                    width,
                };
                let Some([x, y]) = described.pixel(&posture, &camera, &place) else {
                    continue;
                };
                let there = pose.inverse_transform_point(&place);
                let focal = 45.0 / (0.5 * fov).tan();
                let off_x = x - (80.0 - focal * there.y / there.x);
                let off_y = y - (45.0 - focal * there.z / there.x);
                assert!(
                    off_x.hypot(off_y) < 0.02,
                    "{primitive:?}, {}: {x} {y}",
                    camera.name
                );
                seen += 1;
            }
        }
        assert!(seen > 20, "{seen}");
    }
}
