mod demonstrated;
mod doubts;
mod keys;
mod misses;
mod seen;
mod sight;
mod ways;

use std::sync::Arc;

use nalgebra::Point3;

use demonstrated::Demonstrated;
use keys::Keys;
use seen::Seen;

use super::place::{Sighting, place_of};
use crate::graph::Node;
use crate::model::{HIDDEN_M, LandmarkBook};
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
    /// What was lately seen of each landmark.
    seen: Vec<Seen>,
    /// Steps of this stage in which the robot was led.
    led_steps: usize,
    /// Closings of this stage to which it was led.
    closings: usize,
    /// Times of this stage that the robot looked again before the gripper opened.
    looks: usize,
    /// Steps since the gripper closed.
    closed_steps: u32,
    /// Looks in a row, since the gripper closed, that showed it empty.
    empty_looks: usize,
    /// Whether demonstrations lift what the last closing took.
    is_lifting: bool,
    /// Closings of this stage that were seen to hold nothing.
    misses: usize,
    /// The landmark at which the gripper is about to close.
    closing: Option<usize>,
    /// What is still to be done of what follows a closing, or shows a place again, the next last.
    departure: Vec<usize>,
    /// Whether the base was stopped on its way ahead since it last moved.
    is_stopped: bool,
}

/// Pictures that a place is found from.
const REMEMBERED: usize = 6;
/// The same of a place at which the gripper is to open: it is seen well from some way off only.
const OPENING_REMEMBERED: usize = 12;
/// Sureness from which a sighting counts.
const LEAST_PEAK: f32 = 0.05;
/// Sureness from which it counts in full.
const FULL_PEAK: f32 = 0.2;
/// The same for where a place is at which the gripper is to open, and at which demonstrations aim with the arm; there it
/// counts by its square: a sight that is half as sure is at least twice as far off, and shows little more than where such a
/// place mostly is.
const AIMED_FULL_PEAK: f32 = 0.4;
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
/// Steps after a closing in which it is hoped that something is held.
const HOPE_STEPS: u32 = 10;
/// Farthest from its place that the gripper is opened where demonstrations aim with the arm, in metres.
const AIMED_FROM_M: f32 = 0.12;
/// Farthest from its place that the gripper is closed, in metres.
const CLOSE_FROM_M: f32 = 0.07;
/// Most closings of a stage to which the robot is led.
const MOST_CLOSINGS: usize = 6;
/// Most steps that a stage is led.
const MOST_LED_STEPS: usize = 120;

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
            seen: vec![Seen::default(); book.landmarks.len()],
            led_steps: 0,
            closings: 0,
            looks: 0,
            closed_steps: 0,
            empty_looks: 0,
            is_lifting: false,
            misses: 0,
            closing: None,
            departure: Vec::new(),
            is_stopped: false,
            book: Arc::clone(book),
        })
    }

    /// A new episode, in the posture in which demonstrations begin.
    pub(super) fn reset(&mut self) {
        self.posture = self.book.robot.at_start();
        self.is_closed = false;
        self.seen.iter_mut().for_each(Seen::clear);
        (self.closing, self.departure) = (None, Vec::new());
        (self.closed_steps, self.empty_looks) = (0, 0);
        (self.is_lifting, self.is_stopped) = (false, false);
        self.enter();
    }

    /// A new stage.
    pub(super) fn enter(&mut self) {
        (self.led_steps, self.closings) = (0, 0);
        (self.looks, self.misses) = (0, 0);
    }

    /// An action was carried out, and something moved.
    pub(super) fn note(&mut self, class: usize) {
        if Some(class) == self.keys.close {
            self.is_closed = true;
            (self.closed_steps, self.empty_looks) = (0, 0);
            if let Some(number) = self.closing.take() {
                self.departure = self.shown.departure(number).iter().rev().copied().collect();
                self.is_lifting = self.lifts(number);
            }
        } else if Some(class) == self.keys.open {
            self.is_closed = false;
        }
        if self.keys.is_of_base(class) {
            self.seen.iter_mut().for_each(Seen::base_moved);
            self.is_stopped = false;
        }
        if let Some(name) = self.keys.names.get(class) {
            self.posture = self.book.robot.after(&self.posture, name);
        }
    }

    /// An action was carried out, and nothing moved.
    pub(super) fn note_stopped(&mut self, class: usize) {
        let ahead = self.keys.drives[1].map(|(ahead, _)| ahead);
        self.is_stopped |= Some(class) == ahead;
    }

    /// What the cameras see now.
    pub(super) fn look(&mut self, latent: &[f32]) {
        self.closed_steps += 1;
        let lens_of = |camera| self.book.robot.lens(&self.posture, camera);
        let lenses: Vec<Option<Lens>> = self.cameras.iter().map(lens_of).collect();
        for landmark in 0..self.seen.len() {
            if self.is_hidden(landmark) {
                continue;
            }
            let sightings = self.sightings(landmark, latent, &lenses);
            let remembered = if self.book.landmarks[landmark].closes {
                REMEMBERED
            } else {
                OPENING_REMEMBERED
            };
            self.seen[landmark].add(sightings, remembered);
        }
    }

    /// What the cameras show of a landmark now.
    fn sightings(&self, landmark: usize, latent: &[f32], lenses: &[Option<Lens>]) -> Vec<Sighting> {
        let is_aimed = self.is_aimed_at(landmark);
        let sighting = |(camera, lens): (usize, &Option<Lens>)| {
            let lens = lens.filter(|_| self.counts(camera, landmark))?;
            let sight = self.book.sight(latent, camera, landmark);
            let sureness = (sight.peak / FULL_PEAK).min(1.0);
            let weight = if is_aimed {
                (sight.peak / AIMED_FULL_PEAK).min(1.0).powi(2)
            } else {
                sureness
            };
            (sight.peak >= LEAST_PEAK).then_some(Sighting {
                lens,
                pixel: sight.pixel,
                weight,
                sureness,
            })
        };
        let may_be_the_arm = self.is_closed && self.lays_down_at(landmark);
        let is_believed =
            |sighting: &Sighting| !may_be_the_arm || !self.is_too_near(landmark, sighting);
        let all = lenses.iter().enumerate().filter_map(sighting);
        all.filter(is_believed).collect()
    }

    /// The next action where the robot is led and not left to its policy, on the way to a goal state. `is_blocked` says whether
    /// a class had no effect here.
    pub(super) fn lead(
        &mut self,
        goal: &Node,
        is_stuck: bool,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        if let Some(class) = self.depart(&is_blocked) {
            return Some(class);
        }
        if self.led_steps >= MOST_LED_STEPS {
            return None;
        }
        let class = (self.next(goal, &is_blocked))
            .or_else(|| is_stuck.then(|| self.drive(goal, &is_blocked))?)
            .or_else(|| self.rest(goal, &is_blocked))?;
        self.led_steps += 1;
        Some(class)
    }

    /// What follows a closing in demonstrations: whether it held is seen once the gripper is away from there. Or what is left of
    /// a look at a place.
    fn depart(&mut self, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        let class = self.departure.pop()?;
        if is_blocked(class) {
            self.departure.clear();
            return None;
        }
        Some(class)
    }

    /// The classes that are of no use here: to close what is closed, to open what is open, to turn away from where something is
    /// to be laid down; where the robot is not stuck also any of the arm where demonstrations only drive, and to let go what was
    /// just grasped.
    pub(super) fn useless(&self, goal: &Node, is_stuck: bool) -> Vec<usize> {
        let keys = &self.keys;
        let pressed = if self.is_closed {
            keys.close
        } else {
            keys.open
        };
        let mut useless: Vec<usize> = pressed.into_iter().collect();
        useless.extend(self.turning_away(goal));
        if is_stuck {
            return useless;
        }
        if self.resting(goal).is_some() {
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

    /// The posture in a goal state in which the arm rests.
    fn resting(&self, goal: &Node) -> Option<&Posture> {
        let key = self.book.key(&goal.task, &goal.trajectory);
        self.shown.resting(&key, goal.step)
    }

    /// The arm to where it rests in a goal state: demonstrations drive with it there.
    fn rest(&self, goal: &Node, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        let there = self.resting(goal)?;
        self.posture_step(there, is_blocked)
    }

    /// The next action on the way to the event that follows a goal state; none where that is far or not seen.
    fn next(&mut self, goal: &Node, is_blocked: impl Fn(usize) -> bool) -> Option<usize> {
        if self.closings >= MOST_CLOSINGS {
            return None;
        }
        let (number, steps) = self.due(goal)?;
        let landmark = &self.book.landmarks[number];
        if steps > LED_FROM_STEPS && !self.is_in_sight(number) {
            return None;
        }
        let place = self.sure_place(number)?;
        let class = if landmark.closes {
            self.towards(number, &place, &is_blocked)
        } else {
            self.over(number, &place, &is_blocked)
        }?;
        let class = self.look_again(class, number, is_blocked).unwrap_or(class);
        self.closings += usize::from(Some(class) == self.keys.close);
        Some(class)
    }

    /// The event that is still to come after a goal state, and how many steps after it: what is open closes next, what
    /// is closed opens. It may also lie on the way to that state, or little before it: where the robot is believed to
    /// be past an event that it did not do, the event is still to be done.
    fn due(&self, goal: &Node) -> Option<(usize, u32)> {
        let events = self.book.events_of(&goal.task, &goal.trajectory);
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
        if self.book.landmarks[number].closes {
            let from = Point3::from(self.posture.gripper_m()) - self.sure_place(number)?;
            return self.keys.close.filter(|_| from.norm() > CLOSE_FROM_M);
        }
        let farthest_m = if self.lays_down_at(number) {
            AIMED_FROM_M
        } else {
            LED_FROM_M
        };
        let is_far = self
            .place(number)
            .is_some_and(|place| self.beside_m(&place) > farthest_m);
        self.keys.open.filter(|_| is_far || steps > HELD_STEPS)
    }

    /// What is done instead where the policy would open the gripper beside the place of the opening that follows a
    /// goal state, or where that place is in doubt. `is_blocked` says whether a class had no effect here.
    pub(super) fn instead_of(
        &mut self,
        class: usize,
        goal: &Node,
        is_blocked: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let (number, _) = self.due(goal)?;
        let opens = Some(class) == self.keys.open && !self.book.landmarks[number].closes;
        if !opens || self.led_steps >= MOST_LED_STEPS {
            return None;
        }
        let place = self.sure_place(number);
        let led = place.and_then(|place| self.over(number, &place, &is_blocked));
        let again = self.look_again(led.unwrap_or(class), number, is_blocked);
        let class = again.or(led)?;
        self.led_steps += 1;
        Some(class)
    }

    /// Where a landmark is that the encoder sees well enough to go there.
    fn sure_place(&self, number: usize) -> Option<Point3<f32>> {
        self.place(number).filter(|_| self.is_seen_well(number))
    }

    fn is_seen_well(&self, number: usize) -> bool {
        self.book.landmarks[number].error_pixels <= LARGEST_ERROR_PIXELS
    }

    /// Where a landmark is, in the base's frame.
    fn place(&self, number: usize) -> Option<Point3<f32>> {
        let landmark = &self.book.landmarks[number];
        let sightings = self.seen[number].sightings()?;
        let spread_m = if landmark.closes {
            self.keys.height_spread_m(landmark.height_spread_m)
        } else {
            landmark.height_spread_m
        };
        let place = place_of(&sightings, landmark.height_m, spread_m)?;
        Some(self.posture.in_base(&place))
    }

    /// Whether the gripper hides a landmark at which it is to open.
    fn is_hidden(&self, number: usize) -> bool {
        if self.book.landmarks[number].closes || !self.is_closed {
            return false;
        }
        let is_beside = |place: Point3<f32>| self.beside_m(&place) < HIDDEN_M;
        self.may_hide(number) && self.place(number).is_some_and(is_beside)
    }

    /// How far the gripper is from a place, over the floor.
    fn beside_m(&self, place: &Point3<f32>) -> f32 {
        let from = Point3::from(self.posture.gripper_m()) - place;
        from.xy().norm()
    }
}

#[cfg(test)]
mod tests;
