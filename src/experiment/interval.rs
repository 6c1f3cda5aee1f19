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
    let z = NORMAL;
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

/// The 97.5 % quantiles of Student's t distribution with 1 to 10 degrees of freedom.
const STUDENT: [f64; 10] = [
    12.706_205, 4.302_653, 3.182_446, 2.776_445, 2.570_582, 2.446_912, 2.364_624, 2.306_004,
    2.262_157, 2.228_139,
];
/// The 97.5 % quantile of the normal distribution.
const NORMAL: f64 = 1.959_963_984_540_054;

/// The 95 % interval of a mean of independent values, as `[low, high]`: `m ± t d / √(n - 1)` with the mean `m` of `n` values,
/// their standard deviation `d` (the root of the mean of `(x - m)²`, with the divisor `n`) and the 97.5 % quantile `t` of
/// Student's t distribution with `n - 1` degrees of freedom. None for fewer than two values, which do not tell how much
/// they vary.
#[must_use]
pub fn mean_interval_95(mean: f64, deviation: f64, count: usize) -> Option<[f64; 2]> {
    let degrees = count.checked_sub(1).filter(|degrees| *degrees > 0)?;
    let half = student(degrees) * deviation / (degrees as f64).sqrt();
    Some([mean - half, mean + half])
}

/// The 97.5 % quantile of Student's t distribution with one degree of freedom or more. Beyond the table it is the expansion
/// around the normal distribution of Abramowitz & Stegun, *Handbook of Mathematical Functions*, 26.7.5, right to three decimals.
fn student(degrees: usize) -> f64 {
    if let Some(quantile) = STUDENT.get(degrees - 1) {
        return *quantile;
    }
    let n = degrees as f64;
    let [z, z2] = [NORMAL, NORMAL * NORMAL];
    let first = z * (z2 + 1.0) / 4.0;
    let second = z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let third = z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    z + (first + (second + third / n) / n) / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_have_the_interval_of_students_distribution() {
        // 1, 2 and 3: the sample's deviation is 1, so that the interval is 2 ± 4.303 / √3.
        let [low, high] = mean_interval_95(2.0, (2.0_f64 / 3.0).sqrt(), 3).unwrap();
        let half = 4.302_653 / 3.0_f64.sqrt();
        assert!((low - 2.0 + half).abs() < 1e-9 && (high - 2.0 - half).abs() < 1e-9);
        assert_eq!(mean_interval_95(2.0, 0.0, 9), Some([2.0, 2.0]));
        assert_eq!(
            [0, 1].map(|count| mean_interval_95(2.0, 0.0, count)),
            [None; 2]
        );
    }

    #[test]
    fn quantiles_agree_with_published_tables() {
        for (degrees, published) in [
            (1, 12.706),
            (2, 4.303),
            (3, 3.182),
            (10, 2.228),
            (11, 2.201),
            (30, 2.042),
            (99, 1.984),
            (1000, 1.962),
        ] {
            let quantile = student(degrees);
            assert!((quantile - published).abs() < 6e-4, "{degrees}: {quantile}");
        }
    }

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
