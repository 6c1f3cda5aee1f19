use super::{Subgoal, Task};

/// What reaching a subgoal means at a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transition {
    /// The subgoal that was due: the next stage begins.
    Advance(usize),
    /// Reached before, or not asked for: the stage stays.
    Stay,
    /// A shortcut: the subgoal lies ahead, and those at these stages were not reached before it.
    Shortcut {
        /// The stages that were skipped, in order.
        skipped: Vec<usize>,
    },
}

/// Which subgoals are to be reached, in which order. Stage `k` means that the first `k` subgoals are
/// reached; the last stage accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Automaton {
    subgoals: Vec<Subgoal>,
    tasks: Vec<String>,
}

impl Automaton {
    /// All subgoals of all tasks, task after task, each in its order.
    #[must_use]
    pub fn in_order(tasks: &[Task]) -> Self {
        Self {
            subgoals: tasks.iter().flat_map(|t| t.subgoals.clone()).collect(),
            tasks: tasks.iter().map(|t| t.name.clone()).collect(),
        }
    }

    /// The subgoals in the order in which they are due.
    #[must_use]
    pub fn subgoals(&self) -> &[Subgoal] {
        &self.subgoals
    }

    /// The tasks in the order in which they are due.
    #[must_use]
    pub fn tasks(&self) -> &[String] {
        &self.tasks
    }

    /// Number of stages: one more than there are subgoals.
    #[must_use]
    pub fn stage_count(&self) -> usize {
        self.subgoals.len() + 1
    }

    /// Whether all subgoals are reached at this stage.
    #[must_use]
    pub fn is_accepting(&self, stage: usize) -> bool {
        stage >= self.subgoals.len()
    }

    /// The stage at which a subgoal is due: its first place in the order. A subgoal of a task that is
    /// done several times has more, see [`next_due_stage`](Self::next_due_stage).
    #[must_use]
    pub fn due_stage(&self, subgoal: &Subgoal) -> Option<usize> {
        self.subgoals.iter().position(|s| s == subgoal)
    }

    /// The stage at which a subgoal is due, of those at which `stage` subgoals or more are reached.
    #[must_use]
    pub fn next_due_stage(&self, stage: usize, subgoal: &Subgoal) -> Option<usize> {
        let rest = self.subgoals.get(stage..)?;
        Some(stage + rest.iter().position(|s| s == subgoal)?)
    }

    /// What reaching `subgoal` means when the first `stage` subgoals are reached.
    #[must_use]
    pub fn transition(&self, stage: usize, subgoal: &Subgoal) -> Transition {
        let was_reached = self.due_stage(subgoal).is_some_and(|first| first < stage);
        match self.next_due_stage(stage, subgoal) {
            Some(due) if due == stage => Transition::Advance(stage + 1),
            // That of an earlier round still holds.
            Some(_) if was_reached => Transition::Stay,
            Some(due) => Transition::Shortcut {
                skipped: (stage..due).collect(),
            },
            None => Transition::Stay,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> Automaton {
        let task = |name: &str, subgoals: &[&str]| Task {
            name: name.to_owned(),
            subgoals: subgoals
                .iter()
                .map(|s| Subgoal {
                    task: name.to_owned(),
                    name: (*s).to_owned(),
                })
                .collect(),
        };
        Automaton::in_order(&[task("a", &["a1", "a2"]), task("b", &["b1"])])
    }

    #[test]
    fn subgoal_due_now_advances_and_later_one_is_a_shortcut() {
        let automaton = chain();
        let subgoal = |i: usize| automaton.subgoals()[i].clone();
        assert_eq!(automaton.transition(0, &subgoal(0)), Transition::Advance(1));
        assert_eq!(automaton.transition(2, &subgoal(0)), Transition::Stay);
        assert_eq!(
            automaton.transition(0, &subgoal(2)),
            Transition::Shortcut {
                skipped: vec![0, 1]
            }
        );
        assert!(automaton.is_accepting(3) && !automaton.is_accepting(2));
    }

    #[test]
    fn subgoal_of_a_second_round_is_due_in_its_turn() {
        let [a, b] = ["a", "b"].map(|name| Subgoal {
            task: "t".to_owned(),
            name: name.to_owned(),
        });
        let round = Task {
            name: "t".to_owned(),
            subgoals: vec![a.clone(), b.clone()],
        };
        let automaton = Automaton::in_order(&[round.clone(), round]);
        assert_eq!(automaton.transition(1, &a), Transition::Stay);
        assert_eq!(automaton.transition(2, &a), Transition::Advance(3));
        assert_eq!(automaton.transition(4, &b), Transition::Stay);
        assert_eq!(automaton.next_due_stage(1, &a), Some(2));
        assert_eq!(automaton.next_due_stage(3, &a), None);
    }
}
