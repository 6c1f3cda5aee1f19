use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Score, ShortcutDetection, SubgoalOutcome, wilson_interval_95};
use crate::rollout::{Episode, EpisodeEnd, Event, StepTimes};
use crate::task::Subgoal;
use crate::wording::counted;

/// One scored episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeResult {
    /// The seed that started it.
    pub seed: u64,
    /// Whether all subgoals were reached in order.
    pub success: bool,
    /// Time steps that it took.
    pub steps: usize,
    /// How it ended, such as `finished` or `out_of_steps`.
    pub ended: String,
    /// What became of each subgoal.
    pub outcomes: Vec<SubgoalOutcome>,
    /// The first step at which each subgoal held.
    pub first_steps: Vec<Option<usize>>,
    /// The first step at which a subgoal held before an earlier one had; none without a shortcut.
    #[serde(default)]
    pub shortcut_step: Option<usize>,
    /// The first step at which the monitor flagged a shortcut; none where it saw none.
    #[serde(default)]
    pub flagged_step: Option<usize>,
    /// What that first flag said was skipped, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub flagged_skipped: Vec<String>,
    /// Shortcuts that the monitor flagged.
    pub shortcuts_flagged: usize,
    /// Steps at which the robot was lost.
    pub lost_steps: usize,
    /// Time that each step took to see, localise, plan and act, in milliseconds, without the simulator.
    #[serde(skip)]
    pub step_times_ms: Vec<f64>,
}

/// How often a subgoal was reached, skipped and missed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubgoalTally {
    /// The subgoal's name.
    pub name: String,
    /// Episodes in which it was reached in order.
    pub reached: usize,
    /// Episodes in which a later one was reached first.
    pub skipped: usize,
    /// Episodes in which it was not reached, nor anything later.
    pub missed: usize,
    /// Episodes in which it and all earlier ones were reached in order. Of two that follow each other the
    /// second divided by the first is how probable it is from where the robot really was.
    #[serde(default)]
    pub in_order: usize,
}

/// A success rate with what is needed to judge it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// What was evaluated: a task's or a composition's name.
    pub name: String,
    /// Level of variation of the world.
    pub level: String,
    /// Seed of the first episode; the others follow it one by one.
    pub seed: u64,
    /// Number of episodes.
    pub episodes: usize,
    /// Share of episodes in which all subgoals were reached in order, 0..=1.
    pub success_rate: f64,
    /// 95 % Wilson interval of the success rate.
    pub interval_95: [f64; 2],
    /// Median number of time steps of the successful episodes, the upper one of an even number; none if there is none.
    pub steps_median: Option<usize>,
    /// Every subgoal in order.
    pub subgoals: Vec<SubgoalTally>,
    /// Median time of a step (see, localise, plan, act) in milliseconds, the lower one of an even number.
    pub step_median_ms: f64,
    /// 99th percentile of it.
    pub step_p99_ms: f64,
    /// Share of all steps at which the robot was lost, 0..=1.
    pub lost_share: f64,
    /// How well the monitor noticed shortcuts.
    pub detection: ShortcutDetection,
    /// The inference engine.
    pub engine: String,
    /// Every episode.
    pub results: Vec<EpisodeResult>,
}

impl EpisodeResult {
    /// Puts together what the run said of itself and what the truth says of it.
    #[must_use]
    pub fn new(seed: u64, episode: &Episode, score: &Score) -> Self {
        let events = episode.events.iter();
        let flags: Vec<(usize, &[Subgoal])> = events.filter_map(Event::shortcut).collect();
        let first = flags.first();
        let skipped = first.into_iter().flat_map(|(_, skipped)| *skipped);
        let ended = match &episode.end {
            EpisodeEnd::Finished => "finished".to_owned(),
            EpisodeEnd::OutOfSteps => "out_of_steps".to_owned(),
            EpisodeEnd::Shortcut => "shortcut".to_owned(),
            EpisodeEnd::NoPath(why) => format!("no_path: {why}"),
        };
        Self {
            seed,
            success: score.is_success(),
            steps: episode.steps,
            ended,
            outcomes: score.outcomes(),
            first_steps: score.first_steps().to_vec(),
            shortcut_step: score.shortcut_step(),
            flagged_step: first.map(|(step, _)| *step),
            flagged_skipped: skipped.map(|s| s.name.clone()).collect(),
            shortcuts_flagged: flags.len(),
            lost_steps: episode.lost_steps,
            step_times_ms: episode.times.iter().map(StepTimes::total_ms).collect(),
        }
    }
}

impl Evaluation {
    /// Sums up episodes of one composition, whose subgoals are named in order.
    ///
    /// # Panics
    /// If an episode has fewer outcomes than there are subgoals.
    #[must_use]
    pub fn new(
        name: &str,
        level: &str,
        seed: u64,
        engine: &str,
        subgoals: &[String],
        results: Vec<EpisodeResult>,
    ) -> Self {
        let successes: Vec<_> = results.iter().filter(|r| r.success).collect();
        let mut times: Vec<f64> = results
            .iter()
            .flat_map(|r| r.step_times_ms.clone())
            .collect();
        times.sort_by(f64::total_cmp);
        let mut steps: Vec<_> = successes.iter().map(|r| r.steps).collect();
        steps.sort_unstable();
        let all_steps: usize = results.iter().map(|r| r.steps).sum();
        let lost: usize = results.iter().map(|r| r.lost_steps).sum();
        Self {
            name: name.to_owned(),
            level: level.to_owned(),
            seed,
            episodes: results.len(),
            success_rate: successes.len() as f64 / results.len().max(1) as f64,
            interval_95: wilson_interval_95(successes.len(), results.len()),
            steps_median: steps.get(steps.len() / 2).copied(),
            subgoals: tally(subgoals, &results),
            step_median_ms: quantile(&times, 0.5),
            step_p99_ms: quantile(&times, 0.99),
            lost_share: lost as f64 / all_steps.max(1) as f64,
            detection: ShortcutDetection::new(
                results.iter().map(|r| (r.shortcut_step, r.flagged_step)),
            ),
            engine: engine.to_owned(),
            results,
        }
    }
}

fn tally(subgoals: &[String], results: &[EpisodeResult]) -> Vec<SubgoalTally> {
    let count = |i: usize, outcome| results.iter().filter(|r| r.outcomes[i] == outcome).count();
    subgoals
        .iter()
        .enumerate()
        .map(|(i, name)| SubgoalTally {
            name: name.clone(),
            reached: count(i, SubgoalOutcome::Reached),
            skipped: count(i, SubgoalOutcome::Skipped),
            missed: count(i, SubgoalOutcome::Missed),
            in_order: results
                .iter()
                .filter(|r| {
                    r.outcomes[..=i]
                        .iter()
                        .all(|o| *o == SubgoalOutcome::Reached)
                })
                .count(),
        })
        .collect()
}

/// The value below which a share of sorted values lies (nearest rank: as a median the lower one of an even number); 0
/// for no values.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or(0.0)
}

impl fmt::Display for Evaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [low, high] = self.interval_95.map(|x| 100.0 * x);
        writeln!(
            f,
            "{}: {:.0} % of {} (95 % interval {low:.0}-{high:.0} %), level {}, seeds {}..={}",
            self.name,
            100.0 * self.success_rate,
            counted(self.episodes, "episode"),
            self.level,
            self.seed,
            self.seed + (self.episodes as u64).saturating_sub(1),
        )?;
        writeln!(
            f,
            "  {:<16} {:>8} {:>8} {:>8} {:>10}",
            "subgoal", "reached", "skipped", "missed", "all so far"
        )?;
        for s in &self.subgoals {
            writeln!(
                f,
                "  {:<16} {:>8} {:>8} {:>8} {:>10}",
                s.name, s.reached, s.skipped, s.missed, s.in_order
            )?;
        }
        writeln!(f, "  {}", self.detection)?;
        if let Some(steps) = self.steps_median {
            writeln!(f, "  median steps of a success: {steps}")?;
        }
        write!(
            f,
            "  a step takes {:.1} ms at the median, {:.1} ms at the 99th percentile ({}); lost in {:.1} % of steps",
            self.step_median_ms,
            self.step_p99_ms,
            self.engine,
            100.0 * self.lost_share
        )
    }
}

#[cfg(test)]
mod tests {
    use super::SubgoalOutcome::{Missed, Reached, Skipped};
    use super::*;

    fn episode(seed: u64, success: bool, outcomes: [SubgoalOutcome; 2]) -> EpisodeResult {
        EpisodeResult {
            seed,
            success,
            steps: 10 + seed as usize,
            ended: "finished".to_owned(),
            outcomes: outcomes.to_vec(),
            first_steps: vec![None; 2],
            shortcut_step: None,
            flagged_step: None,
            flagged_skipped: Vec::new(),
            shortcuts_flagged: 0,
            lost_steps: 1,
            step_times_ms: vec![1.0, 2.0, 3.0, 100.0],
        }
    }

    #[test]
    fn sums_up_by_hand() {
        let results = vec![
            episode(0, true, [Reached, Reached]),
            episode(1, false, [Skipped, Reached]),
            episode(2, false, [Reached, Missed]),
        ];
        let names = ["a".to_owned(), "b".to_owned()];
        let e = Evaluation::new("t", "paper", 0, "tract", &names, results);
        assert!((e.success_rate - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(e.steps_median, Some(10));
        assert_eq!((e.subgoals[0].reached, e.subgoals[0].skipped), (2, 1));
        assert_eq!((e.subgoals[1].reached, e.subgoals[1].missed), (2, 1));
        assert_eq!((e.subgoals[0].in_order, e.subgoals[1].in_order), (2, 1));
        assert!((e.step_median_ms - 2.0).abs() < 1e-12);
        assert!((e.step_p99_ms - 100.0).abs() < 1e-12);
        assert!((e.lost_share - 3.0 / 33.0).abs() < 1e-12);
    }
}
