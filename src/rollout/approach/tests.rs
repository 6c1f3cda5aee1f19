mod closing;
mod demonstrated;
mod doubts;
mod opening;
mod sight;

use std::collections::BTreeMap;

use super::*;
use crate::model::{Landmark, LandmarkView};
use crate::trajectory::RobotGeometry;

const NAMES: [&str; 14] = [
    "end_effector_left",
    "end_effector_right",
    "end_effector_forward",
    "end_effector_backward",
    "end_effector_up",
    "end_effector_down",
    "base_forward",
    "base_backward",
    "wrist_down",
    "gripper_close",
    "gripper_open",
    "wrist_up",
    "base_turn_left",
    "base_turn_right",
];

fn class(name: &str) -> usize {
    NAMES.iter().position(|n| *n == name).unwrap()
}

fn camera(name: &str) -> CameraSpec {
    CameraSpec {
        name: name.to_owned(),
        height: 90,
        width: 160,
    }
}

fn approach(landmark: Landmark) -> Approach {
    let view = |first| LandmarkView {
        first,
        middle_pixels: [80.0, 45.0],
        unit_pixels: [80.0, 45.0],
    };
    let book = LandmarkBook {
        robot: RobotGeometry::locobot(),
        views: vec![view(0), view(3)],
        landmarks: vec![landmark],
        events: [("shown".to_owned(), vec![(12, 0)])].into(),
        actions: BTreeMap::new(),
        grasp: None,
    };
    let space = ActionSpace::Primitives {
        names: NAMES.map(String::from).to_vec(),
    };
    Approach::new(&Arc::new(book), &[camera("head"), camera("wrist")], &space).unwrap()
}

fn goal(step: u32) -> Node {
    Node {
        task: "a".to_owned(),
        trajectory: "shown".to_owned(),
        step,
        reached: Vec::new(),
        progress: 0,
        is_end: false,
    }
}

/// What the cameras see of a place, as a latent.
fn latent(approach: &Approach, place: &Point3<f32>) -> Vec<f32> {
    let robot = &approach.book.robot;
    let see = |name| match robot.pixel(&approach.posture, &camera(name), place) {
        Some([x, y]) => [x / 80.0 - 1.0, y / 45.0 - 1.0, 1.0],
        None => [0.0; 3],
    };
    [see("head"), see("wrist")].concat()
}

/// The names of what is done until nothing more is.
fn led(approach: &mut Approach, place: &Point3<f32>, blocked: &[&str]) -> Vec<&'static str> {
    let mut done = Vec::new();
    for _ in 0..30 {
        approach.look(&latent(approach, place));
        let is_blocked = |c: usize| blocked.contains(&NAMES[c]);
        let Some(next) = approach.next(&goal(8), is_blocked) else {
            break;
        };
        done.push(NAMES[next]);
        approach.note(next);
    }
    done
}

/// An approach whose one demonstration does this.
fn shown(actions: &[&str], events: Vec<(u32, usize)>, landmarks: Vec<Landmark>) -> Approach {
    let mut made = approach(landmarks[0].clone());
    let book = LandmarkBook {
        landmarks,
        events: [("shown".to_owned(), events)].into(),
        actions: [(
            "shown".to_owned(),
            actions.iter().map(|n| class(n)).collect(),
        )]
        .into(),
        ..(*made.book).clone()
    };
    let space = ActionSpace::Primitives {
        names: NAMES.map(String::from).to_vec(),
    };
    made = Approach::new(&Arc::new(book), &[camera("head"), camera("wrist")], &space).unwrap();
    made
}
