use std::path::PathBuf;

use crate::model::{BaselineValidation, ValidationMetrics};

/// The losses of one step, without the weights of policy and far pairs unless said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLosses {
    /// The whole objective, all weights included.
    pub total: f32,
    /// Cross-entropy of near pairs, classes weighted alike.
    pub near: f32,
    /// Mean cross-entropy of far pairs.
    pub far: f32,
    /// Cross-entropy of the actions.
    pub policy: f32,
    /// Mean squared error of the motion to go; 0 where it is not learnt.
    pub motion: f32,
    /// Cross-entropy between where landmarks are and where they are told to be; 0 where none are learnt.
    pub landmarks: f32,
}

/// What happens during a training.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TrainingEvent {
    /// The data are laid out and training begins or goes on.
    Started {
        /// States that are trained on.
        training_states: usize,
        /// States that are held out.
        validation_states: usize,
        /// Steps of the whole training.
        steps: u64,
        /// Steps that an earlier run has done.
        resumed_from: u64,
        /// Weights of the network.
        parameters: usize,
    },
    /// A step was done.
    Step {
        /// Number of steps done.
        step: u64,
        /// Share of the training that is done.
        progress: f64,
        /// The learning rate of this step.
        learning_rate: f64,
        /// Its losses.
        losses: StepLosses,
        /// States trained per second, since this run began.
        states_per_sec: f64,
    },
    /// The averaged weights were tried on the held-out demonstrations.
    Validated {
        /// Number of steps done.
        step: u64,
        /// How well they did.
        metrics: ValidationMetrics,
        /// The temperature that calibrates the traversability.
        temperature: f32,
        /// Whether no earlier weights did better.
        is_best: bool,
    },
    /// The averaged weights of a baseline were tried on the held-out demonstrations.
    BaselineValidated {
        /// Number of steps done.
        step: u64,
        /// How well they did.
        validation: BaselineValidation,
        /// Whether no earlier weights had a lower loss.
        is_best: bool,
    },
    /// A checkpoint was written.
    CheckpointWritten {
        /// Number of steps done.
        step: u64,
        /// The file.
        path: PathBuf,
    },
}

/// Is told what happens during a training, and may stop it.
pub trait TrainingObserver {
    /// Something happened.
    fn notice(&mut self, event: &TrainingEvent);

    /// Asked after every step: whether to write a checkpoint and stop.
    fn wants_stop(&mut self) -> bool {
        false
    }
}

/// An observer that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct SilentObserver;

impl TrainingObserver for SilentObserver {
    fn notice(&mut self, _event: &TrainingEvent) {}
}
