use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::{Evaluation, SubgoalTally};
use crate::composer::{Calibration, OnShortcut};
use crate::planner::PlannerOptions;
use crate::rollout::RolloutOptions;
use crate::task::Automaton;

/// The paper's rate for two tasks that were demonstrated apart (Fu & Finn, section IV-B): 2 of 10.
const PAPERS_RATE: f64 = 0.2;

/// A way of running a chain: with all that guards it, with one guard switched off, or with none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChainingMethod {
    /// Everything that guards a chain.
    Ours,
    /// The plan may skip subgoals: the shortest path over the merged graph, as in the paper.
    Unconstrained,
    /// No memory: at each step the robot is believed to be where the image is nearest, and one vote moves
    /// the stage.
    NoFilter,
    /// The network's own probabilities, at temperature 1.
    NoCalibration,
    /// A skipped subgoal is left skipped.
    NoReplanning,
    /// The policy alone drives the steps before the gripper closes or opens.
    NotLed,
    /// All of these switched off, which is nearest to the paper's robot.
    Unguarded,
}

impl ChainingMethod {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 7] = [
        Self::Ours,
        Self::Unconstrained,
        Self::NoFilter,
        Self::NoCalibration,
        Self::NoReplanning,
        Self::NotLed,
        Self::Unguarded,
    ];

    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::Unconstrained => "unconstrained",
            Self::NoFilter => "no_filter",
            Self::NoCalibration => "no_calibration",
            Self::NoReplanning => "no_replanning",
            Self::NotLed => "not_led",
            Self::Unguarded => "unguarded",
        }
    }

    /// What it is, for people.
    #[must_use]
    pub const fn described(self) -> &'static str {
        match self {
            Self::Ours => "all guards",
            Self::Unconstrained => "plan unconstrained (the paper's way)",
            Self::NoFilter => "no filter: nearest state, one vote",
            Self::NoCalibration => "edges not calibrated",
            Self::NoReplanning => "shortcuts reported, not undone",
            Self::NotLed => "last steps by the policy alone, not led",
            Self::Unguarded => "all of these switched off",
        }
    }

    /// Switches the guard off in how a composition is planned.
    pub fn plan(self, planner: &mut PlannerOptions, calibration: &mut Calibration) {
        if self.is_without(Self::Unconstrained) {
            *planner = PlannerOptions::paper();
        }
        if self.is_without(Self::NoCalibration) {
            *calibration = Calibration::None;
        }
    }

    /// Switches the guard off in how it is run.
    pub fn run(self, options: &mut RolloutOptions) {
        if self.is_without(Self::NoFilter) {
            let filter = &mut options.filter;
            filter.restart = 1.0;
            filter.jump = 0.0;
            filter.classifier_weight = 0.0;
            filter.advance_votes = 1;
            filter.regress_votes = filter.regress_votes.map(|_| 1);
        }
        if self.is_without(Self::NoReplanning) {
            options.on_shortcut = OnShortcut::Report;
        }
        if self.is_without(Self::NotLed) {
            options.approach = false;
        }
    }

    /// Whether the guard that another method switches off is switched off.
    fn is_without(self, guard: Self) -> bool {
        self == guard || self == Self::Unguarded
    }
}

/// How probable a part of a chain was, from where the one before it really ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainPart {
    /// A task, or `to` and the task for the way to its first subgoal.
    pub name: String,
    /// Episodes in which it came off, and all before it.
    pub reached: usize,
    /// Episodes in which all before it had come off.
    pub of: usize,
}

impl ChainPart {
    /// The first task as a whole; of each later one the way to its first subgoal and, where it has more, from there to
    /// its last. Rounds of one task that follow each other are taken as one task, whose last subgoal is that of the last
    /// round.
    ///
    /// # Panics
    /// If there are fewer tallies than subgoals.
    #[must_use]
    pub fn of(automaton: &Automaton, subgoals: &[SubgoalTally], episodes: usize) -> Vec<Self> {
        let named = automaton.subgoals().iter();
        let tasks: Vec<&str> = named.map(|subgoal| subgoal.task.as_str()).collect();
        let mut parts = Vec::new();
        let mut before = episodes;
        let mut first = 0;
        for group in tasks.chunk_by(|a, b| a == b) {
            let last = first + group.len() - 1;
            let mut add = |name: String, subgoal: usize| {
                let reached = subgoals[subgoal].in_order;
                parts.push(Self {
                    name,
                    reached,
                    of: before,
                });
                before = reached;
            };
            if first > 0 {
                add(format!("to {}", group[0]), first);
            }
            if first == 0 || last > first {
                add(group[0].to_owned(), last);
            }
            first = last + 1;
        }
        parts
    }
}

/// One method's figures: a small file that is kept, so that an experiment that was cut goes on with what
/// is missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainingCell {
    /// How the chain was run.
    pub method: ChainingMethod,
    /// Number of episodes.
    pub episodes: usize,
    /// Seed of the first episode; the others follow one by one.
    pub seed: u64,
    /// Share of episodes in which all subgoals were reached in order, 0..=1.
    pub success_rate: f64,
    /// 95 % Wilson interval of it.
    pub interval_95: [f64; 2],
    /// The parts of the chain.
    pub parts: Vec<ChainPart>,
    /// Digest of what the figures depend on: composition, model, graphs, method, seeds.
    pub digest: String,
    /// The commands that made it; older cells have none.
    #[serde(default)]
    pub commands: Vec<String>,
    /// Digests of what it was measured with, by name: the model, the graph of each task. Older cells have none.
    #[serde(default)]
    pub digests: BTreeMap<String, String>,
    /// The commit of the working tree, if it is one.
    pub commit: Option<String>,
    /// Whether it is from a small version of the experiment; older cells do not tell.
    #[serde(default)]
    pub is_quick: bool,
    /// Everything that was measured.
    pub evaluation: Evaluation,
}

impl ChainingCell {
    /// A cell out of an evaluation, of a whole experiment, which names no commands and digests.
    ///
    /// # Panics
    /// If the evaluation has fewer subgoals than the automaton.
    #[must_use]
    pub fn new(
        method: ChainingMethod,
        automaton: &Automaton,
        evaluation: Evaluation,
        digest: String,
        commit: Option<String>,
    ) -> Self {
        Self {
            method,
            episodes: evaluation.episodes,
            seed: evaluation.seed,
            success_rate: evaluation.success_rate,
            interval_95: evaluation.interval_95,
            parts: ChainPart::of(automaton, &evaluation.subgoals, evaluation.episodes),
            digest,
            commands: Vec::new(),
            digests: BTreeMap::new(),
            commit,
            is_quick: false,
            evaluation,
        }
    }
}

/// A Markdown table of cells of one chain.
#[must_use]
pub fn chaining_table(cells: &[ChainingCell]) -> String {
    let Some(first) = cells.first() else {
        return String::new();
    };
    let mut table = String::from("| | success | 95 % interval |");
    let mut rule = String::from("|---|---|---|");
    for part in &first.parts {
        let _ = write!(table, " p({}) |", part.name);
        rule.push_str("---|");
    }
    let _ = writeln!(table, "\n{rule}");
    for cell in cells {
        let [low, high] = cell.interval_95.map(|share| 100.0 * share);
        let _ = write!(
            table,
            "| {} | {:.0} % of {} | {low:.0}-{high:.0} % |",
            cell.method.described(),
            100.0 * cell.success_rate,
            cell.episodes
        );
        for part in &cell.parts {
            let share = match part.of {
                0 => "never got there".to_owned(),
                of => format!("{:.0} %", 100.0 * part.reached as f64 / of as f64),
            };
            let _ = write!(table, " {share} |");
        }
        table.push('\n');
    }
    let _ = writeln!(
        table,
        "| the paper's robot | {:.0} % of 10 | |{}",
        100.0 * PAPERS_RATE,
        " |".repeat(first.parts.len())
    );
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::fakes::task;

    fn tally(in_order: usize) -> SubgoalTally {
        SubgoalTally {
            name: String::new(),
            reached: in_order,
            skipped: 0,
            missed: 0,
            in_order,
        }
    }

    #[test]
    fn parts_are_conditioned_on_what_came_before() {
        let tasks = [
            task("a", &["x", "y"]),
            task("b", &["z"]),
            task("c", &["u", "v"]),
        ];
        let automaton = Automaton::in_order(&tasks);
        let tallies: Vec<_> = [9, 8, 6, 3, 0].map(tally).to_vec();
        let parts = ChainPart::of(&automaton, &tallies, 10);
        let told: Vec<_> = parts
            .iter()
            .map(|p| (p.name.as_str(), p.reached, p.of))
            .collect();
        assert_eq!(
            told,
            [("a", 8, 10), ("to b", 6, 8), ("to c", 3, 6), ("c", 0, 3)]
        );
    }

    #[test]
    fn rounds_that_follow_each_other_are_one_part() {
        let (twice, once) = (task("a", &["x", "y"]), task("b", &["z"]));
        let automaton = Automaton::in_order(&[twice.clone(), twice, once]);
        let tallies: Vec<_> = [9, 8, 6, 5, 4].map(tally).to_vec();
        let parts = ChainPart::of(&automaton, &tallies, 10);
        let told: Vec<_> = parts
            .iter()
            .map(|p| (p.name.as_str(), p.reached, p.of))
            .collect();
        assert_eq!(told, [("a", 5, 10), ("to b", 4, 5)]);
    }

    #[test]
    fn each_method_but_the_first_switches_something_off() {
        let run = |method: ChainingMethod| {
            let (mut planner, mut calibration) =
                (PlannerOptions::default(), Calibration::default());
            let mut options = RolloutOptions::default();
            method.plan(&mut planner, &mut calibration);
            method.run(&mut options);
            (planner, calibration, options)
        };
        let all: Vec<_> = ChainingMethod::ALL.map(run).to_vec();
        for (i, one) in all.iter().enumerate() {
            assert!(
                all[..i].iter().all(|other| other != one),
                "{:?}",
                ChainingMethod::ALL[i]
            );
        }
    }

    #[test]
    fn the_table_says_where_nobody_came() {
        let evaluation = Evaluation::new("chain", "paper", 1, "tract", &[], Vec::new());
        let part = |name: &str, reached, of| ChainPart {
            name: name.to_owned(),
            reached,
            of,
        };
        let cell = ChainingCell {
            method: ChainingMethod::Ours,
            episodes: 10,
            seed: 1,
            success_rate: 0.0,
            interval_95: [0.0, 0.278],
            parts: vec![part("a", 0, 10), part("to b", 0, 0)],
            digest: String::new(),
            commands: Vec::new(),
            digests: BTreeMap::new(),
            commit: None,
            is_quick: false,
            evaluation,
        };
        let table = chaining_table(&[cell]);
        assert_eq!(
            table,
            "| | success | 95 % interval | p(a) | p(to b) |\n|---|---|---|---|---|\n\
             | all guards | 0 % of 10 | 0-28 % | 0 % | never got there |\n\
             | the paper's robot | 20 % of 10 | | | |\n"
        );
    }
}
