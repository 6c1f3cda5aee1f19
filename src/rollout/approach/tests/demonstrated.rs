use super::*;

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
