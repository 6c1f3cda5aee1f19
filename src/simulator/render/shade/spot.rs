//! Points that are to be shaded.

use nalgebra::Vector3;

use crate::simulator::render::Texture;
use crate::simulator::render::solid::{Eye, Solid, Surface};

/// A point of a surface that is to be shaded.
pub(super) struct Spot<'a> {
    pub own: usize,
    pub solid: &'a Solid,
    surface: Surface,
    local: Vector3<f32>,
    local_normal: Vector3<f32>,
    pub point: Vector3<f32>,
    pub normal: Vector3<f32>,
    pub to_eye: Vector3<f32>,
    pub distance: f32,
}

impl<'a> Spot<'a> {
    /// The point of a surface, by its code in the raster, that lies at `seen` in the frame of the
    /// camera.
    #[inline]
    pub fn new(surface: u32, seen: &Vector3<f32>, solids: &'a [Solid], eye: &Eye) -> Self {
        let own = (surface / 8) as usize;
        let solid = &solids[own];
        let surface = Surface::from_code(surface % 8);
        let local = solid.eye + solid.local_from_camera * seen;
        let local_normal = solid.normal(surface, &local);
        let distance = seen.norm();
        let away = eye.world_from_camera * seen;
        Self {
            own,
            solid,
            surface,
            local,
            local_normal,
            point: eye.position + away,
            normal: solid.world_from_local * local_normal,
            to_eye: away / -distance,
            distance,
        }
    }

    /// Where a spot lies on its pattern, in repeats, and how many repeats a metre has there.
    #[inline]
    pub fn place(&self) -> (f32, f32, f32) {
        let solid = self.solid;
        let scale = solid.material.scale;
        let fitted = matches!(solid.material.texture, Texture::Label | Texture::Picture);
        let wood = solid.material.texture == Texture::Wood;
        let half = solid.half_extents();
        let (across, along, around) = match self.surface {
            Surface::Face { axis, positive } => {
                let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
                // To the right for somebody who stands before the face.
                let right = if positive == (axis == 1) { -1.0 } else { 1.0 };
                let right = if axis == 2 { 1.0 } else { right };
                (
                    (self.local[a] * right, half[a]),
                    (self.local[b], half[b]),
                    None,
                )
            }
            Surface::Round => {
                let angle = self.local_normal.y.atan2(self.local_normal.x);
                let (turn, girth) = (
                    angle / std::f32::consts::TAU,
                    std::f32::consts::TAU * half.x,
                );
                ((0.0, half.x), (self.local.z, half.z), Some((turn, girth)))
            }
        };
        let metric = |(at, half): (f32, f32)| {
            if fitted {
                ((0.5 + 0.5 * at / half) * scale, 0.5 * scale / half)
            } else {
                (at * scale, scale)
            }
        };
        let (v, v_rate) = metric(along);
        let (u, u_rate) = match around {
            // Whole repeats around, or there would be a seam.
            Some((turn, girth)) => {
                let repeats = if fitted { scale } else { girth * scale };
                let repeats = repeats.round().max(1.0);
                (turn * repeats, repeats / girth)
            }
            None => metric(across),
        };
        let upright = wood && along.1 > across.1;
        let (u, v) = if upright { (v, u) } else { (u, v) };
        let [du, dv] = solid.pattern_offset;
        (u + du, v + dv, (u_rate * v_rate).sqrt())
    }
}
