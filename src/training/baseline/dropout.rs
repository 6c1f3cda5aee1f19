use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::BaselineConfig;
use crate::training::masks::mask_values;

/// Keeps the generator of masks apart from that of batches, which begins with the same seed.
const SALT: u64 = 0x6d61_736b;

/// What is left out in a step: values of hidden layers (dropout) and residual blocks of single states
/// (stochastic depth). Masks are drawn in the order in which the network asks for them, so that a step depends
/// on its seed and number alone.
pub struct Dropout {
    rng: ChaCha8Rng,
    probability: f64,
    depth: f64,
}

impl Dropout {
    /// The masks of a step, counted from 0.
    pub fn of_step(config: &BaselineConfig, step: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ SALT);
        rng.set_stream(step + 1);
        Self {
            rng,
            probability: config.dropout,
            depth: config.encoder.stochastic_depth,
        }
    }

    /// A table with some of its values set to 0 and the others made larger for it.
    pub fn drop(&mut self, x: Tensor<2>) -> Tensor<2> {
        let [rows, columns] = x.dims();
        let values = mask_values(rows, columns, self.probability, &mut self.rng);
        let mask = Tensor::from_data(TensorData::new(values, [rows, columns]), &x.device());
        x * mask
    }

    /// A mask for each of `blocks` residual blocks, `[states, 1, 1, 1]`.
    pub fn blocks(&mut self, blocks: usize, states: usize, device: &Device) -> Vec<Tensor<4>> {
        (0..blocks)
            .map(|_| {
                let values = mask_values(states, 1, self.depth, &mut self.rng);
                Tensor::from_data(TensorData::new(values, [states, 1, 1, 1]), device)
            })
            .collect()
    }
}

/// Applies [`Dropout::drop`] while training.
pub fn dropped(x: Tensor<2>, dropout: &mut Option<&mut Dropout>) -> Tensor<2> {
    match dropout {
        Some(dropout) => dropout.drop(x),
        None => x,
    }
}
