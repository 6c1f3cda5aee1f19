//! What is left out while training: values of the heads (dropout) and residual blocks of single
//! states (stochastic depth). Drawn from the training's own generator, not from Burn's process-wide
//! one, so that a step depends on its seed and number alone.

use burn::tensor::{Device, Tensor, TensorData};
use rand::RngCore;
use rand_chacha::ChaCha8Rng;

/// A table of `rows x columns` that is 0 with `probability` and `1 / (1 - probability)` otherwise.
pub fn mask_values(
    rows: usize,
    columns: usize,
    probability: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let mut bytes = vec![0_u8; rows * columns * 2];
    rng.fill_bytes(&mut bytes);
    let limit = (probability * 65_536.0).round() as u32;
    let kept = (1.0 / (1.0 - probability)) as f32;
    bytes
        .chunks_exact(2)
        .map(|b| {
            let drawn = u32::from(u16::from_le_bytes([b[0], b[1]]));
            if drawn < limit { 0.0 } else { kept }
        })
        .collect()
}

/// The masks of one head for one set of pairs.
#[derive(Clone, Debug)]
pub struct HeadMasks {
    /// For the first layer, `[pairs, projection_width]`.
    pub first: Tensor<2>,
    /// For the second layer, `[pairs, hidden_width]`.
    pub second: Tensor<2>,
}

/// All masks of a step as plain values, before they are moved to a device.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskValues {
    /// Residual blocks, of the states, or of the traversability pairs where pairs are encoded.
    pub blocks: BlockMasks,
    /// Residual blocks of the policy pairs, where pairs are encoded.
    pub policy_blocks: BlockMasks,
    /// First and second layer of the traversability head.
    pub traversability: MaskPair,
    /// First and second layer of the policy head.
    pub policy: MaskPair,
}

/// A mask for each residual block of each camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockMasks {
    values: Vec<Vec<Vec<f32>>>,
}

/// Two tables with as many rows as there are pairs.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskPair {
    rows: usize,
    first: Vec<f32>,
    second: Vec<f32>,
}

/// How many masks of which size a step needs.
#[derive(Clone, Copy, Debug)]
pub struct MaskSizes {
    /// States that are encoded, or traversability pairs where pairs are.
    pub encoded: usize,
    /// Policy pairs that are encoded; 0 where states are.
    pub encoded_for_policy: usize,
    /// Cameras.
    pub cameras: usize,
    /// Residual blocks of a camera's encoder.
    pub blocks: usize,
    /// Pairs of the traversability loss.
    pub traversability_pairs: usize,
    /// Pairs of the policy loss.
    pub policy_pairs: usize,
    /// Width of the heads' first layer.
    pub projection_width: usize,
    /// Width of the heads' second layer.
    pub hidden_width: usize,
}

impl MaskValues {
    /// Draws the masks of a step.
    pub fn draw(sizes: &MaskSizes, depth: f64, dropout: f64, rng: &mut ChaCha8Rng) -> Self {
        let mut pair = |rows: usize| MaskPair {
            rows,
            first: mask_values(rows, sizes.projection_width, dropout, rng),
            second: mask_values(rows, sizes.hidden_width, dropout, rng),
        };
        let traversability = pair(sizes.traversability_pairs);
        let policy = pair(sizes.policy_pairs);
        let mut blocks = |rows: usize| BlockMasks {
            values: (0..sizes.cameras)
                .map(|_| {
                    (0..sizes.blocks)
                        .map(|_| mask_values(rows, 1, depth, rng))
                        .collect()
                })
                .collect(),
        };
        Self {
            blocks: blocks(sizes.encoded),
            policy_blocks: blocks(sizes.encoded_for_policy),
            traversability,
            policy,
        }
    }
}

impl BlockMasks {
    /// The masks of each camera's blocks on a device, `[rows, 1, 1, 1]` each.
    pub fn tensors(&self, device: &Device) -> Vec<Vec<Tensor<4>>> {
        self.values
            .iter()
            .map(|camera| {
                camera
                    .iter()
                    .map(|values| {
                        let shape = [values.len(), 1, 1, 1];
                        Tensor::from_data(TensorData::new(values.clone(), shape), device)
                    })
                    .collect()
            })
            .collect()
    }
}

impl MaskPair {
    /// The masks on a device.
    pub fn tensors(self, device: &Device) -> HeadMasks {
        let table = |values: Vec<f32>| {
            let columns = values.len().checked_div(self.rows).unwrap_or(0);
            Tensor::from_data(TensorData::new(values, [self.rows, columns]), device)
        };
        HeadMasks {
            first: table(self.first),
            second: table(self.second),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn a_mask_keeps_its_mean_and_drops_its_share() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let values = mask_values(200, 100, 0.3, &mut rng);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let dropped = values.iter().filter(|v| **v == 0.0).count();
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        assert!((5_700..6_300).contains(&dropped), "{dropped}");
    }

    #[test]
    fn probability_zero_changes_nothing() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        assert!(mask_values(10, 10, 0.0, &mut rng).iter().all(|v| *v == 1.0));
    }
}
