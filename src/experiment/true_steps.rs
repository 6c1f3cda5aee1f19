//! How many primitives really lead from one recorded state to another.

use super::Replay;
use super::posture::{Arrival, Posture};
use crate::simulator::{BedroomTask, Graspable, Insight, Primitive};

/// A hand that is to be this near to a thing has to be in the right place of the world, not only held right.
const AT_A_THING_M: f64 = 0.20;
/// A thing that lies further from where it lay is not the same scene, whatever the robot does.
const SAME_SCENE_M: f64 = 0.25;
/// A thing that is this much higher or lower is not where it was.
const SAME_HEIGHT_M: f64 = 0.03;
/// A thing in the gripper that is this far from where it was taken is carried.
const TAKEN_M: f64 = 0.02;

/// A state of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RecordedState {
    /// Index of the replay.
    pub replay: usize,
    /// Step of the recording, from 0.
    pub step: usize,
}

/// One part of a way: be in a state of the recording that is followed, then do what was done there; at the end
/// nothing is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    pub(super) step: usize,
    pub(super) action: Option<Primitive>,
}

/// The least number of primitives between recorded states of the bedroom, by the simulator's truth.
///
/// States of two recordings are never equal: the robot started elsewhere, the things lie elsewhere, other tasks
/// have left other things behind. A robot in state A of one recording *is at* state B of another once
/// - base, arm and fingers are as in B to within `tolerance` primitives in each of their directions, in a room that
///   is shifted so that the thing which B is about (the sock until it is carried, then the box, which stands; the can,
///   then the bin; the tissue, then the spill) lies where it lies for A. Near that thing (20 cm) the hand must be in
///   the right place of the room, elsewhere it is enough that the arm is held as in B;
/// - the same thing is held, the drawer is open or shut as in B and the task of B is done or not done as in B. What
///   other tasks have left behind does not matter.
///
/// Where what is the case differs, it must be brought about as the recording of B did it: go to the last state
/// before the change, do what was done there, go on. What that recording never shows (another thing is held, the can
/// that is in the bin ought to stand on the shelf) has no number of steps. A thing that has not been moved
/// from its place can be taken and let go by the fingers alone, and whatever B's task is not about can be dropped.
///
/// Where A is of another task, or of the same one when it was done before, what B's task is about is taken to be as at
/// the start of B's recording: a composition begins a task that is still to be done, and what some recording of
/// another task found there by chance says nothing about the way.
///
/// The number is a lower bound but for things that are pushed on the way: nothing is ever in the way, everything that
/// is grasped is held, and nobody hesitates. So an edge is false where this number is `d_max` or more.
#[derive(Clone, Copy, Debug)]
pub struct TrueSteps<'a> {
    replays: &'a [Replay],
    tolerance: f64,
}

impl<'a> TrueSteps<'a> {
    /// Steps between states of these recordings; `tolerance` is in primitives (half of one is as near as a robot of
    /// primitives can be brought, one is as much as no primitive makes worse).
    #[must_use]
    pub fn new(replays: &'a [Replay], tolerance: f64) -> Self {
        Self { replays, tolerance }
    }

    /// The recordings.
    #[must_use]
    pub fn replays(&self) -> &'a [Replay] {
        self.replays
    }

    /// Steps from one state to another, at least 1; `None` where no number of steps leads there. States of one task are
    /// of one time that it is done.
    ///
    /// # Panics
    /// If a state is not in the recordings.
    #[must_use]
    pub fn between(&self, from: RecordedState, to: RecordedState) -> Option<u32> {
        let (source, target) = (&self.replays[from.replay], &self.replays[to.replay]);
        if source.task != target.task {
            return self.across_seam(from, to);
        }
        self.steps(&source.insights[from.step], to)
    }

    /// The same to a state of the task that is done next, which may be the same task once more: that is still to be
    /// done, too.
    ///
    /// # Panics
    /// If a state is not in the recordings.
    #[must_use]
    pub fn across_seam(&self, from: RecordedState, to: RecordedState) -> Option<u32> {
        let (source, target) = (&self.replays[from.replay], &self.replays[to.replay]);
        let here = begins(&source.insights[from.step], &target.insights[0]);
        self.steps(&here, to)
    }

    /// Steps from what is the case to a state, at least 1.
    fn steps(&self, here: &Insight, to: RecordedState) -> Option<u32> {
        self.way(here, to).map(|(steps, _)| steps.max(1))
    }

    /// The shortest way from what is the case to a state, and its parts.
    pub(super) fn way(&self, here: &Insight, to: RecordedState) -> Option<(u32, Vec<Leg>)> {
        let replay = &self.replays[to.replay];
        let mut best: Option<(u32, Vec<Leg>)> = None;
        let mut legs = vec![Leg {
            step: to.step,
            action: None,
        }];
        let mut tail = 0;
        loop {
            let entry = legs[0].step;
            if best.as_ref().is_none_or(|(steps, _)| tail < *steps)
                && let Some(steps) = self.directly(here, replay, entry)
                && best.as_ref().is_none_or(|(b, _)| steps + tail < *b)
            {
                best = Some((steps + tail, legs.clone()));
            }
            let Some(change) = last_change(replay, entry) else {
                return best;
            };
            let after = &replay.insights[change + 1];
            tail += 1 + self.posture_steps(after, replay, entry);
            legs.insert(
                0,
                Leg {
                    step: change,
                    action: Some(replay.actions[change]),
                },
            );
        }
    }

    /// Steps to a state that differs in nothing but where the robot is and what the fingers can do there.
    fn directly(&self, here: &Insight, replay: &Replay, step: usize) -> Option<u32> {
        let fingers = finger_steps(here, &replay.insights[step], replay.task)?;
        let focus = Focus::of(replay, step);
        let shift = focus.shift(here);
        if shift[0].hypot(shift[1]) > SAME_SCENE_M {
            return None;
        }
        Some(fingers + self.posture_steps(here, replay, step))
    }

    /// Steps that base, arm and fingers take.
    fn posture_steps(&self, here: &Insight, replay: &Replay, step: usize) -> u32 {
        let (goal, arrival) = self.goal(here, replay, step);
        Posture::of(here).steps_to(&goal, arrival)
    }

    /// The posture of a recorded state in the room as it is now.
    pub(super) fn goal(&self, here: &Insight, replay: &Replay, step: usize) -> (Posture, Arrival) {
        let focus = Focus::of(replay, step);
        let posture = Posture::of(&replay.insights[step]);
        let hand = posture.hand_m();
        let off = [hand[0] - focus.place_m[0], hand[1] - focus.place_m[1]];
        let arrival = Arrival {
            tolerance: self.tolerance,
            hand_in_world: off[0].hypot(off[1]) <= AT_A_THING_M,
        };
        (posture.shifted(focus.shift(here)), arrival)
    }

    /// Whether what is the case is, but for the robot's posture, as in a recorded state.
    pub(super) fn is_alike(&self, here: &Insight, to: RecordedState) -> bool {
        let replay = &self.replays[to.replay];
        let there = &replay.insights[to.step];
        Case::of(here, replay.task) == Case::of(there, replay.task)
    }
}

/// The robot where it is, with whatever it holds, in a room in which another task is still to be done.
fn begins(robot: &Insight, start: &Insight) -> Insight {
    Insight {
        base_m: robot.base_m,
        heading_rad: robot.heading_rad,
        tool: robot.tool,
        gripper_shut: robot.gripper_shut,
        held: held(robot),
        ..*start
    }
}

/// What is in the shut gripper: held by both pads, or wedged between the fingers and lifted.
fn held(insight: &Insight) -> Option<Graspable> {
    let truth = &insight.truth;
    let lifted = [
        (truth.sock_grasped, Graspable::Sock),
        (truth.can_grasped, Graspable::Can),
        (truth.tissue_grasped, Graspable::Tissue),
    ];
    let wedged = lifted.into_iter().find(|(is_lifted, _)| *is_lifted);
    insight.held.or(wedged.map(|(_, thing)| thing))
}

/// What has to be the same in two states beside the robot's posture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Case {
    drawer_is_open: bool,
    is_done: bool,
    held: Option<Graspable>,
}

impl Case {
    fn of(insight: &Insight, task: BedroomTask) -> Self {
        Self {
            drawer_is_open: task == BedroomTask::Sock && insight.truth.drawer_open,
            is_done: insight.truth.is_done(task),
            held: held(insight),
        }
    }
}

/// The last step before `step` at which something else was the case than after it.
fn last_change(replay: &Replay, step: usize) -> Option<usize> {
    let case = |s: usize| Case::of(&replay.insights[s], replay.task);
    (0..step).rev().find(|s| case(*s) != case(*s + 1))
}

/// Steps, beyond those of the posture, after which the same is the case; `None` where that cannot be had by opening
/// or shutting the fingers.
fn finger_steps(here: &Insight, there: &Insight, task: BedroomTask) -> Option<u32> {
    let (now, then) = (Case::of(here, task), Case::of(there, task));
    if (now.drawer_is_open, now.is_done) != (then.drawer_is_open, then.is_done) {
        return None;
    }
    // Open and shut again, where the posture itself asks for neither.
    let again = if here.gripper_shut == there.gripper_shut {
        2
    } else {
        0
    };
    match (now.held, then.held) {
        (a, b) if a == b => Some(0),
        (Some(thing), None) if !is_about(task, thing) => Some(again),
        (None, Some(thing)) | (Some(thing), None) => {
            let (a, b) = (place(here, thing), place(there, thing));
            let is_in_place = (a[2] - b[2]).abs() <= SAME_HEIGHT_M
                && (a[0] - b[0]).hypot(a[1] - b[1]) <= SAME_SCENE_M;
            is_in_place.then_some(again)
        }
        _ => None,
    }
}

fn is_about(task: BedroomTask, thing: Graspable) -> bool {
    match task {
        BedroomTask::Sock => matches!(thing, Graspable::Sock | Graspable::Drawer),
        BedroomTask::Trash => thing == Graspable::Can,
        BedroomTask::Wine => thing == Graspable::Tissue,
    }
}

fn place(insight: &Insight, thing: Graspable) -> [f64; 3] {
    match thing {
        Graspable::Drawer => insight.handle_m,
        Graspable::Sock => insight.sock_m,
        Graspable::Can => insight.can_m,
        Graspable::Tissue => insight.tissue_m,
    }
    .map(f64::from)
}

/// Whether a thing is in the gripper and no longer where it was taken.
fn is_carried(replay: &Replay, step: usize, thing: Graspable) -> bool {
    let holds = |step: usize| held(&replay.insights[step]) == Some(thing);
    if !holds(step) {
        return false;
    }
    let taken = (0..step).rev().find(|s| !holds(*s)).unwrap_or(0);
    let [a, b] = [taken, step].map(|s| place(&replay.insights[s], thing));
    (a[0] - b[0]).hypot(a[1] - b[1]) > TAKEN_M || (a[2] - b[2]).abs() > TAKEN_M
}

/// The thing that a state is about.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Focus {
    thing: Thing,
    place_m: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Thing {
    /// Stands where it stands in every episode, or moves with the hand.
    Fixed,
    Loose(Graspable),
    Spill,
}

impl Focus {
    fn of(replay: &Replay, step: usize) -> Self {
        let insight = &replay.insights[step];
        let truth = &insight.truth;
        let is_carried = |thing| is_carried(replay, step, thing);
        let loose = |thing| (Thing::Loose(thing), place(insight, thing));
        let fixed = |place: [f32; 3]| (Thing::Fixed, place.map(f64::from));
        let (thing, place_m) = match replay.task {
            BedroomTask::Sock if is_carried(Graspable::Sock) || truth.sock_in_box => {
                fixed(insight.container_m)
            }
            BedroomTask::Sock if !truth.drawer_open || insight.held == Some(Graspable::Drawer) => {
                fixed(insight.handle_m)
            }
            BedroomTask::Sock => loose(Graspable::Sock),
            BedroomTask::Trash if is_carried(Graspable::Can) || truth.can_in_bin => {
                fixed(insight.bin_m)
            }
            BedroomTask::Trash => loose(Graspable::Can),
            BedroomTask::Wine if is_carried(Graspable::Tissue) || truth.spill_covered => {
                (Thing::Spill, insight.spill_m.map(f64::from))
            }
            BedroomTask::Wine => loose(Graspable::Tissue),
        };
        Self { thing, place_m }
    }

    /// How far the thing lies from where it lay.
    fn shift(&self, here: &Insight) -> [f64; 3] {
        let now = match self.thing {
            Thing::Fixed => return [0.0; 3],
            Thing::Loose(thing) => place(here, thing),
            Thing::Spill => here.spill_m.map(f64::from),
        };
        [0, 1, 2].map(|axis| now[axis] - self.place_m[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::{Bedroom, BedroomConfig, Demonstration, demonstrate};

    /// Two demonstrations that succeed.
    fn replays(task: BedroomTask) -> Vec<Replay> {
        let config = BedroomConfig::paper(task);
        let shown = (0..).map(|seed| {
            let shown = demonstrate(&mut Bedroom::new(config), task, seed);
            (seed, shown.expect("the room does not fail"))
        });
        let replay = |(seed, shown): (u64, Demonstration)| {
            Replay::new(&shown.trajectory, seed, Some(config)).expect("it was just recorded")
        };
        let succeeded = shown.filter(|(_, shown)| shown.succeeded);
        succeeded.take(2).map(replay).collect()
    }

    fn state(replay: usize, step: usize) -> RecordedState {
        RecordedState { replay, step }
    }

    #[test]
    fn nobody_is_faster_than_the_least_number_of_steps() {
        for task in BedroomTask::ALL {
            let replays = replays(task);
            let truth = TrueSteps::new(&replays, 0.5);
            let (mut pairs, mut longer) = (0, Vec::new());
            for (replay, recorded) in replays.iter().enumerate() {
                let steps = recorded.insights.len();
                for (a, gap) in (0..steps).flat_map(|a| (1..8.min(steps - a)).map(move |g| (a, g)))
                {
                    let found = truth.between(state(replay, a), state(replay, a + gap));
                    pairs += 1;
                    if found.is_none_or(|s| s as usize > gap) {
                        longer.push((replay, a, gap, found));
                    }
                }
            }
            // Only a thing that is pushed in between gives another count: the goal moves with it.
            assert!(longer.len() * 33 < pairs, "{task:?}: {longer:?} of {pairs}");
        }
    }

    #[test]
    fn the_end_is_far_from_the_start_though_the_robot_stands_alike() {
        let replays = replays(BedroomTask::Trash);
        let truth = TrueSteps::new(&replays, 1.0);
        let ends: Vec<usize> = replays.iter().map(|r| r.insights.len() - 1).collect();
        let done = truth.between(state(0, 0), state(1, ends[1]));
        assert!(done.is_some_and(|s| s > 15), "{done:?}");
        // Nobody takes the can out of the bin, but where the task is done once more there is one on the shelf.
        let (end, start) = (state(0, ends[0]), state(1, 0));
        assert_eq!(truth.between(end, start), None);
        assert!(truth.across_seam(end, start).is_some());
        let near = truth.between(state(0, ends[0]), state(1, ends[1]));
        assert!(near.is_some_and(|s| s < 15), "{near:?}");
    }
}
