use std::fmt;
use std::sync::Arc;

use super::nearby::Nearby;
use super::running::Watch;
use super::{Event, MonitorModel, RolloutError, RolloutOptions};
use crate::graph::NodeId;
use crate::model::{GraspSight, Latents, ModelError, Projections};
use crate::planner::{LiveDistances, Localisation, Planner, StageChange, StageFilter};
use crate::task::Subgoal;
use crate::trajectory::{Observation, State};

/// Watches a robot along a composition, from images alone, whoever drives it: says which subgoals it
/// reached, and flags a shortcut.
///
/// [`Rollout`](super::Rollout) has one for the robot that it drives.
#[derive(Clone)]
pub struct Monitor<'a> {
    model: MonitorModel<'a>,
    filter: StageFilter,
    projections: Arc<Projections>,
    candidates: Vec<NodeId>,
    nearby: Option<Arc<Nearby>>,
    subgoals: Vec<Subgoal>,
    near_probability: f32,
    history: Vec<Arc<Observation>>,
    step: usize,
    /// Steps for which the robot has been lost.
    lost_steps: u32,
}

/// A robot is said to be lost once it was for so many steps in a row: nearly all runs that succeed have shorter spells,
/// where the robot stands as no demonstration did.
const TOLD_LOST_STEPS: u32 = 6;

/// What a monitor made of one observation.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The latent of the current state: one row.
    pub latent: Latents,
    /// Predicted steps between the current state and those of the graph.
    pub distances: LiveDistances,
    /// What is seen of the gripper, by a model that has a sense of grasps.
    pub grasp: Option<GraspSight>,
    /// Where the robot is believed to be.
    pub localisation: Localisation,
    /// What happened.
    pub events: Vec<Event>,
    /// Time from images to the latent, in milliseconds.
    pub encode_ms: f64,
    /// Time for distances and filter, in milliseconds.
    pub localise_ms: f64,
}

impl<'a> Monitor<'a> {
    /// A monitor for the composition of a planner. Of the options it takes what concerns localisation, of a
    /// [`RolloutModel`](super::RolloutModel) all but the policy.
    ///
    /// # Errors
    /// [`RolloutError::Graph`] when the graph has another `d_max` or latents of another length than the
    /// model, [`RolloutError::Model`] when a network gives no answer, [`RolloutError::LandmarksDiffer`] when the
    /// landmarks are not of the encoder, [`RolloutError::OptionOutOfRange`] when an option is out of its range,
    /// [`RolloutError::Planner`] when the stages of the graph's states cannot be learnt.
    pub fn new(
        model: impl Into<MonitorModel<'a>>,
        planner: &Planner,
        options: &RolloutOptions,
    ) -> Result<Self, RolloutError> {
        options.check()?;
        let model = model.into();
        let spec = model.encoder.spec();
        planner.graph().ensure_fits(
            "the graph of the composition",
            model.traversability.d_max(),
            spec.latent_dim,
        )?;
        let misfit = (model.landmarks).and_then(|book| book.misfit_of_grasps(&spec.cameras));
        RolloutError::unless_misfit(misfit)?;
        let latents = planner.graph().latents();
        let projections = model
            .traversability
            .project(latents)
            .map_err(|source| RolloutError::Model { step: 0, source })?;
        let mut filter = planner.stage_filter(options.filter.clone());
        if options.filter.classifier_weight > 0.0 {
            filter = filter.with_classifier(planner.stage_classifier()?);
        }
        let book = model.landmarks;
        if let Some((book, sense)) = book.and_then(|book| Some((book, book.grasp.as_ref()?))) {
            let graph = planner.graph();
            let is_closed = |node| {
                let node = graph.node(node);
                book.is_closed(&node.task, &node.trajectory, node.step)
            };
            filter = filter.with_grasps(is_closed, |node| sense.thing_of(&graph.node(node).task));
        }
        let candidates = filter.candidates();
        let nearby = options
            .nearest_states
            .map(|count| Nearby::new(model.traversability, &projections, &candidates, count))
            .transpose()
            .map(|nearby| nearby.map(Arc::new))
            .map_err(|source| RolloutError::Model { step: 0, source })?;
        Ok(Self {
            model,
            filter,
            projections: Arc::new(projections),
            candidates,
            nearby,
            subgoals: planner.automaton().subgoals().to_vec(),
            near_probability: options.near_probability,
            history: Vec::new(),
            step: 0,
            lost_steps: 0,
        })
    }

    /// Forgets all that it saw, for a new episode.
    pub fn reset(&mut self) {
        self.filter.reset();
        self.history.clear();
        self.step = 0;
        self.lost_steps = 0;
    }

    /// The belief and the stage.
    #[must_use]
    pub fn filter(&self) -> &StageFilter {
        &self.filter
    }

    /// Takes the robot to be at a stage from now on, as after a shortcut that is to be left as it is.
    ///
    /// # Panics
    /// If the composition has no such stage.
    pub fn accept_stage(&mut self, stage: usize) {
        self.filter.set_stage(stage);
    }

    /// The next observation, one time step after the last one.
    ///
    /// # Errors
    /// [`RolloutError::Model`] when a network gives no answer, one of another length than it should, or a latent
    /// that holds NaN or infinity.
    pub fn look(&mut self, observation: Arc<Observation>) -> Result<Sight, RolloutError> {
        let step = self.step;
        let failed = |source| RolloutError::Model { step, source };
        let mut watch = Watch::start();
        let stack = self.model.encoder.spec().stack;
        self.history.push(observation);
        let excess = self.history.len().saturating_sub(stack.max(1));
        self.history.drain(..excess);
        let state = State::from_history(&self.history, stack);
        let latent = self.model.encoder.encode(&[state]).map_err(failed)?;
        let latent_dim = self.model.encoder.spec().latent_dim;
        latent.ensure_of(1, latent_dim).map_err(failed)?;
        ensure_finite(&latent).map_err(failed)?;
        let encode_ms = watch.lap_ms();
        let current = self.model.traversability.project(&latent).map_err(failed)?;
        let proposed = self
            .nearby
            .as_ref()
            .map(|nearby| nearby.propose(&current, &self.filter));
        let distances = LiveDistances::query(
            self.model.traversability,
            &self.projections,
            &current,
            proposed.as_ref().unwrap_or(&self.candidates),
            self.near_probability,
        )
        .map_err(failed)?;
        let sense = self.model.landmarks.and_then(|book| book.grasp.as_ref());
        let grasp = sense.and_then(|sense| sense.look(self.history.last()?));
        let before = self.filter.stage();
        let localisation = self.filter.look(&distances, latent.row(0), grasp);
        let mut events = Vec::new();
        // What comes after the last subgoal is nobody's way any more.
        if localisation.stage < self.subgoals.len() {
            events.extend(self.note_lost(localisation.is_lost));
        }
        events.extend(self.events(before, &localisation, grasp));
        self.step += 1;
        Ok(Sight {
            latent,
            distances,
            grasp,
            localisation,
            events,
            encode_ms,
            localise_ms: watch.lap_ms(),
        })
    }

    /// Counts the steps for which the robot is lost; that it is, or no longer is, where that is worth a word.
    fn note_lost(&mut self, is_lost: bool) -> Option<Event> {
        let (step, before) = (self.step, self.lost_steps);
        self.lost_steps = if is_lost { before + 1 } else { 0 };
        if self.lost_steps == TOLD_LOST_STEPS {
            return Some(Event::Lost { step });
        }
        (before >= TOLD_LOST_STEPS && !is_lost).then_some(Event::Found { step })
    }

    /// What the filter noticed, in words; the stage was `before`.
    fn events(
        &self,
        before: usize,
        localisation: &Localisation,
        grasp: Option<GraspSight>,
    ) -> Vec<Event> {
        let step = self.step;
        let mut events = Vec::new();
        let confidence = |stage: usize| {
            let beyond: f64 = localisation.stage_probabilities[stage..].iter().sum();
            beyond as f32
        };
        let subgoals = &self.subgoals;
        let reached = |stage: usize, confidence: f32| Event::SubgoalReached {
            step,
            stage,
            subgoal: subgoals[stage - 1].clone(),
            confidence,
        };
        let due_at = |stages: &[usize]| stages.iter().map(|s| subgoals[*s].clone()).collect();
        match &localisation.change {
            None => {}
            Some(StageChange::Advanced { to }) => {
                let stages = before + 1..=*to;
                events.extend(stages.map(|stage| reached(stage, confidence(stage))));
            }
            // The belief does not know of it yet.
            Some(StageChange::Taken { to }) => {
                let seen = grasp.map_or_else(|| confidence(*to), |sight| sight.held as f32);
                events.push(reached(*to, seen));
            }
            Some(StageChange::Regressed { to } | StageChange::Dropped { to }) => {
                events.push(Event::SetBack {
                    step,
                    stage: *to,
                    subgoal: subgoals[*to].clone(),
                });
            }
            Some(StageChange::Shortcut { to, skipped }) => events.push(Event::Shortcut {
                step,
                subgoal: subgoals[to - 1].clone(),
                skipped: due_at(skipped),
                confidence: confidence(*to),
            }),
            // A last task without subgoals has none that the robot could be heading for.
            Some(StageChange::Ahead { to, skipped }) => {
                events.extend(subgoals.get(*to).map(|subgoal| Event::HeadingAhead {
                    step,
                    subgoal: subgoal.clone(),
                    skipped: due_at(skipped),
                    confidence: confidence(*to),
                }));
            }
        }
        events
    }
}

impl fmt::Debug for Monitor<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Monitor")
            .field("step", &self.step)
            .field("stage", &self.filter.stage())
            .finish_non_exhaustive()
    }
}

/// A latent that is no number is near nothing: the robot would be lost without anybody knowing why.
fn ensure_finite(latent: &Latents) -> Result<(), ModelError> {
    let values = latent.values();
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(place) => Err(ModelError::NotFinite {
            what: "the latent of the current state".to_owned(),
            place,
            value: values[place].to_string(),
        }),
    }
}

#[cfg(test)]
mod tests;
