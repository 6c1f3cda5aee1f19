use std::fmt::Write as _;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Validation losses of one training: a small file that is kept, as [`RateCell`](super::RateCell) is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LossCurve {
    /// The network.
    pub method: String,
    /// Demonstrations of each task, all tasks together in one network.
    pub demonstrations: usize,
    /// Seed of the training.
    pub seed: u64,
    /// Number of weights.
    pub weights: usize,
    /// Digest of all that the curve was to depend on.
    pub digest: String,
    /// The commands that made it.
    pub commands: Vec<String>,
    /// The commit of the working tree, if it is one.
    pub commit: Option<String>,
    /// Whether it is from a small version of the experiment.
    pub is_quick: bool,
    /// The training's configuration.
    pub config: Value,
    /// The validations in order.
    pub points: Vec<LossPoint>,
}

/// One validation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LossPoint {
    /// Optimiser steps so far.
    pub step: u64,
    /// Loss of the traversability function on held-out pairs.
    pub traversability: f64,
    /// Cross-entropy of the policy on held-out pairs.
    pub policy: f64,
}

impl LossPoint {
    /// The validations of a `losses.csv` of a run folder. Rows without a validation are passed over.
    #[must_use]
    pub fn of_csv(text: &str) -> Vec<Self> {
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let column = |name: &str| header.iter().position(|c| *c == name);
        let (Some(step), Some(traversability), Some(policy)) = (
            column("step"),
            column("validation_traversability_loss"),
            column("validation_policy_loss"),
        ) else {
            return Vec::new();
        };
        lines
            .filter_map(|line| {
                let values: Vec<&str> = line.split(',').collect();
                Some(Self {
                    step: values.get(step)?.parse().ok()?,
                    traversability: values.get(traversability)?.parse().ok()?,
                    policy: values.get(policy)?.parse().ok()?,
                })
            })
            .collect()
    }
}

impl LossCurve {
    /// The least losses of the traversability function and of the policy, each at its own step.
    #[must_use]
    pub fn least(&self) -> Option<(f64, f64)> {
        let least =
            |value: fn(&LossPoint) -> f64| self.points.iter().map(value).min_by(f64::total_cmp);
        Some((least(|p| p.traversability)?, least(|p| p.policy)?))
    }

    /// The mean over curves of the same steps, step by step; as long as the shortest.
    #[must_use]
    pub fn mean(curves: &[&Self]) -> Vec<LossPoint> {
        let length = curves.iter().map(|c| c.points.len()).min().unwrap_or(0);
        let count = curves.len() as f64;
        (0..length)
            .map(|i| LossPoint {
                step: curves[0].points[i].step,
                traversability: curves
                    .iter()
                    .map(|c| c.points[i].traversability)
                    .sum::<f64>()
                    / count,
                policy: curves.iter().map(|c| c.points[i].policy).sum::<f64>() / count,
            })
            .collect()
    }
}

/// A Markdown table of the least validation losses: a row a method of `rows` (`(method, what it is for
/// people)`), means over its seeds with the least and the largest.
#[must_use]
pub fn losses_table(curves: &[LossCurve], rows: &[(&str, &str)]) -> String {
    let mut table = String::from(
        "| | weights | seeds | traversability loss | policy loss |\n|---|---|---|---|---|\n",
    );
    for (method, described) in rows {
        let of_row: Vec<&LossCurve> = curves.iter().filter(|c| c.method == *method).collect();
        let least: Vec<(f64, f64)> = of_row.iter().filter_map(|c| c.least()).collect();
        let Some(first) = of_row.first().filter(|_| !least.is_empty()) else {
            let _ = writeln!(table, "| {described} | | 0 | not measured | not measured |");
            continue;
        };
        let printed = |value: fn(&(f64, f64)) -> f64| {
            let values: Vec<f64> = least.iter().map(value).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(0.0, f64::max);
            format!("**{mean:.3}** {low:.3}-{high:.3}")
        };
        let _ = writeln!(
            table,
            "| {described} | {} | {} | {} | {} |",
            first.weights,
            least.len(),
            printed(|l| l.0),
            printed(|l| l.1)
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(seed: u64, losses: &[(f64, f64)]) -> LossCurve {
        LossCurve {
            method: "ours".to_owned(),
            demonstrations: 20,
            seed,
            weights: 7,
            digest: String::new(),
            commands: Vec::new(),
            commit: None,
            is_quick: false,
            config: Value::Null,
            points: (losses.iter().enumerate())
                .map(|(i, (traversability, policy))| LossPoint {
                    step: 10 * i as u64,
                    traversability: *traversability,
                    policy: *policy,
                })
                .collect(),
        }
    }

    #[test]
    fn rows_with_a_validation_are_read_by_the_names_of_their_columns() {
        let csv = "step,x,validation_policy_loss,validation_traversability_loss\n1,0,,\n2,0,0.5,1.5\nbroken\n";
        let point = LossPoint {
            step: 2,
            traversability: 1.5,
            policy: 0.5,
        };
        assert_eq!(LossPoint::of_csv(csv), [point]);
        assert!(LossPoint::of_csv("").is_empty());
    }

    #[test]
    fn the_table_has_the_least_of_each_curve() {
        let curves = [
            curve(1, &[(3.0, 2.0), (1.0, 1.5)]),
            curve(2, &[(2.0, 1.0), (2.5, 3.0)]),
        ];
        let table = losses_table(&curves, &[("ours", "latent flow"), ("siamese", "Siamese")]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(
            lines[2],
            "| latent flow | 7 | 2 | **1.500** 1.000-2.000 | **1.250** 1.000-1.500 |"
        );
        assert_eq!(lines[3], "| Siamese | | 0 | not measured | not measured |");
        let mean = LossCurve::mean(&[&curves[0], &curves[1]]);
        assert!((mean[1].traversability - 1.75).abs() < 1e-12 && mean[1].step == 10);
    }
}
