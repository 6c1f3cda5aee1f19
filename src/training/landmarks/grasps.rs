//! Learns to tell an open gripper, one that closed on nothing, and one that holds something.

use super::LandmarkConfig;
use crate::graph::{Logistic, ROWS_A_CLASS, evenly};
use crate::model::{GraspSense, grasp_values};
use crate::task::GripperEvent;
use crate::training::missed_grasps::{Closing, Outcome, closings};
use crate::training::{Dataset, ImitationConfig, StateRef};
use crate::trajectory::{CameraSpec, RobotGeometry};

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

/// A camera that a gripper carries, and the part of its picture that shows the gripper.
pub(super) type Carried<'a> = (&'a CameraSpec, [f32; 4]);

/// States of one class, by where they are from, with their recordings.
type Rows<'a> = Vec<Vec<(&'a Dataset, StateRef)>>;

/// The states of each class, and the tasks whose things are held.
pub(super) type Classes<'a> = (Vec<Rows<'a>>, Vec<String>);

/// What demonstrations show of their grippers; none without a camera that a gripper carries, or where too few of them closed
/// on nothing.
pub(super) fn grasp_sense(
    data: &Dataset,
    config: &LandmarkConfig,
    imitation: &ImitationConfig,
) -> Option<GraspSense> {
    let carried = carried_camera(data, config)?;
    sense_of(carried, all_shown(data, None, imitation)?)
}

/// What a camera that a gripper carries, and a part of its picture, tell of states whose classes are known.
pub(super) fn sense_of(
    (camera, region): Carried<'_>,
    (classes, things): Classes<'_>,
) -> Option<GraspSense> {
    let (mut targets, mut rows) = (Vec::new(), Vec::new());
    for (class, sources) in classes.iter().enumerate() {
        // Each class weighs alike, and in it practice as much as demonstrations, of which there are many more.
        for states in sources {
            for (shown, at) in evenly(states, ROWS_A_CLASS / sources.len()) {
                let image = shown.observation(at).image(&camera.name).ok()?;
                rows.push(grasp_values(image, region));
                targets.push(class);
            }
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

/// What demonstrations show, and what practice does; none where one kind is never shown, or too seldom.
pub(super) fn all_shown<'a>(
    data: &'a Dataset,
    practice: Option<(&'a Dataset, Shown)>,
    imitation: &ImitationConfig,
) -> Option<Classes<'a>> {
    let (classes, things) = classes(data, imitation);
    let mut classes: Vec<Rows<'a>> = (classes.into_iter())
        .map(|states| vec![of(states, data)])
        .collect();
    if let Some((runs, shown)) = practice {
        classes[EMPTY][0].extend(of(shown.empty, runs));
        for (states, task) in shown.held.into_iter().zip(runs.tasks()) {
            let thing = things.iter().position(|thing| thing == task);
            if let Some(thing) = thing.filter(|_| !states.is_empty()) {
                classes[EMPTY + 1 + thing].push(of(states, runs));
            }
        }
    }
    let is_enough =
        classes[EMPTY][0].len() >= LEAST_EMPTY && !classes[0][0].is_empty() && classes.len() >= 3;
    is_enough.then_some((classes, things))
}

fn of(states: Vec<StateRef>, shown: &Dataset) -> Vec<(&Dataset, StateRef)> {
    states.into_iter().map(|at| (shown, at)).collect()
}

/// The first camera that the gripper carries.
pub(super) fn carried_camera<'a>(
    data: &'a Dataset,
    config: &LandmarkConfig,
) -> Option<Carried<'a>> {
    let mut cameras = data.cameras().iter();
    cameras.find_map(|camera| Some((camera, region(&config.robot, camera)?)))
}

/// The part of a picture that shows the gripper, for a camera that the gripper carries.
fn region(robot: &RobotGeometry, camera: &CameraSpec) -> Option<[f32; 4]> {
    if !robot.is_carried(camera) {
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

/// What practice shows.
pub(super) struct Shown {
    /// States with a gripper that is closed on nothing.
    pub empty: Vec<StateRef>,
    /// States with one that holds something, for each set.
    pub held: Vec<Vec<StateRef>>,
}

/// The states of practice whose gripper is closed: after a closing that reached a subgoal it holds something from
/// there on, after any other nothing.
pub(super) fn practised(runs: &Dataset, imitation: &ImitationConfig) -> Shown {
    let mut shown = Shown {
        empty: Vec::new(),
        held: vec![Vec::new(); runs.tasks().len()],
    };
    for trajectory in 0..runs.trajectory_count() as u32 {
        let closed = Closed::new(runs, trajectory);
        let markers = runs.marker_steps(trajectory);
        for closing in closings(runs.gripper_events(trajectory), markers, imitation) {
            match closing.outcome {
                Outcome::Held => shown.held[runs.set_of(trajectory)].extend(closed.held(&closing)),
                Outcome::Missed | Outcome::Unknown => shown.empty.extend(closed.all(&closing)),
            }
        }
    }
    shown
}

/// The states of a trajectory while its gripper is closed.
struct Closed<'a> {
    trajectory: u32,
    last: usize,
    markers: &'a [usize],
}

impl<'a> Closed<'a> {
    fn new(data: &'a Dataset, trajectory: u32) -> Self {
        Self {
            trajectory,
            last: data.steps(trajectory).saturating_sub(1),
            markers: data.marker_steps(trajectory),
        }
    }

    fn states(&self, from: usize, to: usize) -> impl Iterator<Item = StateRef> + use<> {
        let trajectory = self.trajectory;
        let steps = from as u32..=to.min(self.last) as u32;
        steps.map(move |step| StateRef { trajectory, step })
    }

    /// All after a closing.
    fn all(&self, closing: &Closing) -> impl Iterator<Item = StateRef> + use<> {
        self.states(closing.closed + 1, closing.opened.unwrap_or(self.last))
    }

    /// Those after the subgoal that a closing reached.
    fn held(&self, closing: &Closing) -> impl Iterator<Item = StateRef> + use<> {
        let opened = closing.opened.unwrap_or(self.last);
        let taken = self.markers.iter().find(|step| **step > closing.closed);
        self.states(taken.map_or(opened, |t| t + 1), opened)
    }
}

/// States with an open gripper, states with one that closed on nothing, and those of each task that show
/// something held; with the names of these tasks.
fn classes(data: &Dataset, imitation: &ImitationConfig) -> (Vec<Vec<StateRef>>, Vec<String>) {
    let mut classes = vec![Vec::new(); 2];
    for trajectory in 0..data.trajectory_count() as u32 {
        let events = data.gripper_events(trajectory);
        let markers = data.marker_steps(trajectory);
        let closed = Closed::new(data, trajectory);
        let begins_open = (events.first()).is_none_or(|(_, e)| *e == GripperEvent::Close);
        let openings = events.iter().filter(|(_, e)| *e == GripperEvent::Open);
        let opened = openings.map(|(step, _)| step + 1);
        for from in begins_open.then_some(0).into_iter().chain(opened) {
            let next = events.iter().find(|(step, _)| *step >= from);
            let next = next.map_or(closed.last, |(step, _)| *step);
            classes[0].extend(closed.states(from, next));
        }
        for closing in closings(events, markers, imitation) {
            match closing.outcome {
                Outcome::Missed => classes[EMPTY].extend(closed.all(&closing)),
                Outcome::Held => {
                    let class = 2 + data.set_of(trajectory);
                    classes.resize(classes.len().max(class + 1), Vec::new());
                    classes[class].extend(closed.held(&closing));
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
#[cfg(feature = "simulator")]
mod tests {
    use super::*;
    use crate::inference::{EngineChoice, Model};
    use crate::model::{GraspSight, LANDMARKS_FILE, LandmarkBook};
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Habits, Practice, demonstrate_on};
    use crate::training::landmarks::{GripperPractice, Landmarks};
    use crate::training::{FinishedModel, TrainedModel, TrainingConfig, export, synthetic};
    use crate::trajectory::DemonstrationSet;

    const MISSES: Habits = Habits {
        overshoot: 0.0,
        hesitation: 0.0,
        missed_grasp: 1.0,
        missed_from_above: 0.7,
        late_notice: 0.3,
        slip: 0.0,
        slip_again: 0.0,
        practice: None,
    };
    const ASKEW: Habits = Habits {
        practice: Some(Practice::Askew),
        ..MISSES
    };
    const DRY: Habits = Habits {
        practice: Some(Practice::Dry),
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

    /// What is known of a model that was trained on some demonstrations, but for its weights.
    fn book(shown: &[DemonstrationSet], config: &TrainingConfig) -> LandmarkBook {
        let data = Dataset::new(shown).unwrap();
        let model = TrainedModel::untrained(&data, config);
        Landmarks::book(&data, config, &model.pictures().grids, &[1.0; 8])
            .expect("it has landmarks")
    }

    fn bedroom() -> TrainingConfig {
        let mut config = crate::training::Preset::Bedroom.config();
        config.landmarks = Some(LandmarkConfig::bedroom());
        config
    }

    /// Share of some states for which a sense says something for certain.
    fn told(
        book: &LandmarkBook,
        of: &Dataset,
        states: &[StateRef],
        what: fn(GraspSight) -> f64,
    ) -> f64 {
        let sense = book.grasp.as_ref().expect("it is learnt");
        let looks = states
            .iter()
            .filter_map(|at| sense.look(of.observation(*at)));
        looks.filter(|sight| what(*sight) > 0.7).count() as f64 / states.len() as f64
    }

    #[test]
    fn practice_teaches_what_demonstrations_do_not_show() {
        let config = bedroom();
        let shown = [set(1..17, MISSES)];
        let before = book(&shown, &config);
        let other = Dataset::new(&[set(40..44, DRY)]).unwrap();
        let empty = practised(&other, &config.imitation).empty;
        let odd = Dataset::new(&[set(60..64, ASKEW)]).unwrap();
        let held = practised(&odd, &config.imitation).held.concat();
        let seen = |book: &LandmarkBook| {
            let empty = told(book, &other, &empty, |sight| sight.empty);
            [empty, told(book, &odd, &held, |sight| sight.held)]
        };
        let taught = |runs: &[DemonstrationSet]| {
            let practice = GripperPractice {
                runs,
                demonstrations: &shown,
            };
            let mut book = before.clone();
            let learnt = practice.teach(&config, Some(&mut book)).unwrap();
            assert_eq!(practice.check(&config).unwrap(), learnt);
            (seen(&book), learnt)
        };
        let [empty_before, held_before] = seen(&before);
        let dry = set(30..36, DRY).trajectories().to_vec();
        let ([empty_after, _], learnt) =
            taught(&[DemonstrationSet::new("sock", dry.clone()).unwrap()]);
        assert!(learnt.empty > 6 * 20, "{learnt:?} of six dry runs");
        assert!(
            empty_after > 0.9 && empty_after > empty_before,
            "{empty_before} before, {empty_after} after"
        );

        let askew = set(70..82, ASKEW).trajectories().to_vec();
        let both = DemonstrationSet::new("sock", [dry, askew].concat()).unwrap();
        let ([empty_after, held_after], learnt) = taught(&[both]);
        assert!(learnt.held > 12 * 15, "{learnt:?} of twelve askew runs");
        assert!(
            held_after > 0.9 && held_after >= held_before && empty_after > 0.9,
            "{held_before} before, {held_after} after; empty {empty_after}"
        );
    }

    #[test]
    fn a_finished_model_is_taught_and_keeps_its_networks() {
        let config = bedroom();
        let shown = [set(1..3, MISSES)];
        let data = Dataset::new(&shown).unwrap();
        let mut model = TrainedModel::untrained(&data, &config);
        model.landmarks = Some(book(&shown, &config));
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("model");
        let before = export(&model, [].into(), &folder).unwrap();
        let practice = GripperPractice {
            runs: &[set(30..32, DRY)],
            demonstrations: &shown,
        };
        // As a process leaves it that is killed while it replaces the folder.
        std::fs::rename(&folder, place.path().join(".model.previous")).unwrap();
        let finished = FinishedModel::load(&folder).unwrap();
        let datasets = [("practice of sock".to_owned(), "ab".to_owned())];
        let encoder = Model::load(&folder, EngineChoice::Auto).unwrap();
        let (after, practised) =
            (finished.practised(&practice, &encoder, datasets.into(), &folder)).unwrap();
        assert!(practised.empty > 2 * 20, "{practised:?}");
        let changed = (before.files.iter()).filter(|(name, digest)| after.files[*name] != **digest);
        let changed: Vec<&String> = changed.map(|(name, _)| name).collect();
        assert_eq!(changed, [LANDMARKS_FILE]);
        assert_eq!(FinishedModel::load(&folder).unwrap().manifest(), &after);
        std::fs::write(folder.join(LANDMARKS_FILE), "{}").unwrap();
        let refused = FinishedModel::load(&folder).unwrap_err().to_string();
        assert!(
            refused.contains(LANDMARKS_FILE) && refused.contains("model"),
            "{refused}"
        );
    }

    #[test]
    fn a_model_is_taught_the_same_by_demonstrations_that_more_cameras_saw() {
        let config = bedroom();
        let by_two = [set(1..3, MISSES)];
        let by_one = [synthetic::seen_by(&by_two[0], "wrist")];
        let mut model = TrainedModel::untrained(&Dataset::new(&by_one).unwrap(), &config);
        model.landmarks = Some(book(&by_one, &config));
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("model");
        export(&model, [].into(), &folder).unwrap();
        let encoder = Model::load(&folder, EngineChoice::Auto).unwrap();
        let runs = [set(30..32, DRY)];
        let taught = |demonstrations: &[DemonstrationSet], name: &str| {
            let practice = GripperPractice {
                runs: &runs,
                demonstrations,
            };
            let finished = FinishedModel::load(&folder).unwrap();
            let out = place.path().join(name);
            (finished.practised(&practice, &encoder, [].into(), &out)).unwrap()
        };
        assert_eq!(taught(&by_two, "by two"), taught(&by_one, "by one"));
    }

    #[test]
    fn practice_that_teaches_nothing_is_refused() {
        let mut config = bedroom();
        let shown = [set(1..3, MISSES)];
        let mut book = book(&shown, &config);
        let mut refused = |runs: &[DemonstrationSet], config: &TrainingConfig, has_book: bool| {
            let practice = GripperPractice {
                runs,
                demonstrations: &shown,
            };
            let book = has_book.then_some(&mut book);
            practice.teach(config, book).unwrap_err().to_string()
        };
        let dry = set(30..32, DRY);
        let other = DemonstrationSet::new("practice", dry.trajectories().to_vec()).unwrap();
        let told = refused(&[other], &config, true);
        assert!(
            told.contains("'practice' is none of the tasks that are demonstrated (sock)"),
            "{told}"
        );
        let mut open = dry.trajectories().to_vec();
        for run in &mut open {
            run.steps.truncate(5);
            run.markers.clear();
        }
        let told = refused(
            &[DemonstrationSet::new("sock", open).unwrap()],
            &config,
            true,
        );
        assert!(told.contains("never closes"), "{told}");
        let one = dry.trajectories()[..1].to_vec();
        let told = refused(
            &[DemonstrationSet::new("sock", one).unwrap()],
            &config,
            true,
        );
        assert!(told.contains("fewer than two recordings"), "{told}");
        let runs = [dry];
        let told = refused(&runs, &config, false);
        assert!(told.contains("no landmarks"), "{told}");
        config.cameras = vec!["head".to_owned()];
        let told = refused(&runs, &config, true);
        assert!(told.contains("no camera"), "{told}");
    }

    #[test]
    fn practice_that_shows_too_little_is_refused_before_the_training() {
        let sure = Habits {
            missed_grasp: 0.0,
            ..MISSES
        };
        let mut brief = set(30..32, DRY).trajectories().to_vec();
        let data = Dataset::new(&[set(30..32, DRY)]).unwrap();
        for (number, run) in (0..).zip(&mut brief) {
            let mut events = data.gripper_events(number).iter();
            let closed = events.find(|(_, event)| *event == GripperEvent::Close);
            run.steps.truncate(closed.expect("it closes").0 + 3);
            run.markers.clear();
        }
        let practice = GripperPractice {
            runs: &[DemonstrationSet::new("sock", brief).unwrap()],
            demonstrations: &[set(1..3, sure)],
        };
        let told = practice.check(&bedroom()).unwrap_err().to_string();
        assert!(told.contains("or too few"), "{told}");
    }

    #[test]
    fn grippers_of_other_demonstrations_are_told() {
        let data = |seeds| Dataset::new(&[set(seeds, MISSES)]);
        let imitation = crate::training::Preset::Bedroom.config().imitation;
        let config = LandmarkConfig::bedroom();
        let learnt = data(1..17).unwrap();
        let empty = classes(&learnt, &imitation).0[EMPTY].len();
        assert!(empty >= LEAST_EMPTY, "{empty} states closed on nothing");
        let sense = grasp_sense(&learnt, &config, &imitation).expect("some close on nothing");
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
            grasp_sense(&learnt, &config, &never).is_none(),
            "nothing is known to be missed"
        );
    }
}
