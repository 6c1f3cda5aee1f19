use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::{relu, sigmoid, tanh};

use super::dropout::{Dropout, dropped};
use crate::training::network::{Dense, Initialiser};

/// Keeps the division finite for a row of equal values.
pub const NORM_EPSILON: f32 = 1e-5;

/// Each row at mean 0 and deviation 1, then a learned gain and bias.
#[derive(Module, Debug)]
pub struct LayerNorm {
    /// `[width]`.
    pub gain: Param<Tensor<1>>,
    /// `[width]`.
    pub bias: Param<Tensor<1>>,
}

impl LayerNorm {
    /// Gain 1, bias 0.
    pub fn new(width: usize, init: &mut Initialiser) -> Self {
        Self {
            gain: init.constant([width], 1.0),
            bias: init.constant([width], 0.0),
        }
    }

    /// `[n, width]` to the same.
    #[must_use]
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let centred = x.clone() - x.mean_dim(1);
        let variance = centred.clone().square().mean_dim(1);
        let even = centred / (variance + NORM_EPSILON).sqrt();
        even * self.gain.val().unsqueeze() + self.bias.val().unsqueeze()
    }
}

/// Two hidden layers over what is known of now and the latent of the goal, `[x, z_goal]`, to the logits of
/// the actions.
#[derive(Module, Debug)]
pub struct Perceptron {
    /// Evens out features of an encoder whose scale is not ours.
    pub norm: Option<LayerNorm>,
    /// The first hidden layer.
    pub first: Dense,
    /// The second hidden layer.
    pub second: Dense,
    /// Its outputs are logits.
    pub output: Dense,
}

impl Perceptron {
    /// Random weights; `norm` is for features that both inputs are of.
    pub fn new(
        [now, goal]: [usize; 2],
        width: usize,
        classes: usize,
        norm: Option<LayerNorm>,
        init: &mut Initialiser,
    ) -> Self {
        Self {
            norm,
            first: Dense::new(now + goal, width, 2.0, init),
            second: Dense::new(width, width, 2.0, init),
            output: Dense::new(width, classes, 0.1, init),
        }
    }

    /// `[n, now]` and `[n, goal]` to `[n, classes]`.
    #[must_use]
    pub fn forward(
        &self,
        now: Tensor<2>,
        goal: Tensor<2>,
        mut dropout: Option<&mut Dropout>,
    ) -> Tensor<2> {
        let even = |x: Tensor<2>| match &self.norm {
            Some(norm) => norm.forward(x),
            None => x,
        };
        let x = Tensor::cat(vec![even(now), even(goal)], 1);
        let x = dropped(relu(self.first.forward(x)), &mut dropout);
        let x = dropped(relu(self.second.forward(x)), &mut dropout);
        self.output.forward(x)
    }
}

/// A gated recurrent unit (Cho et al., Learning Phrase Representations using RNN Encoder-Decoder, 2014):
///
/// ```text
/// r = sigmoid(W_r x + U_r h)      k = sigmoid(W_k x + U_k h)
/// n = tanh(W_n x + r * (U_n h))   h' = n + k * (h - n)
/// ```
#[derive(Module, Debug)]
pub struct GatedUnit {
    /// `W_r`, `W_k` and `W_n` with their biases side by side.
    pub input: Dense,
    /// `U_r`, `U_k` and `U_n` with their biases side by side.
    pub hidden: Dense,
}

impl GatedUnit {
    /// Random weights for a memory of `width` values.
    pub fn new(input: usize, width: usize, init: &mut Initialiser) -> Self {
        Self {
            input: Dense::new(input, 3 * width, 1.0, init),
            hidden: Dense::new(width, 3 * width, 1.0, init),
        }
    }

    /// Values that are carried on.
    #[must_use]
    pub fn width(&self) -> usize {
        self.hidden.weight.val().dims()[0]
    }

    /// The memory after each state of a history, `[n, history, input]` to `[n, history, width]`; it
    /// begins at 0.
    #[must_use]
    pub fn forward(&self, history: Tensor<3>) -> Tensor<3> {
        let [n, steps, input] = history.dims();
        let width = self.width();
        let device = history.device();
        let seen = self.input.forward(history.reshape([n * steps, input]));
        let seen = seen.reshape([n, steps, 3 * width]);
        let part = |gates: &Tensor<2>, index: usize| gates.clone().narrow(1, index * width, width);
        let mut memory: Tensor<2> = Tensor::zeros([n, width], &device);
        let mut memories: Vec<Tensor<2>> = Vec::with_capacity(steps);
        for step in 0..steps {
            let x = seen.clone().narrow(1, step, 1).reshape([n, 3 * width]);
            let h = self.hidden.forward(memory.clone());
            let reset = sigmoid(part(&x, 0) + part(&h, 0));
            let keep = sigmoid(part(&x, 1) + part(&h, 1));
            let new = tanh(part(&x, 2) + reset * part(&h, 2));
            memory = new.clone() + keep * (memory - new);
            memories.push(memory.clone());
        }
        Tensor::stack(memories, 1)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::training::evaluation::values;

    fn table<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> Tensor<D> {
        Tensor::from_data(TensorData::new(values, shape), &Device::flex())
    }

    #[test]
    fn a_row_is_evened_out_by_hand() {
        let mut init = Initialiser::new(1, &Device::flex());
        let mut norm = LayerNorm::new(2, &mut init);
        norm.bias = Param::from_tensor(table(vec![0.5, 0.5], [2]));
        let even = values(norm.forward(table(vec![3.0, 7.0], [1, 2])));
        assert!((even[0] + 0.5).abs() < 1e-4 && (even[1] - 1.5).abs() < 1e-4);
    }

    #[test]
    fn two_steps_of_a_memory_of_one_value_by_hand() {
        let mut init = Initialiser::new(1, &Device::flex());
        let mut unit = GatedUnit::new(1, 1, &mut init);
        unit.input.weight = Param::from_tensor(table(vec![0.3, -0.4, 0.8], [1, 3]));
        unit.input.bias = Param::from_tensor(table(vec![0.1, 0.2, -0.1], [3]));
        unit.hidden.weight = Param::from_tensor(table(vec![0.5, 0.6, -0.7], [1, 3]));
        unit.hidden.bias = Param::from_tensor(table(vec![0.0, 0.1, 0.4], [3]));
        let found = values(unit.forward(table(vec![1.0, -2.0], [1, 2, 1])));
        let logistic = |x: f32| 1.0 / (1.0 + (-x).exp());
        let mut memory = 0.0_f32;
        for (x, found) in [1.0_f32, -2.0].into_iter().zip(found) {
            let reset = logistic(0.3 * x + 0.1 + 0.5 * memory);
            let keep = logistic(-0.4 * x + 0.2 + 0.6 * memory + 0.1);
            let new = (0.8 * x - 0.1 + reset * (-0.7 * memory + 0.4)).tanh();
            memory = (1.0 - keep) * new + keep * memory;
            assert!((found - memory).abs() < 1e-5, "{found} and {memory}");
        }
    }
}
