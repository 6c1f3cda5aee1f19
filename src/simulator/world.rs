//! The bedroom's physics: furniture, drawer, objects, and the robot among them.

mod body;
mod build;
mod furniture;
mod gripper;
mod obstacle;
mod things;

use nalgebra::{Isometry3, Point3};
use rapier3d::prelude::{
    ColliderHandle, ImpulseJointHandle, PhysicsWorld, Pose, RigidBodyHandle, Vector,
};

use super::kinematics::{PALM_TO_TOOL_M, shift};
use super::layout::Layout;
use super::primitive::Primitive;
use super::render::{Material, Shape, Visual};
use super::robot::Robot;
use super::variation::Arrangement;

pub(crate) use gripper::Held;
pub(crate) use things::TISSUE_HALF_M;

/// Physics steps a second.
const RATE_HZ: f32 = 120.0;
/// Physics steps of one primitive.
const STEPS_PER_PRIMITIVE: u32 = 60;
/// Physics steps from one look for obstacles to the next; divides the steps of a primitive.
const LOOK_AHEAD_STEPS: u32 = 4;
/// Simulated time that one primitive takes.
pub const PRIMITIVE_SECS: f64 = STEPS_PER_PRIMITIVE as f64 / RATE_HZ as f64;
/// Physics steps before an episode, in which loose things come to rest.
const SETTLING_STEPS: u32 = 36;
/// The middle of a thing that is between the fingers is at most this far from the middle of the pads.
const IN_HAND_M: f32 = 0.1;

/// Something loose that the gripper can take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Graspable {
    /// The drawer, by its handle.
    Drawer,
    /// The sock.
    Sock,
    /// The can.
    Can,
    /// The tissue.
    Tissue,
}

/// One visible primitive, fixed to a body or to the room.
#[derive(Clone, Debug)]
struct Part {
    body: Option<RigidBodyHandle>,
    body_from_shape: Isometry3<f32>,
    shape: Shape,
    material: Material,
}

/// Handles of everything that moves.
#[derive(Clone, Debug)]
struct Bodies {
    base: RigidBodyHandle,
    links: [RigidBodyHandle; 5],
    fingers: [RigidBodyHandle; 2],
    pads: [ColliderHandle; 2],
    finger_joints: [ImpulseJointHandle; 2],
    drawer: RigidBodyHandle,
    sock: RigidBodyHandle,
    can: RigidBodyHandle,
    tissue: RigidBodyHandle,
}

/// The physical world of one episode.
pub(crate) struct World {
    physics: PhysicsWorld,
    bodies: Bodies,
    parts: Vec<Part>,
    layout: Layout,
    robot: Robot,
    held: Option<Held>,
    touching_steps: u32,
    rest_heights_m: [f32; 3],
    spill_m: [f32; 2],
}

impl World {
    /// The world at the start of an episode, everything at rest.
    pub(crate) fn new(layout: &Layout, arrangement: &Arrangement) -> Self {
        let mut world = build::world(layout, arrangement);
        for _ in 0..SETTLING_STEPS {
            let robot = world.robot;
            world.advance(&robot);
        }
        world.rest_heights_m = [Graspable::Sock, Graspable::Can, Graspable::Tissue]
            .map(|thing| world.world_from(thing).translation.z);
        world
    }

    /// Carries out one primitive; motion ends where furniture is in the way.
    pub(crate) fn act(&mut self, primitive: Primitive) {
        let start = self.robot;
        let goal = start.after(primitive);
        self.robot.gripper_shut = goal.gripper_shut;
        let moves = goal.stance != start.stance;
        let on_the_way = |step: u32| {
            let part = smooth(step as f32 / STEPS_PER_PRIMITIVE as f32);
            start.stance.towards(&goal.stance, part)
        };
        let mut free = moves;
        for step in 1..=STEPS_PER_PRIMITIVE {
            if free && step % LOOK_AHEAD_STEPS == 1 {
                free = !self.is_blocked(&on_the_way(step + LOOK_AHEAD_STEPS - 1));
            }
            if free {
                self.robot.stance = on_the_way(step);
            }
            let robot = self.robot;
            self.advance(&robot);
        }
        if free {
            self.robot.tool = goal.tool;
        } else if moves {
            self.robot.tool = self.robot.stance.joints.tool();
        }
    }

    fn advance(&mut self, robot: &Robot) {
        let base = self.bodies.base;
        let pose = Pose::from(robot.stance.world_from_base());
        self.physics.bodies[base].set_next_kinematic_position(pose);
        for (link, pose) in self
            .bodies
            .links
            .iter()
            .zip(robot.stance.world_from_links())
        {
            self.physics.bodies[*link].set_next_kinematic_position(Pose::from(pose));
        }
        self.drive_fingers();
        self.update_grasp();
        self.physics.step();
    }

    /// The robot as commanded and as far as it came.
    pub(crate) fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Where the furniture stands.
    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Where the spill is.
    pub(crate) fn spill_m(&self) -> [f32; 2] {
        self.spill_m
    }

    /// What the gripper holds.
    pub(crate) fn held(&self) -> Option<Graspable> {
        self.held.as_ref().map(|held| held.thing)
    }

    /// Whether a thing is in the shut gripper: held by both pads, or wedged between the fingers and
    /// carried along.
    pub(crate) fn grips(&self, thing: Graspable) -> bool {
        let palm = isometry(self.physics.bodies[self.bodies.links[4]].position());
        let tool = palm * shift(PALM_TO_TOOL_M, 0.0, 0.0);
        let off = self.world_from(thing).translation.vector - tool.translation.vector;
        self.held() == Some(thing) || (self.robot.gripper_shut && off.norm() < IN_HAND_M)
    }

    /// Pose of a loose thing.
    pub(crate) fn world_from(&self, thing: Graspable) -> Isometry3<f32> {
        isometry(self.physics.bodies[self.body(thing)].position())
    }

    /// Height of a thing above where it rested at the start; 0 for the drawer.
    pub(crate) fn lift_m(&self, thing: Graspable) -> f32 {
        let rest = match thing {
            Graspable::Drawer => return 0.0,
            Graspable::Sock => self.rest_heights_m[0],
            Graspable::Can => self.rest_heights_m[1],
            Graspable::Tissue => self.rest_heights_m[2],
        };
        self.world_from(thing).translation.z - rest
    }

    /// How far a thing was carried from where it was gripped; 0 for what is not held.
    pub(crate) fn carried_m(&self, thing: Graspable) -> f32 {
        let held = self.held.as_ref().filter(|held| held.thing == thing);
        held.map_or(0.0, |held| {
            let now = self.physics.bodies[self.body(thing)].translation();
            (now - held.from).length()
        })
    }

    /// How far the drawer is open.
    pub(crate) fn drawer_opening_m(&self) -> f32 {
        self.layout.drawer.centre_m[1] - self.world_from(Graspable::Drawer).translation.y
    }

    /// Middle of the drawer's handle.
    pub(crate) fn handle_m(&self) -> [f32; 3] {
        let drawer = &self.layout.drawer;
        let offset = -drawer.half_m[1] - drawer.handle_standoff_m;
        let point = self.world_from(Graspable::Drawer) * Point3::new(0.0, offset, 0.0);
        [point.x, point.y, point.z]
    }

    /// Everything that can be seen of furniture, objects and robot.
    pub(crate) fn visuals(&self) -> Vec<Visual> {
        self.parts
            .iter()
            .map(|part| Visual {
                shape: part.shape,
                world_from_shape: match part.body {
                    Some(body) => {
                        isometry(self.physics.bodies[body].position()) * part.body_from_shape
                    }
                    None => part.body_from_shape,
                },
                material: part.material,
            })
            .collect()
    }

    fn body(&self, thing: Graspable) -> RigidBodyHandle {
        match thing {
            Graspable::Drawer => self.bodies.drawer,
            Graspable::Sock => self.bodies.sock,
            Graspable::Can => self.bodies.can,
            Graspable::Tissue => self.bodies.tissue,
        }
    }
}

/// Accelerates and brakes: 0 at 0, 1 at 1, level at both ends.
fn smooth(part: f32) -> f32 {
    part * part * (3.0 - 2.0 * part)
}

fn isometry(pose: &Pose) -> Isometry3<f32> {
    Isometry3::from(*pose)
}

fn vector(v: [f32; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}
