use super::*;

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
