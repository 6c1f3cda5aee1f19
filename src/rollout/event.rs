use std::fmt;

use serde::{Deserialize, Serialize};

use crate::task::Subgoal;

/// Something worth telling that happened during a run, seen from images and actions alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "event")]
#[non_exhaustive]
pub enum Event {
    /// The subgoal that was due is seen to be reached.
    SubgoalReached {
        /// Time step.
        step: usize,
        /// The stage that begins.
        stage: usize,
        /// What was reached.
        subgoal: Subgoal,
        /// Belief in it, 0..=1.
        confidence: f32,
    },
    /// A later subgoal is seen to be reached without earlier ones.
    Shortcut {
        /// Time step.
        step: usize,
        /// What was reached too early.
        subgoal: Subgoal,
        /// What was skipped, in order.
        skipped: Vec<Subgoal>,
        /// Belief in it, 0..=1.
        confidence: f32,
    },
    /// The robot goes about a later task although an earlier one is not done: it is on its way to a
    /// shortcut, but nothing is skipped yet.
    HeadingAhead {
        /// Time step.
        step: usize,
        /// The first subgoal of the later task.
        subgoal: Subgoal,
        /// What is left out so far, in order.
        skipped: Vec<Subgoal>,
        /// Belief in it, 0..=1.
        confidence: f32,
    },
    /// A subgoal that was reached is seen to hold no longer: what was held has slipped.
    SetBack {
        /// Time step.
        step: usize,
        /// The stage that is gone back to.
        stage: usize,
        /// What is due again.
        subgoal: Subgoal,
    },
    /// What the cameras show is like no state of the graph, and has been for some steps; not said once all subgoals are reached.
    Lost {
        /// Time step.
        step: usize,
    },
    /// The robot recognises where it is again.
    Found {
        /// Time step.
        step: usize,
    },
    /// The cost-to-go has not fallen for a while; the edges tried are made dearer.
    NoProgress {
        /// Time step.
        step: usize,
        /// Steps since it last fell.
        steps: usize,
    },
    /// The robot is at a final state, or has settled in the last stage.
    Terminated {
        /// Time step.
        step: usize,
    },
}

impl Event {
    /// The step at which a shortcut was flagged, and what it skipped; none for any other event.
    #[must_use]
    pub fn shortcut(&self) -> Option<(usize, &[Subgoal])> {
        match self {
            Self::Shortcut { step, skipped, .. } => Some((*step, skipped)),
            _ => None,
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SubgoalReached {
                step,
                subgoal,
                confidence,
                ..
            } => write!(
                f,
                "step {step}: {}/{} reached ({:.0} % sure)",
                subgoal.task,
                subgoal.name,
                100.0 * confidence
            ),
            Self::Shortcut {
                step,
                subgoal,
                skipped,
                confidence,
            } => write!(
                f,
                "step {step}: SHORTCUT to {}/{}, skipping {} ({:.0} % sure)",
                subgoal.task,
                subgoal.name,
                names(skipped),
                100.0 * confidence
            ),
            Self::HeadingAhead {
                step,
                subgoal,
                skipped,
                confidence,
            } => write!(
                f,
                "step {step}: heading for {}/{} without {} ({:.0} % sure)",
                subgoal.task,
                subgoal.name,
                names(skipped),
                100.0 * confidence
            ),
            Self::SetBack { step, subgoal, .. } => {
                write!(
                    f,
                    "step {step}: {}/{} is due again",
                    subgoal.task, subgoal.name
                )
            }
            Self::Lost { step } => write!(f, "step {step}: lost"),
            Self::Found { step } => write!(f, "step {step}: found again"),
            Self::NoProgress { step, steps } => {
                write!(f, "step {step}: no progress for {steps} steps")
            }
            Self::Terminated { step } => write!(f, "step {step}: terminated"),
        }
    }
}

fn names(subgoals: &[Subgoal]) -> String {
    let names: Vec<&str> = subgoals.iter().map(|s| s.name.as_str()).collect();
    names.join(", ")
}
