use std::sync::Arc;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::ScoredBedroom;
use crate::environment::{Environment, EnvironmentError};
use crate::simulator::{BedroomTask, Habits, LONGEST_STEPS, Operator, Practice, Primitive};
use crate::trajectory::Observation;

/// Keeps what is left out apart from how the room is arranged.
const SKIPPER_STREAM: u64 = 0x736b_6970_7065_7200;
/// A task that is left half done is left at most so many steps after a subgoal.
const LONGEST_REST_STEPS: usize = 24;

/// What of a task is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Omission {
    /// All of it.
    Task,
    /// What comes so many steps after one of its subgoals; what is held then is let go wherever that is.
    Rest { subgoal: usize, after_steps: usize },
    /// Its sense: the operator goes through the motions with an empty gripper.
    DryRun,
}

/// An operator who does tasks one after the other and leaves out a part of one before the last: a shortcut that is
/// provoked, in a run that looks well done.
#[derive(Clone, Debug)]
pub struct Skipper {
    tasks: Vec<BedroomTask>,
    /// Which of them, and what of it.
    omitted: Option<(usize, Omission)>,
    seed: u64,
}

impl Skipper {
    /// One who does these tasks; the seed says what is left out. Nothing can be where there is only one.
    #[must_use]
    pub fn new(tasks: Vec<BedroomTask>, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ SKIPPER_STREAM);
        let omitted = (tasks.len() > 1).then(|| {
            let which = rng.random_range(0..tasks.len() - 1);
            let partly = tasks[which].subgoals().len() - 1;
            let omission = match rng.random_range(0..partly + 2) {
                0 => Omission::Task,
                1 => Omission::DryRun,
                number => Omission::Rest {
                    subgoal: number - 2,
                    after_steps: rng.random_range(0..=LONGEST_REST_STEPS),
                },
            };
            (which, omission)
        });
        Self {
            tasks,
            omitted,
            seed,
        }
    }

    /// Drives through the episode of the seed, in at most so many steps, and shows every picture. Returns how many
    /// steps it took.
    ///
    /// # Errors
    /// [`EnvironmentError`] when the bedroom fails, which the simulated one does not.
    pub fn drive(
        &self,
        room: &mut ScoredBedroom,
        most_steps: usize,
        mut show: impl FnMut(&Arc<Observation>),
    ) -> Result<usize, EnvironmentError> {
        show(&Arc::new(room.reset(self.seed)?));
        let mut steps = 0;
        for (number, task) in self.tasks.iter().enumerate() {
            let omission = (self.omitted.filter(|(which, _)| *which == number)).map(|(_, o)| o);
            if omission == Some(Omission::Task) {
                continue;
            }
            let habits = Habits {
                practice: (omission == Some(Omission::DryRun)).then_some(Practice::Dry),
                ..Habits::default()
            };
            let mut operator = Operator::new(*task, &room.insight(), habits, self.seed);
            let mut since = 0;
            for _ in 0..LONGEST_STEPS {
                if let Some(Omission::Rest {
                    subgoal,
                    after_steps,
                }) = omission
                {
                    let name = task.subgoals()[subgoal];
                    since +=
                        usize::from(since > 0 || room.insight().truth.holds(name) == Some(true));
                    if since > after_steps {
                        break;
                    }
                }
                let primitive = operator.next(&room.insight());
                if primitive == Primitive::Terminate || steps >= most_steps {
                    break;
                }
                show(&Arc::new(room.step(&primitive.action())?));
                steps += 1;
            }
        }
        Ok(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::{Bedroom, BedroomConfig};
    use crate::task::{Automaton, Subgoal, Task};

    fn task(task: BedroomTask) -> Task {
        let subgoal = |name: &&str| Subgoal {
            task: task.name().to_owned(),
            name: (*name).to_owned(),
        };
        Task {
            name: task.name().to_owned(),
            subgoals: task.subgoals().iter().map(subgoal).collect(),
        }
    }

    #[test]
    fn what_is_left_out_is_a_shortcut() {
        let tasks = [BedroomTask::Sock, BedroomTask::Trash];
        let config = BedroomConfig::paper(BedroomTask::Sock);
        let chain = Automaton::in_order(&tasks.map(task));
        let mut kinds = Vec::new();
        let mut shortcuts = 0;
        let seeds = 0..12;
        for seed in seeds.clone() {
            let skipper = Skipper::new(tasks.to_vec(), seed);
            let (_, omission) = skipper.omitted.expect("two tasks");
            let mut room = ScoredBedroom::new(Bedroom::new(config), &chain);
            let mut shown = 0;
            let steps = skipper.drive(&mut room, 400, |_| shown += 1).unwrap();
            assert_eq!(shown, steps + 1);
            assert!(!room.score().is_success(), "{omission:?}");
            shortcuts += usize::from(room.score().shortcut_step().is_some());
            kinds.push(std::mem::discriminant(&omission));
        }
        assert!(shortcuts >= 10, "{shortcuts} of {}", seeds.end);
        kinds.sort_by_key(|kind| format!("{kind:?}"));
        kinds.dedup();
        assert_eq!(kinds.len(), 3, "every kind comes up");
        assert!(Skipper::new(vec![BedroomTask::Sock], 1).omitted.is_none());
    }
}
