use burn::tensor::{Device, Tensor, TensorData};

use super::TrainedBaseline;
use crate::model::{FeatureEncoder, Latents};
use crate::training::TrainingError;
use crate::training::evaluation::values;
use crate::trajectory::State;

/// What Burn computes for some states: what an exported baseline has to agree with.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineOutputs {
    /// `latent` of `encoder.onnx`, a row a state.
    pub latents: Latents,
    /// `logits` of `policy.onnx`, a row a window.
    pub logits: Latents,
}

impl TrainedBaseline {
    /// Burn's outputs for states, and for windows of indices of these states, each with the index of its goal.
    ///
    /// # Errors
    /// [`TrainingError::FrozenEncoder`] when the frozen encoder of MVP gives no features,
    /// [`TrainingError::FrozenEncoderNeeded`] when there is none.
    ///
    /// # Panics
    /// If there is no state, a window names a state that is not there or has another length than the
    /// history, or an image is missing or has another size.
    pub fn reference_outputs(
        &self,
        states: &[State],
        windows: &[(Vec<usize>, usize)],
        frozen: Option<&dyn FeatureEncoder>,
    ) -> Result<BaselineOutputs, TrainingError> {
        let device = Device::flex();
        super::trained::check_frozen(self.spec.method, frozen.is_some())?;
        let latents = if let Some(encoder) = frozen {
            encoder
                .features(states, &self.spec.cameras)
                .map_err(|source| TrainingError::FrozenEncoder { source })?
        } else {
            let pictures = self.pictures();
            let patches = pictures.patches(states, None).expect("all cameras");
            let patches = pictures.tensors(patches, states.len(), &device);
            let encoded = values(self.network.encode(&patches, None).latents());
            Latents::from_values(self.spec.latent_dim, encoded)
        };
        let mut logits = Latents::new(self.spec.action_space.head_sizes().iter().sum());
        for (window, goal) in windows {
            assert_eq!(
                window.len(),
                self.spec.history,
                "a window of another length"
            );
            let dim = self.spec.latent_dim;
            let seen: Vec<f32> = window
                .iter()
                .flat_map(|state| latents.row(*state))
                .copied()
                .collect();
            let history: Tensor<3> =
                Tensor::from_data(TensorData::new(seen, [1, window.len(), dim]), &device);
            let goal = TensorData::new(latents.row(*goal).to_vec(), [1, dim]);
            let goal = Tensor::from_data(goal, &device);
            let all = self.network.policy.forward(history, goal, None);
            let last = all.narrow(0, window.len() - 1, 1);
            logits.push(&values(last));
        }
        Ok(BaselineOutputs { latents, logits })
    }
}
