//! Which surface each sample of a picture shows, and how far away it is.

use std::ops::Range;

use nalgebra::Vector3;

use super::Shape;
use super::solid::{Eye, Solid, Surface};

/// Nearer than this, along the viewing direction, nothing is drawn.
const NEAR_M: f32 = 0.01;

/// A depth buffer of samples that also says which surface is nearest.
#[derive(Debug, Default)]
pub(super) struct Raster {
    /// 1 / distance along the viewing direction; 0 where nothing shows.
    pub inverse_depth: Vec<f32>,
    /// `solid * 8 + surface code`, or [`Raster::NOTHING`].
    pub shown: Vec<u32>,
    /// The part of each row that the polygon at hand covers.
    spans: Vec<[f32; 2]>,
}

impl Raster {
    pub const NOTHING: u32 = u32::MAX;

    /// Draws all solids into a fresh buffer.
    pub fn draw(&mut self, solids: &[Solid], eye: &Eye) {
        let samples = eye.width * eye.height;
        self.inverse_depth.clear();
        self.inverse_depth.resize(samples, 0.0);
        self.shown.clear();
        self.shown.resize(samples, Self::NOTHING);
        self.spans.resize(eye.height, [0.0; 2]);
        for (index, solid) in solids.iter().enumerate() {
            let code = index as u32 * 8;
            match solid.shape {
                Shape::Box { .. } => self.draw_box(solid, code, eye),
                Shape::Cylinder { .. } | Shape::Sphere { .. } => self.draw_round(solid, code, eye),
            }
        }
    }

    fn draw_box(&mut self, solid: &Solid, code: u32, eye: &Eye) {
        for (axis, positive) in FACES {
            let height = facing(solid, axis, positive);
            if height <= 0.0 {
                continue;
            }
            let rows = self.cover(&corners(solid, axis, positive), eye);
            let sign = if positive { 1.0 } else { -1.0 };
            // The face is where normal . point = -height, for a point seen from the camera.
            let normal = solid.local_from_camera.row(axis) * (-sign / height);
            let surface = Surface::Face { axis, positive };
            let code = code + surface.code();
            for row in rows {
                let columns = self.columns(row, eye);
                let start = normal.x
                    + normal.y * eye.slope_left(columns.start as f32 + 0.5)
                    + normal.z * eye.slope_up(row as f32 + 0.5);
                let step = -normal.y / eye.focal;
                let samples = row * eye.width + columns.start..row * eye.width + columns.end;
                let depths = &mut self.inverse_depth[samples.clone()];
                let shown = &mut self.shown[samples];
                for (nth, (depth, shown)) in depths.iter_mut().zip(shown).enumerate() {
                    let here = start + step * nth as f32;
                    if here > *depth {
                        (*depth, *shown) = (here, code);
                    }
                }
            }
        }
    }

    /// Draws through the far faces of the bounding box: a ray that meets the solid leaves by
    /// exactly one of them, wherever the camera stands.
    fn draw_round(&mut self, solid: &Solid, code: u32, eye: &Eye) {
        let [forward, left, up] = [0, 1, 2].map(|axis| solid.local_from_camera.column(axis));
        for (axis, positive) in FACES {
            if facing(solid, axis, positive) > 0.0 {
                continue;
            }
            for row in self.cover(&corners(solid, axis, positive), eye) {
                let middle = forward + up * eye.slope_up(row as f32 + 0.5);
                for column in self.columns(row, eye) {
                    let ray = middle + left * eye.slope_left(column as f32 + 0.5);
                    let Some((depth, surface)) = solid.entry(&solid.eye, &ray) else {
                        continue;
                    };
                    let here = depth.recip();
                    let sample = row * eye.width + column;
                    if depth >= NEAR_M && here > self.inverse_depth[sample] {
                        self.inverse_depth[sample] = here;
                        self.shown[sample] = code + surface.code();
                    }
                }
            }
        }
    }

    /// Finds the span of samples in each row that a convex quadrilateral, given in camera
    /// coordinates, covers, and returns the rows. Shared edges leave no gap and no overlap.
    fn cover(&mut self, corners: &[Vector3<f32>; 4], eye: &Eye) -> Range<usize> {
        let mut outline = [[0.0; 2]; 5];
        let points = clip(corners, &mut outline, eye);
        let outline = &outline[..points];
        let (top, bottom) = outline
            .iter()
            .fold((f32::MAX, f32::MIN), |(top, bottom), at| {
                (top.min(at[1]), bottom.max(at[1]))
            });
        let rows = whole(top, bottom, eye.height);
        self.spans[rows.clone()].fill([f32::MAX, f32::MIN]);
        for (nth, &from) in outline.iter().enumerate() {
            let to = outline[(nth + 1) % points];
            // Always from top to bottom, so that neighbours compute the same crossings.
            let (from, to) = if from[1] <= to[1] {
                (from, to)
            } else {
                (to, from)
            };
            let slope = (to[0] - from[0]) / (to[1] - from[1]);
            for row in whole(from[1], to[1], eye.height) {
                let column = from[0] + (row as f32 + 0.5 - from[1]) * slope;
                let [left, right] = &mut self.spans[row];
                (*left, *right) = (left.min(column), right.max(column));
            }
        }
        rows
    }

    fn columns(&self, row: usize, eye: &Eye) -> Range<usize> {
        let [left, right] = self.spans[row];
        whole(left, right, eye.width)
    }
}

const FACES: [(usize, bool); 6] = [
    (0, false),
    (0, true),
    (1, false),
    (1, true),
    (2, false),
    (2, true),
];

/// How far the camera stands in front of a face of the bounding box; negative when behind.
fn facing(solid: &Solid, axis: usize, positive: bool) -> f32 {
    let side = if positive {
        solid.eye[axis]
    } else {
        -solid.eye[axis]
    };
    side - solid.half_extents()[axis]
}

/// The corners of a face of the bounding box, in turn, in camera coordinates.
fn corners(solid: &Solid, axis: usize, positive: bool) -> [Vector3<f32>; 4] {
    let half = solid.half_extents();
    let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
        let mut corner = Vector3::zeros();
        corner[axis] = if positive { half[axis] } else { -half[axis] };
        corner[across] = a * half[across];
        corner[along] = b * half[along];
        solid.local_from_camera.tr_mul(&(corner - solid.eye))
    })
}

/// Cuts off what lies before the near plane and projects the rest to sample coordinates.
fn clip(corners: &[Vector3<f32>; 4], outline: &mut [[f32; 2]; 5], eye: &Eye) -> usize {
    let mut points = 0;
    let mut project = |point: Vector3<f32>| {
        outline[points] = [
            0.5 * eye.width as f32 - eye.focal * point.y / point.x,
            0.5 * eye.height as f32 - eye.focal * point.z / point.x,
        ];
        points += 1;
    };
    for (nth, from) in corners.iter().enumerate() {
        let to = &corners[(nth + 1) % 4];
        if from.x >= NEAR_M {
            project(*from);
        }
        if (from.x >= NEAR_M) != (to.x >= NEAR_M) {
            let mut crossing = from + (to - from) * ((NEAR_M - from.x) / (to.x - from.x));
            crossing.x = NEAR_M;
            project(crossing);
        }
    }
    points
}

/// The whole numbers whose centres lie between two coordinates, within `0..limit`.
fn whole(from: f32, to: f32, limit: usize) -> Range<usize> {
    let limit = limit as f32;
    let start = (from.clamp(0.0, limit) + 0.5) as usize;
    let end = (to.clamp(0.0, limit) + 0.5) as usize;
    start..end.max(start)
}
