//! How a person does each task, part after part.

use std::f32::consts::{FRAC_PI_2, PI};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grasp::Grasp;
use super::stage::{Stage, Target};
use crate::simulator::primitive::WRIST_STEP_RAD;
use crate::simulator::truth::Insight;
use crate::simulator::variation::BedroomTask;
use crate::simulator::world::Graspable;

/// Where a thing should be before the arm reaches for it.
const STAND_M: f32 = 0.48;
/// Where the base turns to the drawer, before its handle.
const BEFORE_DRAWER_M: f32 = 0.65;
/// How far before the sock's middle the hand comes down. The fingers take it from 4 cm before its middle
/// to 3 cm beyond, and from above the wrist camera barely sees what is right below the hand.
const SHORT_OF_SOCK_M: f32 = 0.013;
/// How far ahead the sock is when the base has driven near: the hand is 3 to 13 cm before it then, and the
/// wrist camera still sees it.
const SOCK_AHEAD_M: f32 = 0.55;
/// Height of the gripper above the open drawer.
const OVER_DRAWER_M: f32 = 0.41;
/// Height of the gripper at the can.
const AT_CAN_M: f32 = 0.48;
/// Height of the gripper over the chest. The tissue hangs 5 cm below it and the top is at 0.42 m: room for a
/// hand that is one step too low, which would knock the tissue out of the gripper at the edge.
const OVER_CHEST_M: f32 = 0.54;
/// How far the drawer is pulled.
const PULL_M: f32 = 0.25;

/// The parts of a task from the state that `insight` shows; the lot chooses between equal ways.
/// What is done already is left out.
pub(super) fn stages(task: BedroomTask, insight: &Insight, rng: &mut ChaCha8Rng) -> Vec<Stage> {
    if insight.truth.is_done(task) {
        return vec![Stage::Release, Stage::Home];
    }
    let thing = match task {
        BedroomTask::Sock => Graspable::Sock,
        BedroomTask::Trash => Graspable::Can,
        BedroomTask::Wine => Graspable::Tissue,
    };
    let mut stages = Vec::new();
    if insight.held != Some(thing) {
        stages.extend([Stage::Release, Stage::Home]);
        stages.extend(match task {
            BedroomTask::Sock => fetch_sock(insight, rng),
            BedroomTask::Trash => fetch_can(rng),
            BedroomTask::Wine => fetch_tissue(),
        });
    }
    stages.extend(match task {
        BedroomTask::Sock => deliver(thing, Target::Container, 0.42),
        BedroomTask::Trash => deliver(thing, Target::Bin, 0.41),
        BedroomTask::Wine => cover_spill(rng),
    });
    stages.extend([Stage::Release, Stage::BackOff(2), Stage::Home]);
    stages
}

fn from_ahead(thing: Graspable, target: Target, above_m: f32) -> Stage {
    Stage::Grasp(Grasp {
        thing,
        target,
        above_m,
        short_m: 0.0,
        from_above: false,
    })
}

fn fetch_sock(insight: &Insight, rng: &mut ChaCha8Rng) -> Vec<Stage> {
    let mut stages = Vec::new();
    if insight.truth.drawer_open {
        let before = Target::BeforeDrawer(BEFORE_DRAWER_M);
        if !stands_before_drawer(insight) {
            stages.extend([Stage::Face(before), Stage::Drive(before, 0.0)]);
        }
        stages.push(Stage::FaceHeading(FRAC_PI_2));
    } else {
        stages.extend(to_drawer(insight, rng));
        stages.extend([
            from_ahead(Graspable::Drawer, Target::Handle, 0.0),
            Stage::Pull(PULL_M),
            Stage::Release,
        ]);
    }
    stages.extend([
        Stage::Raise(OVER_DRAWER_M),
        Stage::Retract(0.43),
        // Looking down already, so that the wrist camera sees how near the sock is.
        Stage::Tilt(WRIST_STEP_RAD),
        Stage::CloseIn(Target::Sock, SOCK_AHEAD_M),
        Stage::Grasp(Grasp {
            thing: Graspable::Sock,
            target: Target::Sock,
            above_m: 0.008,
            short_m: SHORT_OF_SOCK_M,
            from_above: true,
        }),
        Stage::Raise(OVER_DRAWER_M),
        Stage::BackAway(Target::Handle, 0.46),
    ]);
    stages
}

/// Two routes: back off from the bin until the cabinet is abreast and turn once, or turn towards
/// the place before the cabinet and drive there at a slant.
fn to_drawer(insight: &Insight, rng: &mut ChaCha8Rng) -> Vec<Stage> {
    let before = Target::BeforeDrawer(BEFORE_DRAWER_M);
    let faces_bin = (insight.heading_rad - PI).cos() > 0.8;
    let east = insight.handle_m[0] - insight.base_m[0];
    let backs_off = rng.random_bool(0.5) && faces_bin && east > 0.0;
    let mut stages = if stands_before_drawer(insight) {
        Vec::new()
    } else if backs_off {
        vec![Stage::BackAbreast(Target::Handle)]
    } else {
        vec![Stage::Face(before), Stage::Drive(before, 0.0)]
    };
    stages.extend([
        Stage::FaceHeading(FRAC_PI_2),
        Stage::CloseIn(Target::Handle, 0.50),
    ]);
    stages
}

fn stands_before_drawer(insight: &Insight) -> bool {
    let [x, y, _] = insight.handle_m;
    let (aside, south) = (x - insight.base_m[0], y - insight.base_m[1]);
    aside.abs() < 0.12 && (0.2..1.0).contains(&south) && insight.heading_rad.sin() > 0.8
}

fn fetch_can(rng: &mut ChaCha8Rng) -> Vec<Stage> {
    let near = Stage::Drive(Target::Can, 0.75);
    let raise = Stage::Raise(AT_CAN_M);
    let [first, second] = if rng.random_bool(0.5) {
        [near, raise]
    } else {
        [raise, near]
    };
    vec![
        Stage::Face(Target::Can),
        first,
        second,
        Stage::Drive(Target::Can, 0.45),
        from_ahead(Graspable::Can, Target::Can, 0.0),
        Stage::Raise(AT_CAN_M + 0.03),
        Stage::BackOff(3),
    ]
}

fn fetch_tissue() -> Vec<Stage> {
    vec![
        Stage::Face(Target::Tissue),
        Stage::Drive(Target::Tissue, STAND_M),
        from_ahead(Graspable::Tissue, Target::Tissue, 0.045),
        Stage::Raise(0.42),
        Stage::BackOff(2),
    ]
}

fn deliver(thing: Graspable, receptacle: Target, stop_m: f32) -> Vec<Stage> {
    vec![
        Stage::Home,
        Stage::Face(receptacle),
        Stage::Drive(receptacle, stop_m),
        Stage::Over(thing, receptacle, 0.08),
    ]
}

fn cover_spill(rng: &mut ChaCha8Rng) -> Vec<Stage> {
    let near = Stage::Drive(Target::Spill, 0.75);
    let raise = Stage::Raise(OVER_CHEST_M);
    let [first, second] = if rng.random_bool(0.5) {
        [near, raise]
    } else {
        [raise, near]
    };
    vec![
        Stage::Home,
        Stage::Face(Target::Spill),
        first,
        second,
        Stage::Drive(Target::Spill, STAND_M),
        Stage::Over(Graspable::Tissue, Target::Spill, 0.018),
    ]
}
