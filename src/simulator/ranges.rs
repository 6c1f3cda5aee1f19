//! How large the ranges of a [`Variation`] may be, and one as it is written.

use serde::Deserialize;
use thiserror::Error;

use super::variation::{Level, TISSUE_ROOM_M, Variation};

/// A range that leaves no possible world, or that would be cut to what there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("`{key}` is {value}, out of range: choose a number within 0..={most}")]
pub struct VariationError {
    /// The field of [`Variation`].
    pub key: &'static str,
    /// What it was to be.
    pub value: f32,
    /// The largest that it may be.
    pub most: f32,
}

impl Variation {
    /// The largest ranges. The start: the waste bin, the container box and the night stand leave the
    /// robot's base 0.30 m to each side, whichever way it heads. Objects: as far as the tissue may lie.
    /// Light: none to twice the nominal one.
    pub const MOST: Self = Self {
        start_position_m: 0.30,
        start_heading_deg: 180.0,
        object_position_m: TISSUE_ROOM_M,
        light: 1.0,
        noise_levels: 255.0,
        appearance: true,
    };

    /// Whether each range is a number from 0 to that of [`MOST`](Self::MOST).
    ///
    /// # Errors
    /// [`VariationError`] for the first that is not.
    pub fn check(&self) -> Result<(), VariationError> {
        let ranges = self.ranges().into_iter().zip(Self::MOST.ranges());
        for ((key, value), (_, most)) in ranges {
            // Contains no value that is not finite.
            if !(0.0..=most).contains(&value) {
                return Err(VariationError { key, value, most });
            }
        }
        Ok(())
    }

    fn ranges(&self) -> [(&'static str, f32); 5] {
        [
            ("start_position_m", self.start_position_m),
            ("start_heading_deg", self.start_heading_deg),
            ("object_position_m", self.object_position_m),
            ("light", self.light),
            ("noise_levels", self.noise_levels),
        ]
    }
}

/// A variation as it is written: what is left out is as at a level.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename = "Variation", deny_unknown_fields)]
pub(super) struct WrittenVariation {
    start_position_m: Option<f32>,
    start_heading_deg: Option<f32>,
    object_position_m: Option<f32>,
    light: Option<f32>,
    noise_levels: Option<f32>,
    appearance: Option<bool>,
}

impl WrittenVariation {
    /// The whole of it, checked.
    pub(super) fn at(&self, level: Level) -> Result<Variation, VariationError> {
        let usual = level.variation();
        let variation = Variation {
            start_position_m: self.start_position_m.unwrap_or(usual.start_position_m),
            start_heading_deg: self.start_heading_deg.unwrap_or(usual.start_heading_deg),
            object_position_m: self.object_position_m.unwrap_or(usual.object_position_m),
            light: self.light.unwrap_or(usual.light),
            noise_levels: self.noise_levels.unwrap_or(usual.noise_levels),
            appearance: self.appearance.unwrap_or(usual.appearance),
        };
        variation.check()?;
        Ok(variation)
    }
}

impl TryFrom<WrittenVariation> for Variation {
    type Error = VariationError;

    fn try_from(written: WrittenVariation) -> Result<Self, VariationError> {
        written.at(Level::default())
    }
}
