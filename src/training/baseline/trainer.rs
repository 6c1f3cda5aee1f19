use std::path::Path;

use burn::tensor::Device;

use super::batch::{BatchInput, WindowBatcher};
use super::dropout::Dropout;
use super::objective::loss_of;
use super::sampler::WindowSampler;
use super::source::Source;
use super::trained::{BaselineState, BestBaseline, check_frozen, network_of};
use super::validation::HeldOut;
use super::{BaselineConfig, BaselineNetwork, TrainedBaseline};
use crate::model::{BaselineMethod, BaselineValidation, FeatureEncoder};
use crate::training::augmentation::check_mirror;
use crate::training::checkpoint::{Checkpoint, check_same};
use crate::training::course::{self, Course, Pace, Progress, Sizes};
use crate::training::export::check_camera_names;
use crate::training::history::LossTable;
use crate::training::learner::Learner;
use crate::training::{
    Dataset, RunFolder, StepLosses, TrainingError, TrainingEvent, TrainingObserver, training_device,
};
use crate::trajectory::DemonstrationSet;

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

/// Refuses a configuration that is out of range or does not go together with the demonstrations, as [`train_baseline`]
/// does, before there is a run folder.
///
/// # Errors
/// [`TrainingError`]: the demonstrations do not go together, or the configuration asks for what they do not show.
pub fn check_baseline_training(
    sets: &[DemonstrationSet],
    config: &BaselineConfig,
) -> Result<(), TrainingError> {
    config.check()?;
    check_against(&Dataset::new(sets)?, config)
}

fn check_against(data: &Dataset, config: &BaselineConfig) -> Result<(), TrainingError> {
    // A frozen encoder sees one camera after another, whatever they are called.
    if config.method != BaselineMethod::Mvp {
        check_camera_names(data.cameras())?;
    }
    check_mirror(&config.augmentation, data.action_space())
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
    run_folder: &RunFolder,
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
    run_folder: &RunFolder,
    observer: &mut dyn TrainingObserver,
) -> Result<BaselineReport, TrainingError> {
    config.check()?;
    check_frozen(config.method, frozen.is_some())?;
    let data = Dataset::new(sets)?;
    Run::prepare(&data, config, frozen, run_folder.path(), device)?.train(observer)
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
    learner: Learner<BaselineNetwork>,
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
        check_against(data, config)?;
        let split = data.split(config.validation_share, config.seed);
        let sampler = WindowSampler::new(data, &split.training, config)?;
        let held_out = HeldOut::new(data, &split.training, &split.validation, config)?;
        let device = device.clone().autodiff();
        let state = BaselineState::new(data, config, &split.training, frozen);
        let checkpoint = Checkpoint::<BaselineState>::load(folder)?;
        if let Some(Checkpoint { state: found, .. }) = &checkpoint {
            let configs = [&found.config, &state.config];
            check_same(folder, configs, &others(found, &state))?;
        }
        let source = match frozen {
            Some(encoder) => Source::features(data, encoder)?,
            None => Source::pictures(&state.spec, config, state.normalisation.clone()),
        };
        let network = network_of(&state.spec, config, &device);
        let done = checkpoint.as_ref().map_or(0, |c| c.state.progress.step);
        let mut run = Self {
            data,
            folder,
            frozen,
            device,
            source,
            sampler,
            held_out,
            training_states: data.states_of(&split.training).count(),
            learner: Learner::new(network, &config.optimiser),
            state,
            losses: LossTable::open(folder, HEADER, done)?,
        };
        if let Some(checkpoint) = checkpoint {
            let found = (run.learner).resume(checkpoint, &config.optimiser, folder)?;
            run.state = BaselineState {
                config: config.clone(),
                ..found
            };
        }
        Ok(run)
    }

    fn train(
        mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<BaselineReport, TrainingError> {
        let config = self.state.config.clone();
        let source = self.source.clone();
        let batcher = WindowBatcher {
            data: self.data,
            sampler: self.sampler.clone(),
            source: &source,
            config: &config,
        };
        let states_per_sec = course::run(&mut self, |step| batcher.step_input(step), observer)?;
        self.report(states_per_sec)
    }

    fn report(self, states_per_sec: f64) -> Result<BaselineReport, TrainingError> {
        let unusable = |reason| Checkpoint::<BaselineState>::unusable(self.folder, reason);
        let Progress {
            step, spent_secs, ..
        } = self.state.progress;
        let best = self
            .state
            .best
            .ok_or_else(|| unusable("it says finished without a validation".to_owned()))?;
        let baseline =
            TrainedBaseline::with_weights(self.state, best, &self.learner.best, self.frozen)
                .map_err(unusable)?;
        Ok(BaselineReport {
            baseline,
            steps: step,
            spent_secs,
            states_per_sec,
        })
    }
}

impl Course for Run<'_> {
    type Input = BatchInput;
    type Validation = BaselineValidation;
    type Network = BaselineNetwork;

    fn pace(&self) -> Pace {
        let config = &self.state.config;
        Pace {
            steps: config.steps,
            max_minutes: config.max_minutes,
            validate_every_steps: config.validate_every_steps,
            checkpoint_every_steps: config.checkpoint_every_steps,
            patience_validations: config.patience_validations,
            optimiser: config.optimiser.clone(),
        }
    }

    fn folder(&self) -> &Path {
        self.folder
    }

    fn sizes(&self) -> Sizes {
        Sizes {
            training_states: self.training_states,
            validation_states: self.held_out.state_count(),
        }
    }

    fn progress(&mut self) -> &mut Progress {
        &mut self.state.progress
    }

    fn learner(&mut self) -> &mut Learner<BaselineNetwork> {
        &mut self.learner
    }

    fn states_of(input: &BatchInput) -> usize {
        input.states
    }

    fn step(&mut self, input: BatchInput, rate: f64) -> Result<StepLosses, TrainingError> {
        let mut dropout = Dropout::of_step(&self.state.config, self.state.progress.step);
        let (total, encodings) = loss_of(
            input,
            &self.learner.network,
            &self.source,
            &self.state.spec.action_space.head_sizes(),
            Some(&mut dropout),
            &self.device,
        );
        let loss = total.clone().into_scalar::<f32>();
        let step = self.state.progress.step + 1;
        self.learner.descend(&total, &encodings, loss, rate, step)?;
        Ok(StepLosses {
            total: loss,
            policy: loss,
            ..StepLosses::default()
        })
    }

    fn validate(&mut self, observer: &mut dyn TrainingObserver) -> BaselineValidation {
        let device = self.device.clone().inner();
        let fresh = network_of(&self.state.spec, &self.state.config, &device);
        let validation = self.held_out.evaluate(
            &self.learner.averaged(fresh),
            self.data,
            &self.source,
            &self.state.config,
            &device,
        );
        let step = self.state.progress.step;
        let best = self.state.best.map(|b| b.validation.loss);
        let is_best = best.is_none_or(|loss| validation.loss < loss);
        self.state.progress.note_validation(is_best);
        if is_best {
            self.learner.keep_average();
            self.state.best = Some(BestBaseline { step, validation });
        }
        observer.notice(&TrainingEvent::BaselineValidated {
            step,
            validation,
            is_best,
        });
        validation
    }

    fn note(
        &mut self,
        rate: f64,
        losses: &StepLosses,
        validation: Option<&BaselineValidation>,
    ) -> Result<(), TrainingError> {
        let row = row(self.state.progress.step, rate, losses.total, validation);
        self.losses.add(&row, validation.is_some())
    }

    fn write_checkpoint(
        &mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError> {
        self.losses.flush()?;
        let (state, step) = (self.state.clone(), self.state.progress.step);
        self.learner
            .write_checkpoint(state, step, self.folder, observer)
    }
}

/// What makes another training beside another configuration, and whether it does.
fn others(found: &BaselineState, wanted: &BaselineState) -> [(&'static str, bool); 3] {
    let demonstrations = found.demonstrations != wanted.demonstrations;
    let [encoder, wanted_encoder] = [found, wanted].map(|s| (&s.frozen, &s.spec.frozen));
    [
        ("demonstrations", demonstrations),
        ("frozen encoders", encoder != wanted_encoder),
        ("actions or cameras", found.spec != wanted.spec),
    ]
}

fn row(step: u64, rate: f64, loss: f32, validation: Option<&BaselineValidation>) -> String {
    let tail = validation.map_or_else(
        || ",".to_owned(),
        |v| format!("{:.5},{:.5}", v.loss, v.accuracy),
    );
    format!("{step},{rate:.3e},{loss:.5},{tail}")
}
