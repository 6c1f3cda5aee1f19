use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix2x3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::CameraSpec;

/// Nearest that a point may come to a camera's lens and still be seen, in metres.
const NEAREST_M: f32 = 0.03;

/// What a robot's primitives move, and where its cameras look: enough to tell from the actions alone where a
/// place lies in the pictures before the gripper reached it.
///
/// The frame of the base has its origin on the floor, x ahead, y left, z up. The gripper's frame has its origin
/// between the fingers and x along them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotGeometry {
    /// Where the gripper is when a demonstration begins, in the base's frame.
    pub gripper_m: [f32; 3],
    /// x and y of the upright axis that the gripper points away from, in the base's frame; without one it always
    /// points ahead.
    #[serde(default)]
    pub waist_m: Option<[f32; 2]>,
    /// What each primitive moves, by its name; one that is not here moves nothing.
    pub primitives: BTreeMap<String, Displacement>,
    /// Where each camera is, by its name.
    pub cameras: BTreeMap<String, CameraMount>,
}

/// What one primitive moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Displacement {
    /// The gripper, in the base's frame.
    pub gripper_m: [f32; 3],
    /// The gripper's tilt, downwards.
    pub gripper_tilt_rad: f32,
    /// The base, ahead.
    pub drive_m: f32,
    /// The base, to the left.
    pub turn_rad: f32,
}

/// A camera on a robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraMount {
    /// What carries it.
    pub on: MountedOn,
    /// Its place in the frame of what carries it.
    pub position_m: [f32; 3],
    /// How far it looks down from that frame's x axis.
    pub tilt_rad: f32,
    /// Vertical field of view. Pixels are square, and the axis goes through the middle of the picture.
    pub vertical_fov_rad: f32,
}

/// What carries a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MountedOn {
    /// The base.
    Base,
    /// The gripper.
    Gripper,
}

/// Where base and gripper are, as the actions tell.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// From the base's frame to where it was at the beginning.
    start_from_base: Isometry3<f32>,
    gripper_m: [f32; 3],
    tilt_rad: f32,
}

impl RobotGeometry {
    /// The `LoCoBot` of the bedroom, as `robots/locobot.json` describes it.
    ///
    /// # Panics
    /// Never: the file is read by a test.
    #[must_use]
    pub fn locobot() -> Self {
        serde_json::from_str(include_str!("../../robots/locobot.json"))
            .expect("the file that is compiled in describes a robot")
    }

    /// Where the robot is when a demonstration begins.
    #[must_use]
    pub fn at_start(&self) -> Posture {
        Posture {
            start_from_base: Isometry3::identity(),
            gripper_m: self.gripper_m,
            tilt_rad: 0.0,
        }
    }

    /// Where it is after a primitive that nothing blocks.
    #[must_use]
    pub fn after(&self, posture: &Posture, primitive: &str) -> Posture {
        let Some(moved) = self.primitives.get(primitive) else {
            return *posture;
        };
        let mut next = *posture;
        for (place, by) in next.gripper_m.iter_mut().zip(moved.gripper_m) {
            *place += by;
        }
        next.tilt_rad += moved.gripper_tilt_rad;
        next.start_from_base *= Isometry3::from_parts(
            Translation3::new(moved.drive_m, 0.0, 0.0),
            turned(Vector3::z(), moved.turn_rad),
        );
        next
    }

    /// Where it is before each of some primitives that follow each other from the beginning and that nothing blocks.
    #[must_use]
    pub fn before_each<'a>(&self, primitives: impl Iterator<Item = &'a str>) -> Vec<Posture> {
        let mut posture = self.at_start();
        let before = |primitive| {
            let next = self.after(&posture, primitive);
            std::mem::replace(&mut posture, next)
        };
        primitives.map(before).collect()
    }

    /// Where a camera is in a posture; none where it is unknown.
    #[must_use]
    pub fn lens(&self, posture: &Posture, camera: &CameraSpec) -> Option<Lens> {
        let mount = self.cameras.get(&camera.name)?;
        let carrier = match mount.on {
            MountedOn::Base => posture.start_from_base,
            MountedOn::Gripper => posture.start_from_base * self.base_from_gripper(posture),
        };
        let lens = Isometry3::from_parts(
            Translation3::from(mount.position_m),
            turned(Vector3::y(), mount.tilt_rad),
        );
        let (height, width) = (camera.height as f32, camera.width as f32);
        Some(Lens {
            start_from_camera: carrier * lens,
            focal_pixels: 0.5 * height / (0.5 * mount.vertical_fov_rad).tan(),
            size_pixels: [width, height],
        })
    }

    /// Whether the gripper carries a camera; not one that is unknown.
    #[must_use]
    pub fn is_carried(&self, camera: &CameraSpec) -> bool {
        let mount = self.cameras.get(&camera.name);
        mount.is_some_and(|mount| mount.on == MountedOn::Gripper)
    }

    /// Where the gripper is, in the frame in which the base began.
    #[must_use]
    pub fn gripper(&self, posture: &Posture) -> Point3<f32> {
        posture.start_from_base * Point3::from(posture.gripper_m)
    }

    /// The pixel, x to the right and y down from the upper left corner, in which a camera shows a place of the
    /// frame in which the base began; none where it is out of the picture, or the camera is unknown.
    #[must_use]
    pub fn pixel(
        &self,
        posture: &Posture,
        camera: &CameraSpec,
        place: &Point3<f32>,
    ) -> Option<[f32; 2]> {
        let lens = self.lens(posture, camera)?;
        let [x, y] = lens.project(&lens.seen(place)?);
        let [width, height] = lens.size_pixels;
        ((0.0..width).contains(&x) && (0.0..height).contains(&y)).then_some([x, y])
    }

    fn base_from_gripper(&self, posture: &Posture) -> Isometry3<f32> {
        let [x, y, _] = posture.gripper_m;
        let heading = self
            .waist_m
            .map_or(0.0, |[from_x, from_y]| (y - from_y).atan2(x - from_x));
        Isometry3::from_parts(
            Translation3::from(posture.gripper_m),
            turned(Vector3::z(), heading) * turned(Vector3::y(), posture.tilt_rad),
        )
    }
}

impl Posture {
    /// A place in the base's frame.
    #[must_use]
    pub fn in_base(&self, place: &Point3<f32>) -> Point3<f32> {
        self.start_from_base.inverse_transform_point(place)
    }

    /// A direction in the base's frame.
    #[must_use]
    pub fn direction_in_base(&self, direction: &Vector3<f32>) -> Vector3<f32> {
        self.start_from_base.inverse_transform_vector(direction)
    }

    /// Where the gripper is in the base's frame.
    #[must_use]
    pub fn gripper_m(&self) -> [f32; 3] {
        self.gripper_m
    }

    /// How far the gripper is tilted down.
    #[must_use]
    pub fn tilt_rad(&self) -> f32 {
        self.tilt_rad
    }
}

/// A camera at one place, in the frame in which the base began.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    start_from_camera: Isometry3<f32>,
    focal_pixels: f32,
    size_pixels: [f32; 2],
}

impl Lens {
    /// A place in the camera's own frame, x ahead; none behind the lens or right before it.
    #[must_use]
    pub fn seen(&self, place: &Point3<f32>) -> Option<Point3<f32>> {
        let seen = self.start_from_camera.inverse_transform_point(place);
        (seen.x >= NEAREST_M).then_some(seen)
    }

    /// The pixel of a place in the camera's own frame.
    #[must_use]
    pub fn project(&self, seen: &Point3<f32>) -> [f32; 2] {
        let [width, height] = self.size_pixels;
        [
            0.5 * width - self.focal_pixels * seen.y / seen.x,
            0.5 * height - self.focal_pixels * seen.z / seen.x,
        ]
    }

    /// How the pixel of a place in the camera's own frame moves with that place, in the frame in which the base
    /// began: pixels a metre.
    #[must_use]
    pub fn slope(&self, seen: &Point3<f32>) -> Matrix2x3<f32> {
        let (f, x) = (self.focal_pixels, seen.x);
        let of_frame = Matrix2x3::new(
            f * seen.y / (x * x),
            -f / x,
            0.0,
            f * seen.z / (x * x),
            0.0,
            -f / x,
        );
        of_frame
            * self
                .start_from_camera
                .rotation
                .inverse()
                .to_rotation_matrix()
    }

    /// The place at a height above the floor that a pixel shows; none where its ray does not get there.
    #[must_use]
    pub fn at_height(&self, [x, y]: [f32; 2], height_m: f32) -> Option<Point3<f32>> {
        let (lens, ray) = self.ray([x, y]);
        let far = (height_m - lens.z) / ray.z;
        (far.is_finite() && far > NEAREST_M).then(|| lens + ray * far)
    }

    /// Where the lens is, and the way that a pixel looks, in the frame in which the base began.
    #[must_use]
    pub fn ray(&self, [x, y]: [f32; 2]) -> (Point3<f32>, Vector3<f32>) {
        let [width, height] = self.size_pixels;
        let ray = Vector3::new(
            1.0,
            (0.5 * width - x) / self.focal_pixels,
            (0.5 * height - y) / self.focal_pixels,
        );
        let lens = Point3::from(self.start_from_camera.translation.vector);
        (lens, self.start_from_camera * ray)
    }
}

fn turned(axis: Vector3<f32>, angle_rad: f32) -> UnitQuaternion<f32> {
    UnitQuaternion::new(axis * angle_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> RobotGeometry {
        serde_json::from_str(
            r#"{
                "gripper_m": [0.4, 0.0, 0.3],
                "primitives": {
                    "left": {"gripper_m": [0.0, 0.1, 0.0]},
                    "drive": {"drive_m": 0.2},
                    "turn": {"turn_rad": 1.5707964}
                },
                "cameras": {
                    "head": {"on": "base", "position_m": [0.0, 0.0, 0.3], "tilt_rad": 0.0, "vertical_fov_rad": 1.5707964},
                    "wrist": {"on": "gripper", "position_m": [-0.2, 0.0, 0.0], "tilt_rad": 0.0, "vertical_fov_rad": 1.5707964}
                }
            }"#,
        )
        .unwrap()
    }

    fn camera(name: &str) -> CameraSpec {
        CameraSpec {
            name: name.to_owned(),
            height: 100,
            width: 200,
        }
    }

    #[test]
    fn a_place_moves_in_the_pictures_against_the_robot() {
        let robot = robot();
        let start = robot.at_start();
        let place = robot.gripper(&start);
        for name in ["head", "wrist"] {
            let middle = robot.pixel(&start, &camera(name), &place).unwrap();
            assert!((middle[0] - 100.0).abs() < 1e-3 && (middle[1] - 50.0).abs() < 1e-3);
        }
        // One tenth of a metre to the right, seen by the wrist from 0.2 m: half of 45 degrees' slope.
        let left = robot.after(&start, "left");
        let seen = robot.pixel(&left, &camera("wrist"), &place).unwrap();
        assert!((seen[0] - 125.0).abs() < 1e-3, "{seen:?}");
        let still = robot.pixel(&left, &camera("head"), &place).unwrap();
        assert!((still[0] - 100.0).abs() < 1e-3, "{still:?}");
        let nearer = robot.after(&start, "drive");
        let above = place + Vector3::new(0.0, 0.0, 0.1);
        let seen = robot.pixel(&nearer, &camera("head"), &above).unwrap();
        assert!((seen[1] - 25.0).abs() < 1e-3, "{seen:?}");
        let turned = robot.after(&start, "turn");
        assert_eq!(robot.pixel(&turned, &camera("head"), &place), None);
        assert_eq!(robot.pixel(&start, &camera("ceiling"), &place), None);
    }
}
