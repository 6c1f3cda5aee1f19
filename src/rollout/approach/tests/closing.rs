use super::*;
use crate::model::GraspSight;

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

#[test]
fn a_base_that_was_stopped_is_not_driven_again_before_what_the_arm_reaches() {
    let mut approach = approach(Landmark {
        reach_m: [[0.3, 0.4], [-0.1, 0.1]],
        ..Landmark::example(true, [1.0, 0.0, 0.0])
    });
    let at = |approach: &mut Approach, ahead| {
        approach.seen[0].clear();
        approach.look(&latent(approach, &Point3::new(ahead, 0.0, 0.3)));
        approach.next(&goal(8), |_| false)
    };
    let drive = class("base_forward");
    let (in_reach, out_of_reach) = (0.45, 0.55);
    approach.note_stopped(drive);
    assert_ne!(at(&mut approach, in_reach), Some(drive));
    assert_eq!(at(&mut approach, out_of_reach), Some(drive));
    approach.note(class("base_backward"));
    assert!(!approach.is_stopped);
}

#[test]
fn a_new_episode_knows_nothing_of_the_last_one() {
    let fresh = approach(Landmark::example(true, [1.0, 0.0, 0.0]));
    let mut used = fresh.clone();
    used.look(&latent(&used, &Point3::new(0.5, 0.0, 0.3)));
    (used.closing, used.is_lifting) = (Some(0), true);
    used.note(class("gripper_close"));
    used.note(class("base_forward"));
    used.note_stopped(class("base_forward"));
    (used.is_lifting, used.empty_looks, used.closed_steps) = (true, 1, 5);
    assert_ne!(format!("{used:?}"), format!("{fresh:?}"));
    used.reset();
    assert_eq!(format!("{used:?}"), format!("{fresh:?}"));
}
