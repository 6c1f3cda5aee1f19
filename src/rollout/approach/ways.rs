use nalgebra::{Point3, Vector3};

use super::{Approach, LED_FROM_M};
use crate::model::Landmark;
use crate::trajectory::Posture;

/// How much farther out than in any demonstration a place may be reached for, in metres.
pub(super) const REACH_M: f32 = 0.06;
/// How much farther to the side a place may be at which the gripper is to open, in metres.
const BESIDE_M: f32 = 0.15;
/// Farthest that the base is driven up to a place out of reach, in metres.
const FAR_FROM_M: f32 = 0.4;
/// Steps to and fro from which on demonstrations aim along an axis; where they do not, the gripper may be as far off.
const WIDE_STEPS: f32 = 2.5;
/// Share of a primitive's step that the gripper may be off.
const NEAR_STEPS: f32 = 0.6;
/// Steps to one side from which the gripper goes back to come into line.
const ASIDE_STEPS: f32 = 1.2;
/// Steps short of the place from which an event is as good as there, where the way is blocked.
const TOUCHING_STEPS: f32 = 1.6;

/// The ways of the gripper, step by step.
impl Approach {
    /// The class that tilts the gripper, where it is not tilted so.
    fn tilting_to(&self, tilt_rad: f32) -> Option<usize> {
        let off = tilt_rad - self.posture.tilt_rad();
        let (class, step) = self.keys.tilts[usize::from(off > 0.0)]?;
        (off.abs() > NEAR_STEPS * step).then_some(class)
    }

    /// The next class on the way of the arm to another posture: up and back first, down last.
    pub(super) fn posture_step(
        &self,
        there: &Posture,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let free = |class: usize| (!is_blocked(class)).then_some(class);
        if let Some(class) = self.tilting_to(there.tilt_rad()) {
            return free(class);
        }
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let away = there.gripper_m()[axis] - self.posture.gripper_m()[axis];
            let key = self.keys.axes[axis][usize::from(away > 0.0)];
            key.filter(|(_, step)| away.abs() > ASIDE_STEPS * step)
                .map(|(class, _)| (class, away))
        });
        let order = [
            z.filter(|z| z.1 > 0.0),
            x.filter(|x| x.1 < 0.0),
            y,
            x.filter(|x| x.1 > 0.0),
            z.filter(|z| z.1 < 0.0),
        ];
        order
            .into_iter()
            .flatten()
            .find_map(|(class, _)| free(class))
    }

    /// The gripper over a place at which it is to open: first to the side, then ahead, and then it opens. Along an axis
    /// along which demonstrations do not move it to and fro before they open it, the place is wide, or the base aims.
    pub(super) fn over(
        &self,
        number: usize,
        place: &Point3<f32>,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let landmark = &self.book.landmarks[number];
        let free = |class: usize| (!is_blocked(class)).then_some(class);
        let gripper = Point3::from(self.posture.gripper_m());
        if self.beside_m(place) > FAR_FROM_M {
            return None;
        }
        // With its wrist down an arm does not rise as far.
        if self.lays_down_at(number)
            && let Some(class) = self.tilting_to(landmark.tilt_rad).and_then(free)
        {
            return Some(class);
        }
        if let Some(class) = self.height_step(number, WIDE_STEPS).and_then(free) {
            return Some(class);
        }
        let [least, most] = landmark.reach_m[0];
        let beyond = REACH_M + self.wide_m(landmark, 0);
        let reach = least - beyond..=most + beyond;
        if !reach.contains(&place.x) {
            let (class, drive_m) = self.keys.drives[usize::from(place.x > most)]?;
            let driven = place.x - drive_m * (place.x - most).signum();
            // A robot that looked again stands farther off than one that comes along the way.
            let is_on_the_way = self.lays_down_at(number) && place.x > most;
            return free(class).filter(|_| is_on_the_way || reach.contains(&driven));
        }
        let [least, most] = landmark.reach_m[1];
        let aside = place.y.clamp(least - BESIDE_M, most + BESIDE_M);
        if aside != place.y
            && let Some(class) = self.keys.turns[usize::from(place.y > most)].and_then(free)
        {
            return Some(class);
        }
        for (axis, off) in [(1, gripper.y - aside), (0, gripper.x - place.x)] {
            let (class, step) = self.keys.axes[axis][usize::from(off < 0.0)]?;
            if off.abs() > self.wide_m(landmark, axis).max(NEAR_STEPS * step) {
                let is_short = axis == 0 && off < 0.0;
                return free(class).or_else(|| self.nearer(number, is_short, free));
            }
        }
        self.keys.open.filter(|_| aside == place.y).and_then(free)
    }

    /// What brings an arm that reaches no farther nearer to the place at which it is to open: down to the height at which
    /// demonstrations open, since a high arm reaches less far, or else, where it is short of a place ahead, the base; the arm
    /// comes back by what is too much.
    fn nearer(
        &self,
        number: usize,
        is_short: bool,
        free: impl Fn(usize) -> Option<usize>,
    ) -> Option<usize> {
        let drive = self.keys.drives[1].filter(|_| is_short);
        let down = self.height_step(number, NEAR_STEPS).and_then(&free);
        down.or_else(|| drive.and_then(|(class, _)| free(class)))
    }

    /// The class that brings the gripper to the height at which demonstrations open it; none where it is not low, and no
    /// more than so many steps high.
    fn height_step(&self, number: usize, high_steps: f32) -> Option<usize> {
        let low = self.shown.height_m(number)? - self.posture.gripper_m()[2];
        let (class, step) = self.keys.axes[2][usize::from(low > 0.0)]?;
        (low > NEAR_STEPS * step || low < -high_steps * step).then_some(class)
    }

    /// Whether a place is one at which the gripper opens and to which demonstrations bring it ahead or back with the arm.
    pub(super) fn is_aimed_at(&self, number: usize) -> bool {
        let landmark = &self.book.landmarks[number];
        !landmark.closes && self.wide_m(landmark, 0) == 0.0
    }

    /// How far to one side of a place along an axis the gripper may open, where demonstrations do not aim along it.
    fn wide_m(&self, landmark: &Landmark, axis: usize) -> f32 {
        let [least, most] = landmark.reach_m[axis];
        let wide = self.keys.axes[axis][1].map_or(0.0, |(_, step)| WIDE_STEPS * step);
        if most - least > wide { 0.0 } else { wide }
    }

    /// The base ahead, where the arm would have to reach farther than in demonstrations, much farther or to where it may
    /// not lift what it takes; the gripper back first, where it would be driven into the thing.
    fn drive_up(
        &self,
        number: usize,
        place: &Point3<f32>,
        from: &Vector3<f32>,
        free: impl Fn(usize) -> Option<usize>,
    ) -> Option<usize> {
        let landmark = &self.book.landmarks[number];
        let (class, drive_m) = self.keys.drives[1]?;
        let [least, most] = landmark.reach_m[0];
        let step = self.keys.axes[0][1].map_or(0.0, |(_, step)| step);
        let beyond = if self.lifts(number) {
            NEAR_STEPS * step
        } else {
            REACH_M
        };
        let is_far = place.x > most + beyond && from.norm() < FAR_FROM_M;
        if !is_far || place.x - drive_m <= least - REACH_M {
            return None;
        }
        // What stopped the base stops it until it went another way, whatever the arm does in between.
        let is_in_reach = place.x <= most + REACH_M;
        let drive = free(class).filter(|_| !(is_in_reach && self.is_stopped))?;
        let approach = Vector3::from(landmark.approach);
        let ahead = -from.dot(&approach);
        let room = if approach.iamax() == 0 {
            drive_m + NEAR_STEPS * step
        } else {
            landmark.clearance_m - 0.5 * step
        };
        if ahead < room {
            let [_, back] = self.keys.along(&approach);
            return back.and_then(|(class, _)| free(class));
        }
        Some(drive)
    }

    /// The gripper to a place at which it is to close: into line with it, then straight to it, and then it closes. The base
    /// is driven up or turned where the arm does not reach.
    pub(super) fn towards(
        &self,
        number: usize,
        place: &Point3<f32>,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let landmark = &self.book.landmarks[number];
        let place = &self.tried(landmark, place);
        let is_within = |axis: usize| {
            let [least, most] = landmark.reach_m[axis];
            (least - REACH_M..=most + REACH_M).contains(&place[axis])
        };
        let free = |class: usize| (!is_blocked(class)).then_some(class);
        let from = Point3::from(self.posture.gripper_m()) - place;
        if is_within(1)
            && let Some(class) = self.drive_up(number, place, &from, free)
        {
            return Some(class);
        }
        if !is_within(1) && from.norm() < FAR_FROM_M {
            let has_room = -from.x > landmark.clearance_m;
            let back = self.keys.drives[0]
                .filter(|_| !has_room)
                .and_then(|(class, _)| free(class));
            let most = landmark.reach_m[1][1];
            let turn = self.keys.turns[usize::from(place.y > most)].and_then(free);
            return back.or(turn);
        }
        if !is_within(0) || from.norm() > LED_FROM_M {
            return None;
        }
        if let Some(class) = self.tilting_to(landmark.tilt_rad) {
            return free(class);
        }
        let approach = Vector3::from(landmark.approach);
        let ahead = -from.dot(&approach);
        let aside = from + approach * ahead;
        let (axis, off) = (0..3)
            .map(|axis| (axis, aside[axis]))
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let (class, step) = self.keys.axes[axis][usize::from(off < 0.0)]?;
        let [onward, back] = self.keys.along(&approach);
        if off.abs() > NEAR_STEPS * step {
            let is_too_near = ahead < landmark.clearance_m - 0.5 * step;
            let is_low = approach.z < -0.5 && is_too_near;
            let most = if is_low { 1.0 } else { ASIDE_STEPS };
            let is_to_go_back = is_too_near && off.abs() > most * step;
            if is_to_go_back && let Some(back) = back.and_then(|(class, _)| free(class)) {
                return Some(back);
            }
            // Where it cannot go higher it goes across as low as it is: ahead and back again would have no end.
            if !is_low || is_to_go_back {
                if let Some(class) = free(class) {
                    return Some(class);
                }
                // An arm that gets no nearer here may get there on the way.
                if off.abs() > ASIDE_STEPS * step {
                    return None;
                }
            }
        }
        let event = self.keys.close.and_then(free);
        let (onward_class, step) = onward?;
        if ahead > NEAR_STEPS * step {
            let touched = event.filter(|_| ahead <= TOUCHING_STEPS * step);
            return free(onward_class).or(touched);
        }
        if ahead < -ASIDE_STEPS * step {
            return back.and_then(|(class, _)| free(class));
        }
        event
    }
}
