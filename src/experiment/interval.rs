/// The 95 % Wilson score interval of a success rate, as `[low, high]` within 0..=1.
///
/// Unlike the normal approximation it stays within 0..=1 and is honest at 0 and at all successes.
/// No trials give `[0, 1]`: nothing is known. Source: E. B. Wilson, *Probable Inference, the Law of
/// Succession, and Statistical Inference*, 1927.
///
/// # Panics
/// If there are more successes than trials.
#[must_use]
pub fn wilson_interval_95(successes: usize, trials: usize) -> [f64; 2] {
    assert!(
        successes <= trials,
        "{successes} successes in {trials} trials"
    );
    if trials == 0 {
        return [0.0, 1.0];
    }
    let z = 1.959_963_984_540_054;
    let n = trials as f64;
    let p = successes as f64 / n;
    let centre = p + z * z / (2.0 * n);
    let spread = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    [
        ((centre - spread) / scale).max(0.0),
        ((centre + spread) / scale).min(1.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_published_values() {
        // 81 of 263: the worked example of Newcombe (1998), method 3: 0.2553 to 0.3662.
        let [low, high] = wilson_interval_95(81, 263);
        assert!((low - 0.2553).abs() < 5e-5, "{low}");
        assert!((high - 0.3662).abs() < 5e-5, "{high}");
        let [low, high] = wilson_interval_95(0, 20);
        assert!(
            low.abs() < 1e-12 && (high - 0.1611).abs() < 5e-5,
            "{low} {high}"
        );
    }

    #[test]
    fn no_trials_say_nothing() {
        assert!(wilson_interval_95(0, 0)[0].abs() < f64::EPSILON);
        assert!((wilson_interval_95(0, 0)[1] - 1.0).abs() < f64::EPSILON);
    }
}
