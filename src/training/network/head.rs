use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use super::Initialiser;
use crate::training::masks::HeadMasks;
use crate::training::{NetworkConfig, NetworkVariant};

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
/// however many pairs it is part of. A Siamese head has no `W3`; a head over one latent of a whole pair has
/// `W1` alone.
#[derive(Module, Debug)]
pub struct FlowHead {
    /// `W1`, for the state that is left: `[latent_dim, width]`.
    pub from: Param<Tensor<2>>,
    /// `W2`, for the state that is to be reached.
    pub to: Option<Param<Tensor<2>>>,
    /// `W3`, for the change.
    pub flow: Option<Param<Tensor<2>>>,
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
        let is_flow = config.variant == NetworkVariant::LatentFlow;
        let is_pair = config.variant.joins_pixels();
        let inputs = match (is_flow, is_pair) {
            (true, _) => 3,
            (false, true) => 1,
            (false, false) => 2,
        };
        let deviation = (2.0 / (inputs * latent_dim) as f64).sqrt();
        let mut matrix = || init.normal([latent_dim, width], deviation);
        Self {
            from: matrix(),
            to: (!is_pair).then(&mut matrix),
            flow: is_flow.then(&mut matrix),
            bias: init.constant([width], 0.0),
            hidden: Dense::new(width, config.hidden_width, 2.0, init),
            output: Dense::new(config.hidden_width, outputs, 0.1, init),
        }
    }

    /// The matrices that project a state: as the one that is left, `W1 - W3`, and as the one that is
    /// to be reached, `W2 + W3`.
    ///
    /// # Panics
    /// If the head sees one latent of a whole pair.
    #[must_use]
    pub fn split(&self) -> (Tensor<2>, Tensor<2>) {
        let to = self.to.as_ref().expect("a head over two states");
        match &self.flow {
            Some(flow) => (self.from.val() - flow.val(), to.val() + flow.val()),
            None => (self.from.val(), to.val()),
        }
    }

    /// Projects states, `[n, latent_dim]` to twice `[n, width]`; the bias is in the first.
    ///
    /// # Panics
    /// As for [`split`](Self::split).
    #[must_use]
    pub fn project(&self, latents: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        let (from, to) = self.split();
        // What comes after that in a latent is for others.
        let latents = latents.narrow(1, 0, from.dims()[0]);
        (
            latents.clone().matmul(from) + self.bias.val().unsqueeze(),
            latents.matmul(to),
        )
    }

    /// The first layer over latents of whole pairs, `[pairs, latent_dim]` to `[pairs, width]`.
    #[must_use]
    pub fn project_pair(&self, latents: Tensor<2>) -> Tensor<2> {
        latents.matmul(self.from.val()) + self.bias.val().unsqueeze()
    }

    /// Logits `[pairs, outputs]` of what the first layer made of pairs, `[pairs, width]`.
    #[must_use]
    pub fn score(&self, projected: Tensor<2>, masks: Option<&HeadMasks>) -> Tensor<2> {
        let mut x = relu(projected);
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
        let (to, flow) = (head.to.as_ref().unwrap(), head.flow.as_ref().unwrap());
        let weight = Tensor::cat(vec![head.from.val(), to.val(), flow.val()], 0);
        let whole = all.matmul(weight) + head.bias.val().unsqueeze();

        let apart = head.project(z).0 + head.project(y).1;
        let difference = (whole - apart).abs().max().into_scalar::<f32>();
        assert!(difference < 1e-5, "{difference}");
    }
}
