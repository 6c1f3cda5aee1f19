//! Where the sun does not reach.

use nalgebra::Vector3;

use super::Lighting;
use super::grid::ColumnGrid;
use super::solid::Solid;

/// Lifts a shadow ray off its surface, so that what stands on it does not shade it from below.
const LIFT_M: f32 = 5e-4;

/// Finds hard sun shadows: a grid across the sun's direction names the few solids that a ray may
/// meet, and those are intersected exactly.
#[derive(Debug, Default)]
pub(super) struct SunGrid {
    grid: ColumnGrid,
}

impl SunGrid {
    /// Takes in the solids of a new picture.
    pub fn rebuild(&mut self, solids: &[Solid], lighting: &Lighting) {
        let towards = Vector3::from(lighting.sun_direction);
        self.grid.rebuild(solids, towards, 0.0, Solid::casts_shadow);
    }

    /// Whether the sun reaches a point of the surface of the solid `own`, which faces the sun. A
    /// convex solid never shades such a point itself.
    #[inline]
    pub fn reaches(
        &self,
        solids: &[Solid],
        own: usize,
        point: &Vector3<f32>,
        normal: &Vector3<f32>,
    ) -> bool {
        let point = point + normal * LIFT_M;
        !self
            .grid
            .beyond(&point)
            .filter(|&other| other != own)
            .any(|other| {
                let solid = &solids[other];
                let origin = solid.world_from_local.tr_mul(&(point - solid.center));
                solid.entry(&origin, &solid.sun).is_some()
            })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::SunGrid;
    use crate::simulator::render::solid::{Eye, Solid};
    use crate::simulator::render::{Camera, Lighting, Material, Shape, Texture, Visual};

    /// Numbers in -1..=1 that look as if drawn.
    pub fn spread(nth: usize, seed: f32) -> f32 {
        (nth as f32 * seed).sin()
    }

    pub fn clutter() -> Vec<Solid> {
        let eye = Eye::new(&Camera {
            world_from_camera: Isometry3::identity(),
            vertical_fov_rad: 1.0,
            height: 4,
            width: 4,
        });
        let shapes = [
            Shape::Box {
                half_extents: [0.3, 0.05, 0.1],
            },
            Shape::Cylinder {
                radius: 0.1,
                half_height: 0.3,
            },
            Shape::Sphere { radius: 0.15 },
        ];
        let visual = |nth: usize| Visual {
            shape: shapes[nth % 3],
            world_from_shape: Isometry3::new(
                Vector3::new(spread(nth, 1.7), spread(nth, 2.9), spread(nth, 4.3)) * 2.0,
                Vector3::new(spread(nth, 5.1), spread(nth, 6.7), spread(nth, 7.9)) * 2.0,
            ),
            material: Material {
                texture: Texture::Plain,
                tint: [0.5; 3],
                scale: 1.0,
                specular: 0.0,
                emission: 0.0,
            },
        };
        let lighting = Lighting::default();
        (0..120)
            .map(|nth| Solid::new(&visual(nth), &eye, &lighting))
            .collect()
    }

    #[test]
    fn the_grid_finds_every_shadow_that_a_search_through_all_solids_finds() {
        let (solids, lighting) = (clutter(), Lighting::default());
        let mut grid = SunGrid::default();
        grid.rebuild(&solids, &lighting);
        let towards = Vector3::from(lighting.sun_direction);
        let mut dark = 0;
        for nth in 0..4000 {
            let point = Vector3::new(spread(nth, 3.1), spread(nth, 8.3), spread(nth, 9.7)) * 2.5;
            let blocked = solids.iter().skip(1).any(|solid| {
                let turned = solid.world_from_local.transpose();
                let lifted = point + Vector3::z() * super::LIFT_M;
                let origin = turned * (lifted - solid.center);
                solid.entry(&origin, &(turned * towards)).is_some()
            });
            dark += usize::from(blocked);
            let reached = grid.reaches(&solids, 0, &point, &Vector3::z());
            assert_eq!(reached, !blocked, "at {point:?}");
        }
        assert!((400..3600).contains(&dark), "{dark} points are informative");
    }

    #[test]
    fn nothing_is_dark_where_there_is_nothing() {
        let mut grid = SunGrid::default();
        grid.rebuild(&[], &Lighting::default());
        assert!(grid.reaches(&[], 0, &Vector3::zeros(), &Vector3::z()));
    }
}
