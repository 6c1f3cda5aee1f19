use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::{Evaluation, wilson_interval_95};

/// How often a method did a task: a small file that is kept, so that an experiment that was cut goes on with
/// what is missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RateCell {
    /// What learnt the task; `ours` is this crate's way.
    pub method: String,
    /// Demonstrations of each task that it learnt from.
    pub demonstrations: usize,
    /// The task.
    pub task: String,
    /// Number of episodes.
    pub episodes: usize,
    /// Seed of the first episode; the others follow one by one.
    pub seed: u64,
    /// Share of episodes in which all subgoals were reached in order, 0..=1.
    pub success_rate: f64,
    /// 95 % Wilson interval of it.
    pub interval_95: [f64; 2],
    /// Digest of all that the figure was to depend on: training, demonstrations, evaluation, version.
    pub digest: String,
    /// The commands that made it.
    pub commands: Vec<String>,
    /// Digests of what it was measured with, by name: the demonstrations of each task, the model, and the image encoder that
    /// somebody else trained where the method has one.
    pub digests: BTreeMap<String, String>,
    /// The commit of the working tree, if it is one.
    pub commit: Option<String>,
    /// The commit that the training began with, which may be an older one; older cells do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training_commit: Option<String>,
    /// Whether it is from a small version of the experiment.
    pub is_quick: bool,
    /// Everything that was measured.
    pub evaluation: Evaluation,
}

/// A success rate that somebody else published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedRate {
    /// The method.
    pub method: &'static str,
    /// Demonstrations of each task.
    pub demonstrations: usize,
    /// Rates in percent of 10 trials of `sock`, `trash` and `wine`.
    pub percent: [u32; 3],
}

/// The tasks of the paper's tables, in their order.
pub const PAPER_TASKS: [&str; 3] = ["sock", "trash", "wine"];

/// Table I of Fu & Finn.
pub const PAPER_TABLE_1: [PublishedRate; 15] = [
    published("ours", 10, [30, 60, 80]),
    published("ours", 20, [60, 80, 90]),
    published("ours", 30, [70, 90, 100]),
    published("bc", 10, [10, 40, 50]),
    published("bc", 20, [30, 50, 60]),
    published("bc", 30, [50, 70, 90]),
    published("bc_rnn", 10, [0, 20, 10]),
    published("bc_rnn", 20, [0, 40, 50]),
    published("bc_rnn", 30, [30, 60, 100]),
    published("rt1", 10, [0, 0, 0]),
    published("rt1", 20, [0, 20, 30]),
    published("rt1", 30, [10, 50, 30]),
    published("mvp", 10, [40, 60, 70]),
    published("mvp", 20, [50, 60, 90]),
    published("mvp", 30, [50, 60, 90]),
];

/// Table III of Fu & Finn.
pub const PAPER_TABLE_3: [PublishedRate; 6] = [
    published("ours", 20, [60, 80, 90]),
    published("siamese", 20, [30, 60, 80]),
    published("pixel_difference", 20, [40, 50, 60]),
    published("frame_stacking", 20, [40, 50, 50]),
    published("only_head", 20, [10, 0, 0]),
    published("only_wrist", 20, [0, 60, 80]),
];

const fn published(
    method: &'static str,
    demonstrations: usize,
    percent: [u32; 3],
) -> PublishedRate {
    PublishedRate {
        method,
        demonstrations,
        percent,
    }
}

/// What the paper's robot did, as a share of 10 trials; none where it was not tried.
#[must_use]
pub fn paper_rate(
    table: &[PublishedRate],
    method: &str,
    demonstrations: usize,
    task: &str,
) -> Option<f64> {
    let row = table
        .iter()
        .find(|r| r.method == method && r.demonstrations == demonstrations)?;
    let column = PAPER_TASKS.iter().position(|t| *t == task)?;
    Some(f64::from(row.percent[column]) / 100.0)
}

/// What the paper's robot did over all tasks, as a share of 30 trials; none where it was not tried.
#[must_use]
pub fn paper_rate_of_all(
    table: &[PublishedRate],
    method: &str,
    demonstrations: usize,
) -> Option<f64> {
    let of = |task: &&str| paper_rate(table, method, demonstrations, task);
    let rates: Option<Vec<f64>> = PAPER_TASKS.iter().map(of).collect();
    rates.map(|rates| rates.iter().sum::<f64>() / rates.len() as f64)
}

/// Success of a method over the tasks of the paper, every episode counting the same; none where one of them was not
/// measured, since tasks differ in how hard they are.
#[must_use]
pub fn rate_of_all<'a>(
    cells: impl Iterator<Item = &'a RateCell> + Clone,
) -> Option<(f64, [f64; 2])> {
    let is_measured = |task: &str| cells.clone().any(|cell| cell.task == task);
    let is_whole = PAPER_TASKS.iter().all(|task| is_measured(task));
    is_whole.then(|| pooled(cells)).flatten()
}

fn pooled<'a>(cells: impl Iterator<Item = &'a RateCell>) -> Option<(f64, [f64; 2])> {
    let (mut successes, mut episodes) = (0, 0);
    for cell in cells {
        successes += (cell.success_rate * cell.episodes as f64).round() as usize;
        episodes += cell.episodes;
    }
    (episodes > 0).then(|| {
        let rate = successes as f64 / episodes as f64;
        (rate, wilson_interval_95(successes, episodes))
    })
}

/// A Markdown table of cells: a row a method and number of demonstrations, in the order of `rows`
/// (`(method, what it is for people, demonstrations)`), a column a task, the paper's rates in brackets.
#[must_use]
pub fn rates_table(
    cells: &[RateCell],
    rows: &[(&str, &str, usize)],
    paper: &[PublishedRate],
) -> String {
    let mut table = String::from("| | demonstrations |");
    for task in PAPER_TASKS {
        let _ = write!(table, " `{task}` |");
    }
    table.push_str(" all three |\n|---|---|");
    table.push_str(&"---|".repeat(PAPER_TASKS.len() + 1));
    table.push('\n');
    for (method, described, demonstrations) in rows {
        let of_row = || {
            cells
                .iter()
                .filter(move |c| c.method == *method && c.demonstrations == *demonstrations)
        };
        let _ = write!(table, "| {described} | {demonstrations} |");
        for task in PAPER_TASKS {
            let measured = pooled(of_row().filter(|c| c.task == task));
            let papers = paper_rate(paper, method, *demonstrations, task);
            let _ = write!(table, " {} |", printed(measured, papers));
        }
        let papers = paper_rate_of_all(paper, method, *demonstrations);
        let _ = writeln!(table, " {} |", printed(rate_of_all(of_row()), papers));
    }
    table
}

/// A rate with its interval, and the paper's beside it.
fn printed(measured: Option<(f64, [f64; 2])>, papers: Option<f64>) -> String {
    let mut text = measured.map_or_else(
        || "not measured".to_owned(),
        |(rate, interval)| {
            let [low, high] = interval.map(|share| 100.0 * share);
            format!("**{:.0} %** {low:.0}-{high:.0}", 100.0 * rate)
        },
    );
    if let Some(rate) = papers {
        let _ = write!(text, " (paper {:.0})", 100.0 * rate);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(method: &str, task: &str, successes: usize, episodes: usize) -> RateCell {
        RateCell {
            method: method.to_owned(),
            demonstrations: 20,
            task: task.to_owned(),
            episodes,
            seed: 1,
            success_rate: successes as f64 / episodes as f64,
            interval_95: wilson_interval_95(successes, episodes),
            digest: String::new(),
            commands: Vec::new(),
            digests: BTreeMap::new(),
            commit: None,
            training_commit: None,
            is_quick: false,
            evaluation: Evaluation::new(task, "paper", 1, "tract", &[], Vec::new()),
        }
    }

    #[test]
    fn a_row_has_its_cells_the_papers_and_all_episodes_together() {
        let cells = [
            cell("ours", "sock", 3, 10),
            cell("ours", "trash", 3, 10),
            cell("ours", "wine", 9, 10),
        ];
        let rows = [("ours", "latent flow", 20), ("siamese", "Siamese", 20)];
        let table = rates_table(&cells, &rows, &PAPER_TABLE_3);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(
            lines[2],
            "| latent flow | 20 | **30 %** 11-60 (paper 60) | **30 %** 11-60 (paper 80) | \
             **90 %** 60-98 (paper 90) | **50 %** 33-67 (paper 77) |"
        );
        assert!(lines[3].starts_with("| Siamese | 20 | not measured (paper 30) |"));
    }

    #[test]
    fn tasks_that_were_measured_do_not_stand_for_those_that_were_not() {
        let cells = [cell("ours", "sock", 3, 10), cell("ours", "wine", 9, 10)];
        assert_eq!(rate_of_all(cells.iter()), None);
        let table = rates_table(&cells, &[("ours", "latent flow", 20)], &PAPER_TABLE_3);
        let row = table.lines().last().unwrap();
        assert!(
            row.ends_with("**90 %** 60-98 (paper 90) | not measured (paper 77) |"),
            "{row}"
        );
    }

    #[test]
    fn the_papers_rates_are_found_by_method_number_and_task() {
        assert_eq!(paper_rate(&PAPER_TABLE_1, "mvp", 10, "wine"), Some(0.7));
        assert_eq!(paper_rate(&PAPER_TABLE_1, "mvp", 15, "wine"), None);
        assert_eq!(
            paper_rate(&PAPER_TABLE_3, "only_head", 20, "sock"),
            Some(0.1)
        );
        let all = paper_rate_of_all(&PAPER_TABLE_1, "mvp", 10).unwrap();
        assert!((all - 17.0 / 30.0).abs() < 1e-9, "{all}");
        assert_eq!(paper_rate_of_all(&PAPER_TABLE_1, "mvp", 15), None);
    }
}
