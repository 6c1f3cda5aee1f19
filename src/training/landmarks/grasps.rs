//! Learns to tell an open gripper, one that closed on nothing, and one that holds something.

use super::LandmarkConfig;
use crate::graph::{Logistic, ROWS_A_CLASS, evenly};
use crate::model::{GraspSense, grasp_values};
use crate::task::GripperEvent;
use crate::training::missed_grasps::{Outcome, closings};
use crate::training::{Dataset, ImitationConfig, StateRef};
use crate::trajectory::{CameraSpec, MountedOn, RobotGeometry};

/// Side of the square of the picture that is looked at, with the gripper in its middle, beside the picture's height.
const SIDE: f32 = 0.8;
/// The class of grippers that closed on nothing.
const EMPTY: usize = 1;
/// Least states that show one.
const LEAST_EMPTY: usize = 10;
/// Weight of the squared weights against the summed loss.
const RIDGE: f64 = 3.0;
/// Added to the spread of a value, 0..=1, so that one that hardly changes does not count for much.
const LEAST_SPREAD: f32 = 0.05;

/// What demonstrations, and dry runs beside them, show of their grippers; none without a camera that a gripper
/// carries, or where too few of them closed on nothing.
pub(super) fn grasp_sense(
    data: &Dataset,
    dry_runs: Option<&Dataset>,
    config: &LandmarkConfig,
    imitation: &ImitationConfig,
) -> Option<GraspSense> {
    let (camera, region) = carried_camera(data, config)?;
    let (classes, things) = classes(data, imitation);
    let of = |states: Vec<StateRef>, shown| states.into_iter().map(move |at| (shown, at));
    let mut classes: Vec<Vec<(&Dataset, StateRef)>> = (classes.into_iter())
        .map(|states| of(states, data).collect())
        .collect();
    if let Some(runs) = dry_runs {
        classes[EMPTY].extend(of(empty_states(runs, imitation), runs));
    }
    if classes[EMPTY].len() < LEAST_EMPTY || classes[0].is_empty() || classes.len() < 3 {
        return None;
    }
    let (mut targets, mut rows) = (Vec::new(), Vec::new());
    for (class, states) in classes.iter().enumerate() {
        for (shown, at) in evenly(states, ROWS_A_CLASS) {
            let image = shown.observation(at).image(&camera.name).ok()?;
            rows.push(grasp_values(image, region));
            targets.push(class);
        }
    }
    let (mean, spread) = moments(&rows);
    let value = |row: usize, k: usize| f64::from((rows[row][k] - mean[k]) / spread[k]);
    let fitted = Logistic::fit(mean.len(), value, targets, RIDGE).ok()?;
    let weights = (0..classes.len()).map(|class| {
        let of_class = fitted.weights_of(class).zip(&spread);
        of_class.map(|(w, s)| w as f32 / s).collect()
    });
    let intercepts = (0..classes.len()).map(|class| fitted.intercept(class) as f32);
    Some(GraspSense {
        camera: camera.name.clone(),
        region,
        weights: weights.collect(),
        intercepts: intercepts.collect(),
        things,
        mean,
    })
}

/// The camera that the gripper carries, and the part of its picture that shows the gripper.
pub(super) fn carried_camera<'a>(
    data: &'a Dataset,
    config: &LandmarkConfig,
) -> Option<(&'a CameraSpec, [f32; 4])> {
    let mut cameras = data.cameras().iter();
    cameras.find_map(|camera| Some((camera, region(&config.robot, camera)?)))
}

/// The part of a picture that shows the gripper, for a camera that the gripper carries.
fn region(robot: &RobotGeometry, camera: &CameraSpec) -> Option<[f32; 4]> {
    let mount = robot.cameras.get(&camera.name)?;
    if mount.on != MountedOn::Gripper {
        return None;
    }
    let posture = robot.at_start();
    let [x, y] = robot.pixel(&posture, camera, &robot.gripper(&posture))?;
    let (height, width) = (camera.height as f32, camera.width as f32);
    let half = 0.5 * SIDE * height;
    let share = |pixel: f32, size: f32| (pixel / size).clamp(0.0, 1.0);
    Some([
        share(x - half, width),
        share(y - half, height),
        share(x + half, width),
        share(y + half, height),
    ])
}

/// The states of dry runs whose gripper is closed, but for closings that reached a subgoal: a handle that was pulled.
pub(super) fn empty_states(runs: &Dataset, imitation: &ImitationConfig) -> Vec<StateRef> {
    let mut empty = Vec::new();
    for trajectory in 0..runs.trajectory_count() as u32 {
        let last = runs.steps(trajectory).saturating_sub(1);
        let events = runs.gripper_events(trajectory);
        let closings = closings(events, runs.marker_steps(trajectory), imitation);
        for closing in closings.filter(|closing| closing.outcome != Outcome::Held) {
            let steps = closing.closed as u32 + 1..=closing.opened.unwrap_or(last) as u32;
            empty.extend(steps.map(|step| StateRef { trajectory, step }));
        }
    }
    empty
}

/// States with an open gripper, states with one that closed on nothing, and those of each task that show
/// something held; with the names of these tasks.
fn classes(data: &Dataset, imitation: &ImitationConfig) -> (Vec<Vec<StateRef>>, Vec<String>) {
    let mut classes = vec![Vec::new(); 2];
    for trajectory in 0..data.trajectory_count() as u32 {
        let events = data.gripper_events(trajectory);
        let markers = data.marker_steps(trajectory);
        let last = data.steps(trajectory).saturating_sub(1);
        let states = |from: usize, to: usize| {
            let steps = from as u32..=to.min(last) as u32;
            steps.map(move |step| StateRef { trajectory, step })
        };
        let begins_open = (events.first()).is_none_or(|(_, e)| *e == GripperEvent::Close);
        let openings = events.iter().filter(|(_, e)| *e == GripperEvent::Open);
        let opened = openings.map(|(step, _)| step + 1);
        for from in begins_open.then_some(0).into_iter().chain(opened) {
            let next = events.iter().find(|(step, _)| *step >= from);
            classes[0].extend(states(from, next.map_or(last, |(step, _)| *step)));
        }
        for closing in closings(events, markers, imitation) {
            let opened = closing.opened.unwrap_or(last);
            match closing.outcome {
                Outcome::Missed => classes[EMPTY].extend(states(closing.closed + 1, opened)),
                Outcome::Held => {
                    let taken = markers.iter().find(|step| **step > closing.closed);
                    let class = 2 + data.set_of(trajectory);
                    classes.resize(classes.len().max(class + 1), Vec::new());
                    classes[class].extend(states(taken.map_or(opened, |t| t + 1), opened));
                }
                Outcome::Unknown => {}
            }
        }
    }
    let held = classes.split_off(2).into_iter().zip(data.tasks());
    let mut things = Vec::new();
    for (states, task) in held.filter(|(states, _)| !states.is_empty()) {
        classes.push(states);
        things.push(task.clone());
    }
    (classes, things)
}

/// Mean of each value, and its spread.
fn moments(rows: &[Vec<f32>]) -> (Vec<f32>, Vec<f32>) {
    let count = rows.len().max(1) as f32;
    let values = rows.first().map_or(0, Vec::len);
    let mean = |k: usize| rows.iter().map(|row| row[k]).sum::<f32>() / count;
    let mean: Vec<f32> = (0..values).map(mean).collect();
    let spread = |k: usize| {
        let squares = rows.iter().map(|row| (row[k] - mean[k]).powi(2));
        (squares.sum::<f32>() / count).sqrt() + LEAST_SPREAD
    };
    let spread = (0..values).map(spread).collect();
    (mean, spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Habits, demonstrate_on};
    use crate::training::TrainedModel;
    use crate::training::landmarks::{Landmarks, check_dry_runs};
    use crate::trajectory::DemonstrationSet;

    const MISSES: Habits = Habits {
        overshoot: 0.0,
        hesitation: 0.0,
        missed_grasp: 1.0,
        missed_from_above: 0.7,
        late_notice: 0.3,
        slip: 0.0,
        slip_again: 0.0,
        dry_run: false,
    };
    const DRY: Habits = Habits {
        dry_run: true,
        ..MISSES
    };

    fn set(seeds: std::ops::Range<u64>, habits: Habits) -> DemonstrationSet {
        let task = BedroomTask::Sock;
        let one = |seed| {
            let mut room = Bedroom::new(BedroomConfig::paper(task));
            room.arrange(seed);
            let shown = demonstrate_on(&mut room, task, habits, seed).unwrap();
            shown.trajectory
        };
        DemonstrationSet::new("sock", seeds.map(one).collect()).unwrap()
    }

    #[test]
    fn dry_runs_teach_an_empty_gripper_wherever_it_is_carried() {
        let mut config = crate::training::Preset::Bedroom.config();
        config.landmarks = Some(LandmarkConfig::bedroom());
        let shown = [set(1..17, MISSES)];
        let data = Dataset::new(&shown).unwrap();
        let mut model = TrainedModel::untrained(&data, &config);
        model.landmarks = Landmarks::book(&data, &config, &model.pictures().grids, &[1.0; 8]);
        let other = Dataset::new(&[set(40..44, DRY)]).unwrap();
        let empty = empty_states(&other, &config.imitation);
        let seen_empty = |model: &TrainedModel| {
            let book = model.landmarks.as_ref().unwrap();
            let sense = book.grasp.as_ref().expect("it is learnt");
            let looks = empty.iter().map(|at| sense.look(other.observation(*at)));
            let told = looks.filter(|sight| sight.is_some_and(|s| s.empty > 0.7));
            told.count() as f64 / empty.len() as f64
        };
        let before = seen_empty(&model);
        let runs = [set(30..36, DRY)];
        let learnt = model.learn_empty_gripper(&shown, &runs).unwrap();
        let told_before = check_dry_runs(&config, &shown, &runs).unwrap();
        assert_eq!(told_before, learnt);
        let after = seen_empty(&model);
        assert!(learnt > 6 * 20, "{learnt} states of six dry runs");
        assert!(
            after > 0.9 && after > before,
            "{before} before, {after} after"
        );

        let sure = Habits {
            missed_from_above: 0.0,
            ..MISSES
        };
        let sure = set(50..52, sure);
        let refused = model.learn_empty_gripper(&shown, &[sure]).unwrap_err();
        assert!(
            refused.to_string().contains("every closing reached"),
            "{refused}"
        );
        model.config.cameras = vec!["head".to_owned()];
        let refused = model.learn_empty_gripper(&shown, &runs).unwrap_err();
        assert!(refused.to_string().contains("no camera"), "{refused}");
        model.landmarks = None;
        let refused = model.learn_empty_gripper(&shown, &runs).unwrap_err();
        assert!(refused.to_string().contains("no landmarks"), "{refused}");
    }

    #[test]
    fn grippers_of_other_demonstrations_are_told() {
        let data = |seeds| Dataset::new(&[set(seeds, MISSES)]);
        let imitation = crate::training::Preset::Bedroom.config().imitation;
        let config = LandmarkConfig::bedroom();
        let learnt = data(1..17).unwrap();
        let empty = classes(&learnt, &imitation).0[EMPTY].len();
        assert!(empty >= LEAST_EMPTY, "{empty} states closed on nothing");
        let sense = grasp_sense(&learnt, None, &config, &imitation).expect("some close on nothing");
        assert_eq!(sense.misfit(learnt.cameras()), None);
        assert_eq!(sense.thing_of("sock"), Some(0));
        let other = data(17..27).unwrap();
        for (class, states) in classes(&other, &imitation).0.iter().enumerate() {
            let told = states.iter().map(|at| {
                let sight = sense.look(other.observation(*at));
                let sight = sight.expect("the wrist sees");
                [sight.open, sight.empty, sight.held][class]
            });
            let mean = told.sum::<f64>() / states.len() as f64;
            assert!(mean > 0.6, "class {class}: {mean} of {}", states.len());
        }
        let never = ImitationConfig::default();
        assert!(
            grasp_sense(&learnt, None, &config, &never).is_none(),
            "nothing is known to be missed"
        );
    }
}
