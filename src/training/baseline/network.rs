use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::BaselineConfig;
use super::dropout::Dropout;
use super::layers::{GatedUnit, LayerNorm, Perceptron};
use super::token_encoder::TokenEncoder;
use super::transformer::CausalTransformer;
use crate::model::{BaselineMethod, BaselineSpec};
use crate::training::NetworkVariant;
use crate::training::encodings::Encodings;
use crate::training::network::{CameraEncoder, Initialiser};
use crate::training::patches::PatchGrid;

/// The network of a baseline: the encoders of all cameras, if they are trained, and the policy. A training makes one,
/// and [`TrainedBaseline`](super::TrainedBaseline) holds it.
#[derive(Module, Debug)]
pub struct BaselineNetwork {
    /// Of BC and BC-RNN, one a camera.
    pub encoders: Vec<CameraEncoder>,
    /// Of RT-1, one a camera.
    pub token_encoders: Vec<TokenEncoder>,
    /// From latents to actions.
    pub policy: PolicyNetwork,
}

/// What makes actions of the latents of the last states and of the goal.
#[derive(Module, Debug)]
pub struct PolicyNetwork {
    /// Of BC-RNN: what is remembered of the states.
    pub memory: Option<GatedUnit>,
    /// Of all but RT-1.
    pub perceptron: Option<Perceptron>,
    /// Of RT-1.
    pub transformer: Option<CausalTransformer>,
}

impl BaselineNetwork {
    /// A network with the random weights of the configuration's seed. `grids` are those of the cameras, and
    /// not looked at for a frozen encoder.
    #[must_use]
    pub(super) fn new(
        grids: &[PatchGrid],
        spec: &BaselineSpec,
        config: &BaselineConfig,
        device: &Device,
    ) -> Self {
        let mut init = Initialiser::new(config.seed, device);
        let (mut encoders, mut token_encoders) = (Vec::new(), Vec::new());
        let size = [config.transformer.tokens, config.transformer.width];
        for grid in grids {
            match config.method {
                BaselineMethod::Bc | BaselineMethod::BcRnn => {
                    encoders.push(CameraEncoder::new(
                        grid,
                        &config.encoder,
                        NetworkVariant::LatentFlow,
                        0,
                        &mut init,
                    ));
                }
                BaselineMethod::Rt1 => {
                    token_encoders.push(TokenEncoder::new(grid, &config.encoder, size, &mut init));
                }
                BaselineMethod::Mvp => {}
            }
        }
        Self {
            encoders,
            token_encoders,
            policy: PolicyNetwork::new(spec, config, &mut init),
        }
    }

    /// The latents of states, from the patches of each camera (`[states, positions, patch_len]`).
    #[must_use]
    pub(super) fn encode(
        &self,
        patches: &[Tensor<3>],
        mut dropout: Option<&mut Dropout>,
    ) -> Encodings {
        // Drawn camera after camera, since the order decides what is drawn.
        let masks: Vec<_> = (patches.iter().enumerate())
            .map(|(camera, patches)| {
                let (states, device) = (patches.dims()[0], patches.device());
                let blocks = match self.encoders.get(camera) {
                    Some(encoder) => encoder.stages.len(),
                    None => self.token_encoders[camera].stages.len(),
                };
                (dropout.as_deref_mut()).map(|d| d.blocks(blocks, states, &device))
            })
            .collect();
        Encodings::of(patches.len(), |camera| {
            let (patches, masks) = (patches[camera].clone(), masks[camera].as_deref());
            match self.encoders.get(camera) {
                Some(encoder) => encoder.forward(patches, masks).0,
                None => self.token_encoders[camera].forward(patches, masks),
            }
        })
    }
}

impl PolicyNetwork {
    fn new(spec: &BaselineSpec, config: &BaselineConfig, init: &mut Initialiser) -> Self {
        let classes = spec.action_space.head_sizes().iter().sum();
        let latent = spec.latent_dim;
        if config.method == BaselineMethod::Rt1 {
            let cameras = spec.cameras.len();
            return Self {
                memory: None,
                perceptron: None,
                transformer: Some(CausalTransformer::new(cameras, config, classes, init)),
            };
        }
        let memory = (config.method == BaselineMethod::BcRnn)
            .then(|| GatedUnit::new(latent, config.memory_width, init));
        let norm = (config.method == BaselineMethod::Mvp).then(|| LayerNorm::new(latent, init));
        let now = memory.as_ref().map_or(latent, GatedUnit::width);
        let width = config.hidden_width;
        Self {
            memory,
            perceptron: Some(Perceptron::new([now, latent], width, classes, norm, init)),
            transformer: None,
        }
    }

    /// Latents of the last states `[n, history, latent_dim]` and of the goal `[n, latent_dim]` to the logits
    /// after each state, `[n * history, classes]`.
    ///
    /// # Panics
    /// Never: a policy has a perceptron or a transformer.
    #[must_use]
    pub(super) fn forward(
        &self,
        history: Tensor<3>,
        goal: Tensor<2>,
        dropout: Option<&mut Dropout>,
    ) -> Tensor<2> {
        if let Some(transformer) = &self.transformer {
            return transformer.forward(history, goal, dropout);
        }
        let perceptron = self.perceptron.as_ref().expect("all but RT-1 have one");
        let now = match &self.memory {
            Some(memory) => memory.forward(history),
            None => history,
        };
        let [n, steps, width] = now.dims();
        let latent = goal.dims()[1];
        let goal = goal.reshape([n, 1, latent]).repeat_dim(1, steps);
        perceptron.forward(
            now.reshape([n * steps, width]),
            goal.reshape([n * steps, latent]),
            dropout,
        )
    }
}
