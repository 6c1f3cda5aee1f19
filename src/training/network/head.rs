use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use super::Initialiser;
use crate::training::NetworkConfig;
use crate::training::masks::HeadMasks;

/// `x W + b`.
#[derive(Module, Debug)]
pub struct Dense {
    /// `[in, out]`.
    pub weight: Param<Tensor<2>>,
    /// `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl Dense {
    /// Random weights of variance `gain / input`, no bias.
    pub fn new(input: usize, output: usize, gain: f64, init: &mut Initialiser) -> Self {
        Self {
            weight: init.normal([input, output], (gain / input as f64).sqrt()),
            bias: init.constant([output], 0.0),
        }
    }

    /// `[n, in]` to `[n, out]`.
    #[must_use]
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }
}

/// A multi-layer perceptron over the latents of two states and their difference,
/// `[z, z', z' - z]`.
///
/// Its first layer is linear in the three, so it is a sum of what each state brings:
/// `W1 z + W2 z' + W3 (z' - z) + b = (W1 - W3) z + b + (W2 + W3) z'`. A state is projected once,
/// however many pairs it is part of.
#[derive(Module, Debug)]
pub struct FlowHead {
    /// `W1`, for the state that is left: `[latent_dim, width]`.
    pub from: Param<Tensor<2>>,
    /// `W2`, for the state that is to be reached.
    pub to: Param<Tensor<2>>,
    /// `W3`, for the change.
    pub flow: Param<Tensor<2>>,
    /// `b`.
    pub bias: Param<Tensor<1>>,
    /// The second layer.
    pub hidden: Dense,
    /// The last layer, whose outputs are logits.
    pub output: Dense,
}

impl FlowHead {
    /// A head with random weights.
    pub fn new(
        latent_dim: usize,
        config: &NetworkConfig,
        outputs: usize,
        init: &mut Initialiser,
    ) -> Self {
        let width = config.projection_width;
        let deviation = (2.0 / (3 * latent_dim) as f64).sqrt();
        Self {
            from: init.normal([latent_dim, width], deviation),
            to: init.normal([latent_dim, width], deviation),
            flow: init.normal([latent_dim, width], deviation),
            bias: init.constant([width], 0.0),
            hidden: Dense::new(width, config.hidden_width, 2.0, init),
            output: Dense::new(config.hidden_width, outputs, 0.1, init),
        }
    }

    /// The matrices that project a state: as the one that is left, `W1 - W3`, and as the one that is
    /// to be reached, `W2 + W3`.
    #[must_use]
    pub fn split(&self) -> (Tensor<2>, Tensor<2>) {
        (
            self.from.val() - self.flow.val(),
            self.to.val() + self.flow.val(),
        )
    }

    /// Projects states, `[n, latent_dim]` to twice `[n, width]`; the bias is in the first.
    #[must_use]
    pub fn project(&self, latents: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        let (from, to) = self.split();
        (
            latents.clone().matmul(from) + self.bias.val().unsqueeze(),
            latents.matmul(to),
        )
    }

    /// Logits of pairs whose states were projected, `[pairs, width]` twice to `[pairs, outputs]`.
    #[must_use]
    pub fn score(&self, from: Tensor<2>, to: Tensor<2>, masks: Option<&HeadMasks>) -> Tensor<2> {
        let mut x = relu(from + to);
        if let Some(masks) = masks {
            x = x * masks.first.clone();
        }
        x = relu(self.hidden.forward(x));
        if let Some(masks) = masks {
            x = x * masks.second.clone();
        }
        self.output.forward(x)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    #[test]
    fn projecting_apart_equals_the_layer_over_all_three() {
        let device = Device::flex();
        let mut init = Initialiser::new(5, &device);
        let head = FlowHead::new(6, &NetworkConfig::default(), 5, &mut init);
        let values = |offset: usize| -> Vec<f32> {
            (0..24)
                .map(|i| ((i * 7 + offset) % 11) as f32 / 5.0 - 1.0)
                .collect()
        };
        let latents = |offset| -> Tensor<2> {
            Tensor::from_data(TensorData::new(values(offset), [4, 6]), &device)
        };
        let (z, y) = (latents(0), latents(3));

        let flow = y.clone() - z.clone();
        let all = Tensor::cat(vec![z.clone(), y.clone(), flow], 1);
        let weight = Tensor::cat(vec![head.from.val(), head.to.val(), head.flow.val()], 0);
        let whole = all.matmul(weight) + head.bias.val().unsqueeze();

        let apart = head.project(z).0 + head.project(y).1;
        let difference = (whole - apart).abs().max().into_scalar::<f32>();
        assert!(difference < 1e-5, "{difference}");
    }
}
