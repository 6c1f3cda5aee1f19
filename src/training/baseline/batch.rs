use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::BaselineConfig;
use super::sampler::{WindowDraw, WindowSampler};
use super::source::{Inputs, Source};
use crate::training::augmentation::{Mirror, vary};
use crate::training::{Dataset, StateRef};

/// Everything that a step needs, as plain values.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchInput {
    /// Number of states that are encoded.
    pub states: usize,
    /// What is seen in them.
    pub inputs: Inputs,
    /// `windows * history` rows of the encoded states.
    pub rows: Vec<i32>,
    /// For each window, the row of its goal.
    pub goals: Vec<i32>,
    /// Places of the windows that are scored: once a state, and only if its action is to be imitated.
    pub scored: Vec<i32>,
    /// What each of these counts.
    pub weights: Vec<f32>,
    /// For each head, the class of each place that is scored.
    pub classes: Vec<Vec<i32>>,
}

/// Makes the input of a step from the seed and the step's number alone, so that a training that was
/// interrupted goes on as if it had not been.
pub struct WindowBatcher<'a> {
    /// Where the states come from.
    pub data: &'a Dataset,
    /// Draws windows and goals.
    pub sampler: WindowSampler,
    /// What is seen in the states.
    pub source: &'a Source,
    /// The training's configuration.
    pub config: &'a BaselineConfig,
}

impl WindowBatcher<'_> {
    /// The input of a step, counted from 0.
    pub fn step_input(&self, step: u64) -> BatchInput {
        let mut rng = ChaCha8Rng::seed_from_u64(self.config.seed);
        rng.set_stream(step + 1);
        let draw = self.sampler.draw(self.data, &mut rng);
        let augmentation = &self.config.augmentation;
        let mirror = Mirror::draw(augmentation, self.data.action_space(), &mut rng);
        // The states of a window must differ by what the robot did and not by how their pictures were moved.
        let cameras = self.data.cameras().len();
        let variations = vary(augmentation, cameras, &draw.group_of, &mirror, &mut rng);
        let stack = self.config.stack;
        let (scored, weights, mut classes) = self.targets(&draw);
        mirror.change(&mut classes);
        let numbers = |rows: &[usize]| rows.iter().map(|row| *row as i32).collect();
        BatchInput {
            states: draw.states.len(),
            inputs: self
                .source
                .inputs(self.data, &draw.states, stack, Some(&variations)),
            rows: numbers(&draw.rows),
            goals: numbers(&draw.goals),
            scored,
            weights,
            classes,
        }
    }

    /// Places that are scored, what each counts, and for each head their classes.
    fn targets(&self, draw: &WindowDraw) -> (Vec<i32>, Vec<f32>, Vec<Vec<i32>>) {
        let heads = self.data.action_space().head_sizes().len();
        let (mut scored, mut weights) = (Vec::new(), Vec::new());
        let mut classes = vec![Vec::new(); heads];
        for (place, row) in draw.rows.iter().enumerate() {
            // Where the first state is repeated only its last place is that state's own.
            let is_repeated = (place + 1) % self.config.history != 0
                && draw.rows.get(place + 1).is_some_and(|next| next == row);
            let at: StateRef = draw.states[*row];
            if is_repeated || !self.data.is_imitated(at, &self.config.imitation) {
                continue;
            }
            scored.push(place as i32);
            weights.push(self.sampler.weight(at));
            for (head, class) in classes.iter_mut().zip(self.data.classes(at)) {
                head.push(*class as i32);
            }
        }
        (scored, weights, classes)
    }
}
