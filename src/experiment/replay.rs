use super::ExperimentError;
use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Insight, Leftovers, Level, Primitive};
use crate::trajectory::{Action, Observation, Trajectory};

/// Largest mean difference between a recorded and a replayed picture, in levels of 0..=255. The noise of the cameras is
/// replayed too, so that only what JPEG loses is left.
const SAME_PICTURE_LEVELS: f64 = 5.0;

/// A recording of the simulated bedroom with what was really the case at each of its steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// The recording's id.
    pub recording: String,
    /// The task that it shows.
    pub task: BedroomTask,
    /// The episodes that it is one of.
    pub config: BedroomConfig,
    /// The episode.
    pub seed: u64,
    /// What was done, step by step.
    pub actions: Vec<Primitive>,
    /// What was the case before each action.
    pub insights: Vec<Insight>,
}

impl Replay {
    /// Does again what was recorded, in the episode of `seed`, and compares every picture.
    ///
    /// A recording of `catena record` says which kind of episodes it is one of (`noted`). For others all levels
    /// with and without leftovers of other tasks are tried; that whose first pictures come nearest is taken.
    ///
    /// # Errors
    /// [`ExperimentError::TaskOfAnotherWorld`] and [`ExperimentError::ActionsOfAnotherRobot`] for recordings that are
    /// not of the bedroom, [`ExperimentError::CameraDiffers`] for one of other cameras or sizes,
    /// [`ExperimentError::ReplayDiffers`] for one that shows something else.
    pub fn new(
        trajectory: &Trajectory,
        seed: u64,
        noted: Option<BedroomConfig>,
    ) -> Result<Self, ExperimentError> {
        let task = BedroomTask::named(&trajectory.task).ok_or_else(|| {
            ExperimentError::TaskOfAnotherWorld {
                recording: trajectory.id.clone(),
                task: trajectory.task.clone(),
            }
        })?;
        let actions =
            primitives(trajectory).ok_or_else(|| ExperimentError::ActionsOfAnotherRobot {
                recording: trajectory.id.clone(),
            })?;
        let config = noted.unwrap_or_else(|| likeliest_config(trajectory, task, seed));
        let mut bedroom = Bedroom::new(config);
        bedroom.arrange(seed);
        let mut insights = Vec::with_capacity(actions.len());
        for (step, action) in actions.iter().enumerate() {
            let recorded = &trajectory.steps[step].observation;
            ensure_same_pictures(&trajectory.id, step, recorded, &bedroom.observe())?;
            insights.push(bedroom.insight());
            bedroom.act(*action);
        }
        Ok(Self {
            recording: trajectory.id.clone(),
            task,
            config,
            seed,
            actions,
            insights,
        })
    }

    /// The bedroom as it was before the action of `step`.
    ///
    /// # Panics
    /// If the recording has fewer steps.
    #[must_use]
    pub fn bedroom_at(&self, step: usize) -> Bedroom {
        let mut bedroom = Bedroom::new(self.config);
        bedroom.arrange(self.seed);
        for action in &self.actions[..step] {
            bedroom.act(*action);
        }
        bedroom
    }
}

fn primitives(trajectory: &Trajectory) -> Option<Vec<Primitive>> {
    if trajectory.action_space != Primitive::action_space() {
        return None;
    }
    let primitive = |action: &Action| match action {
        Action::Primitive(index) => Primitive::from_index(*index),
        Action::Continuous(_) => None,
    };
    trajectory
        .steps
        .iter()
        .map(|s| primitive(&s.action))
        .collect()
}

/// The kind of episodes whose first pictures are most like the recorded ones.
fn likeliest_config(trajectory: &Trajectory, task: BedroomTask, seed: u64) -> BedroomConfig {
    let mut best = (f64::INFINITY, BedroomConfig::paper(task));
    for level in [Level::Paper, Level::Hard] {
        for leftovers in [Leftovers::Varied, Leftovers::AtStart] {
            let config = BedroomConfig {
                level,
                leftovers,
                ..BedroomConfig::paper(task)
            };
            let mut bedroom = Bedroom::new(config);
            bedroom.arrange(seed);
            let recorded = trajectory.steps.first().map(|s| &s.observation);
            let difference = recorded.map_or(f64::INFINITY, |recorded| {
                difference_levels(recorded, &bedroom.observe())
            });
            if difference < best.0 {
                best = (difference, config);
            }
        }
    }
    best.1
}

/// Checks that what a recording shows at a step is what the room shows when it is lived through again.
///
/// # Errors
/// [`ExperimentError::CameraDiffers`] for pictures of other cameras or sizes, [`ExperimentError::ReplayDiffers`] for
/// pictures of something else.
pub(super) fn ensure_same_pictures(
    recording: &str,
    step: usize,
    recorded: &Observation,
    replayed: &Observation,
) -> Result<(), ExperimentError> {
    if let Some(camera) = differing_camera(recorded, replayed) {
        let printed = |observation: &Observation| {
            size_of(observation, camera).map_or_else(
                || "missing".to_owned(),
                |[height, width]| format!("{height}x{width}"),
            )
        };
        return Err(ExperimentError::CameraDiffers {
            recording: recording.to_owned(),
            step,
            camera: camera.to_owned(),
            found: printed(recorded),
            expected: printed(replayed),
        });
    }
    let difference = difference_levels(recorded, replayed);
    if difference > SAME_PICTURE_LEVELS {
        return Err(ExperimentError::ReplayDiffers {
            recording: recording.to_owned(),
            step,
            difference,
        });
    }
    Ok(())
}

/// The first camera that only one of them has, or that has another size in each.
fn differing_camera<'a>(recorded: &'a Observation, replayed: &'a Observation) -> Option<&'a str> {
    let mut names = replayed.iter().chain(recorded.iter()).map(|(name, _)| name);
    names.find(|name| size_of(recorded, name) != size_of(replayed, name))
}

/// Rows and columns of a camera's picture; none where there is none.
fn size_of(observation: &Observation, camera: &str) -> Option<[u32; 2]> {
    let image = observation.image(camera).ok()?;
    Some([image.height(), image.width()])
}

/// Mean difference of the channels of all pixels of all cameras, infinite where cameras or sizes differ.
fn difference_levels(recorded: &Observation, replayed: &Observation) -> f64 {
    if recorded.cameras() != replayed.cameras() {
        return f64::INFINITY;
    }
    let (mut sum, mut count) = (0_u64, 0_u64);
    for ((_, a), (_, b)) in recorded.iter().zip(replayed.iter()) {
        for (a, b) in a.rgb().iter().zip(b.rgb()) {
            sum += u64::from(a.abs_diff(*b));
            count += 1;
        }
    }
    sum as f64 / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::simulator::demonstrate;
    use crate::trajectory::CameraSpec;

    #[test]
    fn a_recording_is_lived_through_again_and_another_seed_is_not() {
        let task = BedroomTask::Wine;
        let config = BedroomConfig {
            leftovers: Leftovers::Varied,
            ..BedroomConfig::paper(task)
        };
        let shown =
            demonstrate(&mut Bedroom::new(config), task, 3).expect("the room does not fail");
        let trajectory = &shown.trajectory;
        let replay = Replay::new(trajectory, 3, None).expect("it is of this bedroom");
        assert_eq!(replay.config, config);
        assert_eq!(replay.insights.len(), trajectory.steps.len());
        for marker in &trajectory.markers {
            let holds = |step: usize| replay.insights[step].truth.holds(&marker.name);
            assert_eq!(holds(marker.step), Some(true), "{}", marker.name);
            assert_eq!(holds(marker.step - 1), Some(false), "{}", marker.name);
        }
        let again = replay.bedroom_at(20).insight();
        assert_eq!(again, replay.insights[20]);
        let error = Replay::new(trajectory, 4, Some(config)).expect_err("another episode");
        assert!(
            matches!(error, ExperimentError::ReplayDiffers { step: 0, .. }),
            "{error}"
        );
        let mut other = trajectory.clone();
        other.task = "cook".to_owned();
        let error = Replay::new(&other, 3, None).expect_err("no such task");
        assert!(error.to_string().contains("no task 'cook'"), "{error}");
    }

    #[test]
    fn of_pictures_of_other_cameras_or_sizes_it_is_said_which_and_how_large() {
        let task = BedroomTask::Wine;
        let config = BedroomConfig::paper(task);
        let shown =
            demonstrate(&mut Bedroom::new(config), task, 3).expect("the room does not fail");
        let seen = &shown.trajectory.steps[0].observation;
        let cameras = seen.cameras();
        let [head, wrist] = &cameras[..] else {
            panic!("two cameras: {cameras:?}");
        };
        let small = CameraSpec {
            height: 45,
            width: 80,
            ..head.clone()
        };
        let fitted = |cameras: &[CameraSpec]| seen.fitted(cameras).expect("they are there");
        let image = seen.image("head").expect("it is there");
        let third = ("ceiling".to_owned(), image.clone());
        let both = seen
            .iter()
            .map(|(name, image)| (name.to_owned(), image.clone()));
        let others = [
            (
                fitted(&[small, wrist.clone()]),
                "camera 'head' is 45x80 in the recording and 90x160 in the bedroom",
            ),
            (
                fitted(std::slice::from_ref(head)),
                "camera 'wrist' is missing in the recording and 90x160 in the bedroom",
            ),
            (
                Observation::new(both.chain([third])),
                "camera 'ceiling' is 90x160 in the recording and missing in the bedroom",
            ),
        ];
        for (other, told) in others {
            let mut trajectory = shown.trajectory.clone();
            trajectory.steps[0].observation = Arc::new(other);
            for noted in [None, Some(config)] {
                let error = Replay::new(&trajectory, 3, noted).expect_err("other pictures");
                let said = error.to_string();
                assert!(said.contains(told) && said.contains("at step 0"), "{said}");
            }
        }
    }
}
