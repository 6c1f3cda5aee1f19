//! Which solids stand in the way along one direction.

use nalgebra::Vector3;

use super::solid::Solid;

/// Cells along each side of the grid.
const CELLS: usize = 64;

/// Solids sorted into the columns of a square grid that lies across a direction.
///
/// Solids and frames change with every picture, so building has to cost little: one pass that
/// counts and one that files.
#[derive(Debug, Default)]
pub(super) struct ColumnGrid {
    /// Two axes across, then the one along.
    axes: [Vector3<f32>; 3],
    corner: [f32; 2],
    cells_per_metre: [f32; 2],
    /// Where each cell's part of `filed` begins; one more than there are cells.
    starts: Vec<u32>,
    filed: Vec<Bounds>,
    bounds: Vec<Bounds>,
}

/// The bounds of a solid in the axes of the grid: two across, the last along.
#[derive(Clone, Copy, Debug, Default)]
struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
    solid: u32,
}

impl Bounds {
    #[inline]
    fn holds(&self, axis: usize, at: f32) -> bool {
        self.low[axis] <= at && at <= self.high[axis]
    }
}

impl ColumnGrid {
    /// Files the solids that `wanted` picks, grown by `margin` metres, along a unit direction.
    pub fn rebuild(
        &mut self,
        solids: &[Solid],
        along: Vector3<f32>,
        margin: f32,
        wanted: impl Fn(&Solid) -> bool,
    ) {
        let helper = if along.x.abs() < 0.6 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let right = along.cross(&helper).normalize();
        self.axes = [right, along.cross(&right), along];
        self.bounds.clear();
        for (index, solid) in solids.iter().enumerate().filter(|(_, solid)| wanted(solid)) {
            let bounds = self.bounds(index as u32, solid, margin);
            self.bounds.push(bounds);
        }
        // A cell lists what reaches highest first, so that a look-up can stop early.
        self.bounds.sort_by(|a, b| b.high[2].total_cmp(&a.high[2]));
        self.fit();
        self.file();
    }

    /// The solids whose bounds hold the point or lie beyond it along the direction of the grid.
    #[inline]
    pub fn beyond(&self, point: &Vector3<f32>) -> impl Iterator<Item = usize> {
        let at = self.axes.map(|axis| axis.dot(point));
        self.cell(&at)
            .iter()
            .take_while(move |bounds| bounds.high[2] > at[2])
            .filter(move |bounds| (0..2).all(|axis| bounds.holds(axis, at[axis])))
            .map(|bounds| bounds.solid as usize)
    }

    /// The solids that may hold the point within their bounds: those whose bounds do, and others
    /// of the same cell.
    #[inline]
    pub fn around(&self, point: &Vector3<f32>) -> impl Iterator<Item = usize> {
        let at = self.axes.map(|axis| axis.dot(point));
        self.cell(&at)
            .iter()
            .take_while(move |bounds| bounds.high[2] > at[2])
            .filter(move |bounds| bounds.low[2] <= at[2])
            .map(|bounds| bounds.solid as usize)
    }

    #[inline]
    fn cell(&self, at: &[f32; 3]) -> &[Bounds] {
        let [column, row] =
            [0, 1].map(|side| (at[side] - self.corner[side]) * self.cells_per_metre[side]);
        let inside = 0.0..CELLS as f32;
        if !inside.contains(&column) || !inside.contains(&row) || self.bounds.is_empty() {
            return &[];
        }
        let cell = row as usize * CELLS + column as usize;
        &self.filed[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    fn bounds(&self, index: u32, solid: &Solid, margin: f32) -> Bounds {
        let middle = self.axes.map(|axis| axis.dot(&solid.center));
        let half = self.axes.map(|axis| {
            let local = solid.world_from_local.tr_mul(&axis);
            solid.reach(&local) + margin
        });
        Bounds {
            low: std::array::from_fn(|axis| middle[axis] - half[axis]),
            high: std::array::from_fn(|axis| middle[axis] + half[axis]),
            solid: index,
        }
    }

    /// Lays the grid over everything.
    fn fit(&mut self) {
        for side in 0..2 {
            let ends = self.bounds.iter();
            let (low, high) = ends.fold((f32::MAX, f32::MIN), |(low, high), bounds| {
                (low.min(bounds.low[side]), high.max(bounds.high[side]))
            });
            self.corner[side] = low;
            self.cells_per_metre[side] = CELLS as f32 / (high - low).max(1e-3);
        }
    }

    fn file(&mut self) {
        self.starts.clear();
        self.starts.resize(CELLS * CELLS + 1, 0);
        for bounds in &self.bounds {
            for cell in self.cells(bounds) {
                self.starts[cell + 1] += 1;
            }
        }
        for cell in 0..CELLS * CELLS {
            self.starts[cell + 1] += self.starts[cell];
        }
        let filed = self.starts[CELLS * CELLS] as usize;
        self.filed.clear();
        self.filed.resize(filed, Bounds::default());
        // Filing from the last to the first leaves every start where its cell begins.
        for bounds in self.bounds.iter().rev() {
            for cell in self.cells(bounds) {
                self.starts[cell + 1] -= 1;
                self.filed[self.starts[cell + 1] as usize] = *bounds;
            }
        }
        self.starts.rotate_left(1);
        self.starts[CELLS * CELLS] = filed as u32;
    }

    fn cells(&self, bounds: &Bounds) -> impl Iterator<Item = usize> + use<> {
        let [columns, rows] = [0, 1].map(|side| {
            let cell = |at: f32| {
                let cell = ((at - self.corner[side]) * self.cells_per_metre[side]) as usize;
                cell.min(CELLS - 1)
            };
            cell(bounds.low[side])..cell(bounds.high[side]) + 1
        });
        rows.flat_map(move |row| columns.clone().map(move |column| row * CELLS + column))
    }
}
