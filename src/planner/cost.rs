use serde::{Deserialize, Serialize};

use crate::graph::Edge;

/// What it costs to go from one state to another, out of class probabilities. Every cost is at
/// least 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeCost {
    /// The most probable class; no edge where that is `d_max` (Fu & Finn, section III-D).
    Argmax,
    /// The expected number of steps, when a pair that turns out not to be connected costs
    /// `disconnected_steps`.
    Expected {
        /// At least `d_max`; about as long as a demonstration.
        disconnected_steps: f64,
    },
    /// The most probable number of steps below `d_max`, plus `lambda * -ln P(connected)`: with
    /// `lambda` 3, an even chance costs two steps more.
    RiskAverse {
        /// Steps that a loss of certainty by a factor of e is worth; not negative.
        lambda: f64,
    },
}

/// What an edge costs, and how many steps it is predicted to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    /// What a plan adds up.
    pub cost: f64,
    /// Predicted steps, `1..d_max`.
    pub steps: u32,
}

impl EdgeCost {
    /// The price of class probabilities, or `None` when they are no edge: NaN in them, certainty that
    /// the pair is not connected, or `d_max` the most probable class where the cost is
    /// [`Argmax`](Self::Argmax).
    #[must_use]
    pub fn price(&self, probabilities: &[f32]) -> Option<Price> {
        let (far, connected) = probabilities.split_last()?;
        let probability = 1.0 - f64::from(*far);
        let class = most_probable(connected)?;
        if probability.is_nan() || probability <= 0.0 {
            return None;
        }
        let steps = class as u32 + 1;
        let cost = match self {
            Self::Argmax => (connected[class] >= *far).then_some(f64::from(steps))?,
            Self::Expected { disconnected_steps } => {
                let near: f64 = connected
                    .iter()
                    .enumerate()
                    .map(|(k, p)| (k + 1) as f64 * f64::from(*p))
                    .sum();
                near + f64::from(*far) * disconnected_steps
            }
            Self::RiskAverse { lambda } => f64::from(steps) - lambda * probability.min(1.0).ln(),
        };
        Some(Price {
            cost: cost.max(1.0),
            steps,
        })
    }

    /// The price of an edge of the graph.
    #[must_use]
    pub fn price_edge(&self, edge: &Edge) -> Option<Price> {
        self.price(&edge.probabilities)
    }
}

fn most_probable(connected: &[f32]) -> Option<usize> {
    let mut best = 0;
    for (class, p) in connected.iter().enumerate() {
        if p.is_nan() {
            return None;
        }
        if *p > connected[best] {
            best = class;
        }
    }
    (!connected.is_empty()).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_by_hand() {
        let sure = [0.0, 1.0, 0.0, 0.0];
        let doubtful = [0.1, 0.3, 0.1, 0.5];
        let risk = EdgeCost::RiskAverse { lambda: 3.0 };
        let expected = EdgeCost::Expected {
            disconnected_steps: 40.0,
        };
        let cost = |c: EdgeCost, p: &[f32]| c.price(p).map(|p| p.cost);
        assert_eq!(cost(EdgeCost::Argmax, &sure), Some(2.0));
        assert_eq!(cost(EdgeCost::Argmax, &doubtful), None);
        assert_eq!(cost(risk, &sure), Some(2.0));
        assert!((cost(risk, &doubtful).unwrap() - (2.0 + 3.0 * 2_f64.ln())).abs() < 1e-6);
        assert!((cost(expected, &doubtful).unwrap() - (0.1 + 0.6 + 0.3 + 20.0)).abs() < 1e-5);
    }

    #[test]
    fn nan_and_impossible_pairs_have_no_price() {
        let risk = EdgeCost::RiskAverse { lambda: 3.0 };
        assert_eq!(risk.price(&[f32::NAN, 0.5, 0.5]), None);
        assert_eq!(risk.price(&[0.5, 0.5, f32::NAN]), None);
        assert_eq!(risk.price(&[0.0, 0.0, 1.0]), None);
        assert_eq!(risk.price(&[]), None);
    }
}
