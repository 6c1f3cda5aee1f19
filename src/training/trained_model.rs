use std::path::Path;

use burn::tensor::Device;

use super::batch::Pictures;
use super::checkpoint::{BestSoFar, Checkpoint};
use super::landmarks::landmark_count;
use super::motion_to_go::motion_axes;
use super::network::OutputSizes;
use super::patches::PatchGrid;
use super::weights::{NamedWeights, assign, collect, weight_count};
use super::{ChannelNormalisation, Dataset, LatentFlowNetwork, TrainingConfig, TrainingError};
use crate::model::{LANDMARK_VALUES, LandmarkBook, ModelSpec, ValidationMetrics};

/// A network with everything that is needed to export it.
#[derive(Debug)]
pub struct TrainedModel {
    /// What it takes and gives.
    pub spec: ModelSpec,
    /// How it was trained.
    pub config: TrainingConfig,
    /// The network, on the CPU and not training.
    pub network: LatentFlowNetwork,
    /// How the values of each camera are normalised.
    pub normalisation: Vec<ChannelNormalisation>,
    /// Divides the traversability logits.
    pub temperature: f32,
    /// The step after which these weights were found.
    pub step: u64,
    /// How well they do on held-out demonstrations.
    pub metrics: ValidationMetrics,
    /// What is known of its landmarks; none where the demonstrations are not at hand.
    pub landmarks: Option<LandmarkBook>,
}

impl TrainedModel {
    /// The best model that a run has found so far, from its checkpoint; `None` before the first
    /// validation.
    ///
    /// # Errors
    /// [`TrainingError::CheckpointUnusable`], [`TrainingError::Io`].
    pub fn of_run(run_folder: &Path) -> Result<Option<Self>, TrainingError> {
        let Some(checkpoint) = <Checkpoint>::load(run_folder)? else {
            return Ok(None);
        };
        let state = checkpoint.state;
        let Some(best) = state.best else {
            return Ok(None);
        };
        Self::with_weights(
            state.spec,
            state.config,
            state.normalisation,
            &best,
            &checkpoint.best,
        )
        .map(Some)
        .map_err(|reason| <Checkpoint>::unusable(run_folder, reason))
    }

    /// A model with random weights, as it is before the first step.
    ///
    /// # Panics
    /// Never: the weights are the network's own.
    #[must_use]
    pub fn untrained(data: &Dataset, config: &TrainingConfig) -> Self {
        let spec = spec_of(data, config);
        let all: Vec<u32> = (0..data.trajectory_count() as u32).collect();
        let normalisation = ChannelNormalisation::measure(data, &all);
        let network = network_of(&spec, config, &Device::flex());
        let best = BestSoFar {
            step: 0,
            score: f64::INFINITY,
            metrics: ValidationMetrics::default(),
            temperature: 1.0,
        };
        let weights = collect(&network);
        Self::with_weights(spec, config.clone(), normalisation, &best, &weights)
            .expect("a network's own weights fit it")
    }

    pub(super) fn with_weights(
        spec: ModelSpec,
        config: TrainingConfig,
        normalisation: Vec<ChannelNormalisation>,
        best: &BestSoFar,
        weights: &[NamedWeights],
    ) -> Result<Self, String> {
        let network = assign(network_of(&spec, &config, &Device::flex()), weights)?;
        Ok(Self {
            spec,
            config,
            network,
            normalisation,
            temperature: best.temperature,
            step: best.step,
            metrics: best.metrics.clone(),
            landmarks: None,
        })
    }

    /// Number of weights of the network.
    #[must_use]
    pub fn weight_count(&self) -> usize {
        weight_count(&collect(&self.network))
    }

    /// Values in each of a state's two projections.
    #[must_use]
    pub fn projection_width(&self) -> usize {
        if self.network.joins_pixels() {
            self.spec.latent_dim / 2
        } else {
            self.config.network.projection_width
        }
    }

    pub(super) fn pictures(&self) -> Pictures {
        pictures_of(&self.spec, &self.config, self.normalisation.clone())
    }
}

/// What a model of a dataset takes and gives.
pub(super) fn spec_of(data: &Dataset, config: &TrainingConfig) -> ModelSpec {
    let network = &config.network;
    let mut spec = ModelSpec {
        cameras: data.cameras().to_vec(),
        stack: config.stack,
        action_space: data.action_space().clone(),
        d_max: config.d_max,
        latent_dim: data.cameras().len() * network.encoder.latent_dim,
    };
    spec.latent_dim += data.cameras().len() * LANDMARK_VALUES * landmark_count(config);
    spec.latent_dim += motion_axes(&spec.action_space, config);
    if network.variant.joins_pixels() {
        let grids = grids_of(&spec, config);
        let positions: usize = grids.iter().map(PatchGrid::positions).sum();
        spec.latent_dim = 2 * network.encoder.stem_channels * positions;
    }
    spec
}

/// The cameras' patch grids.
fn grids_of(spec: &ModelSpec, config: &TrainingConfig) -> Vec<PatchGrid> {
    PatchGrid::of_cameras(&spec.cameras, spec.stack, &config.network.encoder)
}

/// The pictures of a model's cameras.
pub(super) fn pictures_of(
    spec: &ModelSpec,
    config: &TrainingConfig,
    normalisation: Vec<ChannelNormalisation>,
) -> Pictures {
    let encoder = &config.network.encoder;
    Pictures::new(&spec.cameras, spec.stack, encoder, normalisation)
}

/// A network with the random weights of the configuration's seed.
pub(super) fn network_of(
    spec: &ModelSpec,
    config: &TrainingConfig,
    device: &Device,
) -> LatentFlowNetwork {
    LatentFlowNetwork::new(
        &grids_of(spec, config),
        &config.network,
        OutputSizes {
            d_max: spec.d_max,
            action_classes: spec.action_space.head_sizes().iter().sum(),
            motion_axes: motion_axes(&spec.action_space, config),
            landmarks: landmark_count(config),
        },
        config.seed,
        device,
    )
}
