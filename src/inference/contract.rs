//! [`Model`] as the encoder, the traversability function and the local policy of the house.

use super::Model;
use super::network::{Network, Tensor, in_batches};
use super::pixels::planes;
use crate::model::{
    ActionDistribution, Encoder, Latents, LocalPolicy, ModelError, ModelSpec, Projections,
    StepDistributions, Traversability,
};
use crate::trajectory::{ActionSpace, CameraSpec, State};

/// States that are encoded at once.
pub(super) const STATES_A_BATCH: usize = 16;
/// Latents that are projected at once.
const LATENTS_A_BATCH: usize = 512;
/// Pairs that are scored at once; larger batches were measured to be slower.
const PAIRS_A_BATCH: usize = 2048;
/// Values that go into a batch of pairs from each side, where projections are maps of a picture: larger batches
/// leave the processor's cache.
const VALUES_A_BATCH: usize = 1 << 20;

impl Encoder for Model {
    fn spec(&self) -> &ModelSpec {
        &self.manifest.spec
    }

    fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
        let dim = self.spec().latent_dim;
        let [latents] = in_batches(states.len(), STATES_A_BATCH, |range| {
            let spec = self.spec();
            encode_cameras(&self.encoder, &spec.cameras, spec.stack, &states[range])
        })?;
        ModelError::unless_as_many("values of the encoder", states.len() * dim, latents.len())?;
        Ok(Latents::from_values(dim, latents))
    }
}

/// The values of `latent` for states, from the images of all cameras.
pub(super) fn encode_cameras(
    encoder: &Network,
    cameras: &[CameraSpec],
    stack: usize,
    states: &[State],
) -> Result<[Vec<f32>; 1], ModelError> {
    let mut pixels = Vec::with_capacity(cameras.len());
    for camera in cameras {
        pixels.push(planes(states, camera, stack)?);
    }
    let inputs: Vec<Tensor<'_>> = cameras
        .iter()
        .zip(&pixels)
        .map(|(camera, values)| Tensor {
            name: &camera.name,
            shape: vec![
                states.len(),
                3 * stack,
                camera.height as usize,
                camera.width as usize,
            ],
            values,
        })
        .collect();
    encoder.run(&inputs, states.len(), ["latent"])
}

impl Traversability for Model {
    fn d_max(&self) -> usize {
        self.spec().d_max
    }

    fn project(&self, latents: &Latents) -> Result<Projections, ModelError> {
        let dim = self.spec().latent_dim;
        ModelError::unless_as_many("latents", dim, latents.dim())?;
        let [from, to] = in_batches(latents.len(), LATENTS_A_BATCH, |range| {
            let input = Tensor {
                name: "latent",
                shape: vec![range.len(), dim],
                values: &latents.values()[range.start * dim..range.end * dim],
            };
            self.projection.run(&[input], range.len(), ["from", "to"])
        })?;
        let width = self.manifest.projection_width;
        ModelError::unless_as_many("projections", latents.len() * width, from.len())?;
        ModelError::unless_as_many("projections", latents.len() * width, to.len())?;
        Ok(Projections {
            from: Latents::from_values(width, from),
            to: Latents::from_values(width, to),
        })
    }

    fn predict(
        &self,
        from: &Projections,
        to: &Projections,
        pairs: &[(u32, u32)],
    ) -> Result<StepDistributions, ModelError> {
        let width = self.manifest.projection_width;
        if !pairs.is_empty() {
            ModelError::unless_as_many("projections", width, from.from.dim())?;
            ModelError::unless_as_many("projections", width, to.to.dim())?;
        }
        let batch = (VALUES_A_BATCH / width.max(1)).clamp(1, PAIRS_A_BATCH);
        let [mut logits] = in_batches(pairs.len(), batch, |range| {
            let pairs = &pairs[range];
            let sources = gather(&from.from, pairs.iter().map(|p| p.0));
            let targets = gather(&to.to, pairs.iter().map(|p| p.1));
            let input = |name, values| Tensor {
                name,
                shape: vec![pairs.len(), width],
                values,
            };
            let inputs = [input("from", &sources), input("to", &targets)];
            self.traversability.run(&inputs, pairs.len(), ["logits"])
        })?;
        let d_max = self.d_max();
        ModelError::unless_as_many(
            "logits of the traversability function",
            pairs.len() * d_max,
            logits.len(),
        )?;
        for row in logits.chunks_exact_mut(d_max) {
            softmax(row, self.temperature);
        }
        Ok(StepDistributions::new(d_max, logits))
    }
}

impl LocalPolicy for Model {
    fn act(&self, from: &[f32], goal: &[f32]) -> Result<ActionDistribution, ModelError> {
        let dim = self.spec().latent_dim;
        ModelError::unless_as_many("latents", dim, from.len())?;
        ModelError::unless_as_many("latents", dim, goal.len())?;
        let input = |name, values| Tensor {
            name,
            shape: vec![1, dim],
            values,
        };
        let inputs = [input("from", from), input("goal", goal)];
        let [mut logits] = self.policy.run(&inputs, 1, ["logits"])?;
        distribution(&mut logits, &self.spec().action_space)
    }
}

/// The probabilities of the classes of each head, whose logits lie side by side.
pub(super) fn distribution(
    logits: &mut [f32],
    space: &ActionSpace,
) -> Result<ActionDistribution, ModelError> {
    let sizes = space.head_sizes();
    ModelError::unless_as_many(
        "logits of the local policy",
        sizes.iter().sum(),
        logits.len(),
    )?;
    let mut rest = logits;
    let heads = sizes
        .iter()
        .map(|size| {
            let (head, after) = std::mem::take(&mut rest).split_at_mut(*size);
            rest = after;
            softmax(head, 1.0);
            head.to_vec()
        })
        .collect();
    Ok(ActionDistribution { heads })
}

/// Rows of a table, one after another.
fn gather(table: &Latents, rows: impl ExactSizeIterator<Item = u32>) -> Vec<f32> {
    let mut gathered = Vec::with_capacity(rows.len() * table.dim());
    for row in rows {
        gathered.extend_from_slice(table.row(row as usize));
    }
    gathered
}

/// Turns logits into probabilities in place, after dividing them by the temperature.
fn softmax(logits: &mut [f32], temperature: f32) {
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sum = 0.0;
    for value in logits.iter_mut() {
        *value = ((*value - largest) / temperature).exp();
        sum += *value;
    }
    for value in logits {
        *value /= sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn softmax_at_a_temperature_is_that_of_the_divided_logits() {
        let mut row = [2.0_f32.ln() * 3.0, 0.0, 1000.0_f32.ln() * -3.0];
        softmax(&mut row, 3.0);
        let sum = 2.0 + 1.0 + 0.001;
        for (p, expected) in row.iter().zip([2.0 / sum, 1.0 / sum, 0.001 / sum]) {
            assert!((p - expected).abs() < 1e-6, "{row:?}");
        }
    }

    #[test]
    fn softmax_of_large_logits_stays_finite() {
        let mut row = [1e30, 1e30];
        softmax(&mut row, 0.5);
        assert_eq!(row, [0.5, 0.5]);
    }
}
