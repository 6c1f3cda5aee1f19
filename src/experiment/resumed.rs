use super::replay::ensure_same_pictures;
use super::{ExperimentError, ScoredBedroom, SubgoalOutcome};
use crate::environment::{Environment, EnvironmentError};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Observation, Trajectory};

/// A scored bedroom whose episodes begin in the middle of a recorded one: what was done until some subgoals
/// were reached is done again at every reset, unseen by whoever acts from there on.
///
/// The score and its steps count from the beginning of the recorded episode.
pub struct ResumedBedroom {
    room: ScoredBedroom,
    seed: u64,
    actions: Vec<Action>,
}

impl ResumedBedroom {
    /// Does again what was recorded in the episode of `seed` until the first `stage` subgoals of the room's
    /// score are reached, and compares every picture on the way: from the first one, at stage 0 too, to that after
    /// the last action, where the recording has it.
    ///
    /// # Errors
    /// [`ExperimentError::ReplayDiffers`] when the recording is of another room or seed,
    /// [`ExperimentError::CameraDiffers`] when it is of other cameras or sizes,
    /// [`ExperimentError::NeverReached`] when it does not come to that stage, or not in order, and
    /// [`ExperimentError::Environment`] when it holds an action that the room refuses.
    pub fn new(
        mut room: ScoredBedroom,
        recorded: &Trajectory,
        seed: u64,
        stage: usize,
    ) -> Result<Self, ExperimentError> {
        let mut actions = Vec::new();
        let mut seen = room.reset(seed)?;
        loop {
            let step = recorded.steps.get(actions.len());
            if let Some(step) = step {
                ensure_same_pictures(&recorded.id, actions.len(), &step.observation, &seen)?;
            }
            if is_reached(&room, stage) {
                break;
            }
            let Some(step) = step else {
                return Err(ExperimentError::NeverReached {
                    recording: recorded.id.clone(),
                    missing: missing(&room, stage),
                });
            };
            seen = room.step(&step.action)?;
            actions.push(step.action.clone());
        }
        Ok(Self {
            room,
            seed,
            actions,
        })
    }

    /// The room with the score of the whole episode.
    #[must_use]
    pub fn room(&self) -> &ScoredBedroom {
        &self.room
    }

    /// The seed of the recorded episode: a reset gives it, whichever seed is asked for.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// How many steps are done again at every reset.
    #[must_use]
    pub fn replayed_steps(&self) -> usize {
        self.actions.len()
    }
}

fn is_reached(room: &ScoredBedroom, stage: usize) -> bool {
    let outcomes = room.score().outcomes();
    let mut due = outcomes.iter().take(stage);
    due.all(|outcome| *outcome == SubgoalOutcome::Reached)
}

fn missing(room: &ScoredBedroom, stage: usize) -> String {
    let subgoals = room
        .automaton()
        .subgoals()
        .iter()
        .zip(room.score().outcomes());
    let lacking = subgoals
        .take(stage)
        .filter(|(_, o)| *o != SubgoalOutcome::Reached);
    let names: Vec<&str> = lacking.map(|(s, _)| s.name.as_str()).collect();
    names.join(", ")
}

impl Environment for ResumedBedroom {
    fn cameras(&self) -> Vec<CameraSpec> {
        self.room.cameras()
    }

    fn action_space(&self) -> ActionSpace {
        self.room.action_space()
    }

    fn reset(&mut self, _: u64) -> Result<Observation, EnvironmentError> {
        let mut seen = self.room.reset(self.seed)?;
        for action in &self.actions {
            seen = self.room.step(action)?;
        }
        Ok(seen)
    }

    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        self.room.step(action)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, demonstrate};
    use crate::task::{Automaton, Subgoal, Task};

    #[test]
    fn an_episode_goes_on_where_a_recorded_one_had_come_to() {
        let config = BedroomConfig::paper(BedroomTask::Wine);
        let shown = demonstrate(&mut Bedroom::new(config), BedroomTask::Wine, 3)
            .expect("the room does not fail");
        let recorded = &shown.trajectory;
        let subgoals = ["tissue_grasped", "spill_covered"].map(|name| Subgoal {
            task: "wine".to_owned(),
            name: name.to_owned(),
        });
        let wine = Task {
            name: "wine".to_owned(),
            subgoals: subgoals.to_vec(),
        };
        let room = || {
            ScoredBedroom::new(
                Bedroom::new(config),
                &Automaton::in_order(std::slice::from_ref(&wine)),
            )
        };
        let mut resumed = ResumedBedroom::new(room(), recorded, 3, 1).expect("it was grasped");
        let marker = recorded.markers.iter().find(|m| m.name == "tissue_grasped");
        let grasped = marker.expect("it was marked").step;
        assert_eq!(resumed.replayed_steps(), grasped);
        let seen = resumed.reset(77).expect("the room does not fail");
        let shown = &recorded.steps[grasped].observation;
        ensure_same_pictures(&recorded.id, grasped, shown, &seen).expect("it is seen again");
        for step in &recorded.steps[grasped..] {
            resumed.step(&step.action).expect("the room does not fail");
        }
        assert!(resumed.room().score().is_success());

        let mut short = recorded.clone();
        short.steps.truncate(grasped / 2);
        let error = ResumedBedroom::new(room(), &short, 3, 1).err();
        let error = error.expect("nothing was grasped yet").to_string();
        assert!(error.contains("never reached tissue_grasped"), "{error}");
        let other = ResumedBedroom::new(room(), recorded, 4, 1).err();
        assert!(matches!(
            other,
            Some(ExperimentError::ReplayDiffers { step: 0, .. })
        ));
    }

    #[test]
    fn the_pictures_at_which_an_episode_is_begun_and_gone_on_with_are_compared_too() {
        let config = BedroomConfig::paper(BedroomTask::Wine);
        let shown = demonstrate(&mut Bedroom::new(config), BedroomTask::Wine, 3)
            .expect("the room does not fail");
        let recorded = shown.trajectory;
        let grasp = Subgoal {
            task: "wine".to_owned(),
            name: "tissue_grasped".to_owned(),
        };
        let wine = Task {
            name: "wine".to_owned(),
            subgoals: vec![grasp],
        };
        let automaton = Automaton::in_order(&[wine]);
        let resumed = |recorded: &Trajectory, seed: u64, stage: usize| {
            let room = ScoredBedroom::new(Bedroom::new(config), &automaton);
            ResumedBedroom::new(room, recorded, seed, stage).map(|room| room.replayed_steps())
        };
        // At stage 0 nothing is done again, and the room is compared all the same.
        assert!(matches!(resumed(&recorded, 3, 0), Ok(0)));
        let other = resumed(&recorded, 4, 0);
        assert!(
            matches!(other, Err(ExperimentError::ReplayDiffers { step: 0, .. })),
            "{other:?}"
        );
        let grasped = recorded.marker_step("tissue_grasped");
        let grasped = grasped.expect("it was marked");
        let mut changed = recorded.clone();
        changed.steps[grasped].observation = Arc::clone(&recorded.steps[0].observation);
        let other = resumed(&changed, 3, 1);
        assert!(
            matches!(other, Err(ExperimentError::ReplayDiffers { step, .. }) if step == grasped),
            "{other:?}"
        );
        // A recording that ends with the last action that is done again has no picture after it.
        changed.steps.truncate(grasped);
        let whole = resumed(&changed, 3, 1);
        assert!(matches!(whole, Ok(steps) if steps == grasped), "{whole:?}");
    }
}
