//! How much of the light from all around is kept off by what is near.

use nalgebra::{Matrix3, Vector3};

use super::Shape;
use super::grid::ColumnGrid;
use super::solid::Solid;

/// Solids farther away than this keep no light off.
const REACH_M: f32 = 0.22;

/// The share of the light that is left in the deepest corner.
const FLOOR: f32 = 0.40;

/// Finds the distance from points in front of a surface to the nearest solids. A third of the time
/// that a picture takes goes here, so every evaluation counts.
#[derive(Debug, Default)]
pub(super) struct OcclusionGrid {
    grid: ColumnGrid,
    occluders: Vec<Occluder>,
}

impl OcclusionGrid {
    /// Takes in the solids of a new picture.
    pub fn rebuild(&mut self, solids: &[Solid]) {
        self.grid.rebuild(solids, Vector3::z(), REACH_M, |_| true);
        self.occluders.clear();
        self.occluders.extend(solids.iter().map(Occluder::new));
    }

    /// The share, 0..=1, of the light from all around that reaches a point of the solid `own`.
    #[inline]
    pub fn openness(&self, own: usize, point: &Vector3<f32>, normal: &Vector3<f32>) -> f32 {
        let probe = point + normal * REACH_M;
        let mut open = 1.0;
        for other in self.grid.around(&probe).filter(|&other| other != own) {
            let squared = self.occluders[other].squared_distance(&probe);
            if squared >= REACH_M * REACH_M {
                continue;
            }
            let share = squared.sqrt() / REACH_M;
            open *= FLOOR + (1.0 - FLOOR) * share * (2.0 - share);
            if open <= FLOOR {
                return FLOOR;
            }
        }
        open
    }
}

/// What the distance to a solid takes, close together in memory.
#[derive(Debug)]
struct Occluder {
    shape: Shape,
    center: Vector3<f32>,
    /// `None` where the axes are the world's, as those of most furniture are.
    world_from_local: Option<Matrix3<f32>>,
}

impl Occluder {
    fn new(solid: &Solid) -> Self {
        let turned = solid.world_from_local != Matrix3::identity();
        Self {
            shape: solid.shape,
            center: solid.center,
            world_from_local: turned.then_some(solid.world_from_local),
        }
    }

    /// The square of the distance from a point of the world to the solid, m²; 0 inside.
    #[inline]
    fn squared_distance(&self, point: &Vector3<f32>) -> f32 {
        let away = point - self.center;
        let local = match &self.world_from_local {
            Some(world_from_local) => world_from_local.tr_mul(&away),
            None => away,
        };
        let square = |beyond: f32| if beyond > 0.0 { beyond * beyond } else { 0.0 };
        match self.shape {
            Shape::Box {
                half_extents: [x, y, z],
            } => square(local.x.abs() - x) + square(local.y.abs() - y) + square(local.z.abs() - z),
            Shape::Cylinder {
                radius,
                half_height,
            } => {
                square(hypotenuse(local.x, local.y) - radius) + square(local.z.abs() - half_height)
            }
            Shape::Sphere { radius } => square(local.norm() - radius),
        }
    }
}

/// As exact as `f32::hypot`, which is a call.
fn hypotenuse(x: f32, y: f32) -> f32 {
    let (x, y) = (f64::from(x), f64::from(y));
    (x * x + y * y).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::{Occluder, OcclusionGrid, REACH_M};
    use crate::simulator::render::sun::tests::{clutter, spread};

    fn point(nth: usize) -> Vector3<f32> {
        Vector3::new(spread(nth, 3.1), spread(nth, 8.3), spread(nth, 9.7)) * 2.2
    }

    #[test]
    fn the_grid_misses_nothing_that_keeps_light_off() {
        let solids = clutter();
        let mut grid = OcclusionGrid::default();
        grid.rebuild(&solids);
        let occluders: Vec<Occluder> = solids.iter().map(Occluder::new).collect();
        let mut dim = 0;
        for nth in 0..4000 {
            let (point, normal) = (point(nth), Vector3::z());
            let probe = point + normal * REACH_M;
            let near = occluders.iter().skip(1).any(|occluder| {
                // A hair within reach, where rounding cannot decide.
                occluder.squared_distance(&probe) < REACH_M * REACH_M * 0.999
            });
            let open = grid.openness(0, &point, &normal);
            assert!(!near || open < 1.0, "at {point:?}");
            dim += usize::from(near);
        }
        assert!((400..3600).contains(&dim), "{dim} points are informative");
    }

    /// Walks towards the centre until inside: no step is longer than the distance says.
    #[test]
    fn no_point_is_nearer_to_the_skin_than_its_distance() {
        for solid in clutter() {
            let occluder = Occluder::new(&solid);
            for nth in 0..50 {
                let point = point(nth);
                let distance = occluder.squared_distance(&point).sqrt();
                let inward = (solid.center - point).normalize();
                let just_before = point + inward * distance * 0.99;
                assert!(distance == 0.0 || occluder.squared_distance(&just_before) > 0.0);
                assert_eq!(occluder.squared_distance(&solid.center), 0.0);
            }
        }
    }

    #[test]
    fn a_solid_that_turns_with_the_point_stays_as_far() {
        let turn = Rotation3::new(Vector3::new(0.4, -1.1, 0.7));
        for (nth, solid) in clutter().iter().enumerate() {
            let upright = Occluder {
                world_from_local: None,
                ..Occluder::new(solid)
            };
            let turned = Occluder {
                world_from_local: Some(*turn.matrix()),
                ..Occluder::new(solid)
            };
            let away = point(nth) - solid.center;
            let distances = [
                upright.squared_distance(&(solid.center + away)).sqrt(),
                turned
                    .squared_distance(&(solid.center + turn * away))
                    .sqrt(),
            ];
            assert!((distances[0] - distances[1]).abs() < 1e-5, "{distances:?}");
        }
    }
}
