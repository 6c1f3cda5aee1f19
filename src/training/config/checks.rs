//! What of a configuration would break a training later, refused before it begins.

use super::{EncoderConfig, OptimiserConfig, TrainingConfig};
use crate::training::TrainingError;

/// What is said of a layer of nothing.
const NO_WIDTH: &str = "no width may be 0";

impl TrainingConfig {
    /// Checks every value that would otherwise break the training later.
    ///
    /// # Errors
    /// [`TrainingError::Config`] with the first field that is out of its range.
    pub fn check(&self) -> Result<(), TrainingError> {
        let encoder = &self.network.encoder;
        let sampling = &self.sampling;
        demand(self.stack > 0, "stack", self.stack, "it must be 1 or more")?;
        demand(self.d_max > 1, "d_max", self.d_max, "it must be 2 or more")?;
        demand(self.steps > 0, "steps", self.steps, "it must be 1 or more")?;
        demand(
            self.validate_every_steps > 0,
            "validate_every_steps",
            self.validate_every_steps,
            "it must be 1 or more",
        )?;
        demand(
            self.checkpoint_every_steps > 0,
            "checkpoint_every_steps",
            self.checkpoint_every_steps,
            "it must be 1 or more",
        )?;
        check_ends(self.patience_validations, self.max_minutes)?;
        for (field, weight) in [
            ("far_weight", self.far_weight),
            ("policy_weight", self.policy_weight),
            ("motion_weight", self.motion_weight),
        ] {
            demand(weight >= 0.0, field, weight, "it must be 0 or more")?;
        }
        if let Some(landmarks) = &self.landmarks {
            landmarks.check(encoder)?;
        }
        check_validation_share(self.validation_share)?;
        encoder.check("network.encoder")?;
        self.check_heads()?;
        demand(
            sampling.window >= self.d_max,
            "sampling.window",
            sampling.window,
            "a window must hold pairs of every near class: at least d_max states",
        )?;
        demand(
            sampling.pixel_pairs >= 3 * self.d_max || !self.network.variant.joins_pixels(),
            "sampling.pixel_pairs",
            sampling.pixel_pairs,
            "each third of the pairs must be able to hold every class: at least 3 * d_max",
        )?;
        demand(
            sampling.states >= 2 * sampling.window,
            "sampling.states",
            sampling.states,
            "a batch must hold two windows, or there is no far pair",
        )?;
        check_shares(&[
            ("network.dropout", self.network.dropout),
            ("network.encoder.stochastic_depth", encoder.stochastic_depth),
            ("sampling.look_alike_share", sampling.look_alike_share),
            ("sampling.hard_share", sampling.hard_share),
            ("sampling.aligned_share", sampling.aligned_share),
            (
                "sampling.aligned_policy_share",
                sampling.aligned_policy_share,
            ),
            ("sampling.missed_grasp_share", sampling.missed_grasp_share),
            ("augmentation.mirror_share", self.augmentation.mirror_share),
            ("optimiser.average_decay", self.optimiser.average_decay),
        ])?;
        let share = sampling.missed_grasp_share;
        demand(
            share + sampling.hard_share.max(sampling.look_alike_share) < 1.0,
            "sampling.missed_grasp_share",
            share,
            "with hard_share, and with look_alike_share, it must leave a share for the other pairs: below 1 in all",
        )?;
        self.optimiser.check()
    }

    fn check_heads(&self) -> Result<(), TrainingError> {
        let network = &self.network;
        let motion = self.tells_motion().then_some(network.motion_width);
        let widths = [
            ("network.projection_width", Some(network.projection_width)),
            ("network.hidden_width", Some(network.hidden_width)),
            ("network.motion_width", motion),
        ];
        for (field, width) in widths {
            demand(width != Some(0), field, 0, NO_WIDTH)?;
        }
        Ok(())
    }
}

impl EncoderConfig {
    /// Checks the patches of the first layer and all widths; `place` is what the encoder is called.
    ///
    /// # Errors
    /// [`TrainingError::Config`].
    pub(in crate::training) fn check(&self, place: &str) -> Result<(), TrainingError> {
        demand(
            self.stem_stride > 0 && self.stem_kernel >= self.stem_stride,
            &format!("{place}.stem_kernel"),
            self.stem_kernel,
            "it must be at least stem_stride, which must be 1 or more",
        )?;
        let stages = self.stage_channels.iter();
        let widths = [
            ("stem_channels", self.stem_channels),
            ("latent_dim", self.latent_dim),
        ];
        for (field, width) in widths
            .into_iter()
            .chain(stages.map(|width| ("stage_channels", *width)))
        {
            demand(width > 0, &format!("{place}.{field}"), width, NO_WIDTH)?;
        }
        Ok(())
    }
}

impl OptimiserConfig {
    /// Checks the learning rate, and that weights change at all.
    ///
    /// # Errors
    /// [`TrainingError::Config`].
    pub(in crate::training) fn check(&self) -> Result<(), TrainingError> {
        for (field, value) in [
            ("optimiser.learning_rate", self.learning_rate),
            ("optimiser.clip_norm", f64::from(self.clip_norm)),
        ] {
            demand(value > 0.0, field, value, "it must be above 0")?;
        }
        Ok(())
    }
}

/// Checks what ends a training before its last step.
///
/// # Errors
/// [`TrainingError::Config`].
pub(in crate::training) fn check_ends(
    patience_validations: Option<u64>,
    max_minutes: Option<f64>,
) -> Result<(), TrainingError> {
    if let Some(validations) = patience_validations {
        demand(
            validations > 0,
            "patience_validations",
            validations,
            "it must be 1 or more; null goes on to the last step",
        )?;
    }
    if let Some(minutes) = max_minutes {
        demand(
            minutes > 0.0,
            "max_minutes",
            minutes,
            "it must be above 0; null sets no limit",
        )?;
    }
    Ok(())
}

/// Checks the share of demonstrations that is held out.
///
/// # Errors
/// [`TrainingError::Config`].
pub(in crate::training) fn check_validation_share(share: f64) -> Result<(), TrainingError> {
    demand(
        share > 0.0 && share < 1.0,
        "validation_share",
        share,
        "it must lie between 0 and 1",
    )
}

/// Checks probabilities and other shares that must leave something over, by the names of their fields.
///
/// # Errors
/// [`TrainingError::Config`] with the first that does not.
pub(in crate::training) fn check_shares(
    shares: &[(&'static str, f64)],
) -> Result<(), TrainingError> {
    for (field, value) in shares {
        demand(
            (0.0..1.0).contains(value),
            field,
            value,
            "it must be at least 0 and below 1",
        )?;
    }
    Ok(())
}

pub(in crate::training) fn demand(
    holds: bool,
    field: &str,
    value: impl std::fmt::Display,
    demand: &'static str,
) -> Result<(), TrainingError> {
    if holds {
        return Ok(());
    }
    Err(TrainingError::Config {
        field: field.to_owned(),
        value: value.to_string(),
        demand,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_that_leave_nothing_for_the_other_pairs_are_refused() {
        for (hard, look_alike) in [(0.6, 0.0), (0.0, 0.6)] {
            let mut config = TrainingConfig::default();
            config.sampling.hard_share = hard;
            config.sampling.look_alike_share = look_alike;
            config.sampling.missed_grasp_share = 0.3;
            config.check().unwrap();
            config.sampling.missed_grasp_share = 0.5;
            let message = config.check().unwrap_err().to_string();
            assert!(message.contains("sampling.missed_grasp_share"), "{message}");
        }
    }

    #[test]
    fn what_would_break_a_training_later_is_refused_by_its_name() {
        let refused = |change: fn(&mut TrainingConfig), told: &str| {
            let mut config = TrainingConfig::default();
            change(&mut config);
            let message = config.check().unwrap_err().to_string();
            assert!(message.contains(told), "{told} is not in {message}");
        };
        refused(
            |c| c.network.projection_width = 0,
            "network.projection_width is 0",
        );
        refused(|c| c.network.hidden_width = 0, "network.hidden_width is 0");
        refused(
            |c| (c.motion_weight, c.network.motion_width) = (1.0, 0),
            "network.motion_width is 0",
        );
        refused(
            |c| c.network.encoder.stem_channels = 0,
            "network.encoder.stem_channels is 0",
        );
        refused(
            |c| c.network.encoder.stage_channels[1] = 0,
            "network.encoder.stage_channels is 0",
        );
        refused(|c| c.policy_weight = -1.0, "policy_weight is -1");
        refused(|c| c.far_weight = -1.0, "far_weight is -1");
        refused(|c| c.optimiser.clip_norm = 0.0, "optimiser.clip_norm is 0");
        refused(
            |c| c.patience_validations = Some(0),
            "patience_validations is 0",
        );
        refused(|c| c.max_minutes = Some(0.0), "max_minutes is 0");
        let mut config = TrainingConfig::default();
        config.network.motion_width = 0;
        config.check().unwrap();
    }

    #[test]
    fn a_window_without_near_pairs_of_every_class_is_refused() {
        let mut config = TrainingConfig::default();
        config.sampling.window = 4;
        let error = config.check().unwrap_err();
        assert!(error.to_string().contains("sampling.window is 4"));
    }
}
