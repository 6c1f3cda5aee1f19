//! From light to bytes.

use std::sync::OnceLock;

/// Steps of the table per unit of light.
const STEPS: f32 = 1024.0;

/// White paper in full light comes out just below white.
const EXPOSURE: f32 = 0.66;

/// A filmic curve followed by the sRGB transfer, as a table.
#[derive(Debug)]
pub(super) struct ToneCurve(Vec<u8>);

/// The one curve of all pictures.
pub(super) fn curve() -> &'static ToneCurve {
    static CURVE: OnceLock<ToneCurve> = OnceLock::new();
    CURVE.get_or_init(|| ToneCurve((0..4096).map(|step| byte(step as f32 / STEPS)).collect()))
}

impl ToneCurve {
    /// The byte for an amount of light; what is brighter than 4 counts as 4.
    pub fn byte(&self, light: f32) -> u8 {
        self.0[((light * STEPS + 0.5) as usize).min(self.0.len() - 1)]
    }
}

fn byte(light: f32) -> u8 {
    let light = EXPOSURE * light;
    // Narkowicz's fit of the ACES film curve: soft shoulder, deep shadows.
    let film = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14);
    let film = film.clamp(0.0, 1.0);
    let srgb = if film <= 0.003_130_8 {
        12.92 * film
    } else {
        1.055 * film.powf(1.0 / 2.4) - 0.055
    };
    (srgb * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::curve;

    #[test]
    fn more_light_is_never_darker_and_the_ends_are_black_and_white() {
        let bytes: Vec<u8> = (0..500)
            .map(|step| curve().byte(step as f32 * 0.01))
            .collect();
        assert!(bytes.is_sorted());
        assert_eq!(bytes[0], 0);
        assert!(curve().byte(1e9) >= 240);
    }
}
