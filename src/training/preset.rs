use serde::{Deserialize, Serialize};

use super::{EncoderConfig, LandmarkConfig, TrainingConfig};

/// Ready-made configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The paper's set-up: two cameras of about 90x160, tens of demonstrations of 40 to 100 steps, far
    /// pairs uniformly at random.
    Paper,
    /// What does best in the bedroom: one frame a state, hard far pairs besides the uniform ones, goal states of other
    /// demonstrations, mirrored batches, the motion to go and landmarks.
    Bedroom,
    /// Small images and few, short demonstrations.
    Small,
    /// Seconds of training, for tests.
    Tiny,
}

impl Preset {
    /// All presets with the names that [`Preset::parse`] knows.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("paper", Self::Paper),
        ("bedroom", Self::Bedroom),
        ("small", Self::Small),
        ("tiny", Self::Tiny),
    ];

    /// The preset of a name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::NAMES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, preset)| *preset)
    }

    /// Its configuration.
    #[must_use]
    pub fn config(self) -> TrainingConfig {
        match self {
            Self::Paper => TrainingConfig::default(),
            Self::Bedroom => bedroom(),
            Self::Small => small(),
            Self::Tiny => tiny(),
        }
    }
}

fn bedroom() -> TrainingConfig {
    let mut config = TrainingConfig {
        stack: 1,
        motion_weight: 2.0,
        landmarks: Some(LandmarkConfig::bedroom()),
        validation_share: 0.067,
        ..TrainingConfig::default()
    };
    config.network.encoder.keypoints = 32;
    config.sampling.look_alike_share = 0.15;
    config.sampling.hard_share = 0.25;
    config.sampling.aligned_share = 0.5;
    config.sampling.aligned_policy_share = 0.85;
    config.sampling.missed_grasp_share = 0.08;
    config.imitation.missed_grasp_steps = 6;
    config.imitation.lead_steps = 6;
    config.augmentation.mirror_share = 0.4;
    config
}

fn small() -> TrainingConfig {
    let mut config = TrainingConfig {
        steps: 1_500,
        validate_every_steps: 100,
        checkpoint_every_steps: 100,
        ..TrainingConfig::default()
    };
    config.network.encoder.stage_channels = vec![32, 64];
    config.augmentation.shift_pixels = 2;
    config
}

fn tiny() -> TrainingConfig {
    let mut config = TrainingConfig {
        steps: 60,
        validate_every_steps: 20,
        checkpoint_every_steps: 20,
        ..TrainingConfig::default()
    };
    config.network.encoder = EncoderConfig {
        stem_kernel: 4,
        stem_stride: 4,
        stem_channels: 8,
        stage_channels: vec![8],
        keypoints: 4,
        latent_dim: 8,
        stochastic_depth: 0.3,
    };
    config.network.projection_width = 16;
    config.network.hidden_width = 16;
    config.sampling.states = 24;
    config.sampling.far_pairs = 64;
    config.augmentation.shift_pixels = 1;
    config.optimiser.learning_rate = 3e-3;
    config.optimiser.warmup_steps = 5;
    config.optimiser.average_decay = 0.9;
    config
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_pass_their_own_check_and_survive_json() {
        for (name, preset) in Preset::NAMES {
            let config = preset.config();
            config.check().unwrap();
            let json = serde_json::to_string(&config).unwrap();
            assert_eq!(
                serde_json::from_str::<TrainingConfig>(&json).unwrap(),
                config
            );
            assert_eq!(Preset::parse(name), Some(preset));
        }
    }
}
