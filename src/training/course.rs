//! The course of a training, the same for every network: batches made ready ahead, steps, validations,
//! checkpoints, and an end by steps, by time or by patience.

use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use burn::module::Module;
use serde::{Deserialize, Serialize};

use super::budget::Budget;
use super::learner::Learner;
use super::schedule::learning_rate;
use super::weights::weight_count;
use super::{OptimiserConfig, StepLosses, TrainingError, TrainingEvent, TrainingObserver};

/// Batches that are made ready while the network computes.
const BATCHES_AHEAD: usize = 1;

/// How far a training is; part of its checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Steps done.
    pub step: u64,
    /// Seconds that they took.
    pub spent_secs: f64,
    /// Whether the training came to its end.
    pub finished: bool,
    /// Validations since the best weights were found.
    pub validations_without_gain: u64,
}

impl Progress {
    /// Counts a validation, which found the best weights so far or did not.
    pub fn note_validation(&mut self, is_best: bool) {
        if is_best {
            self.validations_without_gain = 0;
        } else {
            self.validations_without_gain += 1;
        }
    }
}

/// What a configuration says of the course.
#[derive(Clone, Debug)]
pub struct Pace {
    /// Number of steps.
    pub steps: u64,
    /// Stop after so many minutes.
    pub max_minutes: Option<f64>,
    /// Validate after so many steps.
    pub validate_every_steps: u64,
    /// Write a checkpoint after so many steps.
    pub checkpoint_every_steps: u64,
    /// Stop when so many validations in a row have brought nothing better.
    pub patience_validations: Option<u64>,
    /// How the learning rate goes.
    pub optimiser: OptimiserConfig,
}

/// What a training has to learn from.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// States that are trained on.
    pub training_states: usize,
    /// States that are held out.
    pub validation_states: usize,
}

/// What is particular to a training.
pub trait Course {
    /// A batch.
    type Input: Send;
    /// What a validation finds.
    type Validation;
    /// What learns.
    type Network: Module;

    /// What its configuration says of its course.
    fn pace(&self) -> Pace;

    /// Where its checkpoints and losses go.
    fn folder(&self) -> &Path;

    /// What it learns from.
    fn sizes(&self) -> Sizes;

    /// How far it is.
    fn progress(&mut self) -> &mut Progress;

    /// What learns.
    fn learner(&mut self) -> &mut Learner<Self::Network>;

    /// States of a batch.
    fn states_of(input: &Self::Input) -> usize;

    /// Changes the weights by a batch.
    ///
    /// # Errors
    /// [`TrainingError::Diverged`].
    fn step(&mut self, input: Self::Input, rate: f64) -> Result<StepLosses, TrainingError>;

    /// Tries the averaged weights on what was held out, and keeps them if they are the best so far.
    fn validate(&mut self, observer: &mut dyn TrainingObserver) -> Self::Validation;

    /// Writes the losses of the last step, and what a validation after it found.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    fn note(
        &mut self,
        rate: f64,
        losses: &StepLosses,
        validation: Option<&Self::Validation>,
    ) -> Result<(), TrainingError>;

    /// Writes a checkpoint.
    ///
    /// # Errors
    /// [`TrainingError::Io`], [`TrainingError::CheckpointNotReplaced`].
    fn write_checkpoint(
        &mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError>;
}

/// Runs a training to its end, with `batch` making the batch of each step, counted from 0, and returns the states
/// a second; 0 when nothing was left to do.
///
/// # Errors
/// [`TrainingError`]: the loss is no number any more, a file cannot be written, or the observer asked to stop.
pub fn run<C: Course>(
    course: &mut C,
    batch: impl Fn(u64) -> C::Input + Send,
    observer: &mut dyn TrainingObserver,
) -> Result<f64, TrainingError> {
    let (pace, progress, sizes) = (course.pace(), *course.progress(), course.sizes());
    observer.notice(&TrainingEvent::Started {
        training_states: sizes.training_states,
        validation_states: sizes.validation_states,
        steps: pace.steps,
        resumed_from: progress.step,
        parameters: weight_count(&course.learner().average.weights),
    });
    if progress.finished {
        return Ok(0.0);
    }
    let (sender, receiver) = sync_channel(BATCHES_AHEAD);
    std::thread::scope(|scope| {
        // Ends when the receiver is gone, whatever became of the training.
        scope.spawn(move || {
            (progress.step..pace.steps).find(|step| sender.send(batch(*step)).is_err())
        });
        run_steps(course, receiver, observer)
    })
}

fn run_steps<C: Course>(
    course: &mut C,
    inputs: Receiver<C::Input>,
    observer: &mut dyn TrainingObserver,
) -> Result<f64, TrainingError> {
    let pace = course.pace();
    let budget = Budget::new(pace.steps, pace.max_minutes, course.progress().spent_secs);
    let (started, mut trained) = (Instant::now(), 0_usize);
    let mut states_per_sec = 0.0;
    for input in inputs {
        let before = course.progress().step;
        let rate = learning_rate(&pace.optimiser, before, budget.progress(before));
        trained += C::states_of(&input);
        let losses = course.step(input, rate)?;
        let step = before + 1;
        course.progress().step = step;
        course.learner().note_step(step);
        states_per_sec = trained as f64 / started.elapsed().as_secs_f64();
        observer.notice(&TrainingEvent::Step {
            step,
            progress: budget.progress(step),
            learning_rate: rate,
            losses,
            states_per_sec,
        });
        let mut done = budget.is_spent(step);
        let mut validation = None;
        if done || step.is_multiple_of(pace.validate_every_steps) {
            validation = Some(course.validate(observer));
            let without_gain = course.progress().validations_without_gain;
            done |= (pace.patience_validations).is_some_and(|most| without_gain >= most);
        }
        course.note(rate, &losses, validation.as_ref())?;
        let stopped = !done && observer.wants_stop();
        course.progress().finished = done;
        course.progress().spent_secs = budget.spent_secs();
        if done || stopped || step.is_multiple_of(pace.checkpoint_every_steps) {
            course.write_checkpoint(observer)?;
        }
        if stopped {
            return Err(TrainingError::Stopped {
                step,
                run_folder: course.folder().to_owned(),
            });
        }
        if done {
            break;
        }
    }
    Ok(states_per_sec)
}
