//! Puts furniture, things and robot into a new physical world.

use std::f32::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::{
    ColliderBuilder, ColliderHandle, FrictionModel, Group, InteractionGroups, InteractionTestMode,
    PhysicsWorld, Pose, RigidBodyBuilder, RigidBodyHandle, Vector,
};

use super::{Part, RATE_HZ, World};
use crate::simulator::kinematics::{shift, spin};
use crate::simulator::layout::Layout;
use crate::simulator::render::{Material, Shape};
use crate::simulator::robot::Robot;
use crate::simulator::variation::Arrangement;

/// Who meets whom.
pub(super) mod groups {
    use rapier3d::prelude::Group;

    pub const FLOOR: Group = Group::GROUP_1;
    pub const FURNITURE: Group = Group::GROUP_2;
    pub const ROBOT: Group = Group::GROUP_3;
    pub const FINGER: Group = Group::GROUP_4;
    pub const LOOSE: Group = Group::GROUP_5;
    pub const DRAWER: Group = Group::GROUP_6;
    pub const HANDLE: Group = Group::GROUP_7;
}

/// A world with everything in its place and nothing moving.
pub(super) fn world(layout: &Layout, arrangement: &Arrangement) -> World {
    let mut builder = Builder::new();
    builder.room(layout);
    builder.furniture(layout, arrangement);
    let drawer = builder.drawer(layout, arrangement);
    let sock = builder.sock(layout, arrangement);
    let can = builder.can(layout, arrangement);
    let tissue = builder.tissue(layout, arrangement);
    let start = arrangement.start;
    let robot = Robot::at_home(start.position_m, start.heading_rad);
    let bodies = builder.robot(&robot, &arrangement.palette, [drawer, sock, can, tissue]);
    World {
        physics: builder.physics,
        bodies,
        parts: builder.parts,
        layout: *layout,
        robot,
        held: None,
        touching_steps: 0,
        rest_heights_m: [0.0; 3],
        spill_m: arrangement.spill_m,
    }
}

/// A form for physics and for the eye.
pub(super) struct Form {
    pub collider: ColliderBuilder,
    pub shape: Shape,
    pub body_from_shape: Isometry3<f32>,
}

/// How a part of a body weighs, rubs and meets others.
#[derive(Clone, Copy)]
pub(super) struct Substance {
    pub mass_kg: f32,
    pub friction: f32,
    pub own: Group,
    pub others: Group,
}

/// The world while it is being built.
pub(super) struct Builder {
    pub physics: PhysicsWorld,
    parts: Vec<Part>,
}

impl Form {
    /// A box of these half extents.
    pub fn cuboid(half: [f32; 3], body_from_shape: Isometry3<f32>) -> Self {
        Self {
            collider: ColliderBuilder::cuboid(half[0], half[1], half[2])
                .position(Pose::from(body_from_shape)),
            shape: Shape::Box { half_extents: half },
            body_from_shape,
        }
    }

    /// A cylinder that stands up; physics lays its cylinders along y.
    pub fn upright(radius: f32, half_height: f32, body_from_shape: Isometry3<f32>) -> Self {
        let turned = body_from_shape * spin(Vector3::x(), FRAC_PI_2);
        Self {
            collider: ColliderBuilder::cylinder(half_height, radius).position(Pose::from(turned)),
            shape: Shape::Cylinder {
                radius,
                half_height,
            },
            body_from_shape,
        }
    }
}

impl Builder {
    fn new() -> Self {
        let mut physics = PhysicsWorld::new();
        physics.gravity = Vector::new(0.0, 0.0, -9.81);
        let parameters = &mut physics.integration_parameters;
        parameters.dt = 1.0 / RATE_HZ;
        parameters.num_solver_iterations = 4;
        parameters.friction_model = FrictionModel::Coulomb;
        // Recycled contacts go stale under a moving grip, and the grip breaks.
        parameters.contact_recycling = false;
        Self {
            physics,
            parts: Vec::new(),
        }
    }

    /// Something to see, fixed to a body or to the room.
    pub fn show(
        &mut self,
        body: Option<RigidBodyHandle>,
        body_from_shape: Isometry3<f32>,
        shape: Shape,
        material: Material,
    ) {
        self.parts.push(Part {
            body,
            body_from_shape,
            shape,
            material,
        });
    }

    /// Adds a form to a body, to be felt and seen.
    pub fn attach(
        &mut self,
        body: RigidBodyHandle,
        form: Form,
        substance: Substance,
        material: Material,
    ) -> ColliderHandle {
        self.show(Some(body), form.body_from_shape, form.shape, material);
        self.feel(body, form.collider, substance)
    }

    /// Adds something to a body that is felt and not seen.
    pub fn feel(
        &mut self,
        body: RigidBodyHandle,
        collider: ColliderBuilder,
        substance: Substance,
    ) -> ColliderHandle {
        let collider = collider
            .mass(substance.mass_kg)
            .friction(substance.friction)
            .collision_groups(touching(substance.own, substance.others));
        self.physics.insert_collider(collider, Some(body))
    }

    /// A body that falls and can be pushed; `damping_per_s` is how fast a spin dies away.
    pub fn loose(&mut self, place: [f32; 3], yaw_rad: f32, damping_per_s: f32) -> RigidBodyHandle {
        let pose = shift(place[0], place[1], place[2]) * spin(Vector3::z(), yaw_rad);
        let body = RigidBodyBuilder::dynamic()
            .pose(Pose::from(pose))
            .ccd_enabled(true)
            .angular_damping(damping_per_s);
        self.physics.insert_body(body)
    }
}

pub(super) fn touching(own: Group, others: Group) -> InteractionGroups {
    InteractionGroups::new(own, others, InteractionTestMode::And)
}
