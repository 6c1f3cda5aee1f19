//! The robot's body: base, mast, links and fingers.

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::{
    CoefficientCombineRule, ColliderHandle, ImpulseJointHandle, MotorModel, Pose,
    PrismaticJointBuilder, RigidBodyBuilder, RigidBodyHandle, Vector,
};

use super::Bodies;
use super::build::groups::{DRAWER, FINGER, HANDLE, LOOSE, ROBOT};
use super::build::{Builder, Form, Substance};
use super::gripper::{
    FINGER_DAMPING, FINGER_FORCE_N, FINGER_OPEN_M, FINGER_PLAY_M, FINGER_STIFFNESS,
    FINGER_THICKNESS_M, SIDES,
};
use crate::simulator::kinematics::{PALM_TO_TOOL_M, shift, spin};
use crate::simulator::palette::Palette;
use crate::simulator::render::{Material, Shape};
use crate::simulator::robot::Robot;

/// Base of the robot: a disc above its wheels.
pub(super) const BASE_RADIUS_M: f32 = 0.178;
pub(super) const BASE_HALF_M: f32 = 0.05;
pub(super) const BASE_CENTRE_M: f32 = 0.065;

/// Half extents of each link's box and its middle in the link's frame.
pub(super) const LINK_BOXES: [([f32; 3], [f32; 3]); 5] = [
    ([0.03, 0.03, 0.03], [0.0, 0.0, 0.0]),
    ([0.025, 0.025, 0.1], [0.025, 0.0, 0.1]),
    ([0.09, 0.02, 0.02], [0.1, 0.0, 0.0]),
    ([0.02, 0.02, 0.02], [0.03, 0.0, 0.0]),
    ([0.025, 0.03, 0.02], [0.02, 0.0, 0.0]),
];

const PAD_HALF_M: [f32; 3] = [0.04, FINGER_THICKNESS_M, 0.012];
/// How far the middle of a pad lies ahead of where the gripper is commanded to.
const PAD_AHEAD_M: f32 = 0.01;
/// The tips in front of the pads bend outwards, so that a thing a little aside slides in between.
const TIP_HALF_M: [f32; 3] = [0.009, 0.002, 0.012];
const TIP_FLARE_RAD: f32 = 0.7;

const SHELL: Substance = Substance {
    mass_kg: 0.3,
    friction: 0.5,
    own: ROBOT,
    others: LOOSE.union(DRAWER).union(HANDLE),
};

struct Finger {
    body: RigidBodyHandle,
    pad: ColliderHandle,
    joint: ImpulseJointHandle,
}

impl Builder {
    /// The robot where it starts, beside the things that it may hold.
    pub fn robot(
        &mut self,
        robot: &Robot,
        palette: &Palette,
        [drawer, sock, can, tissue]: [RigidBodyHandle; 4],
    ) -> Bodies {
        let base = self.moved(robot.stance.world_from_base());
        let disc = Form::upright(BASE_RADIUS_M, BASE_HALF_M, shift(0.0, 0.0, BASE_CENTRE_M));
        self.attach(base, disc, SHELL, palette.robot);
        self.mast(base, palette);
        let poses = robot.stance.world_from_links();
        let links = [0, 1, 2, 3, 4].map(|i| {
            let link = self.moved(poses[i]);
            let (half, at) = LINK_BOXES[i];
            let form = Form::cuboid(half, shift(at[0], at[1], at[2]));
            self.attach(link, form, SHELL, palette.robot);
            link
        });
        let [left, right] = SIDES.map(|side| self.finger(robot, links[4], side, palette.finger));
        Bodies {
            base,
            links,
            fingers: [left.body, right.body],
            pads: [left.pad, right.pad],
            finger_joints: [left.joint, right.joint],
            drawer,
            sock,
            can,
            tissue,
        }
    }

    fn moved(&mut self, pose: Isometry3<f32>) -> RigidBodyHandle {
        let body = RigidBodyBuilder::kinematic_position_based().pose(Pose::from(pose));
        self.physics.insert_body(body)
    }

    fn mast(&mut self, base: RigidBodyHandle, palette: &Palette) {
        let post = Shape::Box {
            half_extents: [0.015, 0.03, 0.23],
        };
        self.show(Some(base), shift(-0.04, 0.0, 0.345), post, palette.robot);
        let head = Shape::Box {
            half_extents: [0.02, 0.06, 0.02],
        };
        self.show(Some(base), shift(0.0, 0.0, 0.591), head, palette.finger);
    }

    fn finger(
        &mut self,
        robot: &Robot,
        palm: RigidBodyHandle,
        side: f32,
        material: Material,
    ) -> Finger {
        let open = FINGER_OPEN_M + FINGER_THICKNESS_M;
        let palm_pose = robot.stance.world_from_links()[4];
        let pose = palm_pose * shift(PALM_TO_TOOL_M, side * open, 0.0);
        let body = RigidBodyBuilder::dynamic()
            .pose(Pose::from(pose))
            .can_sleep(false);
        let body = self.physics.insert_body(body);
        let mut form = Form::cuboid(PAD_HALF_M, shift(PAD_AHEAD_M, 0.0, 0.0));
        form.collider = form
            .collider
            .friction_combine_rule(CoefficientCombineRule::Max);
        let rubber = Substance {
            mass_kg: 0.03,
            friction: 1.0,
            own: FINGER,
            others: LOOSE | HANDLE,
        };
        let pad = self.attach(body, form, rubber, material);
        let polished = Substance {
            mass_kg: 0.003,
            friction: 0.1,
            ..rubber
        };
        let (sine, cosine) = TIP_FLARE_RAD.sin_cos();
        let [half_length, half_thickness, _] = TIP_HALF_M;
        let ahead = PAD_AHEAD_M + PAD_HALF_M[0] + half_length * cosine - half_thickness * sine;
        let outwards = half_length * sine + half_thickness * cosine - FINGER_THICKNESS_M;
        let bend = spin(Vector3::z(), side * TIP_FLARE_RAD);
        let tip = Form::cuboid(TIP_HALF_M, shift(ahead, side * outwards, 0.0) * bend);
        self.attach(body, tip, polished, material);
        let bar = Shape::Box {
            half_extents: [0.015, 0.004, 0.008],
        };
        self.show(Some(body), shift(-0.043, 0.0, 0.0), bar, material);
        let joint = PrismaticJointBuilder::new(Vector::new(0.0, side, 0.0))
            .local_anchor1(Vector::new(PALM_TO_TOOL_M, 0.0, 0.0))
            .limits([FINGER_THICKNESS_M - FINGER_PLAY_M, open])
            .motor_model(MotorModel::ForceBased)
            .motor_position(open, FINGER_STIFFNESS, FINGER_DAMPING)
            .motor_max_force(FINGER_FORCE_N)
            .contacts_enabled(false);
        let joint = self.physics.insert_impulse_joint(palm, body, joint);
        Finger { body, pad, joint }
    }
}
