use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

use super::augmentation::{Mirror, Variation, vary};
use super::landmarks::Landmarks;
use super::loss::Targets;
use super::masks::{MaskSizes, MaskValues};
use super::motion_to_go::{MotionTargets, MotionToGo};
use super::patches::PatchGrid;
use super::sampler::Sampler;
use super::{ChannelNormalisation, Dataset, EncoderConfig, TrainingConfig};
use crate::trajectory::{CameraSpec, Image, State, TrajectoryError};

/// The pictures of a model's cameras: their names, grids and normalisation, in the order of the
/// latents.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// Names of the cameras.
    pub names: Vec<String>,
    /// How each camera's pictures are cut.
    pub grids: Vec<PatchGrid>,
    /// How each camera's values are normalised.
    pub normalisation: Vec<ChannelNormalisation>,
}

impl Pictures {
    /// The pictures of some cameras, `stack` frames a state, as an encoder sees them.
    pub fn new(
        cameras: &[CameraSpec],
        stack: usize,
        encoder: &EncoderConfig,
        normalisation: Vec<ChannelNormalisation>,
    ) -> Self {
        Self {
            names: cameras.iter().map(|c| c.name.clone()).collect(),
            grids: PatchGrid::of_cameras(cameras, stack, encoder),
            normalisation,
        }
    }

    /// The patches of states for each camera, `[states, positions, patch_len]` row after row.
    ///
    /// # Errors
    /// [`TrajectoryError::CameraMissing`] when a state lacks a camera.
    pub fn patches(
        &self,
        states: &[State],
        variations: Option<&[Vec<Variation>]>,
    ) -> Result<Vec<Vec<f32>>, TrajectoryError> {
        (0..self.names.len())
            .map(|camera| self.camera_patches(camera, states, variations))
            .collect()
    }

    fn camera_patches(
        &self,
        camera: usize,
        states: &[State],
        variations: Option<&[Vec<Variation>]>,
    ) -> Result<Vec<f32>, TrajectoryError> {
        let grid = &self.grids[camera];
        let size = grid.positions() * grid.patch_len();
        let mut values = vec![0.0; states.len() * size];
        values
            .par_chunks_exact_mut(size)
            .zip(states.par_iter())
            .enumerate()
            .try_for_each(|(row, (out, state))| {
                let frames: Vec<&Image> = state
                    .frames()
                    .iter()
                    .map(|frame| frame.image(&self.names[camera]))
                    .collect::<Result<_, _>>()?;
                let variation = variations.map_or(Variation::NONE, |v| v[row][camera]);
                grid.cut(&frames, &self.normalisation[camera], &variation, out);
                Ok(())
            })?;
        Ok(values)
    }

    /// Moves patches of `states` states to a device.
    pub fn tensors(
        &self,
        patches: Vec<Vec<f32>>,
        states: usize,
        device: &Device,
    ) -> Vec<Tensor<3>> {
        self.grids
            .iter()
            .zip(patches)
            .map(|(grid, values)| {
                let shape = [states, grid.positions(), grid.patch_len()];
                Tensor::from_data(TensorData::new(values, shape), device)
            })
            .collect()
    }
}

/// Everything that a step needs, as plain values.
pub struct StepInput {
    /// Number of states.
    pub states: usize,
    /// The patches of each camera.
    pub patches: Vec<Vec<f32>>,
    /// What is left out.
    pub masks: MaskValues,
    /// Pairs with their classes and weights.
    pub targets: Targets,
    /// What the robot still does from the states.
    pub motion: MotionTargets,
    /// For each camera where its landmarks are; empty where none are learnt.
    pub landmarks: Vec<Vec<f32>>,
}

/// Makes the input of a step from the seed and the step's number alone, so that a training that was
/// interrupted goes on as if it had not been.
pub struct Batcher<'a> {
    /// Where the states come from.
    pub data: &'a Dataset,
    /// Draws states and pairs.
    pub sampler: Sampler,
    /// What the robot still does from each state; empty where that is not learnt.
    pub motion: MotionToGo,
    /// Where landmarks are in the pictures of each state; none where they are not learnt.
    pub landmarks: Option<Landmarks>,
    /// The cameras.
    pub pictures: &'a Pictures,
    /// The training's configuration.
    pub config: &'a TrainingConfig,
}

impl Batcher<'_> {
    /// The input of a step, counted from 0.
    ///
    /// # Panics
    /// Never: the dataset has checked that every observation has every camera.
    pub fn step_input(&self, step: u64) -> StepInput {
        let mut rng = ChaCha8Rng::seed_from_u64(self.config.seed);
        rng.set_stream(step + 1);
        let draw = self.sampler.draw(&mut rng);
        let augmentation = &self.config.augmentation;
        let mirror = Mirror::draw(augmentation, self.data.action_space(), &mut rng);
        // Neighbours must differ by what the robot did and not by how their pictures were moved.
        let cameras = self.pictures.names.len();
        let variations = vary(augmentation, cameras, &draw.window_of, &mirror, &mut rng);
        let mut targets = Targets::of(&draw, self.data, self.config);
        mirror.change(&mut targets.policy.classes);
        let motion = self.motion.targets(&draw.states, &mirror);
        let landmarks = self.landmarks.as_ref().map_or_else(Vec::new, |landmarks| {
            landmarks.targets(&draw.states, &variations, &self.pictures.grids)
        });
        let network = &self.config.network;
        let joins_pixels = network.variant.joins_pixels();
        if joins_pixels {
            targets.thin(self.config.sampling.pixel_pairs / 3, &mut rng);
        }
        let sizes = MaskSizes {
            encoded: if joins_pixels {
                targets.traversability.len()
            } else {
                draw.states.len()
            },
            encoded_for_policy: if joins_pixels {
                targets.policy.len()
            } else {
                0
            },
            cameras: self.pictures.names.len(),
            blocks: network.encoder.stage_channels.len(),
            traversability_pairs: targets.traversability.len(),
            policy_pairs: targets.policy.len(),
            projection_width: network.projection_width,
            hidden_width: network.hidden_width,
        };
        let depth = network.encoder.stochastic_depth;
        let masks = MaskValues::draw(&sizes, depth, network.dropout, &mut rng);
        let states: Vec<State> = draw
            .states
            .iter()
            .map(|at| self.data.state(*at, self.config.stack))
            .collect();
        let patches = self
            .pictures
            .patches(&states, Some(&variations))
            .expect("the dataset has every camera in every observation");
        StepInput {
            states: states.len(),
            patches,
            masks,
            targets,
            motion,
            landmarks,
        }
    }
}
