use super::OptimiserConfig;

/// The learning rate after `progress` (0 to 1) of the training: a rise over the first steps, then half
/// a cosine down to `final_share` of the largest.
pub fn learning_rate(config: &OptimiserConfig, step: u64, progress: f64) -> f64 {
    let rise = ((step + 1) as f64 / config.warmup_steps.max(1) as f64).min(1.0);
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * progress.clamp(0.0, 1.0)).cos());
    config.learning_rate * rise * (config.final_share + (1.0 - config.final_share) * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rises_then_falls_to_its_end() {
        let config = OptimiserConfig::default();
        let at = |step, progress| learning_rate(&config, step, progress) / config.learning_rate;
        assert!((at(99, 0.0) - 0.5).abs() < 1e-9);
        assert!((at(199, 0.0) - 1.0).abs() < 1e-9);
        assert!((at(1_000, 0.5) - 0.505).abs() < 1e-9);
        assert!((at(2_000, 1.0) - 0.01).abs() < 1e-9);
        assert!((at(2_000, 1.5) - 0.01).abs() < 1e-9);
    }
}
