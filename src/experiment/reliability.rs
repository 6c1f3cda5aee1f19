use serde::{Deserialize, Serialize};

/// Bins of a reliability diagram, equally wide.
const BINS: usize = 10;

/// A statement with a probability, and whether it held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// The probability that was given to it, 0..=1.
    pub confidence: f64,
    /// Whether it is true.
    pub is_true: bool,
    /// What it counts, above 0.
    pub weight: f64,
}

/// One bin of a reliability diagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// Statements in it.
    pub count: usize,
    /// Their share (0..=1) of the weight of all.
    pub share: f64,
    /// Mean of the probabilities that were given, 0..=1.
    pub confidence: f64,
    /// Share (0..=1) of their weight that was true.
    pub accuracy: f64,
}

/// How far the probabilities of statements are from how often they hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// Expected calibration error, 0..=1: the mean distance of confidence and accuracy over the bins, each by its share
    /// (Guo et al., *On Calibration of Modern Neural Networks*, 2017, section 2).
    pub expected_calibration_error: f64,
    /// Mean squared distance of the probability from 1 where the statement holds and from 0 where it does not.
    pub brier_score: f64,
    /// Ten bins of probability, 0 to 0.1 first; a bin without statements is all zeros.
    pub bins: Vec<ReliabilityBin>,
}

impl Reliability {
    /// Sorts forecasts into bins; no forecasts give errors of 0.
    ///
    /// ```
    /// use catena::experiment::{Forecast, Reliability};
    ///
    /// let said = |confidence, is_true| Forecast { confidence, is_true, weight: 1.0 };
    /// // Sure of 95 %, and right in one case of two.
    /// let reliability = Reliability::new([said(0.95, true), said(0.95, false)]);
    /// assert!((reliability.expected_calibration_error - 0.45).abs() < 1e-12);
    /// assert_eq!(reliability.bins[9].count, 2);
    /// ```
    #[must_use]
    pub fn new(forecasts: impl IntoIterator<Item = Forecast>) -> Self {
        let mut bins = vec![ReliabilityBin::default(); BINS];
        let (mut weight, mut squares) = (0.0, 0.0);
        for forecast in forecasts {
            let bin = (forecast.confidence * BINS as f64) as usize;
            let bin = &mut bins[bin.min(BINS - 1)];
            let truth = f64::from(u8::from(forecast.is_true));
            bin.count += 1;
            bin.share += forecast.weight;
            bin.confidence += forecast.weight * forecast.confidence;
            bin.accuracy += forecast.weight * truth;
            weight += forecast.weight;
            squares += forecast.weight * (forecast.confidence - truth).powi(2);
        }
        for bin in bins.iter_mut().filter(|b| b.count > 0) {
            bin.confidence /= bin.share;
            bin.accuracy /= bin.share;
            bin.share /= weight;
        }
        let errors = bins
            .iter()
            .map(|b| b.share * (b.confidence - b.accuracy).abs());
        Self {
            expected_calibration_error: errors.sum(),
            brier_score: if weight > 0.0 { squares / weight } else { 0.0 },
            bins,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(confidence: f64, is_true: bool, weight: f64) -> Forecast {
        Forecast {
            confidence,
            is_true,
            weight,
        }
    }

    #[test]
    fn errors_by_hand() {
        // A quarter of the weight is 0.9 sure and always wrong, the rest is right as often as it says.
        let forecasts = [
            said(0.9, false, 1.0),
            said(0.5, true, 1.5),
            said(0.5, false, 1.5),
        ];
        let r = Reliability::new(forecasts);
        assert!((r.expected_calibration_error - 0.25 * 0.9).abs() < 1e-12);
        assert!((r.brier_score - (0.81 + 3.0 * 0.25) / 4.0).abs() < 1e-12);
        assert_eq!((r.bins[9].count, r.bins[5].count), (1, 2));
        assert!((r.bins[5].share - 0.75).abs() < 1e-12);
    }

    #[test]
    fn certainty_is_in_the_last_bin_and_nothing_has_no_error() {
        assert_eq!(Reliability::new([said(1.0, true, 1.0)]).bins[9].count, 1);
        let none = Reliability::new([]);
        assert_eq!(
            (none.expected_calibration_error, none.brier_score),
            (0.0, 0.0)
        );
    }
}
