use nalgebra::Point3;

use super::Approach;
use super::ways::REACH_M;
use crate::rollout::place::{LEAST_SPREAD_M, Sighting};

/// Weight of all sightings of a place below which the gripper does not open over it before it has looked again.
const SURE_WEIGHT: f32 = 3.0;
/// Weight from which a place that is believed beside the gripper may keep other sights from being believed.
const HIDING_WEIGHT: f32 = 1.0;
/// Most times of a stage that the robot looks again.
const MOST_LOOKS: usize = 2;
/// Steps that the base goes back for it.
const LOOK_STEPS: usize = 3;
/// How much less far out than demonstrations open the arm is then, in metres: stretched out, it is in the way of the cameras.
const DRAWN_IN_M: f32 = 0.09;

/// What is let go beside its place is lost. So where demonstrations aim with the arm, the robot looks again before it opens over
/// a place of which it saw too little, or which its pictures do not agree on.
impl Approach {
    /// Whether demonstrations aim with the arm before they open at a place, and the encoder sees it well enough to tell whether the
    /// robot does. A handle that is let go is aimed at, and nobody looks for it.
    pub(super) fn lays_down_at(&self, number: usize) -> bool {
        self.is_aimed_at(number) && self.is_seen_well(number)
    }

    /// The base back by some steps and then the arm, instead of an opening over a place that is in doubt. What was seen of the
    /// place is forgotten.
    pub(super) fn look_again(
        &mut self,
        class: usize,
        number: usize,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let opens = Some(class) == self.keys.open && self.lays_down_at(number);
        if !opens || self.looks >= MOST_LOOKS || !self.is_in_doubt(number) {
            return None;
        }
        let (back, _) = self.keys.drives[0].filter(|(class, _)| !is_blocked(*class))?;
        let drawn_in_m = self.book.landmarks[number].reach_m[0][0] - DRAWN_IN_M;
        let out_m = self.posture.gripper_m()[0] - drawn_in_m;
        let arm = self.keys.axes[0][0].map_or_else(Vec::new, |(class, step)| {
            vec![class; (out_m / step).round().max(0.0) as usize]
        });
        self.looks += 1;
        self.departure = [arm, vec![back; LOOK_STEPS - 1]].concat();
        self.seen[number].clear();
        Some(back)
    }

    /// Whether too little was seen of a place, or sights contradict each other: what agrees meets at the height at which the
    /// place lies in demonstrations.
    fn is_in_doubt(&self, number: usize) -> bool {
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
    fn weight(&self, number: usize) -> f32 {
        let sightings = self.seen[number].sightings();
        sightings.iter().flatten().map(|s| s.weight).sum()
    }
}
