use std::collections::HashMap;
use std::ops::RangeInclusive;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::BaselineConfig;
use crate::training::{Dataset, StateRef, TrainingError};

/// Draws windows of consecutive states, each with a goal of its task.
#[derive(Clone, Debug)]
pub struct WindowSampler {
    /// Where a window may end: every state whose action is imitated.
    ends: Vec<StateRef>,
    /// Of the windows that may be drawn, how many show a state.
    windows_of: HashMap<StateRef, u32>,
    /// For each set, the last states of its trajectories.
    goals: Vec<Vec<StateRef>>,
    windows: usize,
    goals_a_step: usize,
    history: usize,
}

/// The windows of a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WindowDraw {
    /// States that are to be encoded, each once: those of the windows, then the goals.
    pub states: Vec<StateRef>,
    /// How many of them are of windows.
    pub of_windows: usize,
    /// For each state, the window or, beyond the windows, the goal that it is of; they vary alike.
    pub group_of: Vec<usize>,
    /// Windows and goals.
    pub groups: usize,
    /// Places of the windows, `windows * history` numbers of states, the oldest first. Before the start
    /// of a trajectory its first state is repeated.
    pub rows: Vec<usize>,
    /// For each window, the number of its goal's state.
    pub goals: Vec<usize>,
}

impl WindowSampler {
    /// A sampler over some trajectories.
    ///
    /// # Errors
    /// [`TrainingError::NoPairs`] when no action is to be imitated.
    pub fn new(
        data: &Dataset,
        trajectories: &[u32],
        config: &BaselineConfig,
    ) -> Result<Self, TrainingError> {
        let ends: Vec<StateRef> = data
            .states_of(trajectories)
            .filter(|at| data.is_imitated(*at, &config.imitation))
            .collect();
        if ends.is_empty() {
            return Err(TrainingError::NoPairs { part: "training" });
        }
        let mut windows_of = HashMap::new();
        for end in &ends {
            for step in steps_of_window(end.step, config.history) {
                *windows_of.entry(StateRef { step, ..*end }).or_default() += 1;
            }
        }
        Ok(Self {
            ends,
            windows_of,
            goals: last_states(data, trajectories),
            windows: config.windows,
            goals_a_step: config.goals,
            history: config.history,
        })
    }

    /// What a state that a drawn window shows counts, so that each is learnt from alike: few windows show the last
    /// states of a demonstration, which has the robot let go and end. The weights of a window have a mean sum of 1.
    pub fn weight(&self, at: StateRef) -> f32 {
        1.0 / self.windows_of.get(&at).copied().unwrap_or(1) as f32
    }

    /// Draws the windows of a step.
    pub fn draw(&self, data: &Dataset, rng: &mut ChaCha8Rng) -> WindowDraw {
        let ends: Vec<StateRef> = (0..self.windows)
            .map(|_| self.ends[rng.random_range(0..self.ends.len())])
            .collect();
        let mut draw = WindowDraw {
            states: Vec::new(),
            of_windows: 0,
            group_of: Vec::new(),
            groups: 0,
            rows: Vec::new(),
            goals: Vec::new(),
        };
        for end in &ends {
            draw.push_window(*end, self.history);
        }
        draw.of_windows = draw.states.len();
        let chosen = self.choose_goals(data, &ends, rng);
        let of_set: Vec<Vec<usize>> = chosen
            .iter()
            .map(|goals| goals.iter().map(|g| draw.push_goal(*g)).collect())
            .collect();
        for end in &ends {
            let goals = &of_set[data.set_of(end.trajectory)];
            draw.goals.push(goals[rng.random_range(0..goals.len())]);
        }
        draw
    }

    /// A few goals of each set that a window is of, together about as many as are asked for.
    fn choose_goals(
        &self,
        data: &Dataset,
        ends: &[StateRef],
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<StateRef>> {
        let is_present = |set: usize| ends.iter().any(|e| data.set_of(e.trajectory) == set);
        let sets = (0..self.goals.len()).filter(|set| is_present(*set)).count();
        let each = (self.goals_a_step / sets.max(1)).max(1);
        self.goals
            .iter()
            .enumerate()
            .map(|(set, goals)| {
                let count = if is_present(set) { each } else { 0 };
                (0..count)
                    .map(|_| goals[rng.random_range(0..goals.len())])
                    .collect()
            })
            .collect()
    }
}

impl WindowDraw {
    fn push_window(&mut self, end: StateRef, history: usize) {
        let start = self.states.len();
        for step in steps_of_window(end.step, history) {
            self.states.push(StateRef { step, ..end });
            self.group_of.push(self.groups);
        }
        self.groups += 1;
        self.rows
            .extend(window_rows(end.step, history).map(|back| start + back));
    }

    fn push_goal(&mut self, goal: StateRef) -> usize {
        self.states.push(goal);
        self.group_of.push(self.groups);
        self.groups += 1;
        self.states.len() - 1
    }
}

/// The steps that a window shows which ends at one of them.
fn steps_of_window(end_step: u32, history: usize) -> RangeInclusive<u32> {
    (end_step + 1).saturating_sub(history as u32)..=end_step
}

/// Places of a window that ends at a step, counted from the first state that it shows; the first is repeated
/// where the window begins before the start.
pub fn window_rows(end_step: u32, history: usize) -> impl Iterator<Item = usize> {
    let missing = history.saturating_sub(end_step as usize + 1);
    (0..history).map(move |place| place.saturating_sub(missing))
}

/// For each set, the last states of those of its trajectories that are named.
pub fn last_states(data: &Dataset, trajectories: &[u32]) -> Vec<Vec<StateRef>> {
    let mut goals: Vec<Vec<StateRef>> = Vec::new();
    for trajectory in trajectories {
        let set = data.set_of(*trajectory);
        goals.resize(goals.len().max(set + 1), Vec::new());
        goals[set].push(last_state(data, *trajectory));
    }
    goals
}

/// The last state of a trajectory.
pub fn last_state(data: &Dataset, trajectory: u32) -> StateRef {
    StateRef {
        trajectory,
        step: data.steps(trajectory).saturating_sub(1) as u32,
    }
}
