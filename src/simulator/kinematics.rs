//! The arm: where its links are, and which joint angles bring the gripper to a place.
//!
//! Base frame: origin on the floor under the middle of the base, x ahead, y left, z up. Lengths are
//! those of the robot's public description.

use std::f32::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

const SHOULDER_M: [f32; 3] = [0.0973, 0.0, 0.0974 + 0.0655];
const SHOULDER_LIFT_M: f32 = 0.041_25;
const UPPER_ARM_M: [f32; 2] = [0.05, 0.2];
const FOREARM_M: f32 = 0.2002;
const HAND_M: f32 = 0.063;
/// From the palm's frame to the point between the pads of the fingers.
pub(crate) const PALM_TO_TOOL_M: f32 = 0.10;
const JOINT_LIMIT_RAD: f32 = 1.57;
/// Nearest the gripper may come to the robot's own mast.
const NEAREST_M: f32 = 0.24;

/// The point between the finger pads, in the base frame. The gripper points away from the waist,
/// `pitch_rad` below the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Ahead of the middle of the base.
    pub x_m: f32,
    /// To the left.
    pub y_m: f32,
    /// Above the floor.
    pub z_m: f32,
    /// Downward tilt.
    pub pitch_rad: f32,
}

/// Angles of the four joints that the primitives move; the roll joint stays at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joints {
    /// Waist, shoulder, elbow, wrist.
    pub angles_rad: [f32; 4],
}

/// Poses of the links: waist, upper arm, forearm, wrist, palm.
pub type Links = [Isometry3<f32>; 5];

/// A translation.
pub(crate) fn shift(x: f32, y: f32, z: f32) -> Isometry3<f32> {
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity())
}

/// A rotation about an axis.
pub(crate) fn spin(axis: Vector3<f32>, angle_rad: f32) -> Isometry3<f32> {
    Isometry3::rotation(axis * angle_rad)
}

impl Joints {
    /// The angles that bring the gripper to `tool`, if the arm reaches it within its limits.
    #[must_use]
    pub fn reaching(tool: Tool) -> Option<Self> {
        if tool.x_m < NEAREST_M {
            return None;
        }
        let (dx, dy) = (tool.x_m - SHOULDER_M[0], tool.y_m - SHOULDER_M[1]);
        let hand = HAND_M + PALM_TO_TOOL_M;
        let out = dx.hypot(dy) - hand * tool.pitch_rad.cos();
        let up = tool.z_m - SHOULDER_M[2] - SHOULDER_LIFT_M + hand * tool.pitch_rad.sin();
        let upper = UPPER_ARM_M[0].hypot(UPPER_ARM_M[1]);
        let bend = UPPER_ARM_M[0].atan2(UPPER_ARM_M[1]);
        let distance = out.hypot(up);
        let cosine = (upper * upper + distance * distance - FOREARM_M * FOREARM_M)
            / (2.0 * upper * distance);
        if !(-1.0..=1.0).contains(&cosine) {
            return None;
        }
        let raise = up.atan2(out) + cosine.acos();
        let fore = (up - upper * raise.sin()).atan2(out - upper * raise.cos());
        let shoulder = FRAC_PI_2 - bend - raise;
        let elbow = -fore - shoulder;
        let wrist = tool.pitch_rad - shoulder - elbow;
        let angles_rad = [dy.atan2(dx), shoulder, elbow, wrist];
        angles_rad
            .iter()
            .all(|a| a.abs() <= JOINT_LIMIT_RAD)
            .then_some(Self { angles_rad })
    }

    /// Where the links are, in the base frame.
    #[must_use]
    pub fn links(&self) -> Links {
        let [waist, shoulder, elbow, wrist] = self.angles_rad;
        let (y, z) = (Vector3::y(), Vector3::z());
        let mount = Translation3::from(SHOULDER_M);
        let turret = mount * spin(z, waist);
        let upper = turret * shift(0.0, 0.0, SHOULDER_LIFT_M) * spin(y, shoulder);
        let fore = upper * shift(UPPER_ARM_M[0], 0.0, UPPER_ARM_M[1]) * spin(y, elbow);
        let hand = fore * shift(FOREARM_M, 0.0, 0.0) * spin(y, wrist);
        let palm = hand * shift(HAND_M, 0.0, 0.0);
        [turret, upper, fore, hand, palm]
    }

    /// Where the gripper is.
    #[must_use]
    pub fn tool(&self) -> Tool {
        let [_, shoulder, elbow, wrist] = self.angles_rad;
        let tip = (self.links()[4] * shift(PALM_TO_TOOL_M, 0.0, 0.0)).translation;
        Tool {
            x_m: tip.x,
            y_m: tip.y,
            z_m: tip.z,
            pitch_rad: shoulder + elbow + wrist,
        }
    }

    /// The angles on the way to `goal`; 0 is here, 1 is there.
    #[must_use]
    pub fn towards(&self, goal: &Self, part: f32) -> Self {
        let mut angles_rad = self.angles_rad;
        for (angle, end) in angles_rad.iter_mut().zip(goal.angles_rad) {
            *angle += part * (end - *angle);
        }
        Self { angles_rad }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_and_forward_agree_over_the_workspace() {
        let mut reached = 0;
        for i in 0..10 {
            for j in 0..10 {
                let tool = Tool {
                    x_m: 0.26 + 0.03 * i as f32,
                    y_m: -0.12 + 0.03 * j as f32,
                    z_m: 0.2 + 0.035 * j as f32,
                    pitch_rad: 0.2 * (i % 5) as f32,
                };
                let Some(joints) = Joints::reaching(tool) else {
                    continue;
                };
                reached += 1;
                let back = joints.tool();
                for (a, b) in [
                    (back.x_m, tool.x_m),
                    (back.y_m, tool.y_m),
                    (back.z_m, tool.z_m),
                    (back.pitch_rad, tool.pitch_rad),
                ] {
                    assert!((a - b).abs() < 1e-4, "{tool:?} came back as {back:?}");
                }
            }
        }
        assert!(
            reached > 60,
            "only {reached} of 100 places are within reach"
        );
    }

    #[test]
    fn beyond_the_arm_is_out_of_reach() {
        let far = Tool {
            x_m: 0.8,
            y_m: 0.0,
            z_m: 0.3,
            pitch_rad: 0.0,
        };
        assert_eq!(Joints::reaching(far), None);
    }
}
