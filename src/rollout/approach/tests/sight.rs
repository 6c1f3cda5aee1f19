use super::*;

/// A robot that holds something, and saw its place so many times.
fn carrying(place: Point3<f32>, times: usize) -> Approach {
    let mut approach = approach(Landmark {
        reach_m: [[0.4, 0.5], [-0.1, 0.1]],
        ..Landmark::example(false, [1.0, 0.0, 0.0])
    });
    approach.note(class("gripper_close"));
    (0..times).for_each(|_| approach.look(&latent(&approach, &place)));
    approach
}

const FAR: Point3<f32> = Point3::new(0.9, 0.0, 0.3);

fn driven(approach: &Approach, step: u32) -> Option<&'static str> {
    approach.drive(&goal(step), |_| false).map(|c| NAMES[c])
}

#[test]
fn a_robot_that_sees_where_to_lay_something_down_drives_there() {
    for (place, expected) in [
        (FAR, Some("base_forward")),
        (Point3::new(0.8, 0.3, 0.3), Some("base_turn_left")),
        (Point3::new(0.8, -0.3, 0.3), Some("base_turn_right")),
        (Point3::new(0.5, 0.1, 0.3), None),
    ] {
        assert_eq!(driven(&carrying(place, 3), 1), expected, "{place}");
    }
}

#[test]
fn a_robot_does_not_drive_to_what_it_hardly_saw_nor_into_what_stops_it() {
    let mut faint = latent(&carrying(FAR, 0), &FAR);
    (faint[2], faint[5]) = (0.2, 0.2);
    let mut approach = carrying(FAR, 0);
    (0..3).for_each(|_| approach.look(&faint));
    assert!(approach.place(0).is_some());
    assert_eq!(driven(&approach, 1), None);
    assert_eq!(carrying(FAR, 3).drive(&goal(1), |_| true), None);
    let mut led_enough = carrying(FAR, 3);
    led_enough.led_steps = MOST_LED_STEPS;
    assert_eq!(led_enough.lead(&goal(1), true, |_| false), None);
}

#[test]
fn a_robot_is_led_to_a_place_in_sight_wherever_it_is_believed_to_be() {
    let near = Point3::new(0.45, 0.12, 0.3);
    let next = |times| carrying(near, times).next(&goal(0), |_| false);
    assert_eq!(next(3), Some(class("end_effector_left")));
    let mut faint = carrying(near, 0);
    let mut seen = latent(&faint, &near);
    (seen[2], seen[5]) = (0.2, 0.2);
    (0..3).for_each(|_| faint.look(&seen));
    assert_eq!(faint.next(&goal(0), |_| false), None, "12 steps away");
}

#[test]
fn a_robot_does_not_turn_away_from_where_it_is_to_lay_something_down() {
    let useless = |y: f32| carrying(Point3::new(0.8, y, 0.3), 3).useless(&goal(1), true);
    let [left, right] = ["base_turn_left", "base_turn_right"].map(class);
    assert!(useless(0.2).contains(&right) && !useless(0.2).contains(&left));
    assert!(useless(-0.2).contains(&left) && !useless(-0.2).contains(&right));
    assert!(
        ![left, right]
            .iter()
            .any(|turn| useless(0.05).contains(turn))
    );
    let unseen = carrying(FAR, 0).useless(&goal(1), true);
    assert!(![left, right].iter().any(|turn| unseen.contains(turn)));
}

#[test]
fn a_wrist_that_is_down_comes_up_before_the_arm_rises() {
    let mut approach = carrying(Point3::new(0.45, 0.0, 0.3), 3);
    approach.note(class("wrist_down"));
    let next = approach.next(&goal(8), |_| false);
    assert_eq!(next, Some(class("wrist_up")));
    let next = approach.next(&goal(8), |c| c == class("wrist_up"));
    assert_ne!(next, None, "blocked, it goes on as it is");
}
