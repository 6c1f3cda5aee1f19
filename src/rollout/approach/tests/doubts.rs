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

#[test]
fn a_place_that_was_hardly_seen_is_looked_at_again_before_the_gripper_opens() {
    let place = Point3::new(0.37, 0.0, 0.3);
    let mut approach = held(0.0);
    for _ in 0..2 {
        // Both cameras once: a weight of 2.
        approach.look(&latent(&approach, &place));
        let back = [["base_backward"; 3], ["end_effector_backward"; 3]].concat();
        assert_eq!(ends(&mut approach, 9), back);
        assert!(approach.place(0).is_none(), "what was seen is forgotten");
        for there in ["base_forward", "end_effector_forward"] {
            (0..3).for_each(|_| approach.note(class(there)));
        }
    }
    approach.look(&latent(&approach, &place));
    assert_eq!(ends(&mut approach, 1), ["gripper_open"], "twice is enough");
    let mut sure = held(0.0);
    (0..2).for_each(|_| sure.look(&latent(&sure, &Point3::new(0.54, 0.0, 0.3))));
    let done = ends(&mut sure, 9);
    assert_eq!(done.last(), Some(&"gripper_open"), "{done:?}");
    assert!(!done.contains(&"base_backward"), "{done:?}");
}

#[test]
fn a_policy_that_would_open_where_nothing_is_seen_looks_again() {
    let mut approach = held(0.0);
    let open = class("gripper_open");
    let back = Some(class("base_backward"));
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), back);
    let blocked = |class| Some(class) == back;
    assert_eq!(approach.instead_of(open, &goal(1), blocked), None);
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), back);
    assert_eq!(approach.instead_of(open, &goal(1), |_| false), None);
}

#[test]
fn a_place_is_in_doubt_where_its_sights_do_not_meet_at_its_height() {
    // Seen from two stances, where the height of what is seen tells.
    let is_looked_at_again = |height_m: f32| {
        let mut approach = held(0.018);
        let seen_at =
            |approach: &Approach, x: f32| latent(approach, &Point3::new(x, 0.0, height_m));
        for x in [0.77, 0.67, 0.57, 0.47] {
            approach.look(&seen_at(&approach, x));
            if x > 0.5 {
                approach.note(class("base_forward"));
            }
        }
        let done = ends(&mut approach, 9);
        let ends_with = *done.last().unwrap();
        let is_back = done.contains(&"base_backward");
        assert_eq!(is_back, ends_with != "gripper_open", "{done:?}");
        is_back
    };
    assert!(!is_looked_at_again(0.3));
    assert!(is_looked_at_again(0.36));
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
