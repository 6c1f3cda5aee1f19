//! The colour of what shows in each pixel.

mod spot;
mod tone;

use nalgebra::Vector3;

use super::occlusion::OcclusionGrid;
use super::raster::Raster;
use super::solid::{Eye, SAMPLES, Solid};
use super::sun::SunGrid;
use super::texture::Pattern;
use super::{Lighting, Texture};
use spot::Spot;

/// Light by direction and source, linear RGB.
const SUN: [f32; 3] = [1.06, 0.95, 0.78];
const SKY: [f32; 3] = [0.46, 0.50, 0.56];
const BOUNCE: [f32; 3] = [0.44, 0.39, 0.33];
const HEADLIGHT: f32 = 0.20;

/// What is seen where there is nothing: a pale ceiling.
const NOTHING: [f32; 3] = [0.66, 0.68, 0.70];

/// A highlight in one sample must not outshine the whole pixel.
const BRIGHTEST: f32 = 2.5;

/// The samples of one pixel that show the same surface, summed.
#[derive(Clone, Copy, Debug, Default)]
struct Patch {
    samples: f32,
    column: f32,
    row: f32,
    inverse_depth: f32,
}

/// Whether the sun reaches the place where a surface, carried on, meets a corner of a pixel.
#[derive(Clone, Copy, Debug)]
struct Corner {
    surface: u32,
    sunny: bool,
}

impl Corner {
    const UNKNOWN: Self = Self {
        surface: Raster::NOTHING,
        sunny: false,
    };
}

/// What neighbours found out about the upper left, upper right and lower left corner of a pixel,
/// and what it finds out about its lower right one.
#[derive(Debug)]
struct Corners {
    known: [Corner; 3],
    lower_right: Corner,
}

/// Turns visibility into colour.
pub(super) struct Shader<'a> {
    solids: &'a [Solid],
    sun: &'a SunGrid,
    occlusion: &'a OcclusionGrid,
    lighting: &'a Lighting,
    eye: &'a Eye,
    towards_sun: Vector3<f32>,
    patterns: Vec<&'static Pattern>,
}

impl<'a> Shader<'a> {
    pub fn new(
        solids: &'a [Solid],
        sun: &'a SunGrid,
        occlusion: &'a OcclusionGrid,
        lighting: &'a Lighting,
        eye: &'a Eye,
    ) -> Self {
        Self {
            solids,
            sun,
            occlusion,
            lighting,
            eye,
            towards_sun: Vector3::from(lighting.sun_direction),
            patterns: solids
                .iter()
                .map(|solid| Pattern::of(solid.material.texture))
                .collect(),
        }
    }

    /// The bytes of the picture, row by row.
    pub fn develop(&self, raster: &Raster) -> Vec<u8> {
        let (width, height) = (self.eye.width / SAMPLES, self.eye.height / SAMPLES);
        let curve = tone::curve();
        let mut rgb = Vec::with_capacity(width * height * 3);
        let mut above = vec![Corner::UNKNOWN; width];
        for row in 0..height {
            let [mut upper_left, mut lower_left] = [Corner::UNKNOWN; 2];
            for (column, above) in above.iter_mut().enumerate() {
                let mut corners = Corners {
                    known: [upper_left, *above, lower_left],
                    lower_right: Corner::UNKNOWN,
                };
                let colour = self.pixel(raster, column, row, &mut corners);
                rgb.extend(colour.map(|light| curve.byte(light)));
                lower_left = corners.lower_right;
                upper_left = std::mem::replace(above, corners.lower_right);
            }
        }
        rgb
    }

    fn pixel(&self, raster: &Raster, column: usize, row: usize, corners: &mut Corners) -> [f32; 3] {
        const COUNT: usize = SAMPLES * SAMPLES;
        let corner = [column, row].map(|at| (at * SAMPLES) as f32 + 0.5);
        if let Some((surface, patch)) = self.whole(raster, column, row) {
            let colour = self.patch(surface, &patch, corner, corners);
            return colour.map(|light| light.min(BRIGHTEST));
        }
        let mut shown = [Raster::NOTHING; COUNT];
        let mut patches = [Patch::default(); COUNT];
        let mut kinds = 0;
        for nth in 0..COUNT {
            let (x, y) = (nth % SAMPLES, nth / SAMPLES);
            let sample = (row * SAMPLES + y) * self.eye.width + column * SAMPLES + x;
            let surface = raster.shown[sample];
            let mut kind = 0;
            while kind < kinds && shown[kind] != surface {
                kind += 1;
            }
            shown[kind] = surface;
            kinds = kinds.max(kind + 1);
            let patch = &mut patches[kind];
            patch.samples += 1.0;
            patch.column += x as f32;
            patch.row += y as f32;
            patch.inverse_depth += raster.inverse_depth[sample];
        }
        let mut sum = [0.0; 3];
        for (&surface, patch) in shown[..kinds].iter().zip(&patches) {
            let colour = self.patch(surface, patch, corner, corners);
            for (sum, light) in sum.iter_mut().zip(colour) {
                *sum += light.min(BRIGHTEST) * patch.samples;
            }
        }
        sum.map(|light| light / COUNT as f32)
    }

    /// The one patch of a pixel whose samples all show the same surface, as most do.
    #[inline]
    fn whole(&self, raster: &Raster, column: usize, row: usize) -> Option<(u32, Patch)> {
        /// Columns, or rows, of all samples of a pixel summed.
        const MIDDLE: usize = SAMPLES * SAMPLES * (SAMPLES - 1) / 2;
        let rows = std::array::from_fn::<_, SAMPLES, _>(|y| {
            let first = (row * SAMPLES + y) * self.eye.width + column * SAMPLES;
            first..first + SAMPLES
        });
        let surface = raster.shown[rows[0].start];
        let mut patch = Patch {
            samples: (SAMPLES * SAMPLES) as f32,
            column: MIDDLE as f32,
            row: MIDDLE as f32,
            inverse_depth: 0.0,
        };
        for samples in rows {
            if raster.shown[samples.clone()]
                .iter()
                .any(|&shown| shown != surface)
            {
                return None;
            }
            for depth in &raster.inverse_depth[samples] {
                patch.inverse_depth += depth;
            }
        }
        Some((surface, patch))
    }

    fn patch(
        &self,
        surface: u32,
        patch: &Patch,
        corner: [f32; 2],
        corners: &mut Corners,
    ) -> [f32; 3] {
        if surface == Raster::NOTHING {
            return NOTHING;
        }
        let share = patch.samples.recip();
        let ray = Vector3::new(
            1.0,
            self.eye.slope_left(corner[0] + patch.column * share),
            self.eye.slope_up(corner[1] + patch.row * share),
        );
        let spot = Spot::new(
            surface,
            &(ray * (patch.samples / patch.inverse_depth)),
            self.solids,
            self.eye,
        );
        let facing = spot.normal.dot(&self.towards_sun).max(0.0);
        let sunny = if facing == 0.0 {
            0.0
        } else if patch.samples >= (SAMPLES * SAMPLES) as f32 {
            let [left, top] = corner.map(|at| at - 0.5 + SAMPLES as f32);
            self.share_of_corners(&spot, surface, [left, top], corners)
        } else {
            f32::from(self.reached(&spot, &spot.point))
        };
        self.light(&spot, sunny * facing, sunny)
    }

    fn light(&self, spot: &Spot, sun: f32, sunny: f32) -> [f32; 3] {
        let material = &spot.solid.material;
        let albedo = self.albedo(spot);
        let up = 0.5 + 0.5 * spot.normal.z;
        let open = self.occlusion.openness(spot.own, &spot.point, &spot.normal);
        let ambient = self.lighting.ambient * open;
        let head = self.lighting.headlight * HEADLIGHT * spot.to_eye.dot(&spot.normal).max(0.0)
            / (1.0 + 0.2 * spot.distance * spot.distance);
        let sun = self.lighting.sun * sun;
        let shine = self.lighting.sun * self.highlight(spot, sunny);
        std::array::from_fn(|channel| {
            let around = BOUNCE[channel] + (SKY[channel] - BOUNCE[channel]) * up;
            let light = ambient * around + SUN[channel] * sun + head + material.emission;
            albedo[channel] * light + SUN[channel] * shine
        })
    }

    fn reached(&self, spot: &Spot, point: &Vector3<f32>) -> bool {
        self.sun.reaches(self.solids, spot.own, point, &spot.normal)
    }

    /// The share of a pixel's corners that the sun reaches. Only the lower right one is looked up;
    /// the others are its neighbours', as far as those show the same surface. This smooths the
    /// edges of shadows for the price of one look-up a pixel.
    fn share_of_corners(
        &self,
        spot: &Spot,
        surface: u32,
        [column, row]: [f32; 2],
        corners: &mut Corners,
    ) -> f32 {
        let ray = self.eye.world_from_camera
            * Vector3::new(1.0, self.eye.slope_left(column), self.eye.slope_up(row));
        let depth = -spot.distance * spot.normal.dot(&spot.to_eye) / spot.normal.dot(&ray);
        // On a surface seen edge on, the corner can be anywhere.
        let near = (0.7..1.4).contains(&(depth * ray.norm() / spot.distance));
        let point = if near {
            self.eye.position + ray * depth
        } else {
            spot.point
        };
        let sunny = self.reached(spot, &point);
        corners.lower_right = Corner { surface, sunny };
        let (mut bright, mut all) = (f32::from(sunny), 1.0);
        for corner in &corners.known {
            if corner.surface == surface {
                bright += f32::from(corner.sunny);
                all += 1.0;
            }
        }
        bright / all
    }

    fn highlight(&self, spot: &Spot, sunny: f32) -> f32 {
        let specular = spot.solid.material.specular * sunny;
        if specular == 0.0 {
            return 0.0;
        }
        let half = (self.towards_sun + spot.to_eye).normalize();
        specular * spot.normal.dot(&half).max(0.0).powi(48)
    }

    fn albedo(&self, spot: &Spot) -> [f32; 3] {
        let material = &spot.solid.material;
        if material.texture == Texture::Plain {
            return material.tint;
        }
        let (u, v, repeats_per_metre) = spot.place();
        let slant = spot.normal.dot(&spot.to_eye).max(0.1);
        let pixel = spot.distance * SAMPLES as f32 / self.eye.focal;
        let footprint = pixel * repeats_per_metre / slant.sqrt();
        self.patterns[spot.own].colour(u, v, footprint, &material.tint)
    }
}
