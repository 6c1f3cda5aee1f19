use nalgebra::{Point3, Vector3};

use super::Approach;
use crate::model::{GraspSight, Landmark};

/// Probability of holding nothing from which a closing is in doubt ...
const EMPTY: f64 = 0.7;
/// ... and looks in a row after which it is taken to have missed.
const EMPTY_LOOKS: usize = 2;
/// Share of the fingers' direction from which they point along an axis.
const ALONG: f32 = 0.5;

/// Closings that held nothing, or are seen as if they did.
impl Approach {
    /// What is seen of the gripper now: one that lifts nothing on its way from a closing tries again at once, while what
    /// slipped lies where it did. A handle that is pulled lies between fingers that are all but closed, as nothing does.
    pub(in crate::rollout) fn feel(&mut self, sight: GraspSight) {
        if self.departure.is_empty() || !self.is_closed || !self.is_lifting {
            return;
        }
        self.empty_looks = if sight.empty >= EMPTY {
            self.empty_looks + 1
        } else {
            0
        };
        if self.empty_looks >= EMPTY_LOOKS {
            self.misses += 1;
            self.let_go();
        }
    }

    /// Whether demonstrations lift what they take at a closing.
    pub(super) fn lifts(&self, number: usize) -> bool {
        let up = self.keys.axes[2][1].map(|(class, _)| class);
        up.is_some_and(|up| self.shown.departure(number).contains(&up))
    }

    /// A gripper that holds nothing is opened next.
    pub(in crate::rollout) fn let_go(&mut self) {
        let opens = self.keys.open.filter(|_| self.is_closed);
        (self.closing, self.departure) = (None, opens.into_iter().collect());
    }

    /// Where a gripper that missed before closes instead: a step nearer, then a step farther. From above, what lies too
    /// far back between the fingers is held badly; from before, what they only just reach.
    pub(super) fn tried(&self, landmark: &Landmark, place: &Point3<f32>) -> Point3<f32> {
        let step = self.keys.axes[0][0].map_or(0.0, |(_, step)| step);
        let first = if landmark.approach[0] > ALONG {
            step
        } else {
            -step
        };
        let by = match self.misses % 3 {
            0 => 0.0,
            1 => first,
            _ => -first,
        };
        place + Vector3::new(by, 0.0, 0.0)
    }
}
