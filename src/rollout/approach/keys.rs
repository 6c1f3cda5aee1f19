use nalgebra::Vector3;

use crate::model::LandmarkBook;
use crate::task::GripperSignal;
use crate::trajectory::ActionSpace;

/// The primitives that move the gripper, by what they move.
#[derive(Clone, Debug)]
pub(super) struct Keys {
    pub(super) names: Vec<String>,
    /// For each axis the class that moves against it and the one that moves along it, and by how much.
    pub(super) axes: [[Option<(usize, f32)>; 2]; 3],
    /// Tilt up, tilt down.
    pub(super) tilts: [Option<(usize, f32)>; 2],
    /// The base back, the base ahead.
    pub(super) drives: [Option<(usize, f32)>; 2],
    /// The base to the right, the base to the left.
    pub(super) turns: [Option<usize>; 2],
    pub(super) close: Option<usize>,
    pub(super) open: Option<usize>,
}

impl Keys {
    pub(super) fn of(book: &LandmarkBook, space: &ActionSpace) -> Option<Self> {
        let ActionSpace::Primitives { names } = space else {
            return None;
        };
        let mut keys = Self {
            names: names.clone(),
            axes: [[None; 2]; 3],
            tilts: [None; 2],
            drives: [None; 2],
            turns: [None; 2],
            close: None,
            open: None,
        };
        if let [close, open] = GripperSignal::default().classes(space)[..] {
            (keys.close, keys.open) = (Some(close), Some(open));
        }
        for (class, name) in names.iter().enumerate() {
            let Some(moved) = book.robot.primitives.get(name) else {
                continue;
            };
            if moved.drive_m != 0.0 && moved.turn_rad == 0.0 {
                let ahead = usize::from(moved.drive_m > 0.0);
                keys.drives[ahead] = Some((class, moved.drive_m.abs()));
            }
            if moved.turn_rad != 0.0 && moved.drive_m == 0.0 {
                keys.turns[usize::from(moved.turn_rad > 0.0)] = Some(class);
            }
            if moved.drive_m != 0.0 || moved.turn_rad != 0.0 {
                continue;
            }
            for (axis, by) in moved.gripper_m.into_iter().enumerate() {
                if by != 0.0 {
                    keys.axes[axis][usize::from(by > 0.0)] = Some((class, by.abs()));
                }
            }
            let by = moved.gripper_tilt_rad;
            if by != 0.0 {
                keys.tilts[usize::from(by > 0.0)] = Some((class, by.abs()));
            }
        }
        Some(keys)
    }

    /// How much the heights of a place differ, given those of the gripper there: what is less than a step of the arm
    /// says nothing of the place.
    pub(super) fn height_spread_m(&self, of_gripper_m: f32) -> f32 {
        let step = self.axes[2][1].map_or(0.0, |(_, step)| step);
        (of_gripper_m * of_gripper_m - step * step).max(0.0).sqrt()
    }

    /// The class that goes on along the main axis of a direction and the one that goes back, and by how much.
    pub(super) fn along(&self, direction: &Vector3<f32>) -> [Option<(usize, f32)>; 2] {
        let main = direction.iamax();
        [direction[main] > 0.0, direction[main] < 0.0]
            .map(|positive| self.axes[main][usize::from(positive)])
    }

    /// Whether a class moves the base.
    pub(super) fn is_of_base(&self, class: usize) -> bool {
        let drives = self.drives.iter().flatten().map(|(class, _)| class);
        drives
            .chain(self.turns.iter().flatten())
            .any(|c| *c == class)
    }

    /// Whether a class moves the arm or the gripper.
    pub(super) fn is_of_arm(&self, class: usize) -> bool {
        let axes = self.axes.iter().chain([&self.tilts]).flatten().flatten();
        axes.map(|(class, _)| *class)
            .chain(self.close)
            .chain(self.open)
            .any(|c| c == class)
    }
}
