use thiserror::Error;

use crate::environment::EnvironmentError;
use crate::graph::GraphError;
use crate::model::ModelError;
use crate::planner::PlannerError;
use crate::trajectory::{ActionSpace, TrajectoryError, told_apart};

/// Why a run broke off. That a plan does not exist, or that time ran out, is no error but an
/// [`EpisodeEnd`](super::EpisodeEnd).
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum RolloutError {
    /// The robot failed or refused an action.
    #[error("step {step}: {source}")]
    Environment {
        /// Time step.
        step: usize,
        /// What it said.
        source: EnvironmentError,
    },
    /// The model gave no answer.
    #[error("step {step}: {source}")]
    Model {
        /// Time step.
        step: usize,
        /// What it said.
        source: ModelError,
    },
    /// The graph is not of the model.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The composition and the graph do not go together.
    #[error(transparent)]
    Planner(#[from] PlannerError),
    /// The policy's classes do not fit the action space.
    #[error("step {step}: {source}")]
    Action {
        /// Time step.
        step: usize,
        /// What does not fit.
        source: TrajectoryError,
    },
    /// What is known of landmarks is not of the encoder.
    #[error(
        "the landmarks are not of this encoder: {misfit}; take those that were written with it"
    )]
    LandmarksDiffer {
        /// What does not fit.
        misfit: String,
    },
    /// An option that no run can be made with.
    #[error("{option} is {value}, but it must be {range}")]
    OptionOutOfRange {
        /// Which of [`RolloutOptions`](super::RolloutOptions), or of their
        /// [filter](crate::planner::FilterOptions).
        option: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// The robot's actions are not those that the model was trained on.
    #[error("the robot takes {robot}, the model was trained on {model}: use a model of this robot")]
    ActionSpaceDiffers {
        /// The robot's action space.
        robot: String,
        /// The model's.
        model: String,
    },
}

impl RolloutError {
    /// Refuses landmarks of which something does not fit.
    pub(super) fn unless_misfit(misfit: Option<String>) -> Result<(), Self> {
        misfit.map_or(Ok(()), |misfit| Err(Self::LandmarksDiffer { misfit }))
    }

    /// Refuses a robot whose actions are not those of a model.
    pub(super) fn unless_same_actions(
        robot: &ActionSpace,
        model: &ActionSpace,
    ) -> Result<(), Self> {
        if robot == model {
            return Ok(());
        }
        let (robot, model) = told_apart(robot, model);
        Err(Self::ActionSpaceDiffers { robot, model })
    }
}
