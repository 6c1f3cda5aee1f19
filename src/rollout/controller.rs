use std::fmt;
use std::sync::Arc;

use super::approach::Approach;
use super::reflex::Reflex;
use super::running::{Run, Watch};
use super::{
    EpisodeEnd, Event, Monitor, RolloutError, RolloutModel, RolloutOptions, Sight, StepRecord,
    StepTimes,
};
use crate::composer::OnShortcut;
use crate::model::{ActionDistribution, Latents, ModelSpec};
use crate::planner::{GoalChoice, Localisation, Planner, StageChange};
use crate::trajectory::{ActionSpace, Observation, Step};

/// Answers each observation of a robot with the action to take, until the composition is done: the loop
/// without the robot, for programs that hold the robot themselves. [`Rollout`](super::Rollout) closes it
/// over an [`Environment`](crate::environment::Environment).
///
/// A clone shares the graph, what was computed of it, and the model, and follows an episode of its own.
#[derive(Clone)]
pub struct Controller<'a> {
    model: RolloutModel<'a>,
    pub(super) planner: Planner,
    pub(super) monitor: Monitor<'a>,
    pub(super) options: RolloutOptions,
    pub(super) run: Run,
    approach: Option<Approach>,
    /// Classes of what was done before episodes begin and moved something.
    before: Vec<usize>,
}

/// What a [`Controller`] made of an observation.
#[derive(Clone, Debug)]
pub enum Decision {
    /// Act: the record says how and why.
    Act(Box<StepRecord>),
    /// The episode is over.
    End {
        /// Why.
        end: EpisodeEnd,
        /// What happened at this last observation.
        events: Vec<Event>,
        /// Where the robot is believed to be.
        localisation: Box<Localisation>,
    },
}

impl<'a> Controller<'a> {
    /// Makes the states of the planner's graph ready for the model's traversability function.
    ///
    /// # Errors
    /// Those of [`Monitor::new`], and [`RolloutError::LandmarksDiffer`] when the landmarks are not where this encoder
    /// tells them.
    pub fn new(
        model: RolloutModel<'a>,
        planner: Planner,
        options: RolloutOptions,
    ) -> Result<Self, RolloutError> {
        let monitor = Monitor::new(model, &planner, &options)?;
        let spec = model.encoder.spec();
        let book = model.landmarks.filter(|_| options.approach);
        let misfit = book.and_then(|book| book.misfit(spec.latent_dim, &spec.cameras));
        RolloutError::unless_misfit(misfit)?;
        let approach = book.and_then(|book| {
            Approach::new(&Arc::new(book.clone()), &spec.cameras, &spec.action_space)
        });
        Ok(Self {
            run: Run::new(0, &spec.action_space),
            before: Vec::new(),
            approach,
            model,
            planner,
            monitor,
            options,
        })
    }

    /// The planner, as the episode so far left it.
    #[must_use]
    pub fn planner(&self) -> &Planner {
        &self.planner
    }

    /// How it runs a composition.
    #[must_use]
    pub fn options(&self) -> &RolloutOptions {
        &self.options
    }

    /// What it sees and does: cameras and actions.
    #[must_use]
    pub fn spec(&self) -> &ModelSpec {
        self.model.encoder.spec()
    }

    /// How many subgoals are seen to be reached.
    #[must_use]
    pub fn stage(&self) -> usize {
        self.monitor.filter().stage()
    }

    /// Observations answered with an action since the episode began.
    #[must_use]
    pub fn step_count(&self) -> usize {
        self.run.step
    }

    /// Steps of the episode at which the robot was lost.
    #[must_use]
    pub fn lost_steps(&self) -> usize {
        self.run.lost_steps
    }

    /// Begins a new episode. The seed is that of actions that are drawn where the robot makes no progress.
    pub fn reset(&mut self, seed: u64) {
        self.monitor.reset();
        self.planner.recover(0.0);
        self.run = Run::new(seed, &self.model.encoder.spec().action_space);
        if let Some(approach) = &mut self.approach {
            approach.reset();
            self.before.iter().for_each(|class| approach.note(*class));
        }
    }

    /// Episodes that [`reset`](Self::reset) begins go on from here: `done` is what the robot saw and did since it
    /// stood as demonstrations begin, `seen` is what it sees now. So it knows where its gripper is, and whether that
    /// is open. Actions that are none of the model's are skipped.
    pub fn go_on_from(&mut self, done: &[Step], seen: &Observation) {
        let space = &self.model.encoder.spec().action_space;
        let stillness = self.options.stillness();
        let mut reflex = Reflex::new(space);
        let after = (done.iter().skip(1)).map(|step| &*step.observation);
        let pairs = done.iter().zip(after.chain([seen]));
        let moved = pairs.filter_map(|(step, after)| {
            let classes = space.classes(&step.action).ok()?;
            let has_moved = reflex.note(&classes, &step.observation, after, stillness);
            classes.first().copied().filter(|_| has_moved)
        });
        self.before = moved.collect();
    }

    /// The next observation: the first one of the episode, or what is seen after the last action. After an
    /// end, [`reset`](Self::reset) comes first.
    ///
    /// # Errors
    /// [`RolloutError`] when a network gives no answer, or cameras or classes do not fit the model.
    pub fn step(&mut self, observation: Arc<Observation>) -> Result<Decision, RolloutError> {
        let done = self.run.see(&observation, self.options.stillness());
        if let (Some(approach), Some((class, has_moved))) = (&mut self.approach, done) {
            if has_moved {
                approach.note(class);
            } else {
                approach.note_stopped(class);
            }
        }
        let step = self.run.step;
        let sight = self.monitor.look(Arc::clone(&observation))?;
        let Sight {
            latent,
            distances,
            grasp,
            localisation,
            mut events,
            encode_ms,
            localise_ms,
        } = sight;
        self.run.distances = distances;
        if let Some(approach) = &mut self.approach {
            approach.look(latent.row(0));
            if let Some(sight) = grasp {
                approach.feel(sight);
            }
        }
        let mut watch = Watch::start();
        if let Some(end) = self.note_change(&localisation) {
            return Ok(Decision::over(end, events, localisation));
        }
        let goal = match self.planner.next_goal(&localisation, &self.run.distances) {
            Ok(goal) => goal,
            Err(no_path) => {
                let end = EpisodeEnd::NoPath(no_path.to_string());
                return Ok(Decision::over(end, events, localisation));
            }
        };
        events.extend(self.note_progress(&goal));
        let plan_ms = watch.lap_ms();
        if self.is_finished(&localisation, &goal) {
            events.push(Event::Terminated { step });
            return Ok(Decision::over(EpisodeEnd::Finished, events, localisation));
        }
        if step >= self.options.max_steps {
            return Ok(Decision::over(EpisodeEnd::OutOfSteps, events, localisation));
        }
        let (distribution, classes) = self.choose(&latent, &localisation, &goal)?;
        let space = &self.model.encoder.spec().action_space;
        // Of several heads none is ever ruled out, so each dimension may be decoded from all its bins.
        let action = match space {
            ActionSpace::Binned { .. } => space.decoded_action(&distribution.heads),
            _ => space.action(&classes),
        };
        let action = action.map_err(|source| RolloutError::Action { step, source })?;
        let act_ms = watch.lap_ms();
        self.run.acted(classes, Arc::clone(&observation));
        Ok(Decision::Act(Box::new(StepRecord {
            step,
            observation,
            localisation,
            goal,
            distribution,
            action,
            events,
            times: StepTimes {
                encode_ms,
                localise_ms,
                plan_ms,
                act_ms,
            },
        })))
    }

    /// Goes on from the stage that the monitor sees; an end, if a shortcut is one.
    fn note_change(&mut self, localisation: &Localisation) -> Option<EpisodeEnd> {
        self.run.lost_steps += usize::from(localisation.is_lost);
        match localisation.change {
            None | Some(StageChange::Ahead { .. }) => None,
            Some(
                StageChange::Advanced { .. }
                | StageChange::Taken { .. }
                | StageChange::Regressed { .. },
            ) => {
                self.enter_stage();
                None
            }
            Some(StageChange::Dropped { .. }) => {
                self.enter_stage();
                if let Some(approach) = &mut self.approach {
                    approach.let_go();
                }
                None
            }
            Some(StageChange::Shortcut { to, .. }) => match self.options.on_shortcut {
                OnShortcut::Replan => {
                    self.enter_stage();
                    None
                }
                OnShortcut::Stop => Some(EpisodeEnd::Shortcut),
                OnShortcut::Report => {
                    self.monitor.accept_stage(to);
                    self.enter_stage();
                    None
                }
            },
        }
    }

    fn enter_stage(&mut self) {
        self.run.enter();
        if let Some(approach) = &mut self.approach {
            approach.enter();
        }
    }

    /// Makes a goal state dearer that the robot does not get to, and lets old failures fade.
    fn note_progress(&mut self, goal: &GoalChoice) -> Option<Event> {
        self.planner.recover(self.options.penalty_keep);
        if goal.cost < self.run.least_cost - 0.5 {
            self.run.least_cost = goal.cost;
            self.run.progress_step = self.run.step;
        }
        if goal.cost < self.run.nearest_cost - 0.5 {
            self.run.nearest_cost = goal.cost;
            self.run.reflex.note_progress();
        }
        let waited = self.run.step - self.run.progress_step;
        if waited < self.options.patience_steps {
            return None;
        }
        self.planner
            .penalise(None, goal.node, self.options.penalty_steps);
        self.run.least_cost = f64::INFINITY;
        self.run.progress_step = self.run.step;
        Some(Event::NoProgress {
            step: self.run.step,
            steps: waited,
        })
    }

    fn is_finished(&self, localisation: &Localisation, goal: &GoalChoice) -> bool {
        self.planner.automaton().is_accepting(localisation.stage)
            && (goal.has_arrived
                || self.run.step - self.run.stage_step >= self.options.settle_steps)
    }

    fn choose(
        &mut self,
        latent: &Latents,
        localisation: &Localisation,
        goal: &GoalChoice,
    ) -> Result<(ActionDistribution, Vec<usize>), RolloutError> {
        let head_sizes = self.spec().action_space.head_sizes();
        let mut parts = Vec::new();
        for (node, weight) in self.goal_states(localisation, goal) {
            let goal = self.planner.graph().latents().row(node.index());
            let part = self.model.policy.act(latent.row(0), goal);
            let part = part.and_then(|part| part.ensure_of(&head_sizes).map(|()| part));
            let part = part.map_err(|source| RolloutError::Model {
                step: self.run.step,
                source,
            })?;
            parts.push((part, weight as f32));
        }
        let distribution = ActionDistribution::mixture(&parts);
        if let Some(classes) = self.run.reflex.retreat(self.options.blocked_steps) {
            return Ok((distribution, classes));
        }
        let reflex = &self.run.reflex;
        let node = self.planner.graph().node(goal.node);
        let is_stuck = self.run.step - self.run.progress_step >= self.options.doubt_steps;
        if let Some(approach) = &mut self.approach {
            let is_ruled_out = |class| reflex.is_ruled_out(class);
            if let Some(class) = approach.lead(node, is_stuck, is_ruled_out) {
                approach.chosen(class, node);
                return Ok((distribution, vec![class]));
            }
        }
        let too_early = self.approach.as_ref().and_then(|a| a.too_early(node));
        let useless = (self.approach.as_ref()).map_or_else(Vec::new, |a| a.useless(node, is_stuck));
        let out = useless.into_iter().chain(too_early);
        let open_to = out.fold(distribution.clone(), |d, class| d.without(class));
        let mut classes = if is_stuck {
            self.run.reflex.draw(&open_to, &mut self.run.rng)
        } else {
            self.run
                .reflex
                .choose(&open_to, self.options.least_substitute)
        };
        if let Some(approach) = &mut self.approach {
            let is_ruled_out = |class| self.run.reflex.is_ruled_out(class);
            if let Some(class) = approach.instead_of(classes[0], node, is_ruled_out) {
                classes = vec![class];
            }
            approach.chosen(classes[0], node);
        }
        Ok((distribution, classes))
    }
}

impl fmt::Debug for Controller<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Controller")
            .field("model", &self.model)
            .field("monitor", &self.monitor)
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

impl Decision {
    fn over(end: EpisodeEnd, events: Vec<Event>, localisation: Localisation) -> Self {
        Self::End {
            end,
            events,
            localisation: Box::new(localisation),
        }
    }
}
