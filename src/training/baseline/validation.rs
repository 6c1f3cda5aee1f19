use burn::tensor::{Device, Tensor};

use super::objective::windowed;
use super::sampler::{last_state, last_states, window_rows};
use super::source::Source;
use super::{BaselineConfig, BaselineNetwork};
use crate::model::BaselineValidation;
use crate::training::evaluation::{cross_entropy, largest, values};
use crate::training::loss::indices;
use crate::training::{Dataset, StateRef, TrainingError};

/// Windows that are scored at once.
const SCORED_AT_ONCE: usize = 256;

/// The held-out states, and the goal of each as a robot would be given it: the end of a demonstration of the
/// task that was trained on.
pub struct HeldOut {
    states: Vec<StateRef>,
    /// For each set, its goal.
    goals: Vec<StateRef>,
    /// Numbers of the states whose action is to be imitated.
    scored: Vec<usize>,
}

impl HeldOut {
    /// All states of the held-out trajectories.
    ///
    /// # Errors
    /// [`TrainingError::NoPairs`] when no held-out action is to be imitated.
    pub fn new(
        data: &Dataset,
        training: &[u32],
        held_out: &[u32],
        config: &BaselineConfig,
    ) -> Result<Self, TrainingError> {
        let states: Vec<StateRef> = data.states_of(held_out).collect();
        let scored: Vec<usize> = (0..states.len())
            .filter(|i| data.is_imitated(states[*i], &config.imitation))
            .collect();
        if scored.is_empty() {
            return Err(TrainingError::NoPairs { part: "held-out" });
        }
        let trained = last_states(data, training);
        let sets = held_out.iter().map(|t| data.set_of(*t) + 1).max();
        let goals = (0..sets.unwrap_or(0))
            .map(|set| {
                let known = trained.get(set).and_then(|goals| goals.first()).copied();
                let own = held_out.iter().find(|t| data.set_of(**t) == set);
                // A set of which all is held out has no other goal than its own; one without any is not asked.
                known.unwrap_or_else(|| last_state(data, own.copied().unwrap_or_default()))
            })
            .collect();
        Ok(Self {
            states,
            goals,
            scored,
        })
    }

    /// Number of held-out states.
    pub fn state_count(&self) -> usize {
        self.states.len()
    }

    /// Tries a network that does not train: the action after each whole window.
    pub fn evaluate(
        &self,
        network: &BaselineNetwork,
        data: &Dataset,
        source: &Source,
        config: &BaselineConfig,
        device: &Device,
    ) -> BaselineValidation {
        let latents = source.encode(data, &self.states, config.stack, network, device);
        let goals = source.encode(data, &self.goals, config.stack, network, device);
        let heads = data.action_space().head_sizes();
        let (mut loss, mut right) = (0.0, 0_usize);
        for part in self.scored.chunks(SCORED_AT_ONCE) {
            let logits = self.logits(part, &latents, &goals, data, network, config);
            let row_len: usize = heads.iter().sum();
            for (number, row) in part.iter().zip(values(logits).chunks_exact(row_len)) {
                let mut start = 0;
                let classes = data.classes(self.states[*number]);
                for (size, class) in heads.iter().zip(classes) {
                    let head = &row[start..start + size];
                    loss += cross_entropy(head, *class, 1.0);
                    right += usize::from(largest(head) == *class);
                    start += size;
                }
            }
        }
        let count = (self.scored.len() * heads.len()) as f64;
        BaselineValidation {
            loss: loss / count,
            accuracy: right as f64 / count,
        }
    }

    /// Logits after the whole windows that end at some states, `[states, classes]`.
    fn logits(
        &self,
        ends: &[usize],
        latents: &Tensor<2>,
        goals: &Tensor<2>,
        data: &Dataset,
        network: &BaselineNetwork,
        config: &BaselineConfig,
    ) -> Tensor<2> {
        let device = latents.device();
        let (mut rows, mut of_sets) = (Vec::new(), Vec::new());
        for end in ends {
            let at = self.states[*end];
            let shown = (at.step as usize + 1).min(config.history);
            let first = end + 1 - shown;
            let places = window_rows(at.step, config.history);
            rows.extend(places.map(|place| (first + place) as i32));
            of_sets.push(data.set_of(at.trajectory) as i32);
        }
        let history = windowed(latents, &rows, ends.len(), &device);
        let goals = goals.clone().select(0, indices(&of_sets, &device));
        let logits = network.policy.forward(history, goals, None);
        let last: Vec<i32> = (1..=ends.len())
            .map(|window| (window * config.history - 1) as i32)
            .collect();
        logits.select(0, indices(&last, &device))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::BaselineMethod;
    use crate::training::baseline::TrainedBaseline;
    use crate::training::{Preset, synthetic};
    use crate::trajectory::State;

    #[test]
    fn held_out_windows_are_those_that_a_robot_would_see() {
        let sets = ["a", "b"].map(|task| synthetic::demonstrations(task, 3, 7, 5));
        let data = Dataset::new(&sets).unwrap();
        let (training, held_out) = ([0, 1, 3, 4], [2, 5]);
        for method in [BaselineMethod::BcRnn, BaselineMethod::Rt1] {
            let config = BaselineConfig {
                history: 3,
                ..BaselineConfig::of(method, Preset::Tiny)
            };
            let trained = TrainedBaseline::untrained(&data, &config, None).unwrap();
            let normalisation = trained.normalisation.clone();
            let source = Source::pictures(&trained.spec, &config, normalisation);
            let validation = HeldOut::new(&data, &training, &held_out, &config).unwrap();
            let device = Device::flex();
            let found = validation.evaluate(&trained.network, &data, &source, &config, &device);

            // States of trajectory 2, of trajectory 5, then the ends of trajectories 0 and 3.
            let at = |trajectory, step| StateRef { trajectory, step };
            let mut all: Vec<StateRef> = data.states_of(&held_out).collect();
            all.extend([at(0, 6), at(3, 6)]);
            let states: Vec<State> = all.iter().map(|at| data.state(*at, 2)).collect();
            let windows: Vec<(Vec<usize>, usize)> = (0..14)
                .map(|end: usize| {
                    let first = end / 7 * 7;
                    let window = (0..3).rev().map(|b| end.saturating_sub(b).max(first));
                    (window.collect(), 14 + end / 7)
                })
                .collect();
            let outputs = trained.reference_outputs(&states, &windows, None).unwrap();
            let (mut loss, mut right) = (0.0, 0);
            for (state, window) in all[..14].iter().zip(0..14) {
                let class = data.classes(*state)[0];
                let logits = outputs.logits.row(window);
                loss += cross_entropy(logits, class, 1.0) / 14.0;
                right += usize::from(largest(logits) == class);
            }
            assert!(
                (found.loss - loss).abs() < 1e-5,
                "{method}: {found:?} {loss}"
            );
            assert!(
                (found.accuracy - right as f64 / 14.0).abs() < 1e-9,
                "{method}"
            );
        }
    }
}
