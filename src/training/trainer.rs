use std::convert::Infallible;
use std::path::Path;

use burn::tensor::Device;

use super::augmentation::check_mirror;
use super::batch::{Batcher, Pictures, StepInput};
use super::checkpoint::{BestSoFar, Checkpoint, TrainingState, check_same};
use super::course::{self, Course, Pace, Progress, Sizes};
use super::evaluation::{ValidationSet, encode, values};
use super::export::check_camera_names;
use super::history::History;
use super::landmarks::{Landmarks, check_landmarks, learn_offsets};
use super::learner::Learner;
use super::motion_to_go::{MotionToGo, check_motion};
use super::objective::Objective;
use super::sampler::Sampler;
use super::trained_model::{network_of, pictures_of, spec_of};
use super::{
    ChannelNormalisation, Dataset, LatentFlowNetwork, RunFolder, StepLosses, TrainedModel,
    TrainingConfig, TrainingError, TrainingEvent, TrainingObserver, training_device,
};
use crate::model::{LandmarkBook, Latents, ValidationMetrics};
use crate::trajectory::{DemonstrationSet, State};

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

/// Refuses a configuration that is out of range or does not go together with the demonstrations, as [`train`] does,
/// before there is a run folder.
///
/// # Errors
/// [`TrainingError`]: the demonstrations do not go together, or the configuration asks for what they do not show.
pub fn check_training(
    sets: &[DemonstrationSet],
    config: &TrainingConfig,
) -> Result<(), TrainingError> {
    config.check()?;
    let data = Dataset::new(sets)?.seen_by(&config.cameras)?;
    check_against(&data, config)
}

fn check_against(data: &Dataset, config: &TrainingConfig) -> Result<(), TrainingError> {
    check_camera_names(data.cameras())?;
    check_mirror(&config.augmentation, data.action_space())?;
    check_motion(config, data)?;
    check_landmarks(config, data)
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
    run_folder: &RunFolder,
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
    run_folder: &RunFolder,
    observer: &mut dyn TrainingObserver,
) -> Result<TrainingReport, TrainingError> {
    config.check()?;
    let data = Dataset::new(sets)?.seen_by(&config.cameras)?;
    let run = Run::prepare(&data, config, run_folder.path(), device)?;
    run.train(observer)
}

/// A training in progress.
struct Run<'a> {
    data: &'a Dataset,
    folder: &'a Path,
    device: Device,
    pictures: Pictures,
    batches: Sampler,
    motion: MotionToGo,
    landmarks: Option<Landmarks>,
    validation: ValidationSet,
    training_states: usize,
    learner: Learner<LatentFlowNetwork>,
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
        check_against(data, config)?;
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
            progress: Progress::default(),
            best: None,
            config: config.clone(),
            spec,
            normalisation,
            demonstrations: data.fingerprint(),
        };
        let checkpoint = <Checkpoint>::load(run_folder)?;
        if let Some(Checkpoint { state: found, .. }) = &checkpoint {
            let configs = [&found.config, &state.config];
            check_same(run_folder, configs, &others(found, &state))?;
        }
        let done = checkpoint.as_ref().map_or(0, |c| c.state.progress.step);
        let mut run = Self {
            data,
            folder: run_folder,
            device,
            pictures,
            batches,
            motion: MotionToGo::of_training(data, &split.training, config),
            landmarks: Landmarks::of_training(data, &split.training, config),
            validation,
            training_states: data.states_of(&split.training).count(),
            learner: Learner::new(network, &config.optimiser),
            state,
            history: History::open(run_folder, done)?,
        };
        if let Some(checkpoint) = checkpoint {
            let found = (run.learner).resume(checkpoint, &config.optimiser, run_folder)?;
            run.state = TrainingState {
                config: config.clone(),
                ..found
            };
        }
        Ok(run)
    }

    fn train(
        mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<TrainingReport, TrainingError> {
        let config = self.state.config.clone();
        let pictures = self.pictures.clone();
        let batcher = Batcher {
            data: self.data,
            sampler: self.batches.clone(),
            motion: self.motion.clone(),
            landmarks: self.landmarks.clone(),
            pictures: &pictures,
            config: &config,
        };
        let states_per_sec = course::run(&mut self, |step| batcher.step_input(step), observer)?;
        self.report(states_per_sec)
    }

    fn report(self, states_per_sec: f64) -> Result<TrainingReport, TrainingError> {
        let unusable = |reason| <Checkpoint>::unusable(self.folder, reason);
        let state = self.state;
        let best = state
            .best
            .ok_or_else(|| unusable("it says finished without a validation".to_owned()))?;
        let mut model = TrainedModel::with_weights(
            state.spec,
            state.config,
            state.normalisation,
            &best,
            &self.learner.best,
        )
        .map_err(unusable)?;
        if let Some(landmarks) = &self.landmarks {
            model.landmarks = landmark_book(landmarks, &model, self.data, &self.pictures);
        }
        Ok(TrainingReport {
            model,
            steps: state.progress.step,
            spent_secs: state.progress.spent_secs,
            states_per_sec,
        })
    }
}

impl Course for Run<'_> {
    type Input = StepInput;
    type Validation = ValidationMetrics;
    type Network = LatentFlowNetwork;

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
            validation_states: self.validation.state_count(),
        }
    }

    fn progress(&mut self) -> &mut Progress {
        &mut self.state.progress
    }

    fn learner(&mut self) -> &mut Learner<LatentFlowNetwork> {
        &mut self.learner
    }

    fn states_of(input: &StepInput) -> usize {
        input.states
    }

    fn step(&mut self, input: StepInput, rate: f64) -> Result<StepLosses, TrainingError> {
        let Objective {
            total,
            losses,
            encodings,
        } = Objective::of(
            input,
            &self.learner.network,
            &self.pictures,
            &self.state.config,
            &self.state.spec.action_space.head_sizes(),
            &self.device,
        );
        let step = self.state.progress.step + 1;
        self.learner
            .descend(&total, &encodings, losses.total, rate, step)?;
        Ok(losses)
    }

    fn validate(&mut self, observer: &mut dyn TrainingObserver) -> ValidationMetrics {
        let device = self.device.clone().inner();
        let fresh = network_of(&self.state.spec, &self.state.config, &device);
        let found = self.validation.evaluate(
            &self.learner.averaged(fresh),
            self.data,
            &self.pictures,
            &self.state.config,
            &device,
        );
        let step = self.state.progress.step;
        let best_score = self.state.best.as_ref().map(|b| b.score);
        let is_best = best_score.is_none_or(|score| found.score < score);
        self.state.progress.note_validation(is_best);
        if is_best {
            self.learner.keep_average();
            self.state.best = Some(BestSoFar {
                step,
                score: found.score,
                metrics: found.metrics.clone(),
                temperature: found.temperature,
            });
        }
        observer.notice(&TrainingEvent::Validated {
            step,
            metrics: found.metrics.clone(),
            temperature: found.temperature,
            is_best,
        });
        found.metrics
    }

    fn note(
        &mut self,
        rate: f64,
        losses: &StepLosses,
        validation: Option<&ValidationMetrics>,
    ) -> Result<(), TrainingError> {
        let step = self.state.progress.step;
        self.history.add(step, rate, losses, validation)
    }

    fn write_checkpoint(
        &mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError> {
        self.history.flush()?;
        let (state, step) = (self.state.clone(), self.state.progress.step);
        self.learner
            .write_checkpoint(state, step, self.folder, observer)
    }
}

/// What makes another training beside another configuration, and whether it does.
fn others(found: &TrainingState, wanted: &TrainingState) -> [(&'static str, bool); 2] {
    let demonstrations = found.demonstrations != wanted.demonstrations;
    [
        ("demonstrations", demonstrations),
        ("actions or cameras", found.spec != wanted.spec),
    ]
}

/// What a model says of its landmarks, with how well it sees them in all demonstrations that it was trained on, and how far
/// off in all.
fn landmark_book(
    landmarks: &Landmarks,
    model: &TrainedModel,
    data: &Dataset,
    pictures: &Pictures,
) -> Option<LandmarkBook> {
    let seen = landmarks.states_before_events();
    let states: Vec<State> = (seen.iter())
        .map(|at| data.state(*at, model.config.stack))
        .collect();
    let encode = |states: &[State]| {
        encode(&model.network, states, pictures, &Device::flex())
            .expect("the dataset has every camera in every observation")
    };
    // Of few demonstrations all in which the gripper closes or opens may be held out.
    let told: Vec<Vec<f32>> = if states.is_empty() {
        Vec::new()
    } else {
        let told = model.network.landmarks_of(&encode(&states)).into_iter();
        told.map(values).collect()
    };
    let errors = landmarks.errors_before_events(&seen, &told, &pictures.grids);
    let mut book = Landmarks::book(data, &model.config, &pictures.grids, &errors)?;
    let latents_of = |states: &[State]| {
        let latents = encode(states);
        let dim = latents.dims()[1];
        Ok::<_, Infallible>(Latents::from_values(dim, values(latents)))
    };
    let Ok(()) = learn_offsets(&mut book, data, &model.config, latents_of);
    Some(book)
}

#[cfg(test)]
mod tests;
