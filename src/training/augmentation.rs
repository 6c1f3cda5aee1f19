use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::AugmentationConfig;

/// How the frames of one camera are varied: moved by whole pixels and multiplied per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Rows that the picture moves down.
    pub down_pixels: i32,
    /// Columns that the picture moves right.
    pub right_pixels: i32,
    /// Factor of each colour channel.
    pub gain: [f32; 3],
}

impl Variation {
    /// No change.
    pub const NONE: Self = Self {
        down_pixels: 0,
        right_pixels: 0,
        gain: [1.0; 3],
    };

    /// Draws a variation.
    pub fn draw(config: &AugmentationConfig, rng: &mut ChaCha8Rng) -> Self {
        let reach = config.shift_pixels as i32;
        let mut around_one = |spread: f32| 1.0 + spread * rng.random_range(-1.0..=1.0_f32);
        let brightness = around_one(config.brightness);
        let gain = [(); 3].map(|()| brightness * around_one(config.tint));
        Self {
            down_pixels: rng.random_range(-reach..=reach),
            right_pixels: rng.random_range(-reach..=reach),
            gain,
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn nothing_configured_changes_nothing() {
        let still = AugmentationConfig {
            shift_pixels: 0,
            brightness: 0.0,
            tint: 0.0,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert_eq!(Variation::draw(&still, &mut rng), Variation::NONE);
    }

    #[test]
    fn variations_stay_within_their_bounds() {
        let config = AugmentationConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let v = Variation::draw(&config, &mut rng);
            assert!(v.down_pixels.abs() <= 4 && v.right_pixels.abs() <= 4);
            assert!(v.gain.iter().all(|g| (0.75..1.27).contains(g)));
        }
    }
}
