use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;

use super::Initialiser;

/// Keeps the division finite for a filter of equal weights.
const EPSILON: f64 = 1e-6;
/// A `ReLU` lets a third of the variance of its input through; this factor makes up for it.
const RELU_GAIN: f32 = 1.713;

/// A 3x3 convolution whose filters are kept at mean 0 and a learned length (weight standardisation).
///
/// It takes the place of batch normalisation: nothing depends on the other states of a batch, nothing
/// has to be carried along as running means, and no pass over the activations is needed.
#[derive(Module, Debug)]
pub struct StandardisedConvolution {
    /// Free weights `[out, in, 3, 3]`; [`filters`](Self::filters) are what is applied.
    pub weight: Param<Tensor<4>>,
    /// Learned length of each filter.
    pub gain: Param<Tensor<1>>,
    /// Added to each output channel.
    pub bias: Param<Tensor<1>>,
}

impl StandardisedConvolution {
    /// A convolution with random filters.
    pub fn new(input: usize, output: usize, init: &mut Initialiser) -> Self {
        Self {
            weight: init.normal([output, input, 3, 3], 1.0),
            gain: init.constant([output], RELU_GAIN),
            bias: init.constant([output], 0.0),
        }
    }

    /// The filters as applied, `[out, in, 3, 3]`.
    #[must_use]
    pub fn filters(&self) -> Tensor<4> {
        let weight = self.weight.val();
        let [output, input, rows, columns] = weight.dims();
        let fan_in = input * rows * columns;
        let flat: Tensor<2> = weight.reshape([output, fan_in]);
        let centred = flat.clone() - flat.mean_dim(1);
        let variance = centred.clone().square().mean_dim(1);
        let gain = self.gain.val().reshape([output, 1]);
        let scale = gain / (variance * fan_in as f64 + EPSILON).sqrt();
        (centred * scale).reshape([output, input, rows, columns])
    }

    /// `[n, in, rows, columns]` to `[n, out, rows, columns]`; beyond the edge all is 0.
    #[must_use]
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
        conv2d(x, self.filters(), Some(self.bias.val()), options)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    #[test]
    fn filters_have_mean_zero_and_the_length_of_their_gain() {
        let device = Device::flex();
        let mut init = Initialiser::new(3, &device);
        let convolution = StandardisedConvolution::new(4, 2, &mut init);
        let filters: Vec<f32> = convolution.filters().into_data().try_to_vec().unwrap();
        for filter in filters.chunks(36) {
            let length = filter.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!(filter.iter().sum::<f32>().abs() < 1e-4);
            assert!((length - RELU_GAIN).abs() < 1e-3, "{length}");
        }
    }
}
