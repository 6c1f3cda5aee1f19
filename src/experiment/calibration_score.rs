use serde::{Deserialize, Serialize};

use super::{Forecast, Reliability};
use crate::model::{best_temperature, most_probable, temper};

/// Temperatures among which the best one is looked for.
const TEMPERATURES: (f64, f64) = (0.2, 20.0);
const SECTIONS: usize = 20;

/// Which pairs of states are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Population {
    /// All ordered pairs of states of one demonstration, labelled by their distance in time as in training: near ones,
    /// 1 to `d_max - 1` steps, have half of the weight, the others the other half.
    SameDemonstration,
    /// Pairs of different demonstrations of a task, drawn uniformly and labelled by the simulator.
    OtherDemonstration,
    /// The learned edges of a graph: the pairs of different demonstrations that the network takes for near.
    LearnedEdges,
    /// The edges between tasks.
    CrossTaskEdges,
}

impl Population {
    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SameDemonstration => "pairs of one demonstration",
            Self::OtherDemonstration => "pairs of two demonstrations",
            Self::LearnedEdges => "learned edges",
            Self::CrossTaskEdges => "cross-task edges",
        }
    }
}

/// The same statements before calibration, at temperature 1, and after, at the model's temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeforeAndAfter {
    /// At temperature 1.
    pub before: Reliability,
    /// At the model's temperature.
    pub after: Reliability,
}

/// How well calibrated a traversability function is on pairs of states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationScore {
    /// Which pairs.
    pub population: Population,
    /// How many.
    pub pairs: usize,
    /// Share (0..=1) of their weight that is connected, fewer than `d_max` steps apart.
    pub connected_share: f64,
    /// The statement "fewer than `d_max` steps apart".
    pub connected: BeforeAndAfter,
    /// The statement that the most probable class is the right one.
    pub class: BeforeAndAfter,
    /// The temperature, 0.2 to 20, at which the true classes of these pairs have the largest likelihood.
    pub best_temperature: f64,
}

/// A pair with its calibrated class probabilities and its true class.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct JudgedPair {
    pub(super) probabilities: Vec<f32>,
    /// Steps minus 1, at most `d_max - 1`.
    pub(super) class: usize,
    pub(super) weight: f64,
}

impl CalibrationScore {
    /// Judges pairs whose probabilities are those at `temperature`.
    pub(super) fn new(population: Population, pairs: &[JudgedPair], temperature: f32) -> Self {
        let raw: Vec<JudgedPair> = pairs
            .iter()
            .cloned()
            .map(|mut pair| {
                temper(&mut pair.probabilities, temperature);
                pair
            })
            .collect();
        let both = |forecast: fn(&JudgedPair) -> Forecast| BeforeAndAfter {
            before: Reliability::new(raw.iter().map(forecast)),
            after: Reliability::new(pairs.iter().map(forecast)),
        };
        let weight: f64 = pairs.iter().map(|p| p.weight).sum();
        let near = pairs.iter().filter(|p| p.is_connected());
        let near: f64 = near.map(|p| p.weight).sum();
        Self {
            population,
            pairs: pairs.len(),
            connected_share: if weight > 0.0 { near / weight } else { 0.0 },
            connected: both(JudgedPair::connected),
            class: both(JudgedPair::top_class),
            best_temperature: best_temperature(TEMPERATURES, SECTIONS, |t| loss(&raw, t)),
        }
    }
}

/// Cross-entropy of the true classes at a temperature.
fn loss(raw: &[JudgedPair], temperature: f64) -> f64 {
    /// What a probability that was rounded to 0 is taken for.
    const LEAST: f64 = 1e-30;
    let of_pair = |pair: &JudgedPair| {
        let logits = pair
            .probabilities
            .iter()
            .map(|p| f64::from(*p).max(LEAST).ln() / temperature);
        let logits: Vec<f64> = logits.collect();
        let sum: f64 = logits.iter().map(|l| l.exp()).sum();
        pair.weight * (sum.ln() - logits[pair.class])
    };
    raw.iter().map(of_pair).sum()
}

impl JudgedPair {
    fn is_connected(&self) -> bool {
        self.class + 1 < self.probabilities.len()
    }

    fn connected(&self) -> Forecast {
        let far = self.probabilities.last().copied().unwrap_or(1.0);
        Forecast {
            confidence: 1.0 - f64::from(far),
            is_true: self.is_connected(),
            weight: self.weight,
        }
    }

    fn top_class(&self) -> Forecast {
        let top = most_probable(&self.probabilities);
        Forecast {
            confidence: f64::from(self.probabilities[top]),
            is_true: top == self.class,
            weight: self.weight,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_that_fits_lowers_the_error() {
        // Logits of 4 for what holds in three cases of four: at temperature 3.6 the network says 0.75.
        let temperature = 4.0 / 3.0_f32.ln();
        let pairs: Vec<JudgedPair> = (0..100)
            .map(|i| JudgedPair {
                probabilities: vec![0.75, 0.25],
                class: usize::from(i % 4 == 0),
                weight: 1.0,
            })
            .collect();
        let score = CalibrationScore::new(Population::LearnedEdges, &pairs, temperature);
        assert!((score.connected_share - 0.75).abs() < 1e-9);
        assert!(score.connected.after.expected_calibration_error < 1e-6);
        let before = score.connected.before.expected_calibration_error;
        let said = 1.0 / (1.0 + (-4.0_f64).exp());
        assert!((before - (said - 0.75)).abs() < 1e-5, "{before}");
        assert_eq!(score.class.after.bins[7].count, 100);
        let best = score.best_temperature;
        assert!((best - f64::from(temperature)).abs() < 0.05, "{best}");
    }
}
