use serde::{Deserialize, Serialize};

use crate::task::{Automaton, Subgoal};

/// What became of a subgoal in an episode, by the simulator's truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SubgoalOutcome {
    /// It held after all earlier ones had.
    Reached,
    /// A later one held first: a shortcut.
    Skipped,
    /// It never held, and nothing later did.
    Missed,
}

/// Follows the truth through an episode and says which subgoals were reached in order.
#[derive(Clone, Debug)]
pub struct Score {
    names: Vec<String>,
    first_step: Vec<Option<usize>>,
    /// For each subgoal of a name that came before, the one that must be reached before it can be: of a task
    /// that is done again, the last one of the round before.
    opened_by: Vec<Option<usize>>,
    /// Whether each subgoal has not held since that one was reached.
    is_free: Vec<bool>,
}

impl Score {
    /// A score for the subgoals of an automaton, none of them reached.
    #[must_use]
    pub fn new(automaton: &Automaton) -> Self {
        let subgoals = automaton.subgoals();
        let names: Vec<_> = subgoals.iter().map(|s| s.name.clone()).collect();
        let opened_by: Vec<_> = (0..names.len())
            .map(|i| {
                let before = names[..i].iter().rposition(|n| *n == names[i])?;
                let is_round = subgoals[before] == subgoals[i];
                Some(if is_round {
                    last_of_round(subgoals, before)
                } else {
                    before
                })
            })
            .collect();
        Self {
            first_step: vec![None; names.len()],
            is_free: opened_by.iter().map(Option::is_none).collect(),
            opened_by,
            names,
        }
    }

    /// Notes which subgoals hold after `step`; a subgoal counts from the first step at which it holds. One of
    /// a task that is done again must have ceased to hold since the round before was over.
    pub fn observe(&mut self, step: usize, holds: impl Fn(&str) -> bool) {
        for i in 0..self.names.len() {
            let name = &self.names[i];
            if self.first_step[i].is_some() {
                continue;
            }
            if !self.is_free[i] {
                let is_open = self.opened_by[i].is_none_or(|b| self.first_step[b].is_some());
                self.is_free[i] = is_open && !holds(name);
            } else if holds(name) {
                self.first_step[i] = Some(step);
            }
        }
    }

    /// The first step at which each subgoal held, in the automaton's order.
    #[must_use]
    pub fn first_steps(&self) -> &[Option<usize>] {
        &self.first_step
    }

    /// The first step at which a subgoal held before an earlier one had; none for an episode without a
    /// shortcut.
    #[must_use]
    pub fn shortcut_step(&self) -> Option<usize> {
        let is_too_early = |(i, step): &(usize, usize)| {
            let mut before = self.first_step[..*i].iter();
            before.any(|earlier| earlier.is_none_or(|earlier| earlier > *step))
        };
        let held = self.first_step.iter().enumerate();
        held.filter_map(|(i, step)| Some((i, (*step)?)))
            .filter(is_too_early)
            .map(|(_, step)| step)
            .min()
    }

    /// What became of each subgoal, in the automaton's order.
    #[must_use]
    pub fn outcomes(&self) -> Vec<SubgoalOutcome> {
        (0..self.names.len())
            .map(|i| {
                let own = self.first_step[i];
                let overtaken = self.first_step[i + 1..]
                    .iter()
                    .flatten()
                    .any(|later| own.is_none_or(|own| *later < own));
                match own {
                    _ if overtaken => SubgoalOutcome::Skipped,
                    Some(_) => SubgoalOutcome::Reached,
                    None => SubgoalOutcome::Missed,
                }
            })
            .collect()
    }

    /// Whether every subgoal was reached, each after the ones before it.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.outcomes()
            .iter()
            .all(|o| *o == SubgoalOutcome::Reached)
    }
}

/// The last subgoal of the round of a task that the subgoal at `at` is of.
fn last_of_round(subgoals: &[Subgoal], at: usize) -> usize {
    let task = &subgoals[at].task;
    let first = subgoals.iter().find(|s| s.task == *task);
    let rest = subgoals[at + 1..].iter();
    at + rest
        .take_while(|s| s.task == *task && Some(*s) != first)
        .count()
}

#[cfg(test)]
mod tests {
    use super::SubgoalOutcome::{Missed, Reached, Skipped};
    use super::*;
    use crate::task::Task;

    fn automaton() -> Automaton {
        let subgoal = |name: &str| Subgoal {
            task: "t".to_owned(),
            name: name.to_owned(),
        };
        Automaton::in_order(&[Task {
            name: "t".to_owned(),
            subgoals: vec![subgoal("a"), subgoal("b"), subgoal("c")],
        }])
    }

    #[test]
    fn in_order_is_success() {
        let mut score = Score::new(&automaton());
        score.observe(1, |n| n == "a");
        score.observe(2, |n| n == "b");
        score.observe(3, |n| n == "c");
        assert!(score.is_success());
        assert_eq!(score.first_steps(), [Some(1), Some(2), Some(3)]);
        assert_eq!(score.shortcut_step(), None);
    }

    #[test]
    fn later_one_first_is_a_skip_even_if_made_up_for() {
        let mut score = Score::new(&automaton());
        score.observe(1, |n| n == "a");
        score.observe(2, |n| n == "c");
        assert_eq!(score.outcomes(), [Reached, Skipped, Reached]);
        score.observe(3, |n| n == "b");
        assert_eq!(score.outcomes(), [Reached, Skipped, Reached]);
        assert_eq!(score.shortcut_step(), Some(2));
        assert!(!score.is_success());
    }

    #[test]
    fn second_round_counts_once_the_first_is_over() {
        let once = automaton();
        let name = |i: usize| once.subgoals()[i].clone();
        let task = Task {
            name: "t".to_owned(),
            subgoals: vec![name(0)],
        };
        let mut score = Score::new(&Automaton::in_order(&[task.clone(), task]));
        score.observe(1, |_| true);
        score.observe(2, |_| true);
        assert_eq!(score.first_steps(), [Some(1), None]);
        score.observe(3, |_| false);
        score.observe(4, |_| true);
        assert_eq!(score.first_steps(), [Some(1), Some(4)]);
        assert!(score.is_success());
    }

    #[test]
    fn what_slips_within_a_round_is_no_second_round() {
        let once = automaton();
        let task = Task {
            name: "t".to_owned(),
            subgoals: once.subgoals()[..2].to_vec(),
        };
        let mut score = Score::new(&Automaton::in_order(&[task.clone(), task]));
        score.observe(1, |n| n == "a");
        score.observe(2, |_| false);
        score.observe(3, |n| n == "a");
        score.observe(4, |n| n == "b");
        assert_eq!(score.first_steps(), [Some(1), Some(4), None, None]);
        assert_eq!(score.outcomes(), [Reached, Reached, Missed, Missed]);
        assert_eq!(score.shortcut_step(), None);
        score.observe(5, |_| false);
        score.observe(6, |n| n == "a");
        score.observe(7, |n| n == "b");
        assert_eq!(score.first_steps(), [Some(1), Some(4), Some(6), Some(7)]);
        assert!(score.is_success());
    }

    #[test]
    fn what_never_held_is_missed() {
        let mut score = Score::new(&automaton());
        score.observe(5, |n| n == "a");
        assert_eq!(score.outcomes(), [Reached, Missed, Missed]);
    }
}
