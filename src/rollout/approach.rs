mod demonstrated;
mod keys;

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use demonstrated::Demonstrated;
use keys::Keys;

use super::place::{Sighting, place_of};
use crate::graph::Node;
use crate::model::{HIDDEN_M, Landmark, LandmarkBook};
use crate::trajectory::{ActionSpace, CameraSpec, Lens, Posture};

/// Brings the gripper to the place of its next event, where the encoder sees that place: the last steps of a way,
/// in which it matters by a finger's width where a thing lies.
///
/// Where the robot is follows from its own actions, where the place is from what the cameras see of the landmark.
/// The gripper first comes into line with the place and then goes straight to it, as demonstrations do.
#[derive(Clone, Debug)]
pub(super) struct Approach {
    book: Arc<LandmarkBook>,
    cameras: Vec<CameraSpec>,
    keys: Keys,
    shown: Arc<Demonstrated>,
    posture: Posture,
    is_closed: bool,
    /// What was lately seen of each landmark, picture by picture.
    seen: Vec<VecDeque<Vec<Sighting>>>,
    /// Steps of this stage in which the robot was led.
    led_steps: usize,
    /// Closings of this stage to which it was led.
    closings: usize,
    /// Steps since the gripper closed.
    closed_steps: u32,
    /// The landmark at which the gripper is about to close.
    closing: Option<usize>,
    /// What is still to be done of what follows a closing, the next last.
    departure: Vec<usize>,
}

/// Pictures that a place is found from.
const REMEMBERED: usize = 6;
/// The same of a place at which the gripper is to open: it is seen well from some way off only.
const OPENING_REMEMBERED: usize = 12;
/// Sureness from which a sighting counts.
const LEAST_PEAK: f32 = 0.05;
/// Sureness from which it counts in full.
const FULL_PEAK: f32 = 0.2;
/// Least weight of all sightings together.
const LEAST_WEIGHT: f32 = 0.5;
/// Largest median error of a landmark that is approached.
const LARGEST_ERROR_PIXELS: f32 = 12.0;
/// Steps before an event from which on the robot is led.
const LED_FROM_STEPS: u32 = 10;
/// Steps that a goal state may lie behind an event that is still to come.
const GOAL_AHEAD_STEPS: u32 = 6;
/// Steps before an opening up to which what is held is not let go.
const HELD_STEPS: u32 = 12;
/// Farthest from the place that the robot is led, in metres.
const LED_FROM_M: f32 = 0.3;
/// How much farther out than in any demonstration a place may be reached for, in metres.
const REACH_M: f32 = 0.06;
/// How much farther to the side a place may be at which the gripper is to open, in metres.
const BESIDE_M: f32 = 0.15;
/// Steps after a closing in which it is hoped that something is held.
const HOPE_STEPS: u32 = 10;
/// Farthest from its place that the gripper is closed, in metres.
const CLOSE_FROM_M: f32 = 0.07;
/// Farthest that the base is driven up to a place out of reach, in metres.
const FAR_FROM_M: f32 = 0.4;
/// Most closings of a stage to which the robot is led.
const MOST_CLOSINGS: usize = 6;
/// Most steps that a stage is led.
const MOST_LED_STEPS: usize = 120;
/// Steps to and fro from which on demonstrations aim along an axis; where they do not, the gripper may be as far off.
const WIDE_STEPS: f32 = 2.5;
/// Share of a primitive's step that the gripper may be off.
const NEAR_STEPS: f32 = 0.6;
/// Steps to one side from which the gripper goes back to come into line.
const ASIDE_STEPS: f32 = 1.2;
/// Steps short of the place from which an event is as good as there, where the way is blocked.
const TOUCHING_STEPS: f32 = 1.6;

impl Approach {
    /// None where a model has no landmarks, or actions are no primitives.
    pub(super) fn new(
        book: &Arc<LandmarkBook>,
        cameras: &[CameraSpec],
        space: &ActionSpace,
    ) -> Option<Self> {
        let keys = Keys::of(book, space)?;
        Some(Self {
            shown: Arc::new(Demonstrated::of(book, &keys)),
            keys,
            cameras: cameras.to_vec(),
            posture: book.robot.at_start(),
            is_closed: false,
            seen: vec![VecDeque::new(); book.landmarks.len()],
            led_steps: 0,
            closings: 0,
            closed_steps: 0,
            closing: None,
            departure: Vec::new(),
            book: Arc::clone(book),
        })
    }

    /// A new episode, in the posture in which demonstrations begin.
    pub(super) fn reset(&mut self) {
        self.posture = self.book.robot.at_start();
        self.is_closed = false;
        self.seen.iter_mut().for_each(VecDeque::clear);
        (self.closing, self.departure) = (None, Vec::new());
        self.enter();
    }

    /// A new stage.
    pub(super) fn enter(&mut self) {
        (self.led_steps, self.closings) = (0, 0);
    }

    /// An action was carried out, and something moved.
    pub(super) fn note(&mut self, class: usize) {
        if Some(class) == self.keys.close {
            self.is_closed = true;
            self.closed_steps = 0;
            if let Some(number) = self.closing.take() {
                self.departure = self.shown.departure(number).iter().rev().copied().collect();
            }
        } else if Some(class) == self.keys.open {
            self.is_closed = false;
        }
        if let Some(name) = self.keys.names.get(class) {
            self.posture = self.book.robot.after(&self.posture, name);
        }
    }

    /// What the cameras see now.
    pub(super) fn look(&mut self, latent: &[f32]) {
        self.closed_steps += 1;
        let lens_of = |camera| self.book.robot.lens(&self.posture, camera);
        let lenses: Vec<Option<Lens>> = self.cameras.iter().map(lens_of).collect();
        let hidden: Vec<bool> = (0..self.seen.len()).map(|n| self.is_hidden(n)).collect();
        for (landmark, seen) in self.seen.iter_mut().enumerate() {
            if hidden[landmark] {
                continue;
            }
            let remembered = if self.book.landmarks[landmark].closes {
                REMEMBERED
            } else {
                OPENING_REMEMBERED
            };
            let views = self.book.views.iter().zip(&lenses);
            let sightings = views.filter_map(|(view, lens)| {
                let sight = view.of(latent, landmark);
                let is_seen = sight.peak >= LEAST_PEAK;
                lens.filter(|_| is_seen).map(|lens| Sighting {
                    lens,
                    pixel: sight.pixel,
                    weight: (sight.peak / FULL_PEAK).min(1.0),
                })
            });
            seen.push_back(sightings.collect());
            if seen.len() > remembered {
                seen.pop_front();
            }
        }
    }

    /// What follows a closing in demonstrations: whether it held is seen once the gripper is away from there.
    pub(super) fn depart(&mut self, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        let class = self.departure.pop()?;
        if is_blocked(class) {
            self.departure.clear();
            return None;
        }
        Some(class)
    }

    /// The classes that are of no use here: to close what is closed, to open what is open; where the robot is not
    /// stuck also any of the arm where demonstrations only drive, and to let go what was just grasped.
    pub(super) fn useless(&self, goal: &Node, is_stuck: bool) -> Vec<usize> {
        let keys = &self.keys;
        let pressed = if self.is_closed {
            keys.close
        } else {
            keys.open
        };
        let mut useless: Vec<usize> = pressed.into_iter().collect();
        if is_stuck {
            return useless;
        }
        if self.shown.resting(&goal.trajectory, goal.step).is_some() {
            useless.extend((0..keys.names.len()).filter(|class| keys.is_of_arm(*class)));
        }
        let hopes = self.is_closed && self.closed_steps <= HOPE_STEPS && !self.opens_next(goal);
        useless.extend(keys.open.filter(|_| hopes));
        useless
    }

    /// Whether the opening that follows a goal state is near.
    fn opens_next(&self, goal: &Node) -> bool {
        let due = self.due(goal);
        due.is_some_and(|(number, steps)| {
            !self.book.landmarks[number].closes && steps <= HELD_STEPS
        })
    }

    /// A class was chosen on the way to a goal state.
    pub(super) fn chosen(&mut self, class: usize, goal: &Node) {
        let closing = self
            .due(goal)
            .filter(|(number, _)| self.book.landmarks[*number].closes);
        let is_closing = Some(class) == self.keys.close && !self.is_closed;
        self.closing = closing.filter(|_| is_closing).map(|(number, _)| number);
    }

    /// The arm to where it rests in a goal state: demonstrations drive with it there.
    pub(super) fn rest(
        &mut self,
        goal: &Node,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        if self.led_steps >= MOST_LED_STEPS {
            return None;
        }
        let there = self.shown.resting(&goal.trajectory, goal.step)?;
        let class = self.posture_step(there, is_blocked)?;
        self.led_steps += 1;
        Some(class)
    }

    /// The next class on the way of the arm to another posture: up and back first, down last.
    fn posture_step(&self, there: &Posture, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        let free = |class: usize| (!is_blocked(class)).then_some(class);
        let tilt = there.tilt_rad() - self.posture.tilt_rad();
        if let Some((class, step)) = self.keys.tilts[usize::from(tilt > 0.0)]
            && tilt.abs() > NEAR_STEPS * step
        {
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

    /// The next action on the way to the event that follows a goal state; none where the robot is not to be led.
    /// `is_blocked` says whether a class had no effect here.
    pub(super) fn next(
        &mut self,
        goal: &Node,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let (number, steps) = self.due(goal)?;
        let landmark = &self.book.landmarks[number];
        let is_worn_out = self.led_steps >= MOST_LED_STEPS || self.closings >= MOST_CLOSINGS;
        let is_unseen = landmark.error_pixels > LARGEST_ERROR_PIXELS;
        if steps > LED_FROM_STEPS || is_worn_out || is_unseen {
            return None;
        }
        let place = self.place(number)?;
        let class = if landmark.closes {
            self.towards(landmark, &place, is_blocked)
        } else {
            self.over(number, &place, is_blocked)
        }?;
        self.led_steps += 1;
        self.closings += usize::from(Some(class) == self.keys.close);
        Some(class)
    }

    /// The event that is still to come after a goal state, and how many steps after it: what is open closes next, what
    /// is closed opens. It may also lie on the way to that state, or little before it: where the robot is believed to
    /// be past an event that it did not do, the event is still to be done.
    fn due(&self, goal: &Node) -> Option<(usize, u32)> {
        let events = self.book.events.get(&goal.trajectory)?;
        let near = (events.iter()).skip_while(|(at, _)| at + GOAL_AHEAD_STEPS < goal.step);
        for (at, number) in near {
            let closes = self.book.landmarks[*number].closes;
            if closes != self.is_closed {
                return Some((*number, at.saturating_sub(goal.step)));
            }
            if *at >= goal.step {
                return None;
            }
        }
        None
    }

    /// The class that comes too early: the one that would let go what the plan still carries on, since the opening
    /// that is due is many steps away, or its place is; or the one that would close the gripper beside a thing.
    pub(super) fn too_early(&self, goal: &Node) -> Option<usize> {
        let (number, steps) = self.due(goal)?;
        let landmark = &self.book.landmarks[number];
        if landmark.closes {
            let is_seen = landmark.error_pixels <= LARGEST_ERROR_PIXELS;
            let place = self.place(number).filter(|_| is_seen)?;
            let from = Point3::from(self.posture.gripper_m()) - place;
            return self.keys.close.filter(|_| from.norm() > CLOSE_FROM_M);
        }
        let is_far = self
            .place(number)
            .is_some_and(|place| self.beside_m(&place) > LED_FROM_M);
        self.keys.open.filter(|_| is_far || steps > HELD_STEPS)
    }

    /// What is done instead where the policy would open the gripper beside the place of the opening that follows a
    /// goal state. `is_blocked` says whether a class had no effect here.
    pub(super) fn instead_of(
        &mut self,
        class: usize,
        goal: &Node,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let (number, _) = self.due(goal)?;
        let landmark = &self.book.landmarks[number];
        let opens = Some(class) == self.keys.open && !landmark.closes;
        let is_unseen = landmark.error_pixels > LARGEST_ERROR_PIXELS;
        if !opens || is_unseen || self.led_steps >= MOST_LED_STEPS {
            return None;
        }
        let class = self.over(number, &self.place(number)?, is_blocked)?;
        self.led_steps += 1;
        Some(class)
    }

    /// Where a landmark is, in the base's frame.
    fn place(&self, number: usize) -> Option<Point3<f32>> {
        let landmark = &self.book.landmarks[number];
        let seen = &self.seen[number];
        let sightings: Vec<Sighting> = seen.iter().flatten().copied().collect();
        if sightings.iter().map(|s| s.weight).sum::<f32>() < LEAST_WEIGHT {
            return None;
        }
        let place = place_of(&sightings, landmark.height_m, landmark.height_spread_m)?;
        Some(self.posture.in_base(&place))
    }

    /// Whether the gripper hides a landmark at which it is to open.
    fn is_hidden(&self, number: usize) -> bool {
        if self.book.landmarks[number].closes || !self.is_closed {
            return false;
        }
        self.place(number)
            .is_some_and(|place| self.beside_m(&place) < HIDDEN_M)
    }

    /// How far the gripper is from a place, over the floor.
    fn beside_m(&self, place: &Point3<f32>) -> f32 {
        let from = Point3::from(self.posture.gripper_m()) - place;
        from.xy().norm()
    }

    /// The gripper over a place at which it is to open: first to the side, then ahead, and then it opens. Along an axis
    /// along which demonstrations do not move it to and fro before they open it, the place is wide, or the base aims.
    fn over(
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
        if let Some(height_m) = self.shown.height_m(number) {
            let low = height_m - gripper.z;
            if let Some((class, step)) = self.keys.axes[2][usize::from(low > 0.0)]
                && (low > NEAR_STEPS * step || low < -WIDE_STEPS * step)
                && let Some(class) = free(class)
            {
                return Some(class);
            }
        }
        let [least, most] = landmark.reach_m[0];
        let beyond = REACH_M + self.wide_m(landmark, 0);
        let reach = least - beyond..=most + beyond;
        if !reach.contains(&place.x) {
            let (class, drive_m) = self.keys.drives[usize::from(place.x > most)]?;
            let driven = place.x - drive_m * (place.x - most).signum();
            return free(class).filter(|_| reach.contains(&driven));
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
                return free(class);
            }
        }
        self.keys.open.filter(|_| aside == place.y).and_then(free)
    }

    /// How far to one side of a place along an axis the gripper may open, where demonstrations do not aim along it.
    fn wide_m(&self, landmark: &Landmark, axis: usize) -> f32 {
        let [least, most] = landmark.reach_m[axis];
        let wide = self.keys.axes[axis][1].map_or(0.0, |(_, step)| WIDE_STEPS * step);
        if most - least > wide { 0.0 } else { wide }
    }

    fn towards(
        &self,
        landmark: &Landmark,
        place: &Point3<f32>,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let is_within = |axis: usize| {
            let [least, most] = landmark.reach_m[axis];
            (least - REACH_M..=most + REACH_M).contains(&place[axis])
        };
        let free = |class: usize| (!is_blocked(class)).then_some(class);
        let from = Point3::from(self.posture.gripper_m()) - place;
        if let Some((class, drive_m)) = self.keys.drives[1] {
            let [least, most] = landmark.reach_m[0];
            let is_far = place.x > most + REACH_M && from.norm() < FAR_FROM_M;
            if is_far && place.x - drive_m > least - REACH_M {
                return free(class);
            }
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
        if !is_within(0) || !is_within(1) || from.norm() > LED_FROM_M {
            return None;
        }
        let tilt = landmark.tilt_rad - self.posture.tilt_rad();
        if let Some((class, step)) = self.keys.tilts[usize::from(tilt > 0.0)]
            && tilt.abs() > NEAR_STEPS * step
        {
            return free(class);
        }
        let approach = Vector3::from(landmark.approach);
        let ahead = -from.dot(&approach);
        let aside = from + approach * ahead;
        let (axis, off) = (0..3)
            .map(|axis| (axis, aside[axis]))
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let (class, step) = self.keys.axes[axis][usize::from(off < 0.0)]?;
        let main = approach.iamax();
        let [onward, back] = [approach[main] > 0.0, approach[main] < 0.0]
            .map(|positive| self.keys.axes[main][usize::from(positive)]);
        if off.abs() > NEAR_STEPS * step {
            let is_too_near = ahead < landmark.clearance_m - 0.5 * step;
            let is_low = approach.z < -0.5 && is_too_near;
            let most = if is_low { 1.0 } else { ASIDE_STEPS };
            if off.abs() > most * step
                && is_too_near
                && let Some(back) = back.and_then(|(class, _)| free(class))
            {
                return Some(back);
            }
            if !is_low {
                return free(class);
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

#[cfg(test)]
mod tests;
