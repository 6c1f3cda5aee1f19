use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::{FinalChoice, PlannerError};
use crate::graph::{NodeId, TopologicalGraph};
use crate::task::Automaton;

/// Where the robot is when a plan begins.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Where demonstrations of the first task begin.
    #[default]
    Beginning,
    /// Anywhere in the first task, at whichever stage of it: the robot finds out from what it sees. A plan
    /// that is made before begins at whichever state without a subgoal is cheapest.
    Anywhere,
    /// At the end of another task, whose graph is merged with those of the composition; a plan leads over
    /// an edge from one of its end states.
    After(String),
    /// At any state at which so many subgoals of the composition are reached. A plan that is made before
    /// begins where a demonstration reaches the last of them.
    Stage(usize),
}

impl Start {
    pub(super) fn check(
        &self,
        graph: &TopologicalGraph,
        automaton: &Automaton,
    ) -> Result<(), PlannerError> {
        let known = graph.tasks();
        match self {
            Self::After(task) if !known.contains(&task.as_str()) => {
                Err(PlannerError::UnknownStart {
                    task: task.clone(),
                    known: known.join(", "),
                })
            }
            Self::Stage(stage) if *stage >= automaton.stage_count() => {
                Err(PlannerError::UnknownStage {
                    stage: *stage,
                    subgoals: automaton.subgoals().len(),
                })
            }
            _ => Ok(()),
        }
    }
}

/// States that a plan must not pass.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AvoidedRegion {
    /// What the region is called in messages.
    pub name: String,
    /// The states.
    pub states: Vec<NodeId>,
}

/// What a plan keeps to besides the order of subgoals: where it starts, where it may end, what it does not
/// pass.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Terms {
    /// Where the robot is at the beginning.
    pub start: Start,
    /// Which end state of the last task it leads to.
    pub end: FinalChoice,
    /// What neither a plan nor a goal state on the way may touch.
    pub avoid: Vec<AvoidedRegion>,
    /// States that are no part of the composition: neither planned over nor believed in.
    pub unplaced: Vec<NodeId>,
}

impl Terms {
    /// The states that are no part of the composition.
    pub(super) fn strangers(&self) -> HashSet<NodeId> {
        self.unplaced.iter().copied().collect()
    }

    /// The names of the avoided regions, separated by commas.
    pub(super) fn region_names(&self) -> String {
        let names: Vec<&str> = self.avoid.iter().map(|r| r.name.as_str()).collect();
        names.join(", ")
    }

    /// The states of all avoided regions.
    pub(super) fn avoided(&self) -> HashSet<NodeId> {
        self.avoided_but(&|_| false)
    }

    /// The same without the regions at some places of the list; a state that lies in another one, too, stays.
    pub(super) fn avoided_but(&self, is_left_out: &dyn Fn(usize) -> bool) -> HashSet<NodeId> {
        let regions = self.avoid.iter().enumerate();
        let kept = regions.filter(|(i, _)| !is_left_out(*i));
        kept.flat_map(|(_, region)| region.states.iter().copied())
            .collect()
    }
}

impl From<&FinalChoice> for Terms {
    /// From the beginning to this end.
    fn from(end: &FinalChoice) -> Self {
        Self {
            end: end.clone(),
            ..Self::default()
        }
    }
}

impl From<&Terms> for Terms {
    fn from(terms: &Terms) -> Self {
        terms.clone()
    }
}
