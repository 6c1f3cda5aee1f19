//! The robot is moved by hand through physics, so it has to look where it goes: a stance that runs
//! into furniture is refused.

use nalgebra::Isometry3;
use rapier3d::prelude::{
    Collider, ColliderHandle, Cuboid, Cylinder, Group, Pose, QueryFilter, Shape,
};

use super::body::{BASE_CENTRE_M, BASE_HALF_M, BASE_RADIUS_M, LINK_BOXES};
use super::build::groups::{DRAWER, FURNITURE};
use super::build::touching;
use super::{Graspable, World, vector};
use crate::simulator::kinematics::{shift, spin};
use crate::simulator::robot::Stance;

/// Half extents of the open hand, fingers included, and its place in the palm's frame.
const HAND_HALF_M: [f32; 3] = [0.03, 0.046, 0.012];
const HAND_CENTRE_M: f32 = 0.10;
const MAST_HALF_M: [f32; 3] = [0.03, 0.03, 0.24];

impl World {
    /// Whether the robot would stand in furniture, or would newly run into the drawer.
    pub(super) fn is_blocked(&self, stance: &Stance) -> bool {
        let furniture = filter(FURNITURE);
        if self.touches(stance, furniture) {
            return true;
        }
        self.held() != Some(Graspable::Drawer)
            && self.touches(stance, filter(DRAWER))
            && !self.touches(&self.robot.stance, filter(DRAWER))
    }

    fn touches(&self, stance: &Stance, filter: QueryFilter) -> bool {
        let query = self.physics.query_pipeline_with_filter(filter);
        let hits = |shape: &dyn Shape, pose: Isometry3<f32>| {
            let mut found = query.intersect_shape(Pose::from(pose), shape);
            let first: Option<(ColliderHandle, &Collider)> = found.next();
            first.is_some()
        };
        let base = stance.world_from_base();
        let upright = spin(nalgebra::Vector3::x(), std::f32::consts::FRAC_PI_2);
        let links = stance.world_from_links();
        hits(
            &Cylinder::new(BASE_HALF_M, BASE_RADIUS_M),
            base * shift(0.0, 0.0, BASE_CENTRE_M) * upright,
        ) || hits(
            &Cuboid::new(vector(MAST_HALF_M)),
            base * shift(-0.03, 0.0, 0.36),
        ) || links.iter().zip(LINK_BOXES).any(|(link, (half, at))| {
            hits(
                &Cuboid::new(vector(half)),
                link * shift(at[0], at[1], at[2]),
            )
        }) || hits(
            &Cuboid::new(vector(HAND_HALF_M)),
            links[4] * shift(HAND_CENTRE_M, 0.0, 0.0),
        )
    }
}

fn filter<'a>(group: Group) -> QueryFilter<'a> {
    QueryFilter::default().groups(touching(Group::ALL, group))
}
