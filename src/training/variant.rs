use serde::{Deserialize, Serialize};

use super::{NetworkConfig, TrainingConfig};

/// Where and how a network joins two states (Fu & Finn, sections III-F and IV-B: the paper's own way and
/// the ablations of Table III and Figure 5). All share one trainer, one objective and one way to be deployed; those that
/// join two states in their pixels go without landmarks and the motion to go, and so without what runs make of them.
///
/// The first layer that sees two states is linear. So what it makes of a difference is a difference of what
/// it makes of the two: [`Siamese`](Self::Siamese) can express what [`LatentFlow`](Self::LatentFlow) can,
/// and [`FrameStacking`](Self::FrameStacking) what [`PixelDifference`](Self::PixelDifference) can. They
/// differ in where training starts and how fast it moves in which direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkVariant {
    /// Each image is encoded apart; the heads see both latents and their difference.
    #[default]
    LatentFlow,
    /// Each image is encoded apart; the heads see both latents.
    Siamese,
    /// The images of both states are stacked in their channels and encoded together.
    FrameStacking,
    /// The images of the first state and their difference to those of the second are stacked in their
    /// channels and encoded together.
    PixelDifference,
}

impl NetworkVariant {
    /// All variants with the names that [`NetworkVariant::parse`] knows.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("latent_flow", Self::LatentFlow),
        ("siamese", Self::Siamese),
        ("frame_stacking", Self::FrameStacking),
        ("pixel_difference", Self::PixelDifference),
    ];

    /// The variant of a name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::NAMES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, variant)| *variant)
    }

    /// Whether the images of two states are encoded together, so that a state has no latent of its own and
    /// every pair costs an encoding.
    #[must_use]
    pub const fn joins_pixels(self) -> bool {
        matches!(self, Self::FrameStacking | Self::PixelDifference)
    }

    /// How many matrices of `latent_dim x projection_width` the first layer of a head has.
    const fn matrices(self) -> usize {
        match self {
            Self::LatentFlow => 3,
            Self::Siamese => 2,
            Self::FrameStacking | Self::PixelDifference => 1,
        }
    }
}

impl TrainingConfig {
    /// The same training of another variant, on some of the cameras, with about as many weights: what the
    /// heads of a variant lack in matrices they get in width, and what a network lacks in cameras each
    /// encoder gets in values of its latent. No name means all `present` cameras.
    #[must_use]
    pub fn matched(&self, variant: NetworkVariant, cameras: &[String], present: usize) -> Self {
        let mut config = self.clone();
        config.cameras = cameras.to_vec();
        let kept = if cameras.is_empty() {
            present
        } else {
            cameras.len()
        };
        let network = &mut config.network;
        network.encoder.latent_dim = network.encoder.latent_dim * present / kept.max(1);
        network.projection_width =
            matched_width(network, variant, network.encoder.latent_dim * kept);
        network.variant = variant;
        config
    }
}

/// Width of a head's first layer with which a variant's heads have as many weights as they had before.
fn matched_width(network: &NetworkConfig, variant: NetworkVariant, latent_dim: usize) -> usize {
    /// Widths are multiples of this, which vector units like.
    const MULTIPLE: usize = 8;
    let weights_a_column = |v: NetworkVariant| v.matrices() * latent_dim + network.hidden_width;
    let weights = network.projection_width * weights_a_column(network.variant);
    let width = weights as f64 / weights_a_column(variant) as f64;
    ((width / MULTIPLE as f64).round() as usize).max(1) * MULTIPLE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::{Dataset, Preset, TrainedModel, synthetic};

    #[test]
    fn names_are_those_of_the_configuration() {
        for (name, variant) in NetworkVariant::NAMES {
            assert_eq!(NetworkVariant::parse(name), Some(variant));
            assert_eq!(serde_json::to_value(variant).unwrap(), name);
        }
    }

    #[test]
    fn variants_have_about_as_many_weights() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 8, 3)]).unwrap();
        let names: Vec<String> = data.cameras().iter().map(|c| c.name.clone()).collect();
        let config = Preset::Paper.config();
        let size = |config: &TrainingConfig| {
            let data = Dataset::new(&[synthetic::demonstrations("a", 2, 8, 3)])
                .unwrap()
                .seen_by(&config.cameras)
                .unwrap();
            TrainedModel::untrained(&data, config).weight_count() as f64
        };
        let ours = size(&config);
        for (name, variant) in NetworkVariant::NAMES {
            let ratio = size(&config.matched(variant, &[], names.len())) / ours;
            assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
        }
        for camera in names.chunks(1) {
            let one = config.matched(NetworkVariant::LatentFlow, camera, names.len());
            let ratio = size(&one) / ours;
            assert!((0.75..1.25).contains(&ratio), "{camera:?}: {ratio}");
        }
    }
}
