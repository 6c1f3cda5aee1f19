use std::fmt;

use serde::{Deserialize, Serialize};

use super::{GripperEvent, GripperSignal, Subgoal, TaskError};
use crate::trajectory::{ActionSpace, Trajectory};

/// Which of several events of the same kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Occurrence {
    /// Counted from 1.
    Nth(usize),
    /// The last one of the demonstration, which is how a failed grasp that is repeated is passed over.
    Last,
}

impl fmt::Display for Occurrence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nth(1) => f.write_str("first"),
            Self::Nth(2) => f.write_str("second"),
            Self::Nth(3) => f.write_str("third"),
            Self::Nth(nth) => write!(f, "{nth}th"),
            Self::Last => f.write_str("last"),
        }
    }
}

/// How the moment at which a subgoal is reached is found in a demonstration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SubgoalDetection {
    /// At the first marker of this name.
    Marker(String),
    /// At the state that a gripper event leads to. Events count from the subgoal before on.
    Gripper {
        /// Closing or opening.
        event: GripperEvent,
        /// Which one.
        occurrence: Occurrence,
        /// Which actions close and open.
        signal: GripperSignal,
    },
    /// At the last state.
    End,
}

/// A subgoal and how it is found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubgoalRule {
    /// The subgoal.
    pub subgoal: Subgoal,
    /// How it is found.
    pub detection: SubgoalDetection,
}

/// The step at which each subgoal is first reached, in the order of the rules; steps never fall.
///
/// # Errors
/// Each names task and demonstration: [`TaskError::NoSteps`] for one without steps,
/// [`TaskError::MarkerMissing`] and [`TaskError::MarkerBeyondEnd`] for markers,
/// [`TaskError::GripperSignalAbsent`] when the action space has no such primitives or dimension,
/// [`TaskError::GripperEventMissing`] when the gripper moves less often, [`TaskError::OutOfOrder`] when
/// a subgoal is reached before the one that the rules put before it.
///
/// ```
/// # use std::sync::Arc;
/// # use catena::task::{Subgoal, SubgoalDetection, SubgoalRule, locate_subgoals};
/// # use catena::trajectory::{Action, ActionSpace, Marker, Observation, Step, Trajectory};
/// # let step = Step { time_secs: 0.0, observation: Arc::new(Observation::default()),
/// #     action: Action::Primitive(0) };
/// let trajectory = Trajectory {
///     id: "demo_000".into(),
///     task: "sock".into(),
///     action_space: ActionSpace::Primitives { names: vec!["terminate".into()] },
///     steps: vec![step; 9],
///     markers: vec![Marker { step: 4, name: "drawer_open".into() }],
/// };
/// let rule = |name: &str, detection| SubgoalRule {
///     subgoal: Subgoal { task: "sock".into(), name: name.into() },
///     detection,
/// };
/// let rules = [
///     rule("drawer_open", SubgoalDetection::Marker("drawer_open".into())),
///     rule("sock_in_box", SubgoalDetection::End),
/// ];
/// let steps: Vec<_> = locate_subgoals(&rules, &trajectory)?.into_iter().map(|(_, s)| s).collect();
/// assert_eq!(steps, [4, 8]);
/// # Ok::<(), catena::task::TaskError>(())
/// ```
pub fn locate_subgoals(
    rules: &[SubgoalRule],
    trajectory: &Trajectory,
) -> Result<Vec<(Subgoal, usize)>, TaskError> {
    let mut located: Vec<(Subgoal, usize)> = Vec::with_capacity(rules.len());
    for rule in rules {
        let after = located.last().map_or(0, |(_, step)| *step);
        let step = rule.locate(trajectory, after)?;
        if let Some((earlier, _)) = located.last().filter(|_| step < after) {
            return Err(TaskError::OutOfOrder {
                task: rule.subgoal.task.clone(),
                trajectory: trajectory.id.clone(),
                earlier: earlier.name.clone(),
                earlier_step: after,
                later: rule.subgoal.name.clone(),
                later_step: step,
            });
        }
        located.push((rule.subgoal.clone(), step));
    }
    Ok(located)
}

impl SubgoalRule {
    fn locate(&self, trajectory: &Trajectory, after: usize) -> Result<usize, TaskError> {
        let Some(last) = trajectory.steps.len().checked_sub(1) else {
            return Err(TaskError::NoSteps {
                task: self.subgoal.task.clone(),
                trajectory: trajectory.id.clone(),
            });
        };
        match &self.detection {
            SubgoalDetection::End => Ok(last),
            SubgoalDetection::Marker(name) => self.marker_step(name, trajectory),
            SubgoalDetection::Gripper {
                event,
                occurrence,
                signal,
            } => {
                let step = self.event_step(*event, *occurrence, signal, trajectory, after)?;
                // The observation of a step is older than its action: the next one shows the effect.
                Ok((step + 1).min(last))
            }
        }
    }

    fn marker_step(&self, name: &str, trajectory: &Trajectory) -> Result<usize, TaskError> {
        let Some(step) = trajectory.marker_step(name) else {
            let present = trajectory.markers.iter().map(|m| m.name.as_str());
            return Err(TaskError::MarkerMissing {
                task: self.subgoal.task.clone(),
                subgoal: self.subgoal.name.clone(),
                trajectory: trajectory.id.clone(),
                marker: name.to_owned(),
                present: listed(present),
            });
        };
        if step >= trajectory.steps.len() {
            return Err(TaskError::MarkerBeyondEnd {
                trajectory: trajectory.id.clone(),
                marker: name.to_owned(),
                step,
                steps: trajectory.steps.len(),
            });
        }
        Ok(step)
    }

    fn event_step(
        &self,
        event: GripperEvent,
        occurrence: Occurrence,
        signal: &GripperSignal,
        trajectory: &Trajectory,
        after: usize,
    ) -> Result<usize, TaskError> {
        let actions = trajectory.steps.iter().map(|s| &s.action);
        let all = signal
            .events(&trajectory.action_space, actions)
            .ok_or_else(|| TaskError::GripperSignalAbsent {
                task: self.subgoal.task.clone(),
                trajectory: trajectory.id.clone(),
                signal: signal.to_string(),
                present: listed(action_names(&trajectory.action_space)),
            })?;
        let steps: Vec<usize> = all
            .into_iter()
            .filter(|(step, what)| *what == event && *step >= after)
            .map(|(step, _)| step)
            .collect();
        let step = match occurrence {
            Occurrence::Nth(nth) => nth.checked_sub(1).and_then(|i| steps.get(i)),
            Occurrence::Last => steps.last(),
        };
        step.copied().ok_or_else(|| TaskError::GripperEventMissing {
            task: self.subgoal.task.clone(),
            subgoal: self.subgoal.name.clone(),
            trajectory: trajectory.id.clone(),
            event,
            wanted: occurrence,
            after,
            found: steps.len(),
        })
    }
}

fn action_names(space: &ActionSpace) -> Vec<&str> {
    match space {
        ActionSpace::Primitives { names } | ActionSpace::Continuous { names } => {
            names.iter().map(String::as_str).collect()
        }
        ActionSpace::Binned { dimensions } => dimensions.iter().map(|d| d.name.as_str()).collect(),
    }
}

fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.into_iter().collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

#[cfg(test)]
mod tests;
