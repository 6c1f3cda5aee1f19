//! How much of the light from all around is kept off by what is near.

use nalgebra::Vector3;

use super::grid::ColumnGrid;
use super::solid::Solid;

/// Solids farther away than this keep no light off.
const REACH_M: f32 = 0.22;

/// The share of the light that is left in the deepest corner.
const FLOOR: f32 = 0.40;

/// Finds the distance from points in front of a surface to the nearest solids.
#[derive(Debug, Default)]
pub(super) struct OcclusionGrid {
    grid: ColumnGrid,
}

impl OcclusionGrid {
    /// Takes in the solids of a new picture.
    pub fn rebuild(&mut self, solids: &[Solid]) {
        self.grid.rebuild(solids, Vector3::z(), REACH_M, |_| true);
    }

    /// The share, 0..=1, of the light from all around that reaches a point of the solid `own`.
    pub fn openness(
        &self,
        solids: &[Solid],
        own: usize,
        point: &Vector3<f32>,
        normal: &Vector3<f32>,
    ) -> f32 {
        let probe = point + normal * REACH_M;
        let mut open = 1.0;
        for other in self.grid.around(&probe).filter(|&other| other != own) {
            let distance = solids[other].distance(&probe);
            if distance < REACH_M {
                let share = (distance / REACH_M).max(0.0);
                open *= FLOOR + (1.0 - FLOOR) * share * (2.0 - share);
            }
        }
        open.max(FLOOR)
    }
}
