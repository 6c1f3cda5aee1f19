use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use super::{Dense, Initialiser};

/// Tells the motion to go from the latent of one state.
#[derive(Module, Debug)]
pub struct MotionHead {
    /// The first layer.
    pub hidden: Dense,
    /// The last layer, a value an axis.
    pub output: Dense,
}

impl MotionHead {
    /// A head with random weights.
    pub fn new(latent_dim: usize, width: usize, axes: usize, init: &mut Initialiser) -> Self {
        Self {
            hidden: Dense::new(latent_dim, width, 2.0, init),
            output: Dense::new(width, axes, 0.1, init),
        }
    }

    /// How many values it tells.
    #[must_use]
    pub fn axes(&self) -> usize {
        self.output.weight.val().dims()[1]
    }

    /// Latents `[n, latent_dim]` to the motion to go, `[n, axes]`.
    #[must_use]
    pub fn forward(&self, latents: Tensor<2>) -> Tensor<2> {
        self.output.forward(relu(self.hidden.forward(latents)))
    }
}
