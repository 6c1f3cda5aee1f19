use super::ExperimentError;
use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Insight, Leftovers, Level, Primitive};
use crate::trajectory::{Action, Observation, Trajectory};

/// Largest mean difference between a recorded and a replayed picture, in levels of 0..=255. The noise of the cameras is
/// replayed too, so that only what JPEG loses is left.
pub(super) const SAME_PICTURE_LEVELS: f64 = 5.0;

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
    /// not of the bedroom, [`ExperimentError::ReplayDiffers`] for one that shows something else.
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
            let difference = difference_levels(recorded, &bedroom.observe());
            if difference > SAME_PICTURE_LEVELS {
                return Err(ExperimentError::ReplayDiffers {
                    recording: trajectory.id.clone(),
                    step,
                    difference,
                });
            }
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

/// Mean difference of the channels of all pixels of all cameras, infinite where cameras or sizes differ.
pub(super) fn difference_levels(recorded: &Observation, replayed: &Observation) -> f64 {
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
    use super::*;
    use crate::simulator::demonstrate;

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
}
