use nalgebra::Point3;

use super::Approach;
use super::ways::REACH_M;
use crate::graph::Node;

/// Weight of all sightings of a place from which it is in sight.
const IN_SIGHT_WEIGHT: f32 = 2.0;
/// How far to one side a place may be, as a share of how far ahead it is, for the base to drive to it without turning.
const AHEAD_SHARE: f32 = 0.3;
/// How far to one side a place may be for the base to turn either way, in metres.
const FACING_M: f32 = 0.1;

/// A thing in the gripper changes the pictures, most where it was taken far to one side, and the robot is believed to be where it is
/// not. Where it sees the place at which it is to lay that thing down, it goes by what it sees.
impl Approach {
    /// The base on its way to where something is to be laid down next, where that is in sight: turned to it, then ahead until the
    /// arm reaches it.
    pub(super) fn drive(&self, goal: &Node, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        let (number, place) = self.in_sight(goal)?;
        let [_, most] = self.book.landmarks[number].reach_m[0];
        let class = if place.y.abs() > AHEAD_SHARE * place.x {
            self.keys.turns[usize::from(place.y > 0.0)]
        } else {
            let ahead = self.keys.drives[1].filter(|_| place.x > most + REACH_M);
            ahead.map(|(class, _)| class)
        };
        class.filter(|class| !is_blocked(*class))
    }

    /// The class that turns the base away from where something is to be laid down next, where that is in sight.
    pub(super) fn turning_away(&self, goal: &Node) -> Option<usize> {
        let (_, place) = self.in_sight(goal)?;
        let away = self.keys.turns[usize::from(place.y < 0.0)];
        away.filter(|_| place.y.abs() > FACING_M)
    }

    /// Whether the place of a landmark at which something is to be laid down is in sight.
    pub(super) fn is_in_sight(&self, number: usize) -> bool {
        self.lays_down_at(number) && self.weight(number) >= IN_SIGHT_WEIGHT
    }

    /// The landmark at which something is to be laid down next, and its place, where that is in sight.
    fn in_sight(&self, goal: &Node) -> Option<(usize, Point3<f32>)> {
        let (number, _) = self.due(goal).filter(|(n, _)| self.is_in_sight(*n))?;
        Some((number, self.place(number)?))
    }
}
