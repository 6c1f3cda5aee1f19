//! What a policy server answers with.

use serde::Serialize;

use super::ArrayOf;
use crate::graph::{NodeId, TopologicalGraph};
use crate::planner::Localisation;
use crate::rollout::{EpisodeEnd, Event, StepRecord, StepTimes};
use crate::task::{Automaton, Subgoal};
use crate::trajectory::{Action, ActionSpace};

/// The answer to one observation.
#[derive(Serialize)]
pub(super) struct Reply<'a> {
    /// `[1, dimensions]`; `[0, dimensions]` once the episode is over and the robot has no action that
    /// says so.
    pub(super) actions: ArrayOf<'static>,
    pub(super) action: Option<Primitive<'a>>,
    pub(super) step: usize,
    pub(super) done: bool,
    pub(super) end: Option<&'a EpisodeEnd>,
    /// Subgoals that are seen to be reached.
    pub(super) stage: usize,
    pub(super) due: Option<&'a Subgoal>,
    pub(super) goal: Option<Goal<'a>>,
    pub(super) place: Place<'a>,
    /// Of the action distribution, in nats.
    pub(super) entropy: Option<f32>,
    pub(super) events: Vec<Told<'a>>,
    pub(super) server_timing: Timing,
}

#[derive(Serialize)]
pub(super) struct Primitive<'a> {
    index: usize,
    name: &'a str,
}

/// A demonstrated state.
#[derive(Serialize)]
pub(super) struct Demonstrated<'a> {
    task: &'a str,
    trajectory: &'a str,
    step: u32,
}

#[derive(Serialize)]
pub(super) struct Goal<'a> {
    #[serde(flatten)]
    state: Demonstrated<'a>,
    /// To the goal state, as predicted.
    steps: u32,
    /// To the final state.
    cost: f64,
}

#[derive(Serialize)]
pub(super) struct Place<'a> {
    #[serde(flatten)]
    state: Demonstrated<'a>,
    entropy: f64,
    lost: bool,
}

/// An event with its words.
#[derive(Serialize)]
pub(super) struct Told<'a> {
    #[serde(flatten)]
    event: &'a Event,
    message: String,
}

/// In milliseconds.
#[derive(Clone, Copy, Default, Serialize)]
#[expect(
    clippy::struct_field_names,
    reason = "clients read the unit in the name"
)]
pub(super) struct Timing {
    /// From the whole message to the packed answer.
    pub(super) infer_ms: f64,
    /// The library's step as a whole; 0 where the episode was over.
    pub(super) step_ms: f64,
    encode_ms: f64,
    localise_ms: f64,
    plan_ms: f64,
    act_ms: f64,
}

impl Timing {
    pub(super) fn new(times: StepTimes) -> Self {
        Self {
            infer_ms: 0.0,
            step_ms: 0.0,
            encode_ms: times.encode_ms,
            localise_ms: times.localise_ms,
            plan_ms: times.plan_ms,
            act_ms: times.act_ms,
        }
    }
}

/// An episode that is over.
pub(super) struct Over<'a> {
    pub(super) end: &'a EpisodeEnd,
    pub(super) events: &'a [Event],
    pub(super) localisation: &'a Localisation,
    pub(super) step: usize,
}

/// What answers refer to.
pub(super) struct Context<'a> {
    pub(super) graph: &'a TopologicalGraph,
    pub(super) automaton: &'a Automaton,
    pub(super) space: &'a ActionSpace,
}

impl<'a> Context<'a> {
    pub(super) fn act(&self, record: &'a StepRecord) -> Reply<'a> {
        Reply {
            actions: actions(Some(&record.action), self.space),
            action: self.primitive(&record.action),
            step: record.step,
            done: false,
            end: None,
            stage: record.localisation.stage,
            due: self.automaton.subgoals().get(record.localisation.stage),
            goal: Some(Goal {
                state: self.demonstrated(record.goal.node),
                steps: record.goal.steps,
                cost: record.goal.cost,
            }),
            place: self.place(&record.localisation),
            entropy: Some(record.distribution.entropy()),
            events: told(&record.events),
            server_timing: Timing::new(record.times),
        }
    }

    pub(super) fn over(&self, over: &Over<'a>) -> Reply<'a> {
        let last = self.space.terminate();
        Reply {
            actions: actions(last.as_ref(), self.space),
            action: last.and_then(|action| self.primitive(&action)),
            step: over.step,
            done: true,
            end: Some(over.end),
            stage: over.localisation.stage,
            due: self.automaton.subgoals().get(over.localisation.stage),
            goal: None,
            place: self.place(over.localisation),
            entropy: None,
            events: told(over.events),
            server_timing: Timing::default(),
        }
    }

    fn primitive(&self, action: &Action) -> Option<Primitive<'a>> {
        match (self.space, action) {
            (ActionSpace::Primitives { names }, Action::Primitive(index)) => Some(Primitive {
                index: *index,
                name: names.get(*index)?,
            }),
            _ => None,
        }
    }

    fn place(&self, localisation: &Localisation) -> Place<'a> {
        Place {
            state: self.demonstrated(localisation.node),
            entropy: localisation.entropy_nats,
            lost: localisation.is_lost,
        }
    }

    fn demonstrated(&self, node: NodeId) -> Demonstrated<'a> {
        let node = self.graph.node(node);
        Demonstrated {
            task: &node.task,
            trajectory: &node.trajectory,
            step: node.step,
        }
    }
}

/// One row of an action's values, or no row; a primitive's value is its index.
fn actions(action: Option<&Action>, space: &ActionSpace) -> ArrayOf<'static> {
    let values = match action {
        None => Vec::new(),
        Some(Action::Primitive(index)) => vec![*index as f32],
        Some(Action::Continuous(values)) => values.clone(),
    };
    let rows = usize::from(action.is_some());
    ArrayOf::Floats(values, vec![rows, space.dimension_count()])
}

fn told(events: &[Event]) -> Vec<Told<'_>> {
    let told = |event| Told {
        event,
        message: event.to_string(),
    };
    events.iter().map(told).collect()
}
