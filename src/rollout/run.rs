use std::sync::Arc;

use super::running::{Run, Watch};
use super::{
    Episode, EpisodeEnd, Event, Monitor, RolloutError, RolloutObserver, RolloutOptions, Sight,
    StepRecord, StepTimes,
};
use crate::composer::OnShortcut;
use crate::environment::Environment;
use crate::model::{ActionDistribution, Encoder, Latents, LocalPolicy, Traversability};
use crate::planner::{GoalChoice, Localisation, Planner, StageChange};

/// The three parts of a learned model; one object often is all of them.
#[derive(Clone, Copy)]
pub struct RolloutModel<'a> {
    /// Images to latents.
    pub encoder: &'a dyn Encoder,
    /// Steps between states.
    pub traversability: &'a (dyn Traversability + Sync),
    /// Actions towards a goal state.
    pub policy: &'a dyn LocalPolicy,
}

/// A composition, ready to be run again and again.
pub struct Rollout<'a> {
    model: RolloutModel<'a>,
    pub(super) planner: Planner,
    pub(super) monitor: Monitor<'a>,
    pub(super) options: RolloutOptions,
}

impl<'a> Rollout<'a> {
    /// Makes the states of the planner's graph ready for the model's traversability function.
    ///
    /// # Errors
    /// [`RolloutError::Model`] when the graph's latents are not the model's.
    pub fn new(
        model: RolloutModel<'a>,
        planner: Planner,
        options: RolloutOptions,
    ) -> Result<Self, RolloutError> {
        let monitor = Monitor::new(model, &planner, &options)?;
        Ok(Self {
            model,
            planner,
            monitor,
            options,
        })
    }

    /// The planner, as the last run left it.
    #[must_use]
    pub fn planner(&self) -> &Planner {
        &self.planner
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
        if environment.action_space() != spec.action_space {
            return Err(RolloutError::ActionSpaceDiffers {
                robot: environment.action_space().to_string(),
                model: spec.action_space.to_string(),
            });
        }
        self.monitor.reset();
        self.planner.recover(0.0);
        let first = environment
            .reset(seed)
            .map_err(|source| RolloutError::Environment { step: 0, source })?;
        let mut run = Run::new(first, seed, &spec.action_space);
        let end = loop {
            if let Some(end) = self.step(&mut run, environment, observer)? {
                break end;
            }
        };
        observer.on_end(run.step, &run.newest, &run.pending);
        run.events.append(&mut run.pending);
        Ok(Episode {
            steps: run.step,
            end,
            stage: self.monitor.filter().stage(),
            events: run.events,
            lost_steps: run.lost_steps,
            times: run.times,
        })
    }

    /// One step of the loop; an end, if it is one.
    fn step(
        &mut self,
        run: &mut Run,
        environment: &mut dyn Environment,
        observer: &mut dyn RolloutObserver,
    ) -> Result<Option<EpisodeEnd>, RolloutError> {
        let step = run.step;
        let sight = self.monitor.look(Arc::clone(&run.newest))?;
        let Sight {
            latent,
            distances,
            localisation,
            events,
            encode_ms,
            localise_ms,
        } = sight;
        run.distances = distances;
        run.pending.extend(events);
        let mut watch = Watch::start();
        if let Some(end) = self.note_change(run, &localisation) {
            return Ok(Some(end));
        }
        let goal = match self.planner.next_goal(&localisation, &run.distances) {
            Ok(goal) => goal,
            Err(no_path) => return Ok(Some(EpisodeEnd::NoPath(no_path.to_string()))),
        };
        self.note_progress(run, &goal);
        let plan_ms = watch.lap_ms();
        if self.is_finished(run, &localisation, &goal) {
            run.pending.push(Event::Terminated { step });
            return Ok(Some(EpisodeEnd::Finished));
        }
        if step >= self.options.max_steps {
            return Ok(Some(EpisodeEnd::OutOfSteps));
        }
        let (distribution, classes) = self.act(run, &latent, &localisation, &goal)?;
        let act_ms = watch.lap_ms();
        let action = environment
            .action_space()
            .action(&classes)
            .map_err(|source| RolloutError::Action { step, source })?;
        let times = StepTimes {
            encode_ms,
            localise_ms,
            plan_ms,
            act_ms,
        };
        let record = StepRecord {
            step,
            observation: Arc::clone(&run.newest),
            localisation,
            goal,
            distribution,
            action,
            events: std::mem::take(&mut run.pending),
            times,
        };
        observer.on_step(&record);
        run.events.extend(record.events);
        run.times.push(times);
        let seen = environment
            .step(&record.action)
            .map_err(|source| RolloutError::Environment { step, source })?;
        run.reflex
            .note(&classes, &run.newest, &seen, self.options.still_levels);
        run.see(seen);
        Ok(None)
    }

    /// Goes on from the stage that the monitor sees; an end, if a shortcut is one.
    fn note_change(&mut self, run: &mut Run, localisation: &Localisation) -> Option<EpisodeEnd> {
        run.lost_steps += usize::from(localisation.is_lost);
        match localisation.change {
            None | Some(StageChange::Ahead { .. }) => None,
            Some(StageChange::Advanced { .. } | StageChange::Regressed { .. }) => {
                run.enter();
                None
            }
            Some(StageChange::Shortcut { to, .. }) => match self.options.on_shortcut {
                OnShortcut::Replan => None,
                OnShortcut::Stop => Some(EpisodeEnd::Shortcut),
                OnShortcut::Report => {
                    self.monitor.accept_stage(to);
                    run.enter();
                    None
                }
            },
        }
    }

    /// Makes a goal state dearer that the robot does not get to, and lets old failures fade.
    fn note_progress(&mut self, run: &mut Run, goal: &GoalChoice) {
        self.planner.recover(self.options.penalty_keep);
        if goal.cost < run.least_cost - 0.5 {
            run.least_cost = goal.cost;
            run.progress_step = run.step;
        }
        if goal.cost < run.nearest_cost - 0.5 {
            run.nearest_cost = goal.cost;
            run.reflex.note_progress();
        }
        let waited = run.step - run.progress_step;
        if waited >= self.options.patience_steps {
            run.pending.push(Event::NoProgress {
                step: run.step,
                steps: waited,
            });
            self.planner
                .penalise(None, goal.node, self.options.penalty_steps);
            run.least_cost = f64::INFINITY;
            run.progress_step = run.step;
        }
    }

    fn is_finished(&self, run: &Run, localisation: &Localisation, goal: &GoalChoice) -> bool {
        self.planner.automaton().is_accepting(localisation.stage)
            && (goal.has_arrived || run.step - run.stage_step >= self.options.settle_steps)
    }

    fn act(
        &self,
        run: &mut Run,
        latent: &Latents,
        localisation: &Localisation,
        goal: &GoalChoice,
    ) -> Result<(ActionDistribution, Vec<usize>), RolloutError> {
        let mut parts = Vec::new();
        for (node, weight) in self.goal_states(run, localisation, goal) {
            let goal = self.planner.graph().latents().row(node.index());
            let part = self.model.policy.act(latent.row(0), goal);
            let part = part.map_err(|source| RolloutError::Model {
                step: run.step,
                source,
            })?;
            parts.push((part, weight as f32));
        }
        let distribution = ActionDistribution::mixture(&parts);
        if let Some(classes) = run.reflex.retreat(self.options.blocked_steps) {
            return Ok((distribution, classes));
        }
        let is_stuck = run.step - run.progress_step >= self.options.doubt_steps;
        let classes = if is_stuck {
            run.reflex.draw(&distribution, &mut run.rng)
        } else {
            run.reflex
                .choose(&distribution, self.options.least_substitute)
        };
        Ok((distribution, classes))
    }
}
