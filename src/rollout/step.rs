use std::sync::Arc;

use super::Event;
use crate::model::ActionDistribution;
use crate::planner::{GoalChoice, Localisation};
use crate::trajectory::{Action, Observation};

/// How long the parts of a step took, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepTimes {
    /// Images to latents.
    pub encode_ms: f64,
    /// Distances to the graph, and the filter.
    pub localise_ms: f64,
    /// The goal state.
    pub plan_ms: f64,
    /// The local policy.
    pub act_ms: f64,
}

impl StepTimes {
    /// All of them together.
    #[must_use]
    pub fn total_ms(&self) -> f64 {
        self.encode_ms + self.localise_ms + self.plan_ms + self.act_ms
    }
}

/// Everything about one time step, before its action is carried out.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// From 0.
    pub step: usize,
    /// What the cameras show.
    pub observation: Arc<Observation>,
    /// Where the robot is believed to be.
    pub localisation: Localisation,
    /// Where it is sent.
    pub goal: GoalChoice,
    /// What the policy would do.
    pub distribution: ActionDistribution,
    /// What is done.
    pub action: Action,
    /// What happened at this step.
    pub events: Vec<Event>,
    /// What it cost.
    pub times: StepTimes,
}

/// Is told of every step of a run.
pub trait RolloutObserver {
    /// Called once a step, before the action is carried out.
    fn on_step(&mut self, record: &StepRecord);

    /// Called once at the end with the last observation and the events that came with it.
    fn on_end(&mut self, _step: usize, _observation: &Arc<Observation>, _events: &[Event]) {}
}

/// An observer that does not look.
impl RolloutObserver for () {
    fn on_step(&mut self, _record: &StepRecord) {}
}
