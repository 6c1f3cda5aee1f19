mod resuming;

use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::tensor::Device;

use resuming::{check_same, unusable};

use super::batch::{BatchInput, WindowBatcher};
use super::dropout::Dropout;
use super::objective::loss_of;
use super::sampler::WindowSampler;
use super::source::Source;
use super::trained::{BaselineState, BestBaseline, check_frozen, network_of};
use super::validation::HeldOut;
use super::{BaselineConfig, BaselineNetwork, TrainedBaseline};
use crate::model::{BaselineValidation, FeatureEncoder};
use crate::training::augmentation::check_mirror;
use crate::training::budget::Budget;
use crate::training::checkpoint::Checkpoint;
use crate::training::history::LossTable;
use crate::training::schedule::learning_rate;
use crate::training::trainer::optimiser;
use crate::training::weights::{Average, NamedWeights, assign, collect};
use crate::training::{
    Dataset, StepLosses, TrainingError, TrainingEvent, TrainingObserver, training_device,
};
use crate::trajectory::DemonstrationSet;

/// Batches that are made ready while the network computes.
const BATCHES_AHEAD: usize = 1;
const HEADER: &str = "step,learning_rate,loss,validation_loss,validation_accuracy\n";

/// What came of the training of a baseline.
#[derive(Debug)]
pub struct BaselineReport {
    /// The weights with the lowest loss on held-out demonstrations.
    pub baseline: TrainedBaseline,
    /// Steps done.
    pub steps: u64,
    /// Seconds of training, earlier runs included.
    pub spent_secs: f64,
    /// States trained per second in this run; 0 when nothing was left to do.
    pub states_per_sec: f64,
}

/// Trains a baseline on demonstrations of one or more tasks (Fu & Finn, section IV-A). MVP needs its frozen
/// encoder, which is run once over all images before; the other methods take none.
///
/// Where `run_folder` holds a checkpoint of the same training, it goes on from there and ends with the
/// same weights as if it had not been interrupted. Losses are written to `losses.csv` there.
///
/// # Errors
/// [`TrainingError`]: the demonstrations do not go together, the configuration is out of range, a frozen
/// encoder is missing, of no use or fails, the checkpoint is damaged or belongs to another training, the loss is
/// no number any more, a file cannot be written, or the observer asked to stop.
pub fn train_baseline(
    sets: &[DemonstrationSet],
    config: &BaselineConfig,
    frozen: Option<&dyn FeatureEncoder>,
    run_folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<BaselineReport, TrainingError> {
    train_baseline_on(
        &training_device(),
        sets,
        config,
        frozen,
        run_folder,
        observer,
    )
}

/// Like [`train_baseline`], on a device of the caller's choice.
///
/// # Errors
/// As for [`train_baseline`].
pub fn train_baseline_on(
    device: &Device,
    sets: &[DemonstrationSet],
    config: &BaselineConfig,
    frozen: Option<&dyn FeatureEncoder>,
    run_folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<BaselineReport, TrainingError> {
    config.check()?;
    check_frozen(config.method, frozen.is_some())?;
    let data = Dataset::new(sets)?;
    std::fs::create_dir_all(run_folder).map_err(|source| TrainingError::Io {
        action: "create",
        path: run_folder.to_owned(),
        source,
    })?;
    Run::prepare(&data, config, frozen, run_folder, device)?.train(observer)
}

/// A training in progress.
struct Run<'a> {
    data: &'a Dataset,
    folder: &'a Path,
    frozen: Option<&'a dyn FeatureEncoder>,
    device: Device,
    source: Source,
    sampler: WindowSampler,
    held_out: HeldOut,
    training_states: usize,
    network: BaselineNetwork,
    optimiser: ModuleOptimizer,
    average: Average,
    best: Vec<NamedWeights>,
    state: BaselineState,
    losses: LossTable,
}

impl<'a> Run<'a> {
    fn prepare(
        data: &'a Dataset,
        config: &BaselineConfig,
        frozen: Option<&'a dyn FeatureEncoder>,
        folder: &'a Path,
        device: &Device,
    ) -> Result<Self, TrainingError> {
        check_mirror(&config.augmentation, data.action_space())?;
        let split = data.split(config.validation_share, config.seed);
        let sampler = WindowSampler::new(data, &split.training, config)?;
        let held_out = HeldOut::new(data, &split.training, &split.validation, config)?;
        let device = device.clone().autodiff();
        let state = BaselineState::new(data, config, &split.training, frozen);
        let checkpoint = Checkpoint::<BaselineState>::load(folder)?;
        if let Some(checkpoint) = &checkpoint {
            check_same(&checkpoint.state, &state, folder)?;
        }
        let source = match frozen {
            Some(encoder) => Source::features(data, encoder)?,
            None => Source::pictures(&state.spec, config, state.normalisation.clone()),
        };
        let network = network_of(&state.spec, config, &device);
        let done = checkpoint.as_ref().map_or(0, |c| c.state.step);
        let mut run = Self {
            data,
            folder,
            frozen,
            device,
            source,
            sampler,
            held_out,
            training_states: data.states_of(&split.training).count(),
            average: Average::new(config.optimiser.average_decay, collect(&network)),
            network,
            optimiser: optimiser(&config.optimiser),
            best: Vec::new(),
            state,
            losses: LossTable::open(folder, HEADER, done)?,
        };
        if let Some(checkpoint) = checkpoint {
            run.resume(checkpoint)?;
        }
        Ok(run)
    }

    fn train(
        mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<BaselineReport, TrainingError> {
        observer.notice(&TrainingEvent::Started {
            training_states: self.training_states,
            validation_states: self.held_out.state_count(),
            steps: self.state.config.steps,
            resumed_from: self.state.step,
            parameters: self.average.weights.iter().map(|w| w.values.len()).sum(),
        });
        let mut states_per_sec = 0.0;
        if !self.state.finished {
            let config = self.state.config.clone();
            let source = self.source.clone();
            let (first, last) = (self.state.step, config.steps);
            let batcher = WindowBatcher {
                data: self.data,
                sampler: self.sampler.clone(),
                source: &source,
                config: &config,
            };
            let (sender, receiver) = sync_channel(BATCHES_AHEAD);
            states_per_sec = std::thread::scope(|scope| {
                // Ends when the receiver is gone, whatever became of the training.
                scope.spawn(move || {
                    (first..last).find(|step| sender.send(batcher.step_input(*step)).is_err())
                });
                self.run_steps(receiver, observer)
            })?;
        }
        self.report(states_per_sec)
    }

    fn run_steps(
        &mut self,
        inputs: Receiver<BatchInput>,
        observer: &mut dyn TrainingObserver,
    ) -> Result<f64, TrainingError> {
        let config = self.state.config.clone();
        let budget = Budget::new(config.steps, config.max_minutes, self.state.spent_secs);
        let (started, mut trained) = (Instant::now(), 0_usize);
        let mut states_per_sec = 0.0;
        for input in inputs {
            let progress = budget.progress(self.state.step);
            let rate = learning_rate(&config.optimiser, self.state.step, progress);
            trained += input.states;
            let loss = self.step(input, rate)?;
            self.state.step += 1;
            let step = self.state.step;
            self.average.update(&self.network, step);
            states_per_sec = trained as f64 / started.elapsed().as_secs_f64();
            observer.notice(&TrainingEvent::Step {
                step,
                progress: budget.progress(step),
                learning_rate: rate,
                losses: StepLosses {
                    total: loss,
                    policy: loss,
                    ..StepLosses::default()
                },
                states_per_sec,
            });
            let mut done = budget.is_spent(step);
            let mut found = None;
            if done || step.is_multiple_of(config.validate_every_steps) {
                found = Some(self.validate(observer));
                let patience = config.patience_validations;
                done |= patience.is_some_and(|most| self.state.validations_without_gain >= most);
            }
            self.losses
                .add(&row(step, rate, loss, found), found.is_some())?;
            let stopped = !done && observer.wants_stop();
            self.state.finished = done;
            self.state.spent_secs = budget.spent_secs();
            if done || stopped || step.is_multiple_of(config.checkpoint_every_steps) {
                self.write_checkpoint(observer)?;
            }
            if stopped {
                return Err(TrainingError::Stopped {
                    step,
                    run_folder: self.folder.to_owned(),
                });
            }
            if done {
                break;
            }
        }
        Ok(states_per_sec)
    }

    fn step(&mut self, input: BatchInput, rate: f64) -> Result<f32, TrainingError> {
        let mut dropout = Dropout::of_step(&self.state.config, self.state.step);
        let total = loss_of(
            input,
            &self.network,
            &self.source,
            &self.state.spec.action_space.head_sizes(),
            Some(&mut dropout),
            &self.device,
        );
        let loss = total.clone().into_scalar::<f32>();
        if !loss.is_finite() {
            return Err(TrainingError::Diverged {
                step: self.state.step + 1,
                loss,
                learning_rate: rate,
            });
        }
        let gradients = GradientsParams::from_grads(total.backward(), &self.network);
        self.network = self.optimiser.step(rate, self.network.clone(), gradients);
        Ok(loss)
    }

    fn validate(&mut self, observer: &mut dyn TrainingObserver) -> BaselineValidation {
        let device = self.device.clone().inner();
        let fresh = network_of(&self.state.spec, &self.state.config, &device);
        let network =
            assign(fresh, &self.average.weights).expect("the averages are of this network");
        let config = &self.state.config;
        let held_out = &self.held_out;
        let validation = held_out.evaluate(&network, self.data, &self.source, config, &device);
        let best = self.state.best.map(|b| b.validation.loss);
        let is_best = best.is_none_or(|loss| validation.loss < loss);
        if is_best {
            self.best.clone_from(&self.average.weights);
            self.state.validations_without_gain = 0;
            self.state.best = Some(BestBaseline {
                step: self.state.step,
                validation,
            });
        } else {
            self.state.validations_without_gain += 1;
        }
        observer.notice(&TrainingEvent::BaselineValidated {
            step: self.state.step,
            validation,
            is_best,
        });
        validation
    }

    fn report(self, states_per_sec: f64) -> Result<BaselineReport, TrainingError> {
        let unusable = |reason| unusable(self.folder, reason);
        let (steps, spent_secs) = (self.state.step, self.state.spent_secs);
        let best = self
            .state
            .best
            .ok_or_else(|| unusable("it says finished without a validation".to_owned()))?;
        let baseline = TrainedBaseline::with_weights(self.state, best, &self.best, self.frozen)
            .map_err(unusable)?;
        Ok(BaselineReport {
            baseline,
            steps,
            spent_secs,
            states_per_sec,
        })
    }
}

fn row(step: u64, rate: f64, loss: f32, validation: Option<BaselineValidation>) -> String {
    let tail = validation.map_or_else(
        || ",".to_owned(),
        |v| format!("{:.5},{:.5}", v.loss, v.accuracy),
    );
    format!("{step},{rate:.3e},{loss:.5},{tail}")
}
