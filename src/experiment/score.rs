use serde::{Deserialize, Serialize};

use crate::task::Automaton;

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
    /// Whether each subgoal has not held since that of an earlier round was reached.
    is_free: Vec<bool>,
}

impl Score {
    /// A score for the subgoals of an automaton, none of them reached.
    #[must_use]
    pub fn new(automaton: &Automaton) -> Self {
        let names: Vec<_> = automaton
            .subgoals()
            .iter()
            .map(|s| s.name.clone())
            .collect();
        Self {
            first_step: vec![None; names.len()],
            is_free: (0..names.len())
                .map(|i| !names[..i].contains(&names[i]))
                .collect(),
            names,
        }
    }

    /// Notes which subgoals hold after `step`; a subgoal counts from the first step at which it holds. One of
    /// a task that is done again must have ceased to hold since that of the round before was reached.
    pub fn observe(&mut self, step: usize, holds: impl Fn(&str) -> bool) {
        for i in 0..self.names.len() {
            let name = &self.names[i];
            if self.first_step[i].is_some() {
                continue;
            }
            if !self.is_free[i] {
                let before = self.names[..i].iter().rposition(|n| n == name);
                let was_reached = before.is_some_and(|b| self.first_step[b].is_some());
                self.is_free[i] = was_reached && !holds(name);
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

#[cfg(test)]
mod tests {
    use super::SubgoalOutcome::{Missed, Reached, Skipped};
    use super::*;
    use crate::task::{Subgoal, Task};

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
    fn what_never_held_is_missed() {
        let mut score = Score::new(&automaton());
        score.observe(5, |n| n == "a");
        assert_eq!(score.outcomes(), [Reached, Missed, Missed]);
    }
}
