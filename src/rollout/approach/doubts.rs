use nalgebra::Point3;

use super::Approach;
use super::ways::REACH_M;
use crate::rollout::place::{LEAST_SPREAD_M, Sighting};

/// Weight of all sightings of a place below which the gripper does not open over it before it has looked again.
const SURE_WEIGHT: f32 = 3.0;
/// Weight from which a place that is believed beside the gripper may keep other sights from being believed.
const HIDING_WEIGHT: f32 = 1.0;
/// Most times of a stage that the robot looks again: once always, and again where it is in doubt then.
const MOST_LOOKS: usize = 2;
/// How far the gripper goes aside for it from the line of sight to the place, in metres: what it holds hides the place.
const ASIDE_M: f32 = 0.15;
/// How much farther out than demonstrations open at least the gripper is then, in metres: stretched out, it does not reach
/// aside, and drawn in, it hides more.
const OUT_M: f32 = 0.03;
/// How far the arm is drawn in at last, in metres, while the camera of the base looks.
const DRAWN_IN_M: f32 = 0.09;

/// What is let go beside its place is lost, and far away, where the robot last saw the place, a pixel is centimetres. So where
/// demonstrations aim with the arm, the robot looks again from near before it opens, with what it holds out of the way.
impl Approach {
    /// Whether demonstrations aim with the arm before they open at a place, and the encoder sees it well enough to tell whether the
    /// robot does. A handle that is let go is aimed at, and nobody looks for it.
    pub(super) fn lays_down_at(&self, number: usize) -> bool {
        self.is_aimed_at(number) && self.is_seen_well(number)
    }

    /// The first of what shows a place again, instead of an opening over it; the rest follows as a departure. What was seen of
    /// the place before is forgotten.
    pub(super) fn look_again(
        &mut self,
        class: usize,
        number: usize,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let opens = Some(class) == self.keys.open && self.lays_down_at(number);
        let sees = || {
            self.cameras
                .iter()
                .any(|camera| !self.book.robot.is_carried(camera))
        };
        let is_due = || self.looks == 0 || (self.looks < MOST_LOOKS && self.is_in_doubt(number));
        if !(opens && sees() && is_due()) {
            return None;
        }
        let mut way = self.out_of_sight(number);
        way.retain(|class| !is_blocked(*class));
        way.reverse();
        let first = way.pop()?;
        self.looks += 1;
        self.departure = way;
        self.seen[number].clear();
        Some(first)
    }

    /// The base a step back, and the gripper out of the line of sight from there to a place, to the side where it has more room.
    fn out_of_sight(&self, number: usize) -> Vec<usize> {
        let [ahead_m, left_m, _] = self.posture.gripper_m();
        let out_m = self.book.landmarks[number].reach_m[0][0] + OUT_M;
        let back = self.keys.drives[0];
        let back_m = back.map_or(0.0, |(_, step)| step);
        let in_sight = |place: Point3<f32>| place.y * out_m / (place.x + back_m).max(out_m);
        let sight_m = self.place(number).map_or(left_m, in_sight);
        let is_right = sight_m < 0.0;
        let away = if is_right { 1.0 } else { -1.0 };
        let aside_m = (ASIDE_M + away * (sight_m - left_m)).min(2.0 * ASIDE_M);
        let back = back.map(|(class, _)| class).into_iter().collect();
        [
            back,
            self.presses([0, 0], ahead_m - out_m),
            self.presses([1, usize::from(is_right)], aside_m),
            self.presses([0, 0], DRAWN_IN_M),
        ]
        .concat()
    }

    /// The presses that move the gripper so far along or against an axis.
    fn presses(&self, [axis, along]: [usize; 2], by_m: f32) -> Vec<usize> {
        self.keys.axes[axis][along].map_or_else(Vec::new, |(class, step)| {
            vec![class; (by_m / step).round().max(0.0) as usize]
        })
    }

    /// Whether a camera tells where a place is: not one that the gripper carries, once it went aside to look. Demonstrations never
    /// show the place from there, and it is seen where it is not.
    pub(super) fn counts(&self, camera: usize, number: usize) -> bool {
        let looked = self.looks > 0 && self.lays_down_at(number);
        !looked || !self.book.robot.is_carried(&self.cameras[camera])
    }

    /// Whether too little was seen of a place, or sights contradict each other: what agrees meets at the height at which the
    /// place lies in demonstrations.
    pub(super) fn is_in_doubt(&self, number: usize) -> bool {
        let landmark = &self.book.landmarks[number];
        let spread_m = landmark.height_spread_m.max(LEAST_SPREAD_M);
        let is_high_or_low = |place: Point3<f32>| (place.z - landmark.height_m).abs() > spread_m;
        self.weight(number) < SURE_WEIGHT || self.place(number).is_none_or(is_high_or_low)
    }

    /// Whether what is believed of a place is sure enough to keep other sights from being believed.
    pub(super) fn may_hide(&self, number: usize) -> bool {
        !self.lays_down_at(number) || self.weight(number) >= HIDING_WEIGHT
    }

    /// Whether a sight of a place at which a gripper that aims is to open shows it nearer to the base than demonstrations
    /// bring it: the arm that carries something is taken for it then.
    pub(super) fn is_too_near(&self, number: usize, sighting: &Sighting) -> bool {
        let landmark = &self.book.landmarks[number];
        let at = sighting.lens.at_height(sighting.pixel, landmark.height_m);
        let ahead_m = at.map(|place| self.posture.in_base(&place).x);
        ahead_m.is_some_and(|ahead_m| ahead_m < landmark.reach_m[0][0] - REACH_M)
    }

    /// How much all sightings of a landmark say of where it is.
    pub(super) fn weight(&self, number: usize) -> f32 {
        let sightings = self.seen[number].sightings();
        sightings.iter().flatten().map(|s| s.weight).sum()
    }
}
