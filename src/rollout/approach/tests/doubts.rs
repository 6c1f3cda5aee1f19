use super::*;

/// A gripper that holds something over a place at which it is to open.
fn held(height_spread_m: f32) -> Approach {
    let mut approach = approach(Landmark {
        height_spread_m,
        ..Landmark::example(false, [1.0, 0.0, 0.0])
    });
    approach.note(class("gripper_close"));
    approach
}

/// The names of what is done at the end of the way, one after the other, while nothing more is seen.
fn ends(approach: &mut Approach, count: usize) -> Vec<&'static str> {
    let mut done = Vec::new();
    while done.len() < count {
        let next = (approach.depart(|_| false)).or_else(|| approach.next(&goal(8), |_| false));
        let Some(next) = next else { break };
        done.push(NAMES[next]);
        approach.note(next);
    }
    done
}

/// Near the gripper, as it is before it opens.
const PLACE: Point3<f32> = Point3::new(0.37, 0.0, 0.3);

#[test]
fn before_it_opens_the_robot_looks_again_with_the_gripper_out_of_sight() {
    let mut approach = held(0.0);
    (0..3).for_each(|_| approach.look(&latent(&approach, &PLACE)));
    let aside = ["end_effector_right"; 5];
    let look = [
        &["base_backward"][..],
        &aside,
        &["end_effector_backward"; 3],
    ]
    .concat();
    assert_eq!(ends(&mut approach, 9), look);
    assert!(approach.place(0).is_none(), "what was seen is forgotten");
    let place = Point3::new(0.47, 0.0, 0.3);
    (0..3).for_each(|_| approach.look(&latent(&approach, &place)));
    let done = ends(&mut approach, 20);
    assert_eq!(done.last(), Some(&"gripper_open"), "{done:?}");
    assert!(!done.contains(&"base_backward"), "once is enough: {done:?}");
}

#[test]
fn a_place_that_was_hardly_seen_is_looked_at_a_second_time_and_not_a_third() {
    let mut approach = held(0.0);
    let mut looks = 0;
    // One sight each time, which is a weight of 1.
    for _ in 0..3 {
        approach.look(&latent(&approach, &PLACE));
        let done = ends(&mut approach, 9);
        looks += usize::from(done.contains(&"base_backward"));
        for there in ["end_effector_forward", "end_effector_left", "base_forward"] {
            let count = done.iter().filter(|name| opposite(name) == there).count();
            (0..count).for_each(|_| approach.note(class(there)));
        }
    }
    assert_eq!(looks, 2);
}

fn opposite(name: &str) -> &'static str {
    match name {
        "end_effector_backward" => "end_effector_forward",
        "end_effector_right" => "end_effector_left",
        "base_backward" => "base_forward",
        _ => "",
    }
}

#[test]
fn a_place_to_the_right_is_looked_at_from_its_left() {
    let mut approach = held(0.0);
    (0..4).for_each(|_| approach.note(class("end_effector_right")));
    let place = Point3::new(0.37, -0.12, 0.3);
    (0..3).for_each(|_| approach.look(&latent(&approach, &place)));
    let done = ends(&mut approach, 12);
    assert!(done.contains(&"end_effector_left"), "{done:?}");
    assert!(!done.contains(&"end_effector_right"), "{done:?}");
    // The line of sight to (0.47, -0.12) is 0.10 m to the right where the gripper is.
    assert!(approach.posture.gripper_m()[1] > 0.03);
}

#[test]
fn a_camera_that_went_aside_with_the_gripper_tells_nothing() {
    let mut approach = held(0.0);
    approach.looks = 1;
    let mut seen = latent(&approach, &PLACE);
    // The wrist camera sees it elsewhere.
    (seen[3], seen[4], seen[5]) = (-0.8, 0.6, 1.0);
    (0..3).for_each(|_| approach.look(&seen));
    let believed = approach.place(0).unwrap();
    assert!((believed - PLACE).norm() < 0.01, "{believed}");
    seen[2] = 0.0;
    approach.seen[0].clear();
    approach.look(&seen);
    assert!(approach.place(0).is_none());
}

#[test]
fn a_robot_that_has_no_camera_but_the_grippers_does_not_go_aside_to_look() {
    let looks = |cameras: [&str; 2]| {
        let mut approach = held(0.0);
        approach.cameras = cameras.map(camera).to_vec();
        approach
            .look_again(class("gripper_open"), 0, |_| false)
            .is_some()
    };
    assert!(looks(["head", "wrist"]));
    assert!(!looks(["wrist", "wrist"]));
}

#[test]
fn a_policy_that_would_open_where_nothing_is_seen_looks_again() {
    let mut approach = held(0.0);
    let open = class("gripper_open");
    let back = Some(class("base_backward"));
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), back);
    let blocked = |class| Some(class) == back;
    let aside = Some(class("end_effector_right"));
    assert_eq!(approach.instead_of(open, &goal(1), blocked), aside);
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), None);
}

#[test]
fn a_place_is_in_doubt_where_its_sights_do_not_meet_at_its_height() {
    // Seen from two stances, where the height of what is seen tells.
    let is_in_doubt = |height_m: f32| {
        let mut approach = held(0.018);
        for x in [0.77, 0.67, 0.57, 0.47] {
            approach.look(&latent(&approach, &Point3::new(x, 0.0, height_m)));
            if x > 0.5 {
                approach.note(class("base_forward"));
            }
        }
        approach.is_in_doubt(0)
    };
    assert!(!is_in_doubt(0.3));
    assert!(is_in_doubt(0.36));
}

#[test]
fn an_arm_is_not_taken_for_a_place_nearer_than_demonstrations_bring_it() {
    for (ahead, is_believed) in [(0.52, false), (0.56, true)] {
        let mut approach = approach(Landmark {
            reach_m: [[0.6, 0.8], [-0.1, 0.1]],
            ..Landmark::example(false, [1.0, 0.0, 0.0])
        });
        approach.note(class("gripper_close"));
        approach.look(&latent(&approach, &Point3::new(ahead, 0.0, 0.3)));
        assert_eq!(approach.place(0).is_some(), is_believed, "{ahead}");
    }
}

#[test]
fn a_place_that_is_hardly_seen_hides_nothing() {
    let mut approach = held(0.0);
    let mut faint = latent(&approach, &Point3::new(0.4, 0.0, 0.3));
    (faint[2], faint[5]) = (0.2, 0.2);
    approach.look(&faint);
    let place = Point3::new(0.6, 0.2, 0.3);
    (0..3).for_each(|_| approach.look(&latent(&approach, &place)));
    let believed = approach.place(0).unwrap();
    assert!((believed - place).norm() < 0.03, "{believed}");
}

#[test]
fn what_is_let_go_where_nobody_sees_the_place_is_let_go_at_once() {
    // The handle of a drawer that was pulled.
    let mut approach = approach(Landmark {
        error_pixels: f32::MAX,
        ..Landmark::example(false, [1.0, 0.0, 0.0])
    });
    approach.note(class("gripper_close"));
    let open = class("gripper_open");
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), None);
}
