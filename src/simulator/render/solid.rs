//! Visuals and cameras, prepared for one picture.

use nalgebra::{Matrix3, Vector3};

use super::{Camera, Lighting, Material, Shape, Texture, Visual};

/// Samples along each side of a pixel.
pub(super) const SAMPLES: usize = 2;

/// A camera in sample units.
#[derive(Debug)]
pub(super) struct Eye {
    pub position: Vector3<f32>,
    pub world_from_camera: Matrix3<f32>,
    /// Columns and rows of samples.
    pub width: usize,
    pub height: usize,
    /// Samples per unit of tangent.
    pub focal: f32,
}

impl Eye {
    pub fn new(camera: &Camera) -> Self {
        let pose = &camera.world_from_camera;
        let height = camera.height as usize * SAMPLES;
        Self {
            position: pose.translation.vector,
            world_from_camera: *pose.rotation.to_rotation_matrix().matrix(),
            width: camera.width as usize * SAMPLES,
            height,
            focal: 0.5 * height as f32 / slope(0.5 * camera.vertical_fov_rad),
        }
    }

    /// Leftward slope of the ray through a column coordinate (sample `i` is centred at `i + 0.5`).
    #[inline]
    pub fn slope_left(&self, column: f32) -> f32 {
        (0.5 * self.width as f32 - column) / self.focal
    }

    /// Upward slope of the ray through a row coordinate.
    #[inline]
    pub fn slope_up(&self, row: f32) -> f32 {
        (0.5 * self.height as f32 - row) / self.focal
    }
}

/// The tangent, rounded from double precision. The last bit of a single one depends on whether the
/// compiler or the C library works it out, and pixels at edges depend on that bit.
fn slope(angle_rad: f32) -> f32 {
    f64::from(angle_rad).tan() as f32
}

/// A visual with everything that is the same for all of its samples.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    pub shape: Shape,
    pub material: Material,
    pub center: Vector3<f32>,
    /// Columns are the local axes in the world.
    pub world_from_local: Matrix3<f32>,
    pub local_from_camera: Matrix3<f32>,
    /// The camera's position in the local frame.
    pub eye: Vector3<f32>,
    /// Towards the sun in the local frame.
    pub sun: Vector3<f32>,
    /// Where the pattern starts, so that two boards from one tree differ.
    pub pattern_offset: [f32; 2],
}

impl Solid {
    pub fn new(visual: &Visual, eye: &Eye, lighting: &Lighting) -> Self {
        let pose = &visual.world_from_shape;
        let world_from_local = *pose.rotation.to_rotation_matrix().matrix();
        let local_from_world = world_from_local.transpose();
        let center = pose.translation.vector;
        Self {
            shape: visual.shape,
            material: visual.material,
            center,
            world_from_local,
            local_from_camera: local_from_world * eye.world_from_camera,
            eye: local_from_world * (eye.position - center),
            sun: local_from_world * Vector3::from(lighting.sun_direction),
            pattern_offset: pattern_offset(visual),
        }
    }

    /// Half of the sides of the tightest box along the local axes.
    #[inline]
    pub fn half_extents(&self) -> Vector3<f32> {
        match self.shape {
            Shape::Box { half_extents } => Vector3::from(half_extents),
            Shape::Cylinder {
                radius,
                half_height,
            } => Vector3::new(radius, radius, half_height),
            Shape::Sphere { radius } => Vector3::repeat(radius),
        }
    }

    /// How far the solid reaches from its centre along a unit direction of the local frame.
    pub fn reach(&self, local: &Vector3<f32>) -> f32 {
        match self.shape {
            Shape::Box { half_extents } => Vector3::from(half_extents).dot(&local.abs()),
            Shape::Cylinder {
                radius,
                half_height,
            } => radius * local.x.hypot(local.y) + half_height * local.z.abs(),
            Shape::Sphere { radius } => radius,
        }
    }

    /// Floor boards, painted walls and pictures on them let the sun through; all else stops it.
    pub fn casts_shadow(&self) -> bool {
        !matches!(
            self.material.texture,
            Texture::Floor | Texture::Plaster | Texture::Picture
        )
    }

    /// Distance from the origin of a ray, in units of `direction`, to where it enters the solid, and
    /// the surface that it enters through; `None` when it misses or starts inside or behind.
    #[inline]
    pub fn entry(&self, origin: &Vector3<f32>, direction: &Vector3<f32>) -> Option<(f32, Surface)> {
        match self.shape {
            Shape::Box { half_extents } => box_entry(half_extents, origin, direction),
            Shape::Cylinder {
                radius,
                half_height,
            } => cylinder_entry(radius, half_height, origin, direction),
            Shape::Sphere { radius } => sphere_entry(radius, origin, direction),
        }
    }

    /// The outward normal at a point of a surface, both in the local frame.
    #[inline]
    pub fn normal(&self, surface: Surface, point: &Vector3<f32>) -> Vector3<f32> {
        match surface {
            Surface::Face { axis, positive } => {
                let mut normal = Vector3::zeros();
                normal[axis] = if positive { 1.0 } else { -1.0 };
                normal
            }
            Surface::Round => match self.shape {
                Shape::Cylinder { .. } => Vector3::new(point.x, point.y, 0.0).normalize(),
                _ => point.normalize(),
            },
        }
    }
}

/// One smooth part of a solid's skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Surface {
    /// The plane face across an axis (0, 1 or 2) of the local frame.
    Face { axis: usize, positive: bool },
    /// The side of a cylinder or a whole sphere.
    Round,
}

impl Surface {
    /// A number below 8.
    pub fn code(self) -> u32 {
        match self {
            Self::Face { axis, positive } => 2 * axis as u32 + u32::from(positive),
            Self::Round => 6,
        }
    }

    #[inline]
    pub fn from_code(code: u32) -> Self {
        match code {
            0..=5 => Self::Face {
                axis: (code / 2) as usize,
                positive: code % 2 == 1,
            },
            _ => Self::Round,
        }
    }
}

fn box_entry(
    half_extents: [f32; 3],
    origin: &Vector3<f32>,
    direction: &Vector3<f32>,
) -> Option<(f32, Surface)> {
    let (mut enter, mut leave, mut across) = (f32::NEG_INFINITY, f32::INFINITY, 0);
    for axis in 0..3 {
        let inverse = 1.0 / direction[axis];
        let reach = half_extents[axis] * inverse.abs();
        let middle = -origin[axis] * inverse;
        if middle - reach > enter {
            (enter, across) = (middle - reach, axis);
        }
        leave = leave.min(middle + reach);
    }
    let surface = Surface::Face {
        axis: across,
        positive: direction[across] < 0.0,
    };
    (enter > 0.0 && enter < leave).then_some((enter, surface))
}

fn cylinder_entry(
    radius: f32,
    half_height: f32,
    origin: &Vector3<f32>,
    direction: &Vector3<f32>,
) -> Option<(f32, Surface)> {
    let a = direction.x * direction.x + direction.y * direction.y;
    let b = origin.x * direction.x + origin.y * direction.y;
    let c = origin.x * origin.x + origin.y * origin.y - radius * radius;
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return None;
    }
    let side = (-b - discriminant.sqrt()) / a;
    if side > 0.0 && (origin.z + side * direction.z).abs() <= half_height {
        return Some((side, Surface::Round));
    }
    let positive = direction.z < 0.0;
    let cap = if positive { half_height } else { -half_height };
    let distance = (cap - origin.z) / direction.z;
    let crossing = origin.xy() + direction.xy() * distance;
    let surface = Surface::Face { axis: 2, positive };
    (distance > 0.0 && crossing.norm_squared() <= radius * radius).then_some((distance, surface))
}

fn sphere_entry(
    radius: f32,
    origin: &Vector3<f32>,
    direction: &Vector3<f32>,
) -> Option<(f32, Surface)> {
    let a = direction.norm_squared();
    let b = origin.dot(direction);
    let discriminant = b * b - a * (origin.norm_squared() - radius * radius);
    if discriminant < 0.0 {
        return None;
    }
    let distance = (-b - discriminant.sqrt()) / a;
    (distance > 0.0).then_some((distance, Surface::Round))
}

/// Depends on what does not move: the form and the colour.
fn pattern_offset(visual: &Visual) -> [f32; 2] {
    let fitted = matches!(visual.material.texture, Texture::Label | Texture::Picture);
    let Shape::Box { half_extents } = visual.shape else {
        return [0.0; 2];
    };
    if fitted {
        return [0.0; 2];
    }
    let mut hash = 0x9e37_79b9_u32;
    for value in half_extents.into_iter().chain(visual.material.tint) {
        hash = (hash ^ value.to_bits()).wrapping_mul(0x85eb_ca6b);
        hash ^= hash >> 15;
    }
    [
        (hash & 0xffff) as f32 / 65536.0,
        (hash >> 16) as f32 / 65536.0,
    ]
}
