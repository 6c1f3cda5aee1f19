use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use burn::grad_clipping::GradientClippingConfig;
use burn::optim::{AdamWConfig, GradientsParams, ModuleOptimizer};
use burn::tensor::{Bytes, Device};

use super::augmentation::check_mirror;
use super::batch::{Batcher, Pictures, StepInput};
use super::budget::Budget;
use super::checkpoint::{BestSoFar, Checkpoint, TrainingState};
use super::evaluation::ValidationSet;
use super::history::History;
use super::objective::Objective;
use super::sampler::Sampler;
use super::schedule::learning_rate;
use super::trained_model::{network_of, pictures_of, spec_of};
use super::weights::{Average, NamedWeights, assign, collect};
use super::{
    ChannelNormalisation, Dataset, LatentFlowNetwork, OptimiserConfig, StepLosses, TrainedModel,
    TrainingConfig, TrainingError, TrainingEvent, TrainingObserver, training_device,
};
use crate::trajectory::DemonstrationSet;

/// Batches that are made ready while the network computes.
const BATCHES_AHEAD: usize = 1;

/// What came of a training.
#[derive(Debug)]
pub struct TrainingReport {
    /// The weights that did best on held-out demonstrations.
    pub model: TrainedModel,
    /// Steps done.
    pub steps: u64,
    /// Seconds of training, earlier runs included.
    pub spent_secs: f64,
    /// States trained per second in this run; 0 when nothing was left to do.
    pub states_per_sec: f64,
}

/// Trains the latent-flow network on demonstrations of one or more tasks.
///
/// Where `run_folder` holds a checkpoint of the same training, it goes on from there and ends with the
/// same weights as if it had not been interrupted. Losses are written to `losses.csv` there.
///
/// # Errors
/// [`TrainingError`]: the demonstrations do not go together, the configuration is out of range, the
/// checkpoint is damaged or belongs to another training, the loss is no number any more, a file cannot
/// be written, or the observer asked to stop.
pub fn train(
    sets: &[DemonstrationSet],
    config: &TrainingConfig,
    run_folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<TrainingReport, TrainingError> {
    train_on(&training_device(), sets, config, run_folder, observer)
}

/// Like [`train`], on a device of the caller's choice.
///
/// # Errors
/// As for [`train`].
pub fn train_on(
    device: &Device,
    sets: &[DemonstrationSet],
    config: &TrainingConfig,
    run_folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<TrainingReport, TrainingError> {
    config.check()?;
    let data = Dataset::new(sets)?.seen_by(&config.cameras)?;
    std::fs::create_dir_all(run_folder).map_err(|source| TrainingError::Io {
        action: "create",
        path: run_folder.to_owned(),
        source,
    })?;
    let run = Run::prepare(&data, config, run_folder, device)?;
    run.train(observer)
}

/// A training in progress.
struct Run<'a> {
    data: &'a Dataset,
    folder: &'a Path,
    device: Device,
    pictures: Pictures,
    batches: Sampler,
    validation: ValidationSet,
    training_states: usize,
    network: LatentFlowNetwork,
    optimiser: ModuleOptimizer,
    average: Average,
    best: Vec<NamedWeights>,
    state: TrainingState,
    history: History,
}

impl<'a> Run<'a> {
    fn prepare(
        data: &'a Dataset,
        config: &TrainingConfig,
        run_folder: &'a Path,
        device: &Device,
    ) -> Result<Self, TrainingError> {
        check_mirror(&config.augmentation, data.action_space())?;
        let split = data.split(config.validation_share, config.seed);
        let batches = Sampler::new(
            data,
            &split.training,
            &config.sampling,
            &config.imitation,
            config.d_max,
        )?;
        let validation = ValidationSet::new(data, &split.validation, config)?;
        let device = device.clone().autodiff();
        let spec = spec_of(data, config);
        let normalisation = ChannelNormalisation::measure(data, &split.training);
        let pictures = pictures_of(&spec, config, normalisation.clone());
        let network = network_of(&spec, config, &device);
        let state = TrainingState {
            step: 0,
            spent_secs: 0.0,
            finished: false,
            best: None,
            validations_without_gain: 0,
            config: config.clone(),
            spec,
            normalisation,
            demonstrations: data.fingerprint(),
        };
        let average = Average::new(config.optimiser.average_decay, collect(&network));
        let checkpoint = <Checkpoint>::load(run_folder)?;
        let done = checkpoint.as_ref().map_or(0, |c| c.state.step);
        let mut run = Self {
            data,
            folder: run_folder,
            device,
            pictures,
            batches,
            validation,
            training_states: data.states_of(&split.training).count(),
            network,
            optimiser: optimiser(&config.optimiser),
            average,
            best: Vec::new(),
            state,
            history: History::open(run_folder, done)?,
        };
        if let Some(checkpoint) = checkpoint {
            run.resume(checkpoint)?;
        }
        Ok(run)
    }

    fn resume(&mut self, checkpoint: Checkpoint) -> Result<(), TrainingError> {
        let path = <Checkpoint>::path(self.folder);
        let another = |what| TrainingError::CheckpointOfAnother {
            path: path.clone(),
            what,
        };
        // The time limit may be changed: it says when to stop, not what to learn.
        let mut config = checkpoint.state.config.clone();
        config.max_minutes = self.state.config.max_minutes;
        if config != self.state.config {
            return Err(another("configurations"));
        }
        if checkpoint.state.demonstrations != self.state.demonstrations {
            return Err(another("demonstrations"));
        }
        let unusable = |reason| TrainingError::CheckpointUnusable {
            path: path.clone(),
            reason,
        };
        self.network = assign(self.network.clone(), &checkpoint.weights).map_err(unusable)?;
        self.optimiser = optimiser(&config.optimiser)
            .from_bytes(Bytes::from_bytes_vec(checkpoint.optimiser))
            .map_err(|e| unusable(format!("its optimiser state is damaged: {e}")))?;
        self.average = Average::new(config.optimiser.average_decay, checkpoint.average);
        self.best = checkpoint.best;
        self.state = TrainingState {
            config,
            ..checkpoint.state
        };
        Ok(())
    }

    fn train(
        mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<TrainingReport, TrainingError> {
        observer.notice(&TrainingEvent::Started {
            training_states: self.training_states,
            validation_states: self.validation.state_count(),
            steps: self.state.config.steps,
            resumed_from: self.state.step,
            parameters: self.average.weights.iter().map(|w| w.values.len()).sum(),
        });
        let mut states_per_sec = 0.0;
        if !self.state.finished {
            let config = self.state.config.clone();
            let pictures = self.pictures.clone();
            let (first, last) = (self.state.step, config.steps);
            let batcher = Batcher {
                data: self.data,
                sampler: self.batches.clone(),
                pictures: &pictures,
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
        inputs: Receiver<StepInput>,
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
            let losses = self.step(input, rate)?;
            self.state.step += 1;
            let step = self.state.step;
            self.average.update(&self.network, step);
            states_per_sec = trained as f64 / started.elapsed().as_secs_f64();
            observer.notice(&TrainingEvent::Step {
                step,
                progress: budget.progress(step),
                learning_rate: rate,
                losses,
                states_per_sec,
            });
            let mut done = budget.is_spent(step);
            let mut metrics = None;
            if done || step.is_multiple_of(config.validate_every_steps) {
                metrics = Some(self.validate(observer));
                done |= config
                    .patience_validations
                    .is_some_and(|most| self.state.validations_without_gain >= most);
            }
            self.history.add(step, rate, &losses, metrics.as_ref())?;
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

    fn step(&mut self, input: StepInput, rate: f64) -> Result<StepLosses, TrainingError> {
        let Objective { total, losses } = Objective::of(
            input,
            &self.network,
            &self.pictures,
            &self.state.config,
            &self.state.spec.action_space.head_sizes(),
            &self.device,
        );
        let diverged = |loss| TrainingError::Diverged {
            step: self.state.step + 1,
            loss,
            learning_rate: rate,
        };
        if !losses.total.is_finite() {
            return Err(diverged(losses.total));
        }
        let gradients = GradientsParams::from_grads(total.backward(), &self.network);
        self.network = self.optimiser.step(rate, self.network.clone(), gradients);
        Ok(losses)
    }

    fn validate(&mut self, observer: &mut dyn TrainingObserver) -> crate::model::ValidationMetrics {
        let device = self.device.clone().inner();
        let fresh = network_of(&self.state.spec, &self.state.config, &device);
        let network =
            assign(fresh, &self.average.weights).expect("the averages are of this network");
        let found = self.validation.evaluate(
            &network,
            self.data,
            &self.pictures,
            &self.state.config,
            &device,
        );
        let best_score = self.state.best.as_ref().map(|b| b.score);
        let is_best = best_score.is_none_or(|score| found.score < score);
        if is_best {
            self.best.clone_from(&self.average.weights);
            self.state.validations_without_gain = 0;
            self.state.best = Some(BestSoFar {
                step: self.state.step,
                score: found.score,
                metrics: found.metrics.clone(),
                temperature: found.temperature,
            });
        } else {
            self.state.validations_without_gain += 1;
        }
        observer.notice(&TrainingEvent::Validated {
            step: self.state.step,
            metrics: found.metrics.clone(),
            temperature: found.temperature,
            is_best,
        });
        found.metrics
    }

    fn write_checkpoint(
        &mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError> {
        self.history.flush()?;
        let optimiser = self.optimiser.into_bytes().map_err(|e| TrainingError::Io {
            action: "serialise the optimiser for",
            path: <Checkpoint>::path(self.folder),
            source: std::io::Error::other(e.to_string()),
        })?;
        let checkpoint = Checkpoint {
            state: self.state.clone(),
            weights: collect(&self.network),
            average: self.average.weights.clone(),
            best: self.best.clone(),
            optimiser: optimiser.to_vec(),
        };
        let path = checkpoint.save(self.folder)?;
        observer.notice(&TrainingEvent::CheckpointWritten {
            step: self.state.step,
            path,
        });
        Ok(())
    }

    fn report(self, states_per_sec: f64) -> Result<TrainingReport, TrainingError> {
        let unusable = |reason| TrainingError::CheckpointUnusable {
            path: <Checkpoint>::path(self.folder),
            reason,
        };
        let state = self.state;
        let best = state
            .best
            .ok_or_else(|| unusable("it says finished without a validation".to_owned()))?;
        let model = TrainedModel::with_weights(
            state.spec,
            state.config,
            state.normalisation,
            &best,
            &self.best,
        )
        .map_err(unusable)?;
        Ok(TrainingReport {
            model,
            steps: state.step,
            spent_secs: state.spent_secs,
            states_per_sec,
        })
    }
}

/// `AdamW` as a configuration has it.
pub(super) fn optimiser(config: &OptimiserConfig) -> ModuleOptimizer {
    AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(config.weight_decay)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(config.clip_norm)))
        .init()
}

#[cfg(test)]
mod tests;
