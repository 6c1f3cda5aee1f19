mod doubts;
mod sight;

use std::collections::BTreeMap;

use super::*;
use crate::model::{GraspSight, Landmark, LandmarkView};
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

#[test]
fn the_gripper_comes_into_line_goes_ahead_and_closes() {
    let mut approach = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    let done = led(&mut approach, &Point3::new(0.48, 0.07, 0.3), &[]);
    assert_eq!(done.last(), Some(&"gripper_close"), "{done:?}");
    let ahead = done.iter().position(|n| *n == "end_effector_forward");
    let aside = done.iter().rposition(|n| *n == "end_effector_left");
    assert!(aside < ahead, "{done:?}");
    let [x, y, z] = approach.posture.gripper_m();
    let off = [x - 0.48, y - 0.07, z - 0.3].map(f32::abs);
    assert!(off.iter().all(|o| *o < 0.02), "{off:?}");
}

#[test]
fn a_gripper_beside_its_thing_goes_back_before_it_goes_across() {
    let mut approach = approach(Landmark::example(true, [0.0, 0.0, -1.0]));
    let place = Point3::new(0.42, -0.09, 0.36);
    approach.book = Arc::new(LandmarkBook {
        landmarks: vec![Landmark {
            height_m: 0.36,
            ..approach.book.landmarks[0].clone()
        }],
        ..(*approach.book).clone()
    });
    let done = led(&mut approach, &place, &[]);
    assert_eq!(done[0], "end_effector_up", "{done:?}");
    assert_eq!(done.last(), Some(&"gripper_close"), "{done:?}");
    let across = done.iter().rposition(|n| *n == "end_effector_right");
    let down = done.iter().position(|n| *n == "end_effector_down");
    assert!(across < down, "{done:?}");
}

#[test]
fn what_stops_the_gripper_right_before_its_thing_is_that_thing() {
    let mut approach = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    let place = Point3::new(0.40, 0.0, 0.36);
    approach.book = Arc::new(LandmarkBook {
        landmarks: vec![Landmark {
            height_m: 0.36,
            ..approach.book.landmarks[0].clone()
        }],
        ..(*approach.book).clone()
    });
    let done = led(&mut approach, &place, &["end_effector_forward"]);
    assert_eq!(done, ["gripper_close"]);
    approach.reset();
    let far = Point3::new(0.5, 0.0, 0.36);
    assert!(led(&mut approach, &far, &["end_effector_forward"]).is_empty());
}

#[test]
fn the_gripper_is_brought_over_a_place_first_to_the_side_and_then_opens() {
    let mut approach = approach(Landmark::example(false, [1.0, 0.0, 0.0]));
    let place = Point3::new(0.51, 0.12, 0.3);
    assert!(
        led(&mut approach, &place, &[]).is_empty(),
        "nothing is held"
    );
    approach.note(class("gripper_close"));
    approach.looks = 1;
    let done = led(&mut approach, &place, &[]);
    let expected = [
        &["end_effector_left"; 4][..],
        &["end_effector_forward"; 5],
        &["gripper_open"],
    ];
    assert_eq!(done, expected.concat());
}

#[test]
fn the_base_is_driven_to_where_the_gripper_reaches_over_a_place() {
    for (ahead, drive) in [
        ([0.35, 0.45], "base_forward"),
        ([0.65, 0.75], "base_backward"),
    ] {
        let mut approach = approach(Landmark {
            reach_m: [ahead, [-0.1, 0.1]],
            ..Landmark::example(false, [1.0, 0.0, 0.0])
        });
        approach.note(class("gripper_close"));
        approach.look(&latent(&approach, &Point3::new(0.67, 0.0, 0.3)));
        approach.note(class("base_forward"));
        let next = approach.next(&goal(8), |_| false);
        assert_eq!(next.map(|class| NAMES[class]), Some(drive));
    }
}

#[test]
fn what_is_seen_of_a_place_beside_the_gripper_is_not_believed() {
    let mut approach = approach(Landmark::example(false, [1.0, 0.0, 0.0]));
    approach.note(class("gripper_close"));
    let place = Point3::new(0.45, 0.0, 0.3);
    approach.look(&latent(&approach, &place));
    approach.look(&latent(&approach, &Point3::new(0.45, 0.3, 0.3)));
    let believed = approach.place(0).unwrap();
    assert!((believed - place).norm() < 0.01, "{believed}");
}

#[test]
fn an_unsure_sight_of_where_to_open_counts_by_the_square_of_its_sureness() {
    let (sure, unsure) = (Point3::new(0.6, 0.0, 0.3), Point3::new(0.6, 0.12, 0.3));
    let believed = |closes: bool| {
        let mut approach = approach(Landmark::example(closes, [1.0, 0.0, 0.0]));
        approach.note(class("gripper_close"));
        approach.look(&latent(&approach, &sure));
        let mut faint = latent(&approach, &unsure);
        (faint[2], faint[5]) = (0.1, 0.1);
        (0..3).for_each(|_| approach.look(&faint));
        approach.place(0).unwrap().y
    };
    let (closing, opening) = (believed(true), believed(false));
    assert!(opening < 0.5 * closing, "{opening} and {closing}");
}

#[test]
fn what_is_held_is_not_let_go_beside_its_place_nor_long_before() {
    let mut approach = approach(Landmark::example(false, [1.0, 0.0, 0.0]));
    let open = class("gripper_open");
    let far = Node {
        trajectory: "far".to_owned(),
        ..goal(0)
    };
    approach.book = Arc::new(LandmarkBook {
        events: [
            ("shown".to_owned(), vec![(12, 0)]),
            ("far".to_owned(), vec![(40, 0)]),
        ]
        .into(),
        ..(*approach.book).clone()
    });
    assert_eq!(approach.too_early(&far), None, "nothing is held");
    approach.note(class("gripper_close"));
    assert_eq!(approach.too_early(&far), Some(open));
    assert_eq!(approach.too_early(&goal(8)), None);
    approach.look(&latent(&approach, &Point3::new(0.45, 0.08, 0.3)));
    let instead = approach.instead_of(open, &goal(1), |_| false);
    assert_eq!(instead, Some(class("end_effector_left")));
    let other = class("end_effector_up");
    assert_eq!(approach.instead_of(other, &goal(1), |_| false), None);
}

#[test]
fn the_robot_is_not_led_from_afar_nor_where_nothing_is_seen() {
    let mut approach = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    let place = Point3::new(0.54, 0.05, 0.3);
    approach.look(&latent(&approach, &place));
    assert!(
        approach.next(&goal(1), |_| false).is_none(),
        "11 steps away"
    );
    assert!(approach.next(&goal(19), |_| false).is_none(), "over");
    assert!(approach.next(&goal(6), |_| false).is_some());
    approach.reset();
    approach.look(&[0.0; 6]);
    assert!(approach.next(&goal(6), |_| false).is_none());
    approach.look(&latent(&approach, &Point3::new(0.9, 0.0, 0.3)));
    assert!(approach.next(&goal(6), |_| false).is_none(), "out of reach");
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

#[test]
fn after_a_closing_the_robot_does_what_demonstrations_do_then() {
    let actions = [
        "gripper_close",
        "end_effector_up",
        "base_backward",
        "gripper_open",
    ];
    let mut approach = shown(
        &actions,
        vec![(0, 0)],
        vec![Landmark::example(true, [1.0, 0.0, 0.0])],
    );
    let close = class("gripper_close");
    assert_eq!(approach.depart(|_| false), None, "nothing was closed");
    approach.chosen(close, &goal(0));
    approach.note(close);
    assert!(
        approach
            .useless(&goal(0), false)
            .contains(&class("gripper_open"))
    );
    assert_eq!(approach.depart(|_| false), Some(class("end_effector_up")));
    assert_eq!(approach.depart(|_| false), Some(class("base_backward")));
    assert_eq!(
        approach.depart(|_| false),
        None,
        "the gripper is not opened blindly"
    );
    for _ in 0..=HOPE_STEPS {
        approach.look(&[0.0; 6]);
    }
    assert!(
        !approach
            .useless(&goal(0), false)
            .contains(&class("gripper_open"))
    );
    approach.note(class("gripper_open"));
    approach.chosen(close, &goal(0));
    approach.note(close);
    assert_eq!(approach.depart(|_| true), None, "blocked");
    assert_eq!(
        approach.depart(|_| false),
        None,
        "what was blocked is not gone on with"
    );
}

#[test]
fn the_arm_rests_where_demonstrations_only_drive() {
    let drive = ["base_forward"; 8];
    let actions = [&["end_effector_up"][..], &drive, &["gripper_close"]].concat();
    let mut approach = shown(
        &actions,
        vec![(9, 0)],
        vec![Landmark::example(true, [1.0, 0.0, 0.0])],
    );
    approach.note(class("end_effector_forward"));
    approach.note(class("end_effector_forward"));
    assert_eq!(
        approach.rest(&goal(1), |_| false),
        None,
        "the arm was just moved"
    );
    let mut done = Vec::new();
    while let Some(next) = approach.rest(&goal(5), |_| false) {
        done.push(NAMES[next]);
        approach.note(next);
    }
    assert_eq!(done, ["end_effector_backward"], "to within a step");
    assert!(
        approach
            .useless(&goal(5), false)
            .contains(&class("end_effector_up"))
    );
    assert!(
        !approach
            .useless(&goal(5), true)
            .contains(&class("end_effector_up"))
    );
}

#[test]
fn the_gripper_is_not_closed_beside_a_thing_that_is_seen() {
    let mut approach = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    approach.look(&latent(&approach, &Point3::new(0.54, 0.05, 0.3)));
    let close = class("gripper_close");
    assert_eq!(approach.too_early(&goal(8)), Some(close));
    for name in ["end_effector_forward"; 6] {
        approach.note(class(name));
    }
    approach.note(class("end_effector_left"));
    approach.note(class("end_effector_down"));
    approach.note(class("end_effector_down"));
    assert_eq!(approach.too_early(&goal(8)), None);
}

#[test]
fn a_gripper_that_is_low_rises_before_it_goes_over_its_place() {
    let actions = ["gripper_close", "end_effector_up", "gripper_open"];
    let mut approach = shown(
        &actions,
        vec![(2, 0)],
        vec![Landmark::example(false, [1.0, 0.0, 0.0])],
    );
    approach.note(class("gripper_close"));
    approach.look(&latent(&approach, &Point3::new(0.45, 0.3, 0.3)));
    approach.look(&latent(&approach, &Point3::new(0.42, 0.2, 0.3)));
    approach.note(class("end_effector_down"));
    let next = approach.next(&goal(1), |_| false);
    assert_eq!(next, Some(class("end_effector_up")));
}

#[test]
fn an_arm_that_reaches_no_farther_comes_down_to_where_demonstrations_open_and_then_the_base_goes_ahead()
 {
    let actions = ["gripper_close", "end_effector_up", "gripper_open"];
    let begun = |up: usize, x: f32| {
        let mut approach = shown(
            &actions,
            vec![(2, 0)],
            vec![Landmark::example(false, [1.0, 0.0, 0.0])],
        );
        approach.note(class("gripper_close"));
        approach.look(&latent(&approach, &Point3::new(x, 0.0, 0.3)));
        (0..up).for_each(|_| approach.note(class("end_effector_up")));
        approach
    };
    let then = |approach: &mut Approach, blocked: &[&str]| {
        let is_blocked = |c: usize| blocked.contains(&NAMES[c]);
        approach.next(&goal(1), is_blocked).map(|c| NAMES[c])
    };
    let next = |up: usize, x: f32, blocked: &[&str]| then(&mut begun(up, x), blocked);
    let short = ["end_effector_forward"];
    assert_eq!(next(3, 0.45, &[]), Some("end_effector_forward"));
    assert_eq!(next(3, 0.45, &short), Some("end_effector_down"));
    assert_eq!(next(1, 0.45, &short), Some("base_forward"));
    let stopped = ["end_effector_forward", "base_forward"];
    assert_eq!(next(1, 0.45, &stopped), None);
    let mut little = begun(1, 0.40);
    assert_eq!(then(&mut little, &short), Some("base_forward"));
    little.note(class("base_forward"));
    assert_eq!(then(&mut little, &[]), Some("end_effector_backward"));
    let behind = ["end_effector_backward"];
    assert_eq!(next(1, 0.31, &behind), None, "it is no nearer from ahead");
    let across = ["end_effector_left", "end_effector_right"];
    assert_eq!(next(1, 0.45, &across), Some("end_effector_forward"));
}

#[test]
fn a_gripper_as_high_as_it_gets_goes_across_as_low_as_it_is() {
    let mut approach = approach(Landmark::example(true, [0.0, 0.0, -1.0]));
    let place = Point3::new(0.42, -0.09, 0.3);
    approach.note(class("end_effector_down"));
    approach.look(&latent(&approach, &place));
    let mut next = |blocked: &[&str]| {
        let is_blocked = |c: usize| blocked.contains(&NAMES[c]);
        approach.next(&goal(8), is_blocked).map(|c| NAMES[c])
    };
    assert_eq!(next(&[]), Some("end_effector_up"));
    assert_eq!(next(&["end_effector_up"]), Some("end_effector_right"));
}

#[test]
fn the_base_is_driven_up_where_the_arm_would_reach_too_far_and_the_gripper_is_not_driven_into_the_thing()
 {
    let next = |direction, departure, x: f32| {
        let actions = [&["base_backward"; 12][..], &["gripper_close", departure]].concat();
        let mut approach = shown(
            &actions,
            vec![(12, 0)],
            vec![Landmark::example(true, direction)],
        );
        let [gripper_x, _, z] = approach.posture.gripper_m();
        assert!((gripper_x - 0.36).abs() < 1e-6);
        for _ in 0..5 {
            approach.note(class("end_effector_forward"));
        }
        let height_m = if direction[0] > 0.5 { z } else { z - 0.1 };
        approach.book = Arc::new(LandmarkBook {
            landmarks: vec![Landmark {
                height_m,
                ..approach.book.landmarks[0].clone()
            }],
            ..(*approach.book).clone()
        });
        approach.look(&latent(&approach, &Point3::new(x, 0.0, height_m)));
        approach.next(&goal(8), |_| false).map(|c| NAMES[c])
    };
    let (ahead, above) = ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
    let (up, back) = ("end_effector_up", "base_backward");
    assert_eq!(next(above, up, 0.65), Some("base_forward"));
    assert_eq!(next(ahead, up, 0.65), Some("base_forward"));
    let room = "0.12 m are left";
    assert_eq!(next(ahead, up, 0.63), Some("base_forward"), "{room}");
    assert_eq!(next(ahead, up, 0.62), Some("end_effector_backward"));
    assert_ne!(next(above, up, 0.6), Some("base_forward"), "within reach");
    let nothing_is_lifted = next(ahead, back, 0.63);
    assert_eq!(nothing_is_lifted, Some("end_effector_forward"));
}

#[test]
fn a_closing_that_is_seen_to_hold_nothing_is_tried_again_a_step_farther() {
    let lifted = ["gripper_close", "end_effector_up", "base_backward"];
    let pulled = ["gripper_close", "base_backward", "base_backward"];
    let after = |actions: &[&str; 3], sights: &[f64]| {
        let made = Landmark::example(true, [1.0, 0.0, 0.0]);
        let mut approach = shown(actions, vec![(0, 0)], vec![made]);
        approach.chosen(class("gripper_close"), &goal(0));
        approach.note(class("gripper_close"));
        for empty in sights {
            let (open, held) = (0.0, 1.0 - empty);
            let empty = *empty;
            let thing = 0;
            approach.feel(GraspSight {
                open,
                empty,
                held,
                thing,
            });
        }
        let next = approach.depart(|_| false).map(|c| NAMES[c]);
        let place = Point3::new(0.5, 0.0, 0.3);
        let tried = approach.tried(&approach.book.landmarks[0], &place);
        (next, ((tried.x - place.x) * 100.0).round())
    };
    assert_eq!(after(&lifted, &[0.9, 0.9]), (Some("gripper_open"), 3.0));
    assert_eq!(
        after(&lifted, &[0.9, 0.1, 0.9]),
        (Some("end_effector_up"), 0.0)
    );
    assert_eq!(
        after(&lifted, &[0.6, 0.6, 0.6]),
        (Some("end_effector_up"), 0.0)
    );
    assert_eq!(after(&pulled, &[0.9, 0.9]), (Some("base_backward"), 0.0));
}

#[test]
fn a_base_that_was_stopped_does_not_spoil_where_a_place_is() {
    let mut approach = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    let look = |approach: &mut Approach, x: f32| {
        approach.look(&latent(approach, &Point3::new(x, 0.0, 0.3)));
    };
    (0..4).for_each(|_| look(&mut approach, 0.7));
    approach.note(class("base_forward"));
    // It got half as far as it was sent, 0.1 m.
    let at = |approach: &Approach| (approach.place(0).unwrap().x * 100.0).round();
    assert_eq!(at(&approach), 60.0);
    let seen_from_there = Point3::new(0.75, 0.0, 0.3);
    approach.look(&latent(&approach, &seen_from_there));
    assert_eq!(at(&approach), 65.0);
}
