//! What a person reads of [`EdgeTrust`].

use std::fmt;

use super::EdgeTrust;
use crate::graph::EdgeKind;

impl fmt::Display for EdgeTrust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} demonstrations, {} states, d_max {}, temperature {:.2}\n",
            self.demonstrations, self.states, self.d_max, self.temperature
        )?;
        self.write_calibration(f)?;
        self.write_edges(f)?;
        self.write_walks(f)?;
        self.write_options(f)
    }
}

impl EdgeTrust {
    fn write_calibration(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<28} {:>8} {:>9}   {:<18} {:<19} best temperature",
            "expected calibration error",
            "pairs",
            "connected",
            "connected or not",
            "most probable class"
        )?;
        for score in &self.calibration {
            let errors = [&score.connected, &score.class].map(|both| {
                let [before, after] =
                    [&both.before, &both.after].map(|r| r.expected_calibration_error);
                format!("{before:.3} -> {after:.3}")
            });
            writeln!(
                f,
                "  {:<26} {:>8} {:>7.1} %   {:<18} {:<19} {:>16.2}",
                score.population.name(),
                score.pairs,
                100.0 * score.connected_share,
                errors[0],
                errors[1],
                score.best_temperature
            )?;
        }
        for score in &self.calibration {
            writeln!(
                f,
                "\n{}: P(connected) said, and how many are connected",
                score.population.name()
            )?;
            for (before, after) in score
                .connected
                .before
                .bins
                .iter()
                .zip(&score.connected.after.bins)
            {
                let told = [before, after].map(|bin| match bin.count {
                    0 => format!("{:>22}", "-"),
                    count => format!("{:>6.3} {:>6.3} ({count:>6})", bin.confidence, bin.accuracy),
                });
                writeln!(f, "  before {}   after {}", told[0], told[1])?;
            }
        }
        writeln!(f)
    }

    fn write_edges(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<30} {:>7}  {:>8} {:>11} {:>12} {:>12} {:>13}   to half a primitive",
            "false edges",
            "edges",
            "false",
            "wormholes",
            "impossible",
            "understated",
            "median error"
        )?;
        for tally in &self.edges {
            let of = match tally.kind {
                EdgeKind::CrossTask => format!("{} -> {}", tally.from_task, tally.to_task),
                _ => format!("within {}", tally.from_task),
            };
            let (wide, narrow) = (&tally.within_one_primitive, &tally.within_half_a_primitive);
            let share = |count: usize| 100.0 * count as f64 / tally.edges.max(1) as f64;
            let median = wide
                .median_error_steps
                .map_or_else(|| "-".to_owned(), |m| format!("{m:+.0} steps"));
            writeln!(
                f,
                "  {of:<28} {:>7}  {:>6.1} % {:>9.1} % {:>10.1} % {:>10.1} % {median:>13}   {:>5.1} %",
                tally.edges,
                100.0 * wide.share,
                share(wide.wormholes),
                share(wide.impossible),
                share(wide.understated),
                100.0 * narrow.share
            )?;
        }
        writeln!(f)
    }

    fn write_walks(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, score) in [("true", &self.true_walks), ("false", &self.false_walks)] {
            writeln!(
                f,
                "of {} {what} edges that were walked, {} lead there, {} in fewer than {} steps; {:+.0} steps at the median",
                score.walks,
                score.arrived,
                score.arrived_near,
                self.d_max,
                score.median_extra_steps
            )?;
        }
        writeln!(f)
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<38} {:>8} {:>7} {:>7} {:>10}  {:>6} {:>6} {:>8} {:>6} {:>10} {:>10}",
            "options",
            "learned",
            "cross",
            "false",
            "wormholes",
            "plans",
            "cost",
            "claimed",
            "true",
            "false in",
            "wormholes"
        )?;
        for effect in &self.options {
            writeln!(
                f,
                "  {:<36} {:>8} {:>7} {:>5.1} % {:>8.1} %  {:>2}/{:<3} {:>6.1} {:>8.1} {:>6.1} {:>10.1} {:>10.1}",
                effect.options.name,
                effect.learned_edges,
                effect.cross_task_edges,
                100.0 * effect.false_share,
                100.0 * effect.wormhole_share,
                effect.plans,
                effect.starts,
                effect.mean_cost,
                effect.mean_claimed_steps,
                effect.mean_true_steps,
                effect.mean_false_edges,
                effect.mean_wormholes
            )?;
        }
        Ok(())
    }
}
