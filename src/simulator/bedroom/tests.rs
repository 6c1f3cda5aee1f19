use super::*;
use crate::simulator::layout::StartPose;
use crate::simulator::world::Graspable;
use Primitive::{
    BaseBackward, BaseForward, EndEffectorBackward, EndEffectorDown, EndEffectorForward,
    EndEffectorRight, EndEffectorUp, GripperClose, GripperOpen, Terminate,
};

fn still(start: BedroomTask) -> BedroomConfig {
    BedroomConfig {
        variation: Some(Variation::NONE),
        ..BedroomConfig::paper(start)
    }
}

/// A room in which the robot stands before something, heading there, with the arm at home.
fn standing(task: BedroomTask, position_m: [f32; 2], heading_rad: f32) -> Bedroom {
    let mut room = Bedroom::new(still(task));
    room.arrangement.start = StartPose {
        position_m,
        heading_rad,
    };
    room.world = World::new(&room.layout, &room.arrangement);
    room
}

fn act(room: &mut Bedroom, primitives: &[(Primitive, usize)]) {
    for (primitive, times) in primitives {
        for _ in 0..*times {
            room.act(*primitive);
        }
    }
}

const NORTH: f32 = std::f32::consts::FRAC_PI_2;
const SOUTH: f32 = -std::f32::consts::FRAC_PI_2;

fn before_drawer() -> Bedroom {
    let [x, y, _] = Bedroom::new(still(BedroomTask::Sock)).insight().handle_m;
    standing(BedroomTask::Sock, [x, y - 0.45], NORTH)
}

/// The gripper is around the can, or beside it.
fn at_can(aside_m: f32) -> Bedroom {
    let [x, y] = Layout::bedroom().can_m;
    let mut room = standing(BedroomTask::Trash, [x + aside_m, y + 0.65], SOUTH);
    act(
        &mut room,
        &[
            (EndEffectorUp, 4),
            (BaseForward, 2),
            (EndEffectorForward, 3),
        ],
    );
    let insight = room.insight();
    let [ahead, _] = insight.relative_to_base([insight.can_m[0], insight.can_m[1]]);
    assert!(
        (insight.tool.x_m - ahead).abs() < 0.01,
        "the arm was stopped"
    );
    room
}

#[test]
fn same_seed_shows_the_same_bytes_and_another_seed_does_not() {
    let mut first = Bedroom::new(BedroomConfig::paper(BedroomTask::Wine));
    let mut second = Bedroom::new(BedroomConfig::paper(BedroomTask::Sock));
    second.config.start = BedroomTask::Wine;
    for action in [BaseForward, EndEffectorUp] {
        second.act(action);
    }
    assert_eq!(first.reset(7), second.reset(7));
    for primitive in [Primitive::BaseTurnLeft, BaseForward, EndEffectorForward] {
        let action = primitive.action();
        assert_eq!(first.step(&action), second.step(&action));
    }
    assert_ne!(first.reset(7), first.reset(8));
}

#[test]
fn observations_are_those_of_the_announced_cameras() {
    let mut room = Bedroom::new(BedroomConfig::paper(BedroomTask::Trash));
    let seen = room.reset(0).expect("a simulated room resets");
    assert_eq!(seen.cameras(), room.cameras());
}

#[test]
fn foreign_actions_are_refused() {
    let mut room = Bedroom::new(still(BedroomTask::Sock));
    for action in [Action::Primitive(15), Action::Continuous(vec![0.0])] {
        assert!(matches!(
            room.step(&action),
            Err(EnvironmentError::ActionRefused { .. })
        ));
    }
}

#[test]
fn drawer_follows_a_gripper_that_holds_its_handle() {
    let mut room = before_drawer();
    let reach = [(EndEffectorDown, 2), (EndEffectorForward, 3)];
    act(&mut room, &reach);
    act(&mut room, &[(GripperClose, 1)]);
    assert_eq!(room.insight().held, Some(Graspable::Drawer));
    act(&mut room, &[(BaseBackward, 3), (GripperOpen, 1)]);
    let opened_m = room.insight().drawer_opening_m;
    assert!((opened_m - 0.3).abs() < 0.02, "opened by {opened_m} m");
    assert!(room.truth().drawer_open);
    act(&mut room, &[(BaseBackward, 2)]);
    assert!((room.insight().drawer_opening_m - opened_m).abs() < 0.01);
}

#[test]
fn drawer_stays_shut_when_nothing_holds_it() {
    let mut room = before_drawer();
    act(
        &mut room,
        &[
            (EndEffectorDown, 2),
            (EndEffectorForward, 3),
            (BaseBackward, 3),
        ],
    );
    assert!(room.insight().drawer_opening_m.abs() < 0.005);
    assert!(!room.truth().drawer_open);
}

#[test]
fn grasp_around_the_can_lifts_it_and_release_drops_it() {
    let mut room = at_can(0.0);
    act(&mut room, &[(GripperClose, 1)]);
    assert!(!room.truth().can_grasped, "held, but not lifted yet");
    act(&mut room, &[(EndEffectorUp, 1)]);
    assert!(room.truth().can_grasped);
    act(
        &mut room,
        &[(BaseBackward, 3), (GripperOpen, 1), (Terminate, 1)],
    );
    assert!(!room.truth().can_grasped);
    assert!(room.insight().can_m[2] < 0.1, "it lies on the floor");
}

#[test]
fn grasp_beside_the_can_misses() {
    let mut room = at_can(0.09);
    act(&mut room, &[(GripperClose, 1), (EndEffectorUp, 1)]);
    assert_eq!(room.insight().held, None);
    assert!(!room.truth().can_grasped);
}

#[test]
fn furniture_stops_the_base_and_the_arm() {
    let layout = Layout::bedroom();
    let [x, y] = layout.chest.centre_m;
    let edge_m = y + layout.chest.half_m[1];
    let mut room = standing(BedroomTask::Wine, [x, edge_m + 0.45], SOUTH);
    act(&mut room, &[(EndEffectorUp, 4), (BaseForward, 5)]);
    let ahead_m = room.insight().base_m[1] - edge_m;
    assert!(
        (0.17..0.25).contains(&ahead_m),
        "base stopped {ahead_m} m off"
    );
    let down = room.insight().tool.z_m;
    act(&mut room, &[(EndEffectorDown, 12)]);
    let height_m = room.insight().tool.z_m - layout.chest.top_m;
    assert!(height_m < down - layout.chest.top_m && height_m > 0.0);
    act(
        &mut room,
        &[
            (EndEffectorUp, 2),
            (EndEffectorRight, 1),
            (EndEffectorBackward, 1),
        ],
    );
    assert!(
        room.insight().tool.z_m > layout.chest.top_m + 0.03,
        "it can leave again"
    );
}

#[test]
fn terminate_moves_nothing() {
    let mut room = Bedroom::new(still(BedroomTask::Sock));
    let before = room.insight();
    room.act(Terminate);
    let after = room.insight();
    assert_eq!((before.base_m, before.tool), (after.base_m, after.tool));
}

#[test]
fn a_bedroom_can_move_to_another_thread() {
    fn moves<T: Send>(_: &T) {}
    moves(&Bedroom::new(still(BedroomTask::Sock)));
}

#[test]
fn the_room_can_be_seen_from_above() {
    let mut room = Bedroom::new(still(BedroomTask::Sock));
    let picture = room.render_overview(60, 80);
    assert_eq!((picture.height(), picture.width()), (60, 80));
}

#[test]
fn at_the_largest_start_the_robot_stands_free_whichever_way_it_heads_and_beyond_it_does_not() {
    let layout = Layout::bedroom();
    let can_turn = |task, position_m, heading_rad| {
        let mut room = standing(task, position_m, heading_rad);
        room.act(Primitive::BaseTurnLeft);
        room.world.robot().stance.heading_rad != heading_rad
    };
    let most = Variation::MOST.start_position_m;
    let starts = [
        (BedroomTask::Sock, layout.start_at_bin),
        (BedroomTask::Trash, layout.start_at_container),
    ];
    for (task, nominal) in starts {
        let [x, y] = nominal.position_m;
        for quarter in 0..4_u8 {
            let heading_rad = nominal.heading_rad + f32::from(quarter) * NORTH;
            for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (-1.0, -1.0), (1.0, 1.0)] {
                let position_m = [x + dx * most, y + dy * most];
                assert!(
                    can_turn(task, position_m, heading_rad),
                    "{task:?} at {position_m:?} to {heading_rad}"
                );
            }
        }
    }
    let [x, y] = layout.start_at_container.position_m;
    let beyond = [x + most + 0.01, y];
    assert!(!can_turn(BedroomTask::Trash, beyond, 0.0), "in the box");
}

#[test]
fn what_is_not_written_of_a_variation_is_as_at_the_level() {
    let read = |text: &str| serde_json::from_str::<BedroomConfig>(text);
    let config = read(r#"{"start": "trash", "level": "hard", "variation": {"light": 0.1}}"#);
    let expected = BedroomConfig {
        level: Level::Hard,
        variation: Some(Variation {
            light: 0.1,
            ..Level::Hard.variation()
        }),
        ..BedroomConfig::paper(BedroomTask::Trash)
    };
    assert_eq!(config.expect("it is possible"), expected);
    // What a recording notes of its bedroom is read as it was, and is written as it was.
    let noted = r#"{"start":"sock","level":"paper","leftovers":"varied"}"#;
    let config = read(noted).expect("it is possible");
    assert_eq!(config.variation, None);
    assert_eq!(serde_json::to_string(&config).expect("it is data"), noted);
    let outside = read(r#"{"start": "sock", "variation": {"start_position_m": 3}}"#);
    let fault = outside.unwrap_err().to_string();
    assert!(fault.starts_with("`start_position_m` is 3, out"), "{fault}");
    assert!(read(r#"{"start": "sock", "vary": true}"#).is_err());
}

#[test]
#[should_panic(expected = "`start_position_m` is 3, out of range")]
fn a_room_whose_robot_would_stand_outside_the_house_is_refused() {
    let variation = Some(Variation {
        start_position_m: 3.0,
        ..Variation::NONE
    });
    let _ = Bedroom::new(BedroomConfig {
        variation,
        ..BedroomConfig::paper(BedroomTask::Sock)
    });
}
