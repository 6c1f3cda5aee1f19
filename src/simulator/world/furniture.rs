//! Walls, furniture, receptacles and the drawer.

use rapier3d::prelude::{
    ColliderBuilder, MotorModel, Pose, PrismaticJointBuilder, RigidBodyBuilder, RigidBodyHandle,
    Vector,
};

use super::build::groups::{DRAWER, FINGER, FLOOR, FURNITURE, HANDLE, LOOSE, ROBOT};
use super::build::{Builder, Form, Substance, touching};
use crate::simulator::kinematics::shift;
use crate::simulator::layout::{Block, Drawer, Layout, Receptacle};
use crate::simulator::render::{Material, Shape};
use crate::simulator::variation::Arrangement;

/// Dry friction of the drawer's rails.
const RAIL_FRICTION_N: f32 = 2.0;
const BOARD_HALF_M: f32 = 0.015;
/// Half of the thickness of the drawer's bottom.
pub(super) const BOTTOM_HALF_M: f32 = 0.004;

impl Builder {
    /// Floor and walls.
    pub fn room(&mut self, layout: &Layout) {
        self.physics.insert(
            RigidBodyBuilder::fixed(),
            ColliderBuilder::cuboid(5.0, 5.0, 0.1)
                .translation(Vector::new(0.0, 0.0, -0.1))
                .collision_groups(touching(FLOOR, LOOSE)),
        );
        let [west, east, south, north] = layout.walls_m;
        let half_z = 0.5 * layout.wall_height_m;
        let (mid_x, mid_y) = (0.5 * (west + east), 0.5 * (south + north));
        let (half_x, half_y) = (0.5 * (east - west) + 0.1, 0.5 * (north - south) + 0.1);
        for x in [west - 0.05, east + 0.05] {
            self.fixed([x, mid_y, half_z], [0.05, half_y, half_z], None);
        }
        for y in [south - 0.05, north + 0.05] {
            self.fixed([mid_x, y, half_z], [half_x, 0.05, half_z], None);
        }
    }

    /// Everything that stands in the room, the spill included.
    pub fn furniture(&mut self, layout: &Layout, arrangement: &Arrangement) {
        let palette = &arrangement.palette;
        self.cabinet(layout, palette.cabinet);
        self.block(&layout.shelf, palette.shelf);
        self.block(&layout.chest, palette.chest);
        self.block(&layout.night_stand, palette.night_stand);
        self.receptacle(&layout.bin, palette.bin);
        self.receptacle(&layout.container, palette.container);
        for piece in &palette.clutter {
            let [x, y] = piece.place_m;
            let (half, half_z) = (piece.half_m, 0.5 * piece.height_m);
            self.fixed([x, y, half_z], [half, half, half_z], Some(piece.material));
        }
        self.spill(layout, arrangement.spill_m, palette.spill);
    }

    /// The drawer on its rails.
    pub fn drawer(&mut self, layout: &Layout, arrangement: &Arrangement) -> RigidBodyHandle {
        let drawer = &layout.drawer;
        let [x, y, z] = drawer.centre_m;
        let rail = RigidBodyBuilder::fixed().translation(Vector::new(x, y, z));
        let rail = self.physics.insert_body(rail);
        let open_y = y - arrangement.drawer_opening_m;
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(x, open_y, z))
            .linear_damping(2.0);
        let body = self.physics.insert_body(body);
        let palette = &arrangement.palette;
        self.tray(body, drawer, palette.drawer_front, palette.drawer_inside);
        self.handle(body, drawer, palette.handle);
        // Dry friction is a motor that holds still with little force.
        let joint = PrismaticJointBuilder::new(Vector::new(0.0, -1.0, 0.0))
            .limits([0.0, drawer.travel_m])
            .motor_model(MotorModel::ForceBased)
            .motor_velocity(0.0, 200.0)
            .motor_max_force(RAIL_FRICTION_N)
            .contacts_enabled(false);
        self.physics.insert_impulse_joint(rail, body, joint);
        body
    }

    fn fixed(&mut self, centre: [f32; 3], half: [f32; 3], material: Option<Material>) {
        let pose = shift(centre[0], centre[1], centre[2]);
        self.physics.insert(
            RigidBodyBuilder::fixed().pose(Pose::from(pose)),
            ColliderBuilder::cuboid(half[0], half[1], half[2])
                .friction(0.6)
                .collision_groups(touching(FURNITURE, LOOSE)),
        );
        if let Some(material) = material {
            self.show(None, pose, Shape::Box { half_extents: half }, material);
        }
    }

    fn block(&mut self, block: &Block, material: Material) {
        let half_z = 0.5 * (block.top_m - block.base_m);
        self.fixed(
            [block.centre_m[0], block.centre_m[1], block.base_m + half_z],
            [block.half_m[0], block.half_m[1], half_z],
            Some(material),
        );
    }

    /// Plinth, sides, back and top around the drawer.
    fn cabinet(&mut self, layout: &Layout, material: Material) {
        let (cabinet, drawer) = (&layout.cabinet, &layout.drawer);
        let [x, y] = cabinet.centre_m;
        let [half_x, half_y] = cabinet.half_m;
        let low = drawer.centre_m[2] - drawer.half_m[2] - 0.01;
        let high = drawer.centre_m[2] + drawer.half_m[2] + 0.01;
        let (middle, half_z) = (0.5 * (low + high), 0.5 * (high - low));
        let upper = 0.5 * (cabinet.top_m - high);
        let some = Some(material);
        self.fixed([x, y, 0.5 * low], [half_x, half_y, 0.5 * low], some);
        self.fixed([x, y, high + upper], [half_x, half_y, upper], some);
        for side in [-1.0, 1.0] {
            let at = x + side * (half_x - BOARD_HALF_M);
            self.fixed([at, y, middle], [BOARD_HALF_M, half_y, half_z], some);
        }
        let back = y + half_y - BOARD_HALF_M;
        self.fixed([x, back, middle], [half_x, BOARD_HALF_M, half_z], some);
    }

    fn receptacle(&mut self, receptacle: &Receptacle, material: Material) {
        let [x, y] = receptacle.centre_m;
        let (half, wall) = (receptacle.half_m, 0.5 * receptacle.wall_m);
        let half_z = 0.5 * receptacle.rim_m;
        let some = Some(material);
        self.fixed([x, y, wall], [half, half, wall], some);
        for side in [-1.0, 1.0] {
            let offset = side * (half - wall);
            self.fixed([x + offset, y, half_z], [wall, half, half_z], some);
            self.fixed([x, y + offset, half_z], [half, wall, half_z], some);
        }
    }

    /// Wine is for the eye only.
    fn spill(&mut self, layout: &Layout, [x, y]: [f32; 2], material: Material) {
        let (radius, top) = (layout.spill_radius_m, layout.chest.top_m);
        // Drops lie behind the puddle, so that a camera above the gripper still sees where it is
        // when the tissue hides it.
        let blots = [
            (0.0, 0.0, 1.0),
            (0.5, 0.4, 0.55),
            (0.25, -1.5, 0.3),
            (-0.35, -2.1, 0.22),
            (1.5, -0.3, 0.25),
        ];
        for (dx, dy, part) in blots {
            let disc = Shape::Cylinder {
                radius: part * radius,
                half_height: 0.001,
            };
            let pose = shift(x + dx * radius, y + dy * radius, top);
            self.show(None, pose, disc, material);
        }
    }

    fn tray(&mut self, body: RigidBodyHandle, drawer: &Drawer, front: Material, inside: Material) {
        let [x, y, z] = drawer.half_m;
        let sides_z = z - 0.01;
        for (centre, half, material) in [
            ([0.0, -y, 0.0], [x + 0.02, 0.01, z], front),
            ([0.0, y, -0.01], [x, 0.006, sides_z], inside),
            ([0.0, 0.0, BOTTOM_HALF_M - z], [x, y, BOTTOM_HALF_M], inside),
            ([x, 0.0, -0.01], [0.006, y, sides_z], inside),
            ([-x, 0.0, -0.01], [0.006, y, sides_z], inside),
        ] {
            let form = Form::cuboid(half, shift(centre[0], centre[1], centre[2]));
            self.attach(body, form, Substance::of_drawer(DRAWER, 0.28), material);
        }
    }

    /// An upright post on two arms.
    fn handle(&mut self, body: RigidBodyHandle, drawer: &Drawer, material: Material) {
        let (stand, post_half) = (drawer.handle_standoff_m, drawer.handle_half_m);
        let before = -drawer.half_m[1] - 0.5 * stand;
        for side in [-1.0, 1.0] {
            let pose = shift(0.0, before, side * (post_half - 0.006));
            let arm = Form::cuboid([0.008, 0.5 * stand, 0.006], pose);
            self.attach(body, arm, Substance::of_drawer(HANDLE, 0.02), material);
        }
        let at = shift(0.0, -drawer.half_m[1] - stand, 0.0);
        let upright = Form::upright(drawer.handle_radius_m, post_half, at);
        self.attach(body, upright, Substance::of_drawer(HANDLE, 0.03), material);
    }
}

impl Substance {
    fn of_drawer(own: rapier3d::prelude::Group, mass_kg: f32) -> Self {
        Self {
            mass_kg,
            friction: 0.7,
            own,
            others: LOOSE | ROBOT | FINGER,
        }
    }
}
