use super::Score;
use crate::environment::{Environment, EnvironmentError};
use crate::simulator::{Bedroom, Insight};
use crate::task::Automaton;
use crate::trajectory::{Action, ActionSpace, CameraSpec, Observation};

/// A bedroom that keeps score of its own truth while somebody acts in it, who sees images only.
pub struct ScoredBedroom {
    bedroom: Bedroom,
    automaton: Automaton,
    score: Score,
    step: usize,
}

impl ScoredBedroom {
    /// A bedroom scored for the subgoals of an automaton.
    #[must_use]
    pub fn new(bedroom: Bedroom, automaton: &Automaton) -> Self {
        Self {
            bedroom,
            automaton: automaton.clone(),
            score: Score::new(automaton),
            step: 0,
        }
    }

    /// The subgoals that are scored.
    #[must_use]
    pub fn automaton(&self) -> &Automaton {
        &self.automaton
    }

    /// The score of the current episode.
    #[must_use]
    pub fn score(&self) -> &Score {
        &self.score
    }

    /// All that a demonstrating operator knows.
    #[must_use]
    pub fn insight(&self) -> Insight {
        self.bedroom.insight()
    }

    fn judge(&mut self) {
        let truth = self.bedroom.truth();
        self.score
            .observe(self.step, |name| truth.holds(name) == Some(true));
    }
}

impl Environment for ScoredBedroom {
    fn cameras(&self) -> Vec<CameraSpec> {
        self.bedroom.cameras()
    }

    fn action_space(&self) -> ActionSpace {
        self.bedroom.action_space()
    }

    fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError> {
        let observation = self.bedroom.reset(seed)?;
        self.score = Score::new(&self.automaton);
        self.step = 0;
        self.judge();
        Ok(observation)
    }

    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        let observation = self.bedroom.step(action)?;
        self.step += 1;
        self.judge();
        Ok(observation)
    }
}
