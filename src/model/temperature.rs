/// Class probabilities at another temperature, in place: `softmax(l / t)` becomes `softmax(l / (t / exponent))`,
/// for logits `l` that need not be known. The order of the classes stays; an exponent above 1 makes them surer,
/// below 1 less sure.
///
/// A temperature `t` is undone by the exponent `t`. NaN stays NaN, and a row of zeros becomes NaN.
///
/// ```
/// use catena::model::temper;
///
/// let mut row = [0.8_f32, 0.2];
/// temper(&mut row, 0.5); // odds of 4 become odds of 2
/// assert!((row[0] - 2.0 / 3.0).abs() < 1e-6);
/// ```
pub fn temper(probabilities: &mut [f32], exponent: f32) {
    let largest = probabilities.iter().copied().fold(0.0, f32::max);
    let mut sum = 0.0;
    for p in probabilities.iter_mut() {
        *p = (*p / largest).powf(exponent);
        sum += *p;
    }
    for p in probabilities {
        *p /= sum;
    }
}

/// The probabilities of classes, for their logits.
pub(crate) fn softmax(logits: &[f64]) -> Vec<f64> {
    let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let odds: Vec<f64> = logits.iter().map(|logit| (logit - largest).exp()).collect();
    let total: f64 = odds.iter().sum();
    odds.into_iter().map(|odd| odd / total).collect()
}

/// Index of the largest value; the first wins a tie, an empty slice gives 0.
pub(crate) fn most_probable<T: PartialOrd>(values: &[T]) -> usize {
    let mut best = 0;
    for (i, v) in values.iter().enumerate() {
        if v > &values[best] {
            best = i;
        }
    }
    best
}

/// The temperature within a range at which a loss is least, by golden sections of its logarithm: the
/// loss has one minimum in the inverse temperature.
pub(crate) fn best_temperature(
    (lowest, highest): (f64, f64),
    sections: usize,
    loss: impl Fn(f64) -> f64,
) -> f64 {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (lowest.ln(), highest.ln());
    for _ in 0..sections {
        let (left, right) = (high - ratio * (high - low), low + ratio * (high - low));
        if loss(left.exp()) < loss(right.exp()) {
            high = right;
        } else {
            low = left;
        }
    }
    f64::midpoint(low, high).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same_and_zeros_stay() {
        let before = [0.7_f32, 0.2, 0.1, 0.0];
        let mut row = before;
        temper(&mut row, 1.0 / 1.7);
        assert!(row[0] < 0.7 && row[2] > 0.1 && row[3] == 0.0, "{row:?}");
        assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        temper(&mut row, 1.7);
        for (a, b) in row.iter().zip(before) {
            assert!((a - b).abs() < 1e-6, "{row:?}");
        }
    }
}
