use std::path::Path;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use super::source::{feature_dim, grids_of, pictures_of};
use super::{BaselineConfig, BaselineNetwork};
use crate::model::{BaselineMethod, BaselineSpec, BaselineValidation, FeatureEncoder, sha256_hex};
use crate::training::batch::Pictures;
use crate::training::checkpoint::{Checkpoint, CheckpointState};
use crate::training::course::Progress;
use crate::training::weights::{NamedWeights, assign, collect, weight_count};
use crate::training::{ChannelNormalisation, Dataset, TrainingError};

/// A baseline with everything that is needed to export it.
#[derive(Debug)]
pub struct TrainedBaseline {
    /// What it takes and gives.
    pub spec: BaselineSpec,
    /// How it was trained.
    pub config: BaselineConfig,
    /// The network, on the CPU and not training.
    pub network: BaselineNetwork,
    /// How the values of each camera are normalised.
    pub normalisation: Vec<ChannelNormalisation>,
    /// The ONNX file of the frozen encoder, for MVP.
    pub frozen: Option<Vec<u8>>,
    /// The step after which these weights were found.
    pub step: u64,
    /// How well they do on held-out demonstrations.
    pub validation: BaselineValidation,
}

/// Where the training of a baseline is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BaselineState {
    /// How far it is.
    #[serde(flatten)]
    pub progress: Progress,
    /// The best weights so far.
    pub best: Option<BestBaseline>,
    /// The configuration.
    pub config: BaselineConfig,
    /// What the baseline takes and gives.
    pub spec: BaselineSpec,
    /// How each camera's values are normalised.
    pub normalisation: Vec<ChannelNormalisation>,
    /// A fingerprint of the demonstrations.
    pub demonstrations: String,
    /// SHA-256 of the frozen encoder.
    pub frozen: Option<String>,
}

/// The best weights so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BestBaseline {
    /// The step after which they were found.
    pub step: u64,
    /// How well they do; the loss chose them.
    pub validation: BaselineValidation,
}

impl CheckpointState for BaselineState {
    fn has_best(&self) -> bool {
        self.best.is_some()
    }
}

impl BaselineState {
    /// Before the first step.
    pub(super) fn new(
        data: &Dataset,
        config: &BaselineConfig,
        training: &[u32],
        frozen: Option<&dyn FeatureEncoder>,
    ) -> Self {
        Self {
            progress: Progress::default(),
            best: None,
            config: config.clone(),
            spec: spec_of(data, config, frozen),
            normalisation: ChannelNormalisation::measure(data, training),
            demonstrations: data.fingerprint(),
            frozen: frozen.map(|encoder| sha256_hex(encoder.file())),
        }
    }
}

impl TrainedBaseline {
    /// The best baseline that a run has found so far, from its checkpoint; `None` before the first
    /// validation. The file of a frozen encoder is not part of a checkpoint.
    ///
    /// # Errors
    /// [`TrainingError::CheckpointUnusable`], [`TrainingError::Io`].
    pub fn of_run(
        run_folder: &Path,
        frozen: Option<&dyn FeatureEncoder>,
    ) -> Result<Option<Self>, TrainingError> {
        let Some(checkpoint) = Checkpoint::<BaselineState>::load(run_folder)? else {
            return Ok(None);
        };
        let Some(best) = checkpoint.state.best else {
            return Ok(None);
        };
        Self::with_weights(checkpoint.state, best, &checkpoint.best, frozen)
            .map(Some)
            .map_err(|reason| Checkpoint::<BaselineState>::unusable(run_folder, reason))
    }

    /// A baseline with random weights, as it is before the first step.
    ///
    /// # Errors
    /// [`TrainingError::FrozenEncoderNeeded`] and [`TrainingError::FrozenEncoderUnused`].
    ///
    /// # Panics
    /// Never: the weights are the network's own.
    pub fn untrained(
        data: &Dataset,
        config: &BaselineConfig,
        frozen: Option<&dyn FeatureEncoder>,
    ) -> Result<Self, TrainingError> {
        check_frozen(config.method, frozen.is_some())?;
        let all: Vec<u32> = (0..data.trajectory_count() as u32).collect();
        let state = BaselineState::new(data, config, &all, frozen);
        let weights = collect(&network_of(&state.spec, config, &Device::flex()));
        let best = BestBaseline {
            step: 0,
            validation: BaselineValidation::default(),
        };
        let own = Self::with_weights(state, best, &weights, frozen);
        Ok(own.expect("a network's own weights fit it"))
    }

    /// Number of weights that are trained.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        weight_count(&collect(&self.network))
    }

    pub(super) fn with_weights(
        state: BaselineState,
        best: BestBaseline,
        weights: &[NamedWeights],
        frozen: Option<&dyn FeatureEncoder>,
    ) -> Result<Self, String> {
        let fresh = network_of(&state.spec, &state.config, &Device::flex());
        Ok(Self {
            network: assign(fresh, weights)?,
            spec: state.spec,
            config: state.config,
            normalisation: state.normalisation,
            frozen: frozen.map(|encoder| encoder.file().to_vec()),
            step: best.step,
            validation: best.validation,
        })
    }

    pub(in crate::training) fn pictures(&self) -> Pictures {
        pictures_of(&self.spec, &self.config, self.normalisation.clone())
    }
}

/// A frozen encoder is there exactly where the method wants one.
pub(super) fn check_frozen(method: BaselineMethod, is_given: bool) -> Result<(), TrainingError> {
    match (method, is_given) {
        (BaselineMethod::Mvp, false) => Err(TrainingError::FrozenEncoderNeeded { method }),
        (BaselineMethod::Bc | BaselineMethod::BcRnn | BaselineMethod::Rt1, true) => {
            Err(TrainingError::FrozenEncoderUnused { method })
        }
        _ => Ok(()),
    }
}

/// What a baseline of a dataset takes and gives.
fn spec_of(
    data: &Dataset,
    config: &BaselineConfig,
    frozen: Option<&dyn FeatureEncoder>,
) -> BaselineSpec {
    let cameras = data.cameras().len();
    let latent_dim = match (config.method, frozen) {
        (BaselineMethod::Rt1, _) => cameras * config.transformer.tokens * config.transformer.width,
        (_, Some(encoder)) => feature_dim(data, encoder.pictures()),
        (_, None) => cameras * config.encoder.latent_dim,
    };
    BaselineSpec {
        method: config.method,
        cameras: data.cameras().to_vec(),
        stack: config.stack,
        action_space: data.action_space().clone(),
        history: config.history,
        latent_dim,
        frozen: frozen.map(|encoder| encoder.pictures().clone()),
    }
}

/// A network with the random weights of the configuration's seed.
pub(super) fn network_of(
    spec: &BaselineSpec,
    config: &BaselineConfig,
    device: &Device,
) -> BaselineNetwork {
    BaselineNetwork::new(&grids_of(spec, config), spec, config, device)
}
