use serde::{Deserialize, Serialize};

use crate::model::BaselineMethod;
use crate::training::config::{check_ends, check_shares, check_validation_share, demand};
use crate::training::{
    AugmentationConfig, EncoderConfig, ImitationConfig, OptimiserConfig, Preset, TrainingConfig,
    TrainingError,
};

/// Everything that decides the training of a baseline; with the same demonstrations it gives the same weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BaselineConfig {
    /// The method.
    pub method: BaselineMethod,
    /// Seed of everything random.
    pub seed: u64,
    /// How many frames make a state; 1 for MVP, whose encoder sees one picture.
    pub stack: usize,
    /// How many of the last states the policy acts on; 1 for BC and MVP.
    pub history: usize,
    /// Share of the demonstrations of each task that is held out; at least one in all.
    pub validation_share: f64,
    /// Number of optimiser steps.
    pub steps: u64,
    /// Validate after so many steps.
    pub validate_every_steps: u64,
    /// Write a checkpoint after so many steps.
    pub checkpoint_every_steps: u64,
    /// Stop when so many validations in a row have brought no lower loss: the paper stops every baseline once
    /// the validation loss rises (Fu & Finn, section IV-A).
    pub patience_validations: Option<u64>,
    /// Stop training after so many minutes; the learning rate falls to its end by then. The weights
    /// then depend on the speed of the machine.
    pub max_minutes: Option<f64>,
    /// Windows of `history` consecutive states in a step.
    pub windows: usize,
    /// Goal images that are drawn for a step, shared by its windows; at least one a task.
    pub goals: usize,
    /// The residual network of each camera; of RT-1 without its last layer and keypoints, of MVP unused.
    pub encoder: EncoderConfig,
    /// Width of both hidden layers before the action.
    pub hidden_width: usize,
    /// Values that the GRU of BC-RNN carries on.
    pub memory_width: usize,
    /// Probability with which a value of a hidden layer is set to 0 while training.
    pub dropout: f64,
    /// RT-1's tokens and transformer.
    pub transformer: TransformerConfig,
    /// Which actions are learnt.
    pub imitation: ImitationConfig,
    /// How images are varied; not those of MVP, whose features are computed once.
    pub augmentation: AugmentationConfig,
    /// How weights are changed.
    pub optimiser: OptimiserConfig,
}

/// RT-1's tokens and transformer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TransformerConfig {
    /// Tokens of one camera's state.
    pub tokens: usize,
    /// Values of a token.
    pub width: usize,
    /// Attention heads; they divide `width`.
    pub heads: usize,
    /// Layers, of attention and a perceptron each.
    pub layers: usize,
}

impl Default for TransformerConfig {
    fn default() -> Self {
        Self {
            tokens: 4,
            width: 96,
            heads: 4,
            layers: 3,
        }
    }
}

impl Default for BaselineConfig {
    fn default() -> Self {
        Self::of(BaselineMethod::Bc, Preset::Paper)
    }
}

impl BaselineConfig {
    /// A baseline with an encoder, data and a training as our method has them in a preset.
    #[must_use]
    pub fn of(method: BaselineMethod, preset: Preset) -> Self {
        let ours = preset.config();
        let is_tiny = preset == Preset::Tiny;
        let history = match method {
            BaselineMethod::Bc | BaselineMethod::Mvp => 1,
            BaselineMethod::BcRnn => 10,
            BaselineMethod::Rt1 => 6,
        };
        // About as many states in a step as our method has, and no fewer windows than a task needs variety.
        let windows = (ours.sampling.states / history).max(4);
        Self {
            method,
            seed: ours.seed,
            // As the paper has it, whatever does best for our method.
            stack: if method == BaselineMethod::Mvp {
                1
            } else {
                TrainingConfig::default().stack
            },
            history,
            validation_share: ours.validation_share,
            steps: ours.steps,
            validate_every_steps: ours.validate_every_steps,
            checkpoint_every_steps: ours.checkpoint_every_steps,
            patience_validations: Some(6),
            max_minutes: None,
            windows,
            goals: 8,
            encoder: ours.network.encoder,
            hidden_width: if is_tiny { 16 } else { 256 },
            memory_width: if is_tiny { 16 } else { 256 },
            dropout: ours.network.dropout,
            transformer: if is_tiny {
                TransformerConfig {
                    tokens: 2,
                    width: 8,
                    heads: 2,
                    layers: 1,
                }
            } else {
                TransformerConfig::default()
            },
            imitation: ours.imitation,
            augmentation: AugmentationConfig {
                // Features of pictures as they are know nothing of mirrored ones.
                mirror_share: if method == BaselineMethod::Mvp {
                    0.0
                } else {
                    ours.augmentation.mirror_share
                },
                ..ours.augmentation
            },
            optimiser: ours.optimiser,
        }
    }

    /// Checks every value that would otherwise break the training later.
    ///
    /// # Errors
    /// [`TrainingError::Config`] with the first field that is out of its range.
    pub fn check(&self) -> Result<(), TrainingError> {
        self.check_positive()?;
        let is_single = matches!(self.method, BaselineMethod::Bc | BaselineMethod::Mvp);
        demand(
            self.history == 1 || !is_single,
            "history",
            self.history,
            "this method acts on the last state alone: it must be 1",
        )?;
        demand(
            self.stack == 1 || self.method != BaselineMethod::Mvp,
            "stack",
            self.stack,
            "a frozen encoder sees one picture: it must be 1",
        )?;
        demand(
            self.augmentation.mirror_share == 0.0 || self.method != BaselineMethod::Mvp,
            "augmentation.mirror_share",
            self.augmentation.mirror_share,
            "the features of a frozen encoder are those of the pictures as they are: it must be 0",
        )?;
        check_validation_share(self.validation_share)?;
        check_ends(self.patience_validations, self.max_minutes)?;
        self.encoder.check("encoder")?;
        demand(
            self.transformer
                .width
                .is_multiple_of(self.transformer.heads),
            "transformer.heads",
            self.transformer.heads,
            "it must divide transformer.width",
        )?;
        check_shares(&[
            ("dropout", self.dropout),
            ("encoder.stochastic_depth", self.encoder.stochastic_depth),
            ("augmentation.mirror_share", self.augmentation.mirror_share),
            ("optimiser.average_decay", self.optimiser.average_decay),
        ])?;
        self.optimiser.check()
    }

    fn check_positive(&self) -> Result<(), TrainingError> {
        let transformer = &self.transformer;
        for (field, value) in [
            ("stack", self.stack),
            ("history", self.history),
            ("steps", self.steps as usize),
            ("validate_every_steps", self.validate_every_steps as usize),
            (
                "checkpoint_every_steps",
                self.checkpoint_every_steps as usize,
            ),
            ("windows", self.windows),
            ("goals", self.goals),
            ("hidden_width", self.hidden_width),
            ("memory_width", self.memory_width),
            ("transformer.tokens", transformer.tokens),
            ("transformer.width", transformer.width),
            ("transformer.heads", transformer.heads),
            ("transformer.layers", transformer.layers),
        ] {
            demand(value > 0, field, value, "it must be 1 or more")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_of_every_preset_passes_its_check_and_survives_json() {
        for (_, preset) in Preset::NAMES {
            for (_, method) in BaselineMethod::NAMES {
                let config = BaselineConfig::of(method, preset);
                config.check().unwrap();
                let json = serde_json::to_string(&config).unwrap();
                let read: BaselineConfig = serde_json::from_str(&json).unwrap();
                assert_eq!(read, config);
            }
        }
        assert!(serde_json::from_str::<BaselineConfig>(r#"{"stepz": 3}"#).is_err());
    }

    #[test]
    fn what_a_method_cannot_use_is_refused_by_its_name() {
        let refused = |method, change: fn(&mut BaselineConfig)| {
            let mut config = BaselineConfig::of(method, Preset::Tiny);
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        let message = refused(BaselineMethod::Bc, |c| c.history = 3);
        assert!(message.contains("history is 3"), "{message}");
        let message = refused(BaselineMethod::Mvp, |c| c.stack = 2);
        assert!(message.contains("stack is 2"), "{message}");
        let message = refused(BaselineMethod::Rt1, |c| c.transformer.heads = 3);
        assert!(message.contains("transformer.heads is 3"), "{message}");
        let message = refused(BaselineMethod::Rt1, |c| c.windows = 0);
        assert!(message.contains("windows is 0"), "{message}");
        let message = refused(BaselineMethod::Bc, |c| c.encoder.latent_dim = 0);
        assert!(message.contains("encoder.latent_dim is 0"), "{message}");
        let message = refused(BaselineMethod::Bc, |c| c.patience_validations = Some(0));
        assert!(message.contains("patience_validations is 0"), "{message}");
    }
}
