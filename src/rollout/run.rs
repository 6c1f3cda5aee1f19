use std::sync::Arc;

use super::{
    Controller, Decision, Episode, RolloutError, RolloutModel, RolloutObserver, RolloutOptions,
};
use crate::environment::Environment;
use crate::planner::Planner;
use crate::trajectory::{Observation, Step};

/// A composition, ready to be run again and again.
///
/// A clone shares the graph, what was computed of it, and the model, and runs episodes of its own.
#[derive(Clone, Debug)]
pub struct Rollout<'a> {
    model: RolloutModel<'a>,
    controller: Controller<'a>,
}

impl<'a> Rollout<'a> {
    /// Makes the states of the planner's graph ready for the model's traversability function.
    ///
    /// # Errors
    /// Those of [`Controller::new`].
    pub fn new(
        model: RolloutModel<'a>,
        planner: Planner,
        options: RolloutOptions,
    ) -> Result<Self, RolloutError> {
        Ok(Self {
            model,
            controller: Controller::new(model, planner, options)?,
        })
    }

    /// The planner, as the last run left it.
    #[must_use]
    pub fn planner(&self) -> &Planner {
        self.controller.planner()
    }

    /// Lets the controller know what the environment did before the episodes that its resets begin; see
    /// [`Controller::go_on_from`].
    pub fn go_on_from(&mut self, done: &[Step], seen: &Observation) {
        self.controller.go_on_from(done, seen);
    }

    /// One episode from a reset of the environment to an end.
    ///
    /// # Errors
    /// [`RolloutError`] when the robot or the model fails, or they do not belong together.
    pub fn run(
        &mut self,
        environment: &mut dyn Environment,
        seed: u64,
        observer: &mut dyn RolloutObserver,
    ) -> Result<Episode, RolloutError> {
        let spec = self.model.encoder.spec();
        RolloutError::unless_same_actions(&environment.action_space(), &spec.action_space)?;
        let controller = &mut self.controller;
        controller.reset(seed);
        let failed = |step| move |source| RolloutError::Environment { step, source };
        let mut newest = Arc::new(environment.reset(seed).map_err(failed(0))?);
        let (mut events, mut times) = (Vec::new(), Vec::new());
        loop {
            match controller.step(Arc::clone(&newest))? {
                Decision::Act(record) => {
                    observer.on_step(&record);
                    let seen = environment.step(&record.action);
                    newest = Arc::new(seen.map_err(failed(record.step))?);
                    events.extend(record.events);
                    times.push(record.times);
                }
                Decision::End {
                    end, events: last, ..
                } => {
                    observer.on_end(controller.step_count(), &newest, &last);
                    events.extend(last);
                    return Ok(Episode {
                        steps: controller.step_count(),
                        end,
                        stage: controller.stage(),
                        events,
                        lost_steps: controller.lost_steps(),
                        times,
                    });
                }
            }
        }
    }
}
