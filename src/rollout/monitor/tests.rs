use std::collections::BTreeMap;

use super::*;
use crate::graph::TopologicalGraph;
use crate::graph::fakes::{BrokenEncoder, Oracle, PixelEncoder, add_demonstration, forward, task};
use crate::model::{
    ActionDistribution, GraspSense, Landmark, LandmarkBook, LocalPolicy, grasp_values,
};
use crate::planner::fakes::corridor;
use crate::planner::{FilterOptions, FinalChoice, PlannerOptions};
use crate::rollout::{Rollout, RolloutModel};
use crate::task::Automaton;
use crate::trajectory::{Image, RobotGeometry};

/// The corridor's subgoals.
const THREE: [&str; 3] = ["first", "second", "third"];

/// Drives nowhere.
struct Nobody;

impl LocalPolicy for Nobody {
    fn act(&self, _: &[f32], _: &[f32]) -> Result<ActionDistribution, ModelError> {
        unreachable!("no step is made")
    }
}

fn seen_at(x: u8) -> Arc<Observation> {
    let image = Image::new(1, 1, vec![x, 0, 0]).expect("one pixel");
    Arc::new(Observation::new([("eye".to_owned(), image)]))
}

/// Options of a monitor that asks of all states and has no classifier of stages.
fn without_classifier() -> RolloutOptions {
    RolloutOptions {
        near_probability: 0.0,
        filter: FilterOptions {
            classifier_weight: 0.0,
            ..FilterOptions::default()
        },
        ..RolloutOptions::default()
    }
}

/// What a monitor says of a robot that is seen at these positions of the corridor.
fn told(positions: impl IntoIterator<Item = u8>) -> Vec<Event> {
    told_with(&RolloutOptions::default(), positions)
}

fn told_with(options: &RolloutOptions, positions: impl IntoIterator<Item = u8>) -> Vec<Event> {
    let planner = corridor(&THREE);
    let oracle = Oracle::new(5, forward);
    let model = MonitorModel {
        encoder: &PixelEncoder::new(5),
        traversability: &oracle,
        landmarks: None,
    };
    let options = RolloutOptions {
        near_probability: 0.0,
        ..options.clone()
    };
    let mut monitor = Monitor::new(model, &planner, &options).expect("the graph is of the oracle");
    let mut events = Vec::new();
    for x in positions {
        let sight = monitor.look(seen_at(x));
        events.extend(sight.expect("the oracle knows all").events);
    }
    events
}

#[test]
fn a_graph_of_another_d_max_is_refused_with_both() {
    let model = MonitorModel {
        encoder: &PixelEncoder::new(7),
        traversability: &Oracle::new(7, forward),
        landmarks: None,
    };
    let refused = Monitor::new(model, &corridor(&THREE), &RolloutOptions::default()).err();
    let error = refused.expect("the graph has a d_max of 5").to_string();
    assert!(error.contains("d_max 5, expected 7"), "{error}");
}

#[test]
fn a_latent_that_is_no_number_is_an_error_at_its_step() {
    let encoder = BrokenEncoder::new(5, [2, 0]);
    let model = MonitorModel {
        encoder: &encoder,
        traversability: &Oracle::new(5, forward),
        landmarks: None,
    };
    let options = RolloutOptions::default();
    let mut monitor = Monitor::new(model, &corridor(&THREE), &options).expect("the graph fits");
    for x in 0..2 {
        monitor.look(seen_at(x)).expect("the encoder works here");
    }
    let error = monitor.look(seen_at(2)).unwrap_err().to_string();
    for part in ["step 2", "value 1", "NaN", "train or export it again"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn what_runs_can_be_printed() {
    let (encoder, oracle) = (PixelEncoder::new(5), Oracle::new(5, forward));
    let model = RolloutModel {
        encoder: &encoder,
        traversability: &oracle,
        policy: &Nobody,
        landmarks: None,
    };
    let rollout = Rollout::new(model, corridor(&THREE), RolloutOptions::default());
    let printed = format!("{:?}", rollout.expect("the graph fits"));
    for part in ["latent_dim: 3", "stage: 0", "max_steps: 400"] {
        assert!(printed.contains(part), "{printed}");
    }
}

#[test]
fn a_walk_reaches_every_subgoal_in_order() {
    let reached: Vec<String> = told((0..25).chain([24; 4]))
        .into_iter()
        .map(|event| match event {
            Event::SubgoalReached { subgoal, .. } => subgoal.name,
            other => other.to_string(),
        })
        .collect();
    assert_eq!(reached, ["first", "second", "third"]);
}

#[test]
fn a_robot_that_is_lost_for_long_is_said_to_be_and_to_be_found_again() {
    let of_spell = |steps: usize| {
        let walk = (0..5).chain(std::iter::repeat_n(90, steps)).chain(5..9);
        let told = told(walk).into_iter();
        told.filter(|event| matches!(event, Event::Lost { .. } | Event::Found { .. }))
            .map(|event| event.to_string())
            .collect::<Vec<_>>()
    };
    let patience = FilterOptions::default().lost_patience as usize;
    let long = patience - 1 + TOLD_LOST_STEPS as usize;
    assert!(of_spell(long - 1).is_empty());
    let said = of_spell(long);
    assert_eq!(said.len(), 2, "{said:?}");
    assert_eq!(said[0], format!("step {}: lost", 5 + long - 1));
    assert_eq!(said[1], format!("step {}: found again", 5 + long));
}

#[test]
fn a_robot_that_has_reached_everything_may_be_anywhere() {
    let walk = (0..25).chain([24; 4]).chain([90; 40]);
    let events = told(walk);
    let reached = |event: &&Event| matches!(event, Event::SubgoalReached { .. });
    assert_eq!(events.iter().filter(reached).count(), THREE.len());
    let is_lost = |event: &Event| matches!(event, Event::Lost { .. });
    assert!(!events.iter().any(is_lost), "{events:?}");
}

/// A gripper that closes at the first subgoal and opens at the second; it looks green when it is open and blue
/// when it holds something.
fn book_of_corridor() -> LandmarkBook {
    let landmark = |closes| Landmark::example(closes, [1.0, 0.0, 0.0]);
    let region = [0.0, 0.0, 1.0, 1.0];
    let dark = Image::new(1, 1, vec![0; 3]).expect("one pixel");
    let values = grasp_values(&dark, region).len();
    let events = |aside: i32| (aside.to_string(), vec![(8, 0), (16, 1)]);
    LandmarkBook {
        robot: RobotGeometry::locobot(),
        views: Vec::new(),
        landmarks: vec![landmark(true), landmark(false)],
        events: (0..3).map(events).collect(),
        actions: BTreeMap::new(),
        grasp: Some(GraspSense {
            camera: "eye".to_owned(),
            region,
            mean: vec![0.0; values],
            weights: [[0.0, 1.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]]
                .map(|of_colours| of_colours.repeat(values / 3))
                .to_vec(),
            intercepts: vec![0.0, 100.0, 0.0],
            things: Vec::new(),
        }),
    }
}

#[test]
fn landmarks_of_another_encoder_are_refused_before_a_run() {
    let (oracle, encoder) = (Oracle::new(5, forward), PixelEncoder::new(5));
    let refused = |book: &LandmarkBook| {
        let model = RolloutModel {
            encoder: &encoder,
            traversability: &oracle,
            policy: &Nobody,
            landmarks: Some(book),
        };
        let options = RolloutOptions::default();
        let watched = Monitor::new(model, &corridor(&THREE), &options).err();
        let driven = Rollout::new(model, corridor(&THREE), options).err();
        [watched, driven].map(|error| error.map_or_else(String::new, |e| e.to_string()))
    };
    // To watch the gripper takes no landmark that the encoder tells; to be led to one does.
    let [watched, driven] = refused(&book_of_corridor());
    assert_eq!(watched, "");
    assert!(driven.contains("0 views of 1 cameras"), "{driven}");
    let mut book = book_of_corridor();
    book.landmarks.pop();
    let [watched, _] = refused(&book);
    assert!(watched.contains("an event of landmark 1 of 1"), "{watched}");
}

#[test]
fn what_is_seen_to_be_taken_is_as_sure_as_the_sight_of_it() {
    let (planner, oracle, book) = (
        corridor(&THREE),
        Oracle::new(5, forward),
        book_of_corridor(),
    );
    let model = MonitorModel {
        encoder: &PixelEncoder::new(5),
        traversability: &oracle,
        landmarks: Some(&book),
    };
    let options = without_classifier();
    let mut monitor = Monitor::new(model, &planner, &options).expect("the graph fits");
    // Too far from the first subgoal to be believed there.
    let mut told_of = |gripper: [u8; 2]| {
        let image = Image::new(1, 1, vec![2, gripper[0], gripper[1]]).expect("one pixel");
        let seen = Arc::new(Observation::new([("eye".to_owned(), image)]));
        let looks = (0..4).map(|_| monitor.look(Arc::clone(&seen)).expect("it is known"));
        looks.flat_map(|sight| sight.events).collect::<Vec<_>>()
    };
    assert_eq!(told_of([255, 0]), []);
    let events = told_of([0, 255]);
    let [
        Event::SubgoalReached {
            subgoal,
            confidence,
            ..
        },
    ] = &events[..]
    else {
        panic!("{events:?}")
    };
    assert_eq!(subgoal.name, "first");
    assert!(*confidence > 0.99, "{confidence}");
}

#[test]
fn asking_the_nearest_states_only_tells_the_same() {
    let walk = |nearest_states| -> Vec<(usize, String)> {
        let options = RolloutOptions {
            nearest_states,
            ..RolloutOptions::default()
        };
        told_with(&options, (0..25).chain([24; 4]))
            .into_iter()
            .map(|event| match event {
                Event::SubgoalReached { step, subgoal, .. } => (step, subgoal.name),
                other => panic!("{other}"),
            })
            .collect()
    };
    assert_eq!(walk(Some(20)), walk(None));
    assert_eq!(walk(None).len(), 3);
}

#[test]
fn a_robot_beyond_what_it_never_reached_is_flagged_once() {
    // Along a line a linear classifier tells the middle of three stages from the others at no place.
    let options = without_classifier();
    let events = told_with(&options, (0..4).chain(18..22).chain([22; 12]));
    let flagged: Vec<(&str, Vec<&str>)> = events
        .iter()
        .filter_map(|event| match event {
            Event::Shortcut {
                subgoal, skipped, ..
            } => {
                let names = skipped.iter().map(|s| s.name.as_str());
                Some((subgoal.name.as_str(), names.collect()))
            }
            _ => None,
        })
        .collect();
    assert_eq!(flagged, [("second", vec!["first"])], "{events:?}");
}

#[test]
fn a_last_task_without_subgoals_is_gone_about_without_harm() {
    let tasks = [task("walk", &["first"]), task("rest", &[])];
    let mut graph = TopologicalGraph::new(3, 5);
    for (task, from, reached) in [(&tasks[0], 0, vec![8]), (&tasks[1], 40, vec![])] {
        let places: Vec<Vec<f32>> = (from..from + 9)
            .map(|x: u8| vec![f32::from(x), 0.0, 0.0])
            .collect();
        add_demonstration(&mut graph, task, &task.name, &places, &reached);
    }
    let planner = Planner::new(
        Arc::new(graph),
        &Automaton::in_order(&tasks),
        &FinalChoice::Cheapest,
        PlannerOptions::default(),
    );
    let model = MonitorModel {
        encoder: &PixelEncoder::new(5),
        traversability: &Oracle::new(5, forward),
        landmarks: None,
    };
    let options = without_classifier();
    let monitor = Monitor::new(model, &planner.expect("the graph has both"), &options);
    let mut monitor = monitor.expect("the graph fits");
    // It rests without having reached the subgoal of the walk.
    let mut changes = Vec::new();
    for x in (0..3).chain([44; 12]) {
        let sight = monitor.look(seen_at(x)).expect("the oracle knows all");
        assert_eq!(sight.events, [], "at {x}");
        changes.extend(sight.localisation.change);
    }
    let skipped = vec![0];
    assert_eq!(changes, [StageChange::Ahead { to: 1, skipped }]);
}
