use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::mean_interval_95;

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
    /// Digests of what it was measured with, by name: the demonstrations of each task, the model. Older curves have none.
    #[serde(default)]
    pub digests: BTreeMap<String, String>,
    /// The commit of the working tree, if it is one.
    pub commit: Option<String>,
    /// The commit that the training began with, which may be an older one; older cells do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training_commit: Option<String>,
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

/// A Markdown table of the least validation losses: a row a method of `rows` (`(method, what it is for people)`), means over
/// its seeds with the least and the largest, and how much higher they are than those of the first row on the seeds that both have.
/// The seed also draws which demonstrations are held out, so that losses of different seeds are of different ones. From three
/// seeds on a difference has the 95 % interval of its mean over the seeds ([`mean_interval_95`]), and a line below says so.
#[must_use]
pub fn losses_table(curves: &[LossCurve], rows: &[(&str, &str)]) -> String {
    let mut table = String::from(
        "| | weights | seeds | traversability loss | difference to the first row | policy loss | difference to the first row |\n\
         |---|---|---|---|---|---|---|\n",
    );
    let of_row = |method: &str| -> Vec<&LossCurve> {
        let of_row = curves.iter().filter(|c| c.method == method);
        of_row.filter(|c| !c.points.is_empty()).collect()
    };
    let first = rows.first().map_or_else(Vec::new, |(m, _)| of_row(m));
    for (index, (method, described)) in rows.iter().enumerate() {
        let of_row = of_row(method);
        let Some(any) = of_row.first() else {
            let _ = writeln!(
                table,
                "| {described} | | 0 | not measured | | not measured | |"
            );
            continue;
        };
        let beside = if index == 0 { &[][..] } else { &first };
        let _ = writeln!(
            table,
            "| {described} | {} | {} | {} | {} |",
            any.weights,
            of_row.len(),
            losses(&of_row, beside, |least| least.0),
            losses(&of_row, beside, |least| least.1)
        );
    }
    if table.contains(INTERVAL) {
        let _ = writeln!(
            table,
            "\n{INTERVAL}: the 95 % interval of the mean difference over the seeds that both have (Student's t)"
        );
    }
    table
}

/// Fewer seeds than this say little of how much a difference varies.
const LEAST_SEEDS: usize = 3;
/// How an interval is told.
const INTERVAL: &str = "95 %";

/// The least losses of some curves, and how much higher they are than those of others of the same seeds, as two cells.
fn losses(of_row: &[&LossCurve], others: &[&LossCurve], of: fn((f64, f64)) -> f64) -> String {
    let least = |curve: &LossCurve| curve.least().map(of);
    let values: Vec<f64> = of_row.iter().filter_map(|c| least(c)).collect();
    let differences: Vec<f64> = (of_row.iter())
        .filter_map(|curve| {
            let other = others.iter().find(|o| o.seed == curve.seed)?;
            Some(least(curve)? - least(other)?)
        })
        .collect();
    let plain = |value: f64| format!("{value:.3}");
    let signed = |value: f64| format!("{value:+.3}");
    format!(
        "{} | {}{}",
        mean_and_range(&values, plain),
        mean_and_range(&differences, signed),
        interval(&differences, signed)
    )
}

/// The 95 % interval of the mean of values, where they are not too few.
fn interval(values: &[f64], print: impl Fn(f64) -> String) -> String {
    if values.len() < LEAST_SEEDS {
        return String::new();
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    let interval = mean_interval_95(mean, variance.sqrt(), values.len());
    interval.map_or_else(String::new, |[low, high]| {
        format!("; {INTERVAL} {} to {}", print(low), print(high))
    })
}

/// The mean, and from where to where values reach if there are several.
fn mean_and_range(values: &[f64], print: impl Fn(f64) -> String) -> String {
    let mean = print(values.iter().sum::<f64>() / values.len() as f64);
    match values {
        [] => String::new(),
        [_] => format!("**{mean}**"),
        _ => {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("**{mean}** {} to {}", print(low), print(high))
        }
    }
}

/// Of some curves those of the seeds that all methods have which have any.
#[must_use]
pub fn of_common_seeds(curves: &[LossCurve]) -> Vec<&LossCurve> {
    let has = |method: &str, seed: u64| {
        (curves.iter()).any(|other| other.method == method && other.seed == seed)
    };
    let is_common = |seed: u64| curves.iter().all(|other| has(&other.method, seed));
    curves.iter().filter(|c| is_common(c.seed)).collect()
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
            digests: BTreeMap::new(),
            commit: None,
            training_commit: None,
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
    fn the_table_has_the_least_of_each_curve_and_compares_seed_by_seed() {
        let other = |method: &str, curve: LossCurve| LossCurve {
            method: method.to_owned(),
            ..curve
        };
        let curves = [
            curve(1, &[(3.0, 2.0), (1.0, 1.5)]),
            curve(2, &[(2.0, 1.0), (2.5, 3.0)]),
            other("siamese", curve(2, &[(2.25, 0.5)])),
            other("siamese", curve(3, &[(4.0, 4.0)])),
        ];
        let rows = [
            ("ours", "latent flow"),
            ("siamese", "Siamese"),
            ("none", "no curve"),
        ];
        let table = losses_table(&curves, &rows);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(
            lines[2..],
            [
                "| latent flow | 7 | 2 | **1.500** 1.000 to 2.000 |  | **1.250** 1.000 to 1.500 |  |",
                "| Siamese | 7 | 2 | **3.125** 2.250 to 4.000 | **+0.250** | **2.250** 0.500 to 4.000 | **-0.500** |",
                "| no curve | | 0 | not measured | | not measured | |"
            ]
        );
        assert!(!table.contains("95 %"), "two seeds are too few");
        let common = of_common_seeds(&curves);
        assert_eq!(
            common
                .iter()
                .map(|c| (&*c.method, c.seed))
                .collect::<Vec<_>>(),
            [("ours", 2), ("siamese", 2)]
        );
        let mean = LossCurve::mean(&[&curves[0], &curves[1]]);
        assert!((mean[1].traversability - 1.75).abs() < 1e-12 && mean[1].step == 10);
    }

    #[test]
    fn from_three_seeds_on_a_difference_has_its_interval() {
        let siamese = |seed: u64, losses: &[(f64, f64)]| LossCurve {
            method: "siamese".to_owned(),
            ..curve(seed, losses)
        };
        // Differences of 1, 2 and 3: 2 ± 4.303 / √3. The fourth seed has no other to compare with.
        let curves = [
            curve(1, &[(1.0, 1.0)]),
            curve(2, &[(5.0, 1.0)]),
            curve(3, &[(2.0, 1.0)]),
            siamese(1, &[(2.0, 1.0)]),
            siamese(2, &[(7.0, 1.0)]),
            siamese(3, &[(5.0, 1.0)]),
            siamese(4, &[(6.0, 1.0)]),
        ];
        let table = losses_table(&curves, &[("ours", "latent flow"), ("siamese", "Siamese")]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(
            lines[2..4],
            [
                "| latent flow | 7 | 3 | **2.667** 1.000 to 5.000 |  | **1.000** 1.000 to 1.000 |  |",
                "| Siamese | 7 | 4 | **5.000** 2.000 to 7.000 | **+2.000** +1.000 to +3.000; 95 % -0.484 to +4.484 \
                 | **1.000** 1.000 to 1.000 | **+0.000** +0.000 to +0.000; 95 % +0.000 to +0.000 |"
            ]
        );
        assert!(lines[5].starts_with("95 %: the 95 % interval"), "{table}");
    }
}
