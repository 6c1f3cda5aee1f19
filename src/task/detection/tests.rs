use std::sync::Arc;

use super::*;
use crate::trajectory::{Action, Marker, Observation, Step};

const NAMES: [&str; 3] = ["base_forward", "gripper_close", "gripper_open"];

fn trajectory(space: ActionSpace, actions: Vec<Action>, markers: &[(&str, usize)]) -> Trajectory {
    let steps = actions.into_iter().enumerate().map(|(i, action)| Step {
        time_secs: i as f64,
        observation: Arc::new(Observation::default()),
        action,
    });
    Trajectory {
        id: "demo_000".to_owned(),
        task: "sock".to_owned(),
        action_space: space,
        steps: steps.collect(),
        markers: markers
            .iter()
            .map(|(name, step)| Marker {
                step: *step,
                name: (*name).to_owned(),
            })
            .collect(),
    }
}

fn primitives(indices: &[usize], markers: &[(&str, usize)]) -> Trajectory {
    let names = NAMES.iter().map(|n| (*n).to_owned()).collect();
    let actions = indices.iter().map(|i| Action::Primitive(*i)).collect();
    trajectory(ActionSpace::Primitives { names }, actions, markers)
}

fn rule(name: &str, detection: SubgoalDetection) -> SubgoalRule {
    SubgoalRule {
        subgoal: Subgoal {
            task: "sock".to_owned(),
            name: name.to_owned(),
        },
        detection,
    }
}

fn gripper(event: GripperEvent, occurrence: Occurrence) -> SubgoalDetection {
    SubgoalDetection::Gripper {
        event,
        occurrence,
        signal: GripperSignal::default(),
    }
}

fn steps(rules: &[SubgoalRule], t: &Trajectory) -> Result<Vec<usize>, TaskError> {
    locate_subgoals(rules, t).map(|found| found.into_iter().map(|(_, s)| s).collect())
}

#[test]
fn gripper_events_count_from_the_subgoal_before() {
    // Closes at 1 (the drawer's handle), opens at 4, closes at 5 and opens at 8 (the sock).
    let t = primitives(&[0, 1, 1, 0, 2, 1, 0, 0, 2, 0], &[("drawer_open", 4)]);
    let rules = [
        rule(
            "drawer_open",
            SubgoalDetection::Marker("drawer_open".to_owned()),
        ),
        rule(
            "sock_grasped",
            gripper(GripperEvent::Close, Occurrence::Nth(1)),
        ),
        rule("sock_in_box", gripper(GripperEvent::Open, Occurrence::Last)),
    ];
    assert_eq!(steps(&rules, &t), Ok(vec![4, 6, 9]));
}

#[test]
fn telling_the_gripper_the_same_again_is_no_event() {
    let t = primitives(&[1, 1, 2, 1], &[]);
    let second = [rule("a", gripper(GripperEvent::Close, Occurrence::Nth(2)))];
    assert_eq!(steps(&second, &t), Ok(vec![3]));
    let third = [rule("a", gripper(GripperEvent::Close, Occurrence::Nth(3)))];
    assert!(matches!(
        steps(&third, &t),
        Err(TaskError::GripperEventMissing { found: 2, .. })
    ));
}

#[test]
fn dimension_crosses_its_threshold() {
    let actions = [1.0, 0.9, 0.2, 0.1, 0.8, 0.8]
        .iter()
        .map(|g| Action::Continuous(vec![0.0, *g]))
        .collect();
    let names = vec!["x".to_owned(), "gripper".to_owned()];
    let t = trajectory(ActionSpace::Continuous { names }, actions, &[]);
    let with = |event, name: &str| {
        let detection = SubgoalDetection::Gripper {
            event,
            occurrence: Occurrence::Nth(1),
            signal: GripperSignal::Dimension {
                name: name.to_owned(),
                threshold: 0.5,
                closed_below: true,
            },
        };
        rule("a", detection)
    };
    let both = [
        with(GripperEvent::Close, "gripper"),
        with(GripperEvent::Open, "gripper"),
    ];
    assert_eq!(steps(&both, &t), Ok(vec![3, 5]));
    let absent = steps(&[with(GripperEvent::Close, "grip")], &t).unwrap_err();
    assert!(
        absent.to_string().contains("it has: x, gripper"),
        "{absent}"
    );
}

#[test]
fn faults_name_what_is_there() {
    let marker = |name: &str| rule(name, SubgoalDetection::Marker(name.to_owned()));
    let t = primitives(&[0, 0, 0], &[("b", 0), ("a", 2), ("far", 7)]);
    let missing = steps(&[marker("c")], &t).unwrap_err().to_string();
    assert!(missing.ends_with("its markers: b, a, far"), "{missing}");
    assert!(matches!(
        steps(&[marker("a"), marker("b")], &t),
        Err(TaskError::OutOfOrder {
            earlier_step: 2,
            later_step: 0,
            ..
        })
    ));
    assert!(matches!(
        steps(&[marker("far")], &t),
        Err(TaskError::MarkerBeyondEnd {
            step: 7,
            steps: 3,
            ..
        })
    ));
    assert!(matches!(
        steps(&[rule("e", SubgoalDetection::End)], &primitives(&[], &[])),
        Err(TaskError::NoSteps { .. })
    ));
}
