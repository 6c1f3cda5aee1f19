//! The parts of the bedroom that nobody touches: the shell and what stands in it to be seen.
//!
//! Nothing here has physics. Furniture therefore stands in niches behind the planes of the walls,
//! where the robot's base cannot go, or hangs flat on them. The head camera looks down and sees
//! only what lies below it, about 0.6 m, so every stretch of wall has something of its own there.

mod furniture;
mod shell;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::layout::Layout;
use super::render::{Material, Shape, Texture, Visual};

/// All decoration of the bedroom, at most 110 visuals, in world coordinates.
#[must_use]
pub fn decoration() -> Vec<Visual> {
    let mut room = Room::new(&Layout::bedroom());
    room.shell();
    room.rugs();
    room.bed();
    room.teddy();
    room.bookshelf();
    room.desk();
    room.door();
    room.radiator();
    room.window();
    room.plant();
    room.lamp();
    room.pictures();
    room.visuals
}

/// [`decoration`] without the south wall and what belongs to it, for pictures from outside: the room
/// lies open like a doll's house.
#[must_use]
pub fn decoration_open_to_the_south() -> Vec<Visual> {
    let floor_m = 0.02;
    let mut visuals = decoration();
    visuals.retain(|visual| {
        reach(visual, 2)[1] < floor_m || reach(visual, 1)[1] > shell::BED_FROM_Y_M + 0.01
    });
    visuals
}

/// Lower and upper bound of a visual along an axis (0, 1 or 2) of the world.
fn reach(visual: &Visual, axis: usize) -> [f32; 2] {
    let pose = &visual.world_from_shape;
    let mut along = Vector3::zeros();
    along[axis] = 1.0;
    let local = pose.rotation.inverse() * along;
    let half = match visual.shape {
        Shape::Box { half_extents } => Vector3::from(half_extents).dot(&local.abs()),
        Shape::Cylinder {
            radius,
            half_height,
        } => radius * local.x.hypot(local.y) + half_height * local.z.abs(),
        Shape::Sphere { radius } => radius,
    };
    let middle = pose.translation.vector[axis];
    [middle - half, middle + half]
}

/// The room while it is being furnished.
struct Room {
    west: f32,
    east: f32,
    south: f32,
    north: f32,
    height: f32,
    layout: Layout,
    visuals: Vec<Visual>,
}

impl Room {
    fn new(layout: &Layout) -> Self {
        let [west, east, south, north] = layout.walls_m;
        Self {
            west,
            east,
            south,
            north,
            height: layout.wall_height_m,
            layout: *layout,
            visuals: Vec::new(),
        }
    }

    /// A box between two values of x, of y and of z.
    fn block(&mut self, x: [f32; 2], y: [f32; 2], z: [f32; 2], material: Material) {
        let half_extents = [x, y, z].map(|[low, high]| 0.5 * (high - low));
        let [x, y, z] = [x, y, z].map(|[low, high]| 0.5 * (low + high));
        self.place(
            Shape::Box { half_extents },
            Isometry3::translation(x, y, z),
            material,
        );
    }

    /// An upright cylinder.
    fn post(&mut self, at: [f32; 2], radius: f32, z: [f32; 2], material: Material) {
        let half_height = 0.5 * (z[1] - z[0]);
        let shape = Shape::Cylinder {
            radius,
            half_height,
        };
        let pose = Isometry3::translation(at[0], at[1], z[0] + half_height);
        self.place(shape, pose, material);
    }

    fn ball(&mut self, at: [f32; 3], radius: f32, material: Material) {
        let pose = Isometry3::translation(at[0], at[1], at[2]);
        self.place(Shape::Sphere { radius }, pose, material);
    }

    /// A box that leans: turned by `angle_rad` about `axis` through its centre.
    fn leaning(
        &mut self,
        half_extents: [f32; 3],
        at: [f32; 3],
        axis: Vector3<f32>,
        angle_rad: f32,
        material: Material,
    ) {
        let turn = UnitQuaternion::new(axis * angle_rad);
        let pose = Isometry3::from_parts(Translation3::from(at), turn);
        self.place(Shape::Box { half_extents }, pose, material);
    }

    fn place(&mut self, shape: Shape, world_from_shape: Isometry3<f32>, material: Material) {
        self.visuals.push(Visual {
            shape,
            world_from_shape,
            material,
        });
    }
}

/// A surface without highlights.
const fn matt(texture: Texture, tint: [f32; 3], scale: f32) -> Material {
    Material {
        texture,
        tint,
        scale,
        specular: 0.0,
        emission: 0.0,
    }
}

/// A surface with a soft highlight.
const fn satin(texture: Texture, tint: [f32; 3], scale: f32) -> Material {
    Material {
        texture,
        tint,
        scale,
        specular: 0.15,
        emission: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::render::{Camera, Lighting, Renderer, Scene};
    use super::*;

    #[test]
    fn there_is_much_to_see_but_not_too_much_to_draw() {
        assert!(
            (60..=110).contains(&decoration().len()),
            "{}",
            decoration().len()
        );
    }

    #[test]
    fn nothing_stands_where_the_robot_drives() {
        // The base, 0.178 m in radius and lower than its camera, stays inside the walls.
        let [west, east, south, north] = Layout::bedroom().walls_m;
        let depth = 0.10;
        for visual in decoration() {
            let [[x0, x1], [y0, y1], [z0, z1]] = [0, 1, 2].map(|axis| reach(&visual, axis));
            let flat_on_floor = z1 < 0.02;
            let along_a_wall =
                x1 < west + depth || x0 > east - depth || y1 < south + depth || y0 > north - depth;
            assert!(flat_on_floor || along_a_wall || z0 > 0.43, "{visual:?}");
        }
    }

    #[test]
    fn nothing_stands_in_the_furniture_that_physics_knows() {
        let layout = Layout::bedroom();
        for block in [
            layout.cabinet,
            layout.shelf,
            layout.chest,
            layout.night_stand,
        ] {
            let bounds = [
                [
                    block.centre_m[0] - block.half_m[0],
                    block.centre_m[0] + block.half_m[0],
                ],
                [
                    block.centre_m[1] - block.half_m[1],
                    block.centre_m[1] + block.half_m[1],
                ],
                [block.base_m, block.top_m],
            ];
            for visual in decoration() {
                let apart = (0..3).any(|axis| {
                    let [low, high] = reach(&visual, axis);
                    low >= bounds[axis][1] - 0.021 || high <= bounds[axis][0] + 0.021
                });
                assert!(apart, "{visual:?} stands in {block:?}");
            }
        }
    }

    #[test]
    fn a_camera_that_looks_down_tells_all_headings_apart() {
        const HEADINGS: usize = 16;
        let scene = Scene {
            visuals: decoration(),
            lighting: Lighting::default(),
        };
        let mut renderer = Renderer::new();
        let views: Vec<_> = (0..HEADINGS)
            .map(|nth| {
                let heading = std::f32::consts::TAU * nth as f32 / HEADINGS as f32;
                let turn = UnitQuaternion::from_euler_angles(0.0, 0.38, heading);
                let camera = Camera {
                    world_from_camera: Isometry3::from_parts(
                        Translation3::new(0.0, 0.0, 0.59),
                        turn,
                    ),
                    vertical_fov_rad: 0.733,
                    height: 45,
                    width: 80,
                };
                renderer.render(&scene, &camera)
            })
            .collect();
        for (nth, view) in views.iter().enumerate() {
            for (other, another) in views.iter().enumerate().skip(nth + 1) {
                let bytes = view.rgb().iter().zip(another.rgb());
                let apart: u32 = bytes.map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                let levels = apart as f32 / view.rgb().len() as f32;
                assert!(levels > 14.0, "{nth} and {other}: {levels} of 255 apart");
            }
        }
    }

    #[test]
    fn the_open_room_has_no_south_wall_but_everything_else() {
        let [_, _, south, north] = Layout::bedroom().walls_m;
        let open = decoration_open_to_the_south();
        let tall = |visual: &&Visual| reach(visual, 2)[1] > 1.5;
        assert!(
            open.iter()
                .filter(tall)
                .all(|visual| reach(visual, 1)[1] > south + 0.2)
        );
        assert!(
            open.iter()
                .filter(tall)
                .any(|visual| reach(visual, 1)[1] > north)
        );
        assert!(open.len() > 80 && open.len() < decoration().len());
    }
}
