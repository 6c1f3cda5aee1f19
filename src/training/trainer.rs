use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use burn::grad_clipping::GradientClippingConfig;
use burn::optim::{AdamWConfig, GradientsParams, ModuleOptimizer};
use burn::tensor::{Bytes, Device, Tensor};

use super::batch::{Batcher, Pictures, StepInput};
use super::budget::Budget;
use super::checkpoint::{BestSoFar, Checkpoint, TrainingState};
use super::evaluation::ValidationSet;
use super::history::History;
use super::loss::{WeightedPairs, cross_entropies, indices, policy_entropies, weights};
use super::masks::HeadMasks;
use super::network::FlowHead;
use super::sampler::Sampler;
use super::schedule::learning_rate;
use super::trained_model::{network_of, pictures_of, spec_of};
use super::weights::{Average, NamedWeights, assign, collect};
use super::{
    ChannelNormalisation, Dataset, LatentFlowNetwork, StepLosses, TrainedModel, TrainingConfig,
    TrainingError, TrainingEvent, TrainingObserver, training_device,
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
    let data = Dataset::new(sets)?;
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
    run_folder: &'a Path,
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
        let split = data.split(config.validation_share, config.seed);
        let batches = Sampler::new(data, &split.training, &config.sampling, config.d_max)?;
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
            demonstrations: fingerprint(data),
        };
        let average = Average::new(config.optimiser.average_decay, collect(&network));
        let checkpoint = Checkpoint::load(run_folder)?;
        let done = checkpoint.as_ref().map_or(0, |c| c.state.step);
        let mut run = Self {
            data,
            run_folder,
            device,
            pictures,
            batches,
            validation,
            training_states: data.states_of(&split.training).count(),
            network,
            optimiser: optimiser(config),
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
        let path = Checkpoint::path(self.run_folder);
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
        self.optimiser = optimiser(&config)
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
                    run_folder: self.run_folder.to_owned(),
                });
            }
            if done {
                break;
            }
        }
        Ok(states_per_sec)
    }

    fn step(&mut self, input: StepInput, rate: f64) -> Result<StepLosses, TrainingError> {
        let (total, losses) = self.losses(input);
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

    fn losses(&self, input: StepInput) -> (Tensor<1>, StepLosses) {
        let config = &self.state.config;
        let device = &self.device;
        let targets = input.targets;
        let block_masks = input.masks.block_tensors(device);
        let patches = self
            .pictures
            .tensors(input.patches, input.states, device);
        let latents = self.network.encode(patches, Some(&block_masks));

        let pairs = &targets.traversability;
        let masks = input.masks.traversability.tensors(device);
        let logits = score_pairs(&self.network.traversability, &latents, pairs, &masks);
        let weighted =
            cross_entropies(logits, &pairs.classes[0]) * weights(&pairs.weights, device);
        let near = weighted.clone().slice([0..targets.near]).sum();
        let far = if pairs.len() > targets.near {
            weighted.slice([targets.near..pairs.len()]).sum()
        } else {
            Tensor::zeros([1], device)
        };

        let pairs = &targets.policy;
        let policy = if pairs.len() > 0 {
            let masks = input.masks.policy.tensors(device);
            let logits = score_pairs(&self.network.policy, &latents, pairs, &masks);
            let heads = self.state.spec.action_space.head_sizes();
            let entropies = policy_entropies(&logits, &pairs.classes, &heads);
            (entropies * weights(&pairs.weights, device)).sum()
        } else {
            Tensor::zeros([1], device)
        };
        let value = |tensor: &Tensor<1>| tensor.clone().into_scalar::<f32>();
        let total = near.clone() + far.clone() + policy.clone() * config.policy_weight;
        let losses = StepLosses {
            total: value(&total),
            near: value(&near) / 0.5,
            far: value(&far) / (0.5 * config.far_weight),
            policy: value(&policy) / pairs.weights.iter().sum::<f32>().max(f32::MIN_POSITIVE),
        };
        (total, losses)
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

    fn write_checkpoint(&mut self, observer: &mut dyn TrainingObserver) -> Result<(), TrainingError> {
        self.history.flush()?;
        let optimiser = self.optimiser.into_bytes().map_err(|e| TrainingError::Io {
            action: "serialise the optimiser for",
            path: Checkpoint::path(self.run_folder),
            source: std::io::Error::other(e.to_string()),
        })?;
        let checkpoint = Checkpoint {
            state: self.state.clone(),
            weights: collect(&self.network),
            average: self.average.weights.clone(),
            best: self.best.clone(),
            optimiser: optimiser.to_vec(),
        };
        let path = checkpoint.save(self.run_folder)?;
        observer.notice(&TrainingEvent::CheckpointWritten {
            step: self.state.step,
            path,
        });
        Ok(())
    }

    fn report(self, states_per_sec: f64) -> Result<TrainingReport, TrainingError> {
        let unusable = |reason| TrainingError::CheckpointUnusable {
            path: Checkpoint::path(self.run_folder),
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

fn score_pairs(
    head: &FlowHead,
    latents: &Tensor<2>,
    pairs: &WeightedPairs,
    masks: &HeadMasks,
) -> Tensor<2> {
    let device = latents.device();
    let (from, to) = head.project(latents.clone());
    let from = from.select(0, indices(&pairs.from, &device));
    let to = to.select(0, indices(&pairs.to, &device));
    head.score(from, to, Some(masks))
}

fn optimiser(config: &TrainingConfig) -> ModuleOptimizer {
    AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(config.optimiser.weight_decay)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(
            config.optimiser.clip_norm,
        )))
        .init()
}

/// A fingerprint of all images and actions, to notice that a checkpoint belongs to others. Not
/// cryptographic, since it is computed over all pixels at every start.
fn fingerprint(data: &Dataset) -> String {
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    let mut add = |word: u64| hash = (hash ^ word).wrapping_mul(PRIME).rotate_left(23);
    for trajectory in 0..data.trajectory_count() as u32 {
        add(data.steps(trajectory) as u64);
        for state in data.states_of(&[trajectory]) {
            for (_, image) in data.observation(state).iter() {
                for bytes in image.rgb().chunks(8) {
                    let mut word = [0; 8];
                    word[..bytes.len()].copy_from_slice(bytes);
                    add(u64::from_le_bytes(word));
                }
            }
            for class in data.classes(state) {
                add(*class as u64);
            }
        }
    }
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::{Preset, SilentObserver, synthetic};

    /// Stops after some steps and counts events.
    #[derive(Default)]
    struct Counting {
        steps: u64,
        stop_after: Option<u64>,
        first: f32,
        last: f32,
        validations: usize,
    }

    impl TrainingObserver for Counting {
        fn notice(&mut self, event: &TrainingEvent) {
            match event {
                TrainingEvent::Step { losses, .. } => {
                    self.steps += 1;
                    self.last = losses.total;
                    if self.steps == 1 {
                        self.first = losses.total;
                    }
                }
                TrainingEvent::Validated { .. } => self.validations += 1,
                _ => {}
            }
        }

        fn wants_stop(&mut self) -> bool {
            self.stop_after.is_some_and(|s| self.steps >= s)
        }
    }

    fn sets() -> [DemonstrationSet; 2] {
        [
            synthetic::demonstrations("a", 3, 12, 3),
            synthetic::demonstrations("b", 3, 12, 4),
        ]
    }

    fn tiny(steps: u64) -> TrainingConfig {
        TrainingConfig {
            steps,
            validate_every_steps: 4,
            checkpoint_every_steps: 100,
            ..Preset::Tiny.config()
        }
    }

    fn on_cpu(
        config: &TrainingConfig,
        folder: &Path,
        observer: &mut dyn TrainingObserver,
    ) -> Result<TrainingReport, TrainingError> {
        train_on(&Device::flex(), &sets(), config, folder, observer)
    }

    fn weights_of(report: &TrainingReport) -> Vec<NamedWeights> {
        collect(&report.model.network)
    }

    #[test]
    fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
        let run = |seed| {
            let folder = tempfile::tempdir().unwrap();
            let config = TrainingConfig { seed, ..tiny(8) };
            weights_of(&on_cpu(&config, folder.path(), &mut SilentObserver).unwrap())
        };
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
    }

    #[test]
    fn a_stopped_training_goes_on_to_the_same_weights() {
        let whole = tempfile::tempdir().unwrap();
        let uninterrupted = on_cpu(&tiny(12), whole.path(), &mut SilentObserver).unwrap();

        let parts = tempfile::tempdir().unwrap();
        let mut stopping = Counting {
            stop_after: Some(5),
            ..Counting::default()
        };
        let stopped = on_cpu(&tiny(12), parts.path(), &mut stopping);
        assert!(matches!(stopped, Err(TrainingError::Stopped { step: 5, .. })));
        let mut rest = Counting::default();
        let resumed = on_cpu(&tiny(12), parts.path(), &mut rest).unwrap();
        assert_eq!(rest.steps, 7);
        assert_eq!(weights_of(&resumed), weights_of(&uninterrupted));

        let losses = |folder: &Path| std::fs::read_to_string(folder.join("losses.csv")).unwrap();
        assert_eq!(losses(parts.path()), losses(whole.path()));
        let finished = on_cpu(&tiny(12), parts.path(), &mut Counting::default()).unwrap();
        assert_eq!(weights_of(&finished), weights_of(&uninterrupted));
        let of_run = TrainedModel::of_run(parts.path()).unwrap().unwrap();
        assert_eq!(collect(&of_run.network), weights_of(&uninterrupted));
    }

    #[test]
    fn a_checkpoint_of_another_training_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        on_cpu(&tiny(2), folder.path(), &mut SilentObserver).unwrap();
        let error = on_cpu(&tiny(3), folder.path(), &mut SilentObserver).unwrap_err();
        assert!(matches!(
            error,
            TrainingError::CheckpointOfAnother {
                what: "configurations",
                ..
            }
        ));
        let other = [synthetic::demonstrations("c", 4, 12, 9)];
        let error = train_on(
            &Device::flex(),
            &other,
            &tiny(2),
            folder.path(),
            &mut SilentObserver,
        );
        assert!(matches!(
            error.unwrap_err(),
            TrainingError::CheckpointOfAnother {
                what: "demonstrations",
                ..
            }
        ));
    }

    #[test]
    fn a_learning_rate_beyond_reason_is_told_as_divergence() {
        let folder = tempfile::tempdir().unwrap();
        let mut config = tiny(40);
        config.optimiser.learning_rate = 1e30;
        let error = on_cpu(&config, folder.path(), &mut SilentObserver).unwrap_err();
        assert!(matches!(error, TrainingError::Diverged { .. }), "{error}");
    }

    #[test]
    fn one_batch_can_be_learnt_by_heart() {
        let folder = tempfile::tempdir().unwrap();
        let mut config = tiny(150);
        config.network.dropout = 0.0;
        config.network.encoder.stochastic_depth = 0.0;
        config.augmentation.shift_pixels = 0;
        config.augmentation.brightness = 0.0;
        config.augmentation.tint = 0.0;
        let data = Dataset::new(&sets()).unwrap();
        let device = Device::flex();
        let mut run = Run::prepare(&data, &config, folder.path(), &device).unwrap();
        let pictures = run.pictures.clone();
        let batcher = Batcher {
            data: &data,
            sampler: run.batches.clone(),
            pictures: &pictures,
            config: &config,
        };
        let first = run.step(batcher.step_input(0), 3e-3).unwrap();
        let mut last = first;
        for _ in 0..150 {
            last = run.step(batcher.step_input(0), 3e-3).unwrap();
        }
        assert!(last.total < 0.1 * first.total, "{first:?} {last:?}");
    }

    #[test]
    fn losses_fall_and_validations_come_when_they_are_due() {
        let folder = tempfile::tempdir().unwrap();
        let mut observer = Counting::default();
        let report = on_cpu(&tiny(60), folder.path(), &mut observer).unwrap();
        assert_eq!((observer.steps, observer.validations), (60, 15));
        assert!(observer.last < observer.first);
        assert_eq!(report.steps, 60);
    }
}
