use crate::model::{BaselineSpec, FeatureEncoder, FrozenPictures, Latents};
use crate::training::augmentation::Variation;
use crate::training::batch::Pictures;
use crate::training::encodings::Encodings;
use crate::training::patches::PatchGrid;
use crate::training::{ChannelNormalisation, Dataset, StateRef, TrainingError};
use crate::trajectory::State;
use burn::tensor::{Device, Tensor, TensorData};

use super::dropout::Dropout;
use super::{BaselineConfig, BaselineNetwork};

/// States that are handed to a frozen encoder at once.
const STATES_A_CALL: usize = 64;
/// States that are encoded at once without training.
const ENCODED_AT_ONCE: usize = 64;

/// Where the network's inputs come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// Pictures, for encoders that are trained.
    Pictures(Pictures),
    /// Features of all states of the dataset, computed once, with the row of each trajectory's first state.
    Features {
        /// A row a state.
        table: Latents,
        /// Where trajectories begin.
        starts: Vec<usize>,
    },
}

/// Inputs of some states as plain values.
#[derive(Clone, Debug, PartialEq)]
pub enum Inputs {
    /// The patches of each camera.
    Patches(Vec<Vec<f32>>),
    /// Rows of features.
    Features(Vec<f32>),
}

impl Source {
    /// The pictures of a baseline's cameras.
    pub fn pictures(
        spec: &BaselineSpec,
        config: &BaselineConfig,
        normalisation: Vec<ChannelNormalisation>,
    ) -> Self {
        Self::Pictures(pictures_of(spec, config, normalisation))
    }

    /// Runs a frozen encoder over all states.
    pub fn features(data: &Dataset, encoder: &dyn FeatureEncoder) -> Result<Self, TrainingError> {
        let dim = feature_dim(data, encoder.pictures());
        let mut table = Latents::new(dim);
        let mut starts = Vec::new();
        for trajectory in 0..data.trajectory_count() as u32 {
            starts.push(table.len());
            let states: Vec<State> = data
                .states_of(&[trajectory])
                .map(|at| data.state(at, 1))
                .collect();
            for part in states.chunks(STATES_A_CALL) {
                let features = encoder
                    .features(part, data.cameras())
                    .map_err(|source| TrainingError::FrozenEncoder { source })?;
                table.extend(&features);
            }
        }
        Ok(Self::Features { table, starts })
    }

    /// The inputs of states, varied if there are variations of each state and camera.
    ///
    /// # Panics
    /// Never: the dataset has checked that every observation has every camera.
    pub fn inputs(
        &self,
        data: &Dataset,
        states: &[StateRef],
        stack: usize,
        variations: Option<&[Vec<Variation>]>,
    ) -> Inputs {
        match self {
            Self::Pictures(pictures) => {
                let states: Vec<State> = states.iter().map(|at| data.state(*at, stack)).collect();
                let patches = pictures.patches(&states, variations);
                Inputs::Patches(patches.expect("every observation has every camera"))
            }
            Self::Features { table, starts } => Inputs::Features(
                states
                    .iter()
                    .flat_map(|at| table.row(starts[at.trajectory as usize] + at.step as usize))
                    .copied()
                    .collect(),
            ),
        }
    }

    /// The latents of such inputs.
    pub fn latents(
        &self,
        inputs: Inputs,
        states: usize,
        network: &BaselineNetwork,
        dropout: Option<&mut Dropout>,
        device: &Device,
    ) -> Encodings {
        match (self, inputs) {
            (Self::Pictures(pictures), Inputs::Patches(patches)) => {
                network.encode(&pictures.tensors(patches, states, device), dropout)
            }
            (_, Inputs::Features(values)) => {
                let dim = values.len() / states;
                let values = TensorData::new(values, [states, dim]);
                Encodings::uncut(Tensor::from_data(values, device))
            }
            (Self::Features { .. }, Inputs::Patches(_)) => {
                unreachable!("features are made of features")
            }
        }
    }

    /// The latents of states of the dataset without variations and masks.
    pub fn encode(
        &self,
        data: &Dataset,
        states: &[StateRef],
        stack: usize,
        network: &BaselineNetwork,
        device: &Device,
    ) -> Tensor<2> {
        let parts = states
            .chunks(ENCODED_AT_ONCE)
            .map(|part| {
                let inputs = self.inputs(data, part, stack, None);
                self.latents(inputs, part.len(), network, None, device)
                    .latents()
            })
            .collect();
        Tensor::cat(parts, 0)
    }
}

/// Values of a state's features.
pub fn feature_dim(data: &Dataset, pictures: &FrozenPictures) -> usize {
    data.cameras().len() * pictures.feature_dim
}

/// The cameras' patch grids.
pub fn grids_of(spec: &BaselineSpec, config: &BaselineConfig) -> Vec<PatchGrid> {
    PatchGrid::of_cameras(&spec.cameras, spec.stack, &config.encoder)
}

/// The pictures of a baseline's cameras.
pub fn pictures_of(
    spec: &BaselineSpec,
    config: &BaselineConfig,
    normalisation: Vec<ChannelNormalisation>,
) -> Pictures {
    Pictures::new(&spec.cameras, spec.stack, &config.encoder, normalisation)
}
