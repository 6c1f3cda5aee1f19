use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{
    Action, ActionSpace, CameraSpec, Observation, State, TrajectoryError, printed_cameras,
    told_apart,
};

/// One time step: what was seen, and what was done then.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Seconds since the start of the trajectory.
    pub time_secs: f64,
    /// What the cameras showed before the action.
    pub observation: Arc<Observation>,
    /// The action that followed.
    pub action: Action,
}

/// A named moment of a trajectory: the first step whose observation shows that `name` holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Marker {
    /// Index into the trajectory's steps.
    pub step: usize,
    /// What was reached, such as the name of a subgoal.
    pub name: String,
}

/// One demonstration or one episode, from its first observation to its last.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Unique within a set; the file's stem where it came from a file.
    pub id: String,
    /// Which task it shows.
    pub task: String,
    /// What the actions mean.
    pub action_space: ActionSpace,
    /// All steps in order of time.
    pub steps: Vec<Step>,
    /// Subgoals and other named moments, in order of time.
    pub markers: Vec<Marker>,
}

impl Trajectory {
    /// The state at a step: its observation and the ones before it, `stack` frames deep.
    ///
    /// # Panics
    /// If `step` is not below the number of steps or `stack` is 0.
    #[must_use]
    pub fn state(&self, step: usize, stack: usize) -> State {
        let first = (step + 1).saturating_sub(stack);
        let history: Vec<_> = self.steps[first..=step]
            .iter()
            .map(|s| Arc::clone(&s.observation))
            .collect();
        State::from_history(&history, stack)
    }

    /// The cameras of the first step; empty for a trajectory without steps.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraSpec> {
        self.steps
            .first()
            .map(|s| s.observation.cameras())
            .unwrap_or_default()
    }

    /// The step of the first marker of that name.
    #[must_use]
    pub fn marker_step(&self, name: &str) -> Option<usize> {
        self.markers.iter().find(|m| m.name == name).map(|m| m.step)
    }
}

/// Demonstrations of one task that share cameras and action space.
#[derive(Clone, Debug, PartialEq)]
pub struct DemonstrationSet {
    task: String,
    trajectories: Vec<Trajectory>,
}

impl DemonstrationSet {
    /// Puts trajectories together after checking that every one has steps and cameras and no marker beyond its
    /// steps, and that cameras (those of the first steps) and action spaces agree. That ids are unique is not
    /// checked: graphs tell the demonstrations of a task apart by them.
    ///
    /// # Errors
    /// [`TrajectoryError::Empty`] for no trajectories or one without steps, [`TrajectoryError::NoCamera`] for one
    /// without images, [`TrajectoryError::MarkerBeyondEnd`], and [`TrajectoryError::SetDisagrees`] when cameras or
    /// action spaces differ.
    pub fn new(
        task: impl Into<String>,
        trajectories: Vec<Trajectory>,
    ) -> Result<Self, TrajectoryError> {
        let task = task.into();
        let Some(first) = trajectories.first() else {
            return Err(TrajectoryError::Empty {
                what: format!("the demonstration set of '{task}'"),
            });
        };
        for t in &trajectories {
            if t.steps.is_empty() {
                return Err(TrajectoryError::Empty {
                    what: format!("trajectory '{}'", t.id),
                });
            }
            if t.cameras().is_empty() {
                return Err(TrajectoryError::NoCamera {
                    trajectory: t.id.clone(),
                });
            }
            if let Some(marker) = t.markers.iter().find(|m| m.step >= t.steps.len()) {
                return Err(TrajectoryError::MarkerBeyondEnd {
                    trajectory: t.id.clone(),
                    marker: marker.name.clone(),
                    step: marker.step,
                    last: t.steps.len() - 1,
                });
            }
            let disagrees = |expected: String, found: String| TrajectoryError::SetDisagrees {
                trajectory: t.id.clone(),
                expected,
                found,
            };
            if t.cameras() != first.cameras() {
                return Err(disagrees(
                    format!("cameras {}", printed_cameras(&first.cameras())),
                    format!("cameras {}", printed_cameras(&t.cameras())),
                ));
            }
            if t.action_space != first.action_space {
                let (expected, found) = told_apart(&first.action_space, &t.action_space);
                return Err(disagrees(expected, found));
            }
        }
        Ok(Self { task, trajectories })
    }

    /// The task's name.
    #[must_use]
    pub fn task(&self) -> &str {
        &self.task
    }

    /// All trajectories.
    #[must_use]
    pub fn trajectories(&self) -> &[Trajectory] {
        &self.trajectories
    }

    /// Cameras that all trajectories share.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraSpec> {
        self.trajectories[0].cameras()
    }

    /// The action space that all trajectories share.
    #[must_use]
    pub fn action_space(&self) -> &ActionSpace {
        &self.trajectories[0].action_space
    }

    /// The same demonstrations with another action space, such as one whose dimensions are cut into bins
    /// ([`ActionSpace::binned`]). Whether their actions lie in it is not checked: a training tells of one that does not.
    #[must_use]
    pub fn with_action_space(mut self, space: &ActionSpace) -> Self {
        for trajectory in &mut self.trajectories {
            trajectory.action_space = space.clone();
        }
        self
    }

    /// Number of steps of all trajectories together.
    #[must_use]
    pub fn step_count(&self) -> usize {
        self.trajectories.iter().map(|t| t.steps.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Image;

    #[test]
    fn all_demonstrations_of_a_set_get_the_other_action_space() {
        let trajectories = ["a", "b"].map(|id| trajectory(id, ["left", "right"]));
        let set = DemonstrationSet::new("task", trajectories.to_vec()).expect("they agree");
        let other = trajectory("c", ["up", "down"]).action_space;
        let set = set.with_action_space(&other);
        assert_eq!(*set.action_space(), other);
        assert!(set.trajectories().iter().all(|t| t.action_space == other));
    }

    /// A trajectory of one step.
    fn trajectory(id: &str, names: [&str; 2]) -> Trajectory {
        let image = Image::new(1, 1, vec![0; 3]).expect("one pixel");
        Trajectory {
            id: id.to_owned(),
            task: "sock".to_owned(),
            action_space: ActionSpace::Primitives {
                names: names.map(str::to_owned).to_vec(),
            },
            steps: vec![Step {
                time_secs: 0.0,
                observation: Arc::new(Observation::new([("head".to_owned(), image)])),
                action: Action::Primitive(0),
            }],
            markers: Vec::new(),
        }
    }

    #[test]
    fn a_trajectory_that_no_camera_saw_is_refused() {
        let seen = trajectory("seen", ["left", "right"]);
        let mut blind = trajectory("blind", ["left", "right"]);
        blind.steps[0].observation = Arc::new(Observation::default());
        for all in [vec![blind.clone()], vec![seen, blind]] {
            let error = DemonstrationSet::new("sock", all).expect_err("there is no image");
            assert_eq!(
                error.to_string(),
                "trajectory 'blind' was seen by no camera: its first observation has no image"
            );
        }
    }

    #[test]
    fn a_marker_beyond_the_last_step_is_refused() {
        let mut marked = trajectory("short", ["left", "right"]);
        let marker = |step: usize| Marker {
            step,
            name: format!("reached_{step}"),
        };
        marked.markers = vec![marker(0)];
        DemonstrationSet::new("sock", vec![marked.clone()]).expect("it stands at the only step");
        marked.markers.push(marker(1));
        let error = DemonstrationSet::new("sock", vec![marked]).expect_err("there is one step");
        assert_eq!(
            error.to_string(),
            "marker 'reached_1' of trajectory 'short' stands at step 1, beyond the last one, which is 0"
        );
    }

    #[test]
    fn spaces_that_differ_in_names_alone_are_told_with_them() {
        let both = vec![
            trajectory("first", ["left", "right"]),
            trajectory("second", ["right", "left"]),
        ];
        let error = DemonstrationSet::new("sock", both).expect_err("they differ");
        assert_eq!(
            error.to_string(),
            "trajectory 'second' has 2 primitives (right, left), the others of the set have 2 primitives (left, right)"
        );
    }
}
