//! Two fingers, and a grasp that holds once both press on the same thing from opposite sides.

use rapier3d::prelude::{
    ColliderHandle, FixedJointBuilder, GenericJoint, GenericJointBuilder, ImpulseJointHandle,
    JointAxesMask, JointAxis, Pose, Vector,
};

use super::{Graspable, RATE_HZ, World, isometry};
use crate::simulator::kinematics::{PALM_TO_TOOL_M, shift};

/// Left and right along the closing axis.
pub(super) const SIDES: [f32; 2] = [1.0, -1.0];
/// How far the shut fingers are sent beyond where they meet resistance.
const SQUEEZE_M: f32 = 0.004;
/// Half of the largest opening between the pads.
pub(super) const FINGER_OPEN_M: f32 = 0.037;
/// Half of a finger's thickness.
pub(super) const FINGER_THICKNESS_M: f32 = 0.006;
/// How far a finger can be pushed beyond the middle of the gripper.
pub(super) const FINGER_PLAY_M: f32 = 0.018;
pub(super) const FINGER_FORCE_N: f32 = 8.0;
pub(super) const FINGER_STIFFNESS: f32 = 2000.0;
pub(super) const FINGER_DAMPING: f32 = 40.0;
/// Both pads must press this long before a grasp holds.
const CONTACT_STEPS: u32 = 6;
/// Largest angle between a pad and what it presses on, as a cosine.
const OPPOSED_COSINE: f32 = 0.8;
const CONTACT_M: f32 = 0.0005;
/// Force that tears a grasp apart.
const TEAR_N: f32 = 15.0;

/// A thing in the gripper.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    pub(super) thing: Graspable,
    joint: ImpulseJointHandle,
    /// Where the thing was when the grasp began.
    pub(super) from: Vector,
}

impl World {
    /// Each finger closes until it meets resistance. Once something loose is held, both are sent to
    /// the same distance from the middle between them; a pair of springs would drift to one side.
    pub(super) fn drive_fingers(&mut self) {
        let palm = *self.physics.bodies[self.bodies.links[4]].position();
        let apertures = [0, 1].map(|k| {
            let finger = self.physics.bodies[self.bodies.fingers[k]].translation();
            SIDES[k] * palm.inverse_transform_point(finger).y
        });
        let middle = 0.5 * (apertures[0] + apertures[1]);
        let centred = self.held().is_some_and(|thing| thing != Graspable::Drawer);
        for (side, joint) in self.bodies.finger_joints.into_iter().enumerate() {
            let target = if self.robot.gripper_shut {
                let from = if centred { middle } else { apertures[side] };
                let meeting = 2.0 * FINGER_THICKNESS_M - apertures[1 - side];
                (from - SQUEEZE_M).max(meeting)
            } else {
                FINGER_OPEN_M + FINGER_THICKNESS_M
            };
            if let Some(joint) = self.physics.impulse_joints.get_mut(joint, true) {
                joint.data.set_motor_position(
                    JointAxis::LinX,
                    target,
                    FINGER_STIFFNESS,
                    FINGER_DAMPING,
                );
            }
        }
    }

    /// Begins, keeps or ends a grasp.
    pub(super) fn update_grasp(&mut self) {
        if let Some(held) = &self.held {
            let torn = self
                .physics
                .impulse_joints
                .get(held.joint)
                .is_none_or(|joint| {
                    let pull = joint.impulses;
                    let linear = Vector::new(pull[0], pull[1], pull[2]);
                    linear.length() * RATE_HZ > TEAR_N
                });
            if torn || !self.robot.gripper_shut {
                self.physics.remove_impulse_joint(held.joint);
                self.held = None;
                self.touching_steps = 0;
            }
            return;
        }
        let between = self
            .robot
            .gripper_shut
            .then(|| self.between_pads())
            .flatten();
        self.touching_steps = if between.is_some() {
            self.touching_steps + 1
        } else {
            0
        };
        if let Some(thing) = between.filter(|_| self.touching_steps >= CONTACT_STEPS) {
            let joint = self.grasp_joint(thing);
            let palm = self.bodies.links[4];
            let joint = self
                .physics
                .insert_impulse_joint(palm, self.body(thing), joint);
            let from = self.physics.bodies[self.body(thing)].translation();
            self.held = Some(Held { thing, joint, from });
        }
    }

    /// What both pads press on from opposite sides.
    fn between_pads(&self) -> Option<Graspable> {
        let (left, right) = (self.pressed(0)?, self.pressed(1)?);
        let body = |collider: ColliderHandle| self.physics.colliders[collider].parent();
        let (left, right) = (body(left)?, body(right)?);
        [
            Graspable::Drawer,
            Graspable::Sock,
            Graspable::Can,
            Graspable::Tissue,
        ]
        .into_iter()
        .find(|thing| left == right && self.body(*thing) == left)
    }

    fn pressed(&self, side: usize) -> Option<ColliderHandle> {
        let pad = self.bodies.pads[side];
        let palm = *self.physics.bodies[self.bodies.links[4]].position();
        self.physics
            .narrow_phase
            .contact_pairs_with(pad)
            .find_map(|pair| {
                let first = pair.collider1 == pad;
                let presses = pair.manifolds().iter().any(|manifold| {
                    let normal = if first {
                        manifold.data.normal
                    } else {
                        -manifold.data.normal
                    };
                    let inwards = -SIDES[side] * palm.inverse_transform_vector(normal).y;
                    inwards > OPPOSED_COSINE && manifold.points.iter().any(|p| p.dist < CONTACT_M)
                });
                presses.then_some(if first {
                    pair.collider2
                } else {
                    pair.collider1
                })
            })
    }

    /// Loose things stick to the palm; the drawer only follows along its rails, because fingers
    /// slide along a handle when the pull is a little askew.
    fn grasp_joint(&self, thing: Graspable) -> GenericJoint {
        let palm = isometry(self.physics.bodies[self.bodies.links[4]].position());
        let body = self.world_from(thing);
        if thing != Graspable::Drawer {
            let frame = Pose::from(palm.inverse() * body);
            return FixedJointBuilder::new()
                .local_frame1(frame)
                .contacts_enabled(true)
                .build()
                .data;
        }
        let mut grip = palm * shift(PALM_TO_TOOL_M, 0.0, 0.0);
        grip.rotation = body.rotation;
        GenericJointBuilder::new(JointAxesMask::LIN_Y)
            .local_frame1(Pose::from(palm.inverse() * grip))
            .local_frame2(Pose::from(body.inverse() * grip))
            .contacts_enabled(true)
            .build()
    }
}
