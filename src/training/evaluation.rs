//! How well a network does on held-out demonstrations, and the temperature that calibrates it.

use burn::tensor::{Device, Tensor, TensorData};

use super::augmentation::Mirror;
use super::batch::Pictures;
use super::held_out_pairs::{across, far_pairs, look_alikes, missed_grasps};
use super::landmarks::Landmarks;
use super::loss::{indices, near_class, near_class_weights};
use super::motion_to_go::{MotionTargets, MotionToGo};
use super::network::HeadKind;
use super::{Dataset, LatentFlowNetwork, StateRef, TrainingConfig, TrainingError};
use crate::model::{ValidationMetrics, best_temperature};
use crate::trajectory::State;

/// States that are encoded at once.
const ENCODED_AT_ONCE: usize = 64;
/// Pairs that are scored at once.
const SCORED_AT_ONCE: usize = 4_096;
/// Range of temperatures that are tried.
const TEMPERATURES: (f64, f64) = (0.2, 5.0);

/// The held-out states and a fixed choice of pairs among them.
pub struct ValidationSet {
    states: Vec<StateRef>,
    pairs: Vec<(u32, u32)>,
    classes: Vec<usize>,
    weights: Vec<f32>,
    near: usize,
    /// For each policy pair its place in `pairs`.
    policy: Vec<usize>,
    /// Pairs of one trajectory that look alike and are far apart in time.
    look_alikes: Vec<(u32, u32)>,
    /// A gripper that closed on nothing, and one that holds its thing.
    missed_grasps: Vec<(u32, u32)>,
    /// States with goal states of the same phase in other held-out trajectories.
    across: Vec<(u32, u32)>,
    /// The motion to go of the states that have one.
    motion: MotionTargets,
    /// The landmarks of the states, where they are learnt.
    landmarks: Option<Landmarks>,
}

/// What a validation found.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// The figures.
    pub metrics: ValidationMetrics,
    /// The temperature that calibrates the traversability on the held-out pairs.
    pub temperature: f32,
    /// Lower is better: the traversability loss once it is calibrated, plus the share of wrong
    /// actions, with goal states of other demonstrations where there are any. The policy's own
    /// cross-entropy is left out, since it rises long before the actions get worse.
    pub score: f64,
}

impl ValidationSet {
    /// All near pairs of the held-out trajectories, and far pairs drawn uniformly.
    ///
    /// # Errors
    /// [`TrainingError::NoPairs`] when no held-out trajectory has two steps, the first with an action to imitate.
    pub fn new(
        data: &Dataset,
        trajectories: &[u32],
        config: &TrainingConfig,
    ) -> Result<Self, TrainingError> {
        let states: Vec<StateRef> = data.states_of(trajectories).collect();
        let (mut pairs, mut classes, mut policy) = (Vec::new(), Vec::new(), Vec::new());
        for from in 0..states.len() {
            for gap in 0..config.d_max {
                let to = from + gap;
                if to >= states.len() || states[to].trajectory != states[from].trajectory {
                    break;
                }
                if gap > 0 && data.is_imitated(states[from], &config.imitation) {
                    policy.push(pairs.len());
                }
                pairs.push((from as u32, to as u32));
                classes.push(near_class(gap));
            }
        }
        if policy.is_empty() {
            return Err(TrainingError::NoPairs { part: "held-out" });
        }
        let near = pairs.len();
        let look_alikes = look_alikes(data, trajectories, &states, config.d_max);
        let by_class = near_class_weights(config.d_max, classes.iter().copied());
        let mut weights: Vec<f32> = classes.iter().map(|c| by_class[*c]).collect();
        let far = far_pairs(&states, config);
        let weight = 0.5 * config.far_weight / far.len().max(1) as f32;
        weights.resize(near + far.len(), weight);
        classes.resize(near + far.len(), config.d_max - 1);
        pairs.extend(far);
        Ok(Self {
            pairs,
            classes,
            weights,
            near,
            policy,
            look_alikes,
            missed_grasps: missed_grasps(data, trajectories, &states, config),
            across: across(data, trajectories, &states, config),
            motion: MotionToGo::of_training(data, trajectories, config)
                .targets(&states, &Mirror::NONE),
            landmarks: Landmarks::of_training(data, trajectories, config),
            states,
        })
    }

    /// Number of held-out states.
    pub fn state_count(&self) -> usize {
        self.states.len()
    }

    /// Tries a network that does not train (no stochastic depth, no dropout).
    pub fn evaluate(
        &self,
        network: &LatentFlowNetwork,
        data: &Dataset,
        pictures: &Pictures,
        config: &TrainingConfig,
        device: &Device,
    ) -> Validation {
        let states: Vec<State> = self
            .states
            .iter()
            .map(|at| data.state(*at, config.stack))
            .collect();
        let latents = encode(network, &states, pictures, device)
            .expect("the dataset has every camera in every observation");
        let logits = score(
            network,
            HeadKind::Traversability,
            &latents,
            &self.pairs,
            device,
        );
        let temperature = self.calibrate(&logits, config.d_max);
        let mut metrics = self.traversability(&logits, config.d_max);
        let calibrated = self.loss(&logits, config.d_max, temperature);
        let taken_for_near = |pairs: &[(u32, u32)]| {
            let logits = score(network, HeadKind::Traversability, &latents, pairs, device);
            let rows = logits.chunks_exact(config.d_max);
            let near = rows.filter(|row| largest(row) != config.d_max - 1).count();
            near as f64 / pairs.len().max(1) as f64
        };
        metrics.look_alike_wormhole_rate = taken_for_near(&self.look_alikes);
        let missed = &self.missed_grasps;
        metrics.missed_grasp_wormhole_rate = (!missed.is_empty()).then(|| taken_for_near(missed));
        let pairs: Vec<_> = self.policy.iter().map(|p| self.pairs[*p]).collect();
        let logits = score(network, HeadKind::Policy, &latents, &pairs, device);
        (metrics.policy_loss, metrics.policy_accuracy) = self.policy(&logits, &pairs, data);
        if !self.across.is_empty() {
            let logits = score(network, HeadKind::Policy, &latents, &self.across, device);
            let (_, accuracy) = self.policy(&logits, &self.across, data);
            metrics.policy_accuracy_across = Some(accuracy);
        }
        metrics.motion_explained =
            (network.motion_of(&latents)).and_then(|told| self.motion_explained(&told));
        if let Some(landmarks) = &self.landmarks {
            let told = network.landmarks_of(&latents).into_iter().map(values);
            let told: Vec<Vec<f32>> = told.collect();
            metrics.landmark_error_pixels =
                landmarks.error_pixels(&self.states, &told, &pictures.grids);
        }
        let accuracy = metrics
            .policy_accuracy_across
            .unwrap_or(metrics.policy_accuracy);
        Validation {
            score: calibrated + 1.0 - accuracy,
            metrics,
            temperature: temperature as f32,
        }
    }

    /// Share of the variance of the motion to go that is told rightly, the mean of the axes that vary.
    fn motion_explained(&self, told: &Tensor<2>) -> Option<f64> {
        let rows = indices(&self.motion.rows, &told.device());
        let told = values(told.clone().select(0, rows));
        let count = self.motion.rows.len();
        let axes = told.len().checked_div(count)?;
        let column = |values: &[f32], axis: usize| -> Vec<f64> {
            let column = values.iter().skip(axis).step_by(axes);
            column.map(|v| f64::from(*v)).collect()
        };
        let shares: Vec<f64> = (0..axes)
            .filter_map(|axis| {
                let wanted = column(&self.motion.values, axis);
                let mean = wanted.iter().sum::<f64>() / count as f64;
                let spread: f64 = wanted.iter().map(|w| (w - mean).powi(2)).sum();
                let told = column(&told, axis);
                let error: f64 = (wanted.iter().zip(told))
                    .map(|(w, t)| (w - t).powi(2))
                    .sum();
                (spread > 0.0).then(|| 1.0 - error / spread)
            })
            .collect();
        (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
    }

    fn loss(&self, logits: &[f32], d_max: usize, temperature: f64) -> f64 {
        logits
            .chunks_exact(d_max)
            .zip(self.classes.iter().zip(&self.weights))
            .map(|(row, (class, weight))| {
                f64::from(*weight) * cross_entropy(row, *class, temperature)
            })
            .sum()
    }

    /// The temperature with the least loss.
    fn calibrate(&self, logits: &[f32], d_max: usize) -> f64 {
        const SECTIONS: usize = 24;
        best_temperature(TEMPERATURES, SECTIONS, |temperature| {
            self.loss(logits, d_max, temperature)
        })
    }

    fn traversability(&self, logits: &[f32], d_max: usize) -> ValidationMetrics {
        let (mut near_right, mut far_right) = (0_usize, 0_usize);
        for (index, row) in logits.chunks_exact(d_max).enumerate() {
            let right = largest(row) == self.classes[index];
            if index < self.near {
                near_right += usize::from(right);
            } else {
                far_right += usize::from(right);
            }
        }
        let far = self.pairs.len() - self.near;
        let near_share = near_right as f64 / self.near as f64;
        let far_share = if far == 0 {
            1.0
        } else {
            far_right as f64 / far as f64
        };
        ValidationMetrics {
            traversability_loss: self.loss(logits, d_max, 1.0),
            traversability_accuracy: f64::midpoint(near_share, far_share),
            wormhole_rate: 1.0 - far_share,
            ..ValidationMetrics::default()
        }
    }

    /// Mean loss and share of right actions of pairs of states, by the policy's logits.
    fn policy(&self, logits: &[f32], pairs: &[(u32, u32)], data: &Dataset) -> (f64, f64) {
        let heads = data.action_space().head_sizes();
        let width = heads.iter().sum();
        let (mut loss, mut right) = (0.0, 0_usize);
        for ((from, _), row) in pairs.iter().zip(logits.chunks_exact(width)) {
            let classes = data.classes(self.states[*from as usize]);
            let mut start = 0;
            for (head, class) in heads.iter().zip(classes) {
                let part = &row[start..start + head];
                loss += cross_entropy(part, *class, 1.0);
                right += usize::from(largest(part) == *class);
                start += head;
            }
        }
        let count = (pairs.len() * heads.len()) as f64;
        (loss / count, right as f64 / count)
    }
}

/// Latents of states, `[states, latent_dim]`.
pub fn encode(
    network: &LatentFlowNetwork,
    states: &[State],
    pictures: &Pictures,
    device: &Device,
) -> Result<Tensor<2>, crate::trajectory::TrajectoryError> {
    let parts = states
        .chunks(ENCODED_AT_ONCE)
        .map(|chunk| {
            let patches = pictures.patches(chunk, None)?;
            let tensors = pictures.tensors(patches, chunk.len(), device);
            Ok(network.encode(tensors, None))
        })
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Tensor::cat(parts, 0))
}

/// Logits of pairs of rows of `latents`, pair after pair.
pub fn score(
    network: &LatentFlowNetwork,
    head: HeadKind,
    latents: &Tensor<2>,
    pairs: &[(u32, u32)],
    device: &Device,
) -> Vec<f32> {
    let (from, to) = network.project(head, latents.clone());
    let at_once = if network.joins_pixels() {
        ENCODED_AT_ONCE
    } else {
        SCORED_AT_ONCE
    };
    let mut logits = Vec::new();
    for chunk in pairs.chunks(at_once) {
        let rows = |pick: fn(&(u32, u32)) -> u32| -> Vec<i32> {
            chunk.iter().map(|p| pick(p) as i32).collect()
        };
        let left = from.clone().select(0, indices(&rows(|p| p.0), device));
        let reached = to.clone().select(0, indices(&rows(|p| p.1), device));
        logits.extend(values(network.score(head, left, reached, None)));
    }
    logits
}

/// A tensor's values, row-major.
pub fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    let data: TensorData = tensor.into_data().convert::<f32>();
    data.try_to_vec().expect("converted to f32")
}

/// Cross-entropy of a class in nats, the logits divided by a temperature.
pub fn cross_entropy(logits: &[f32], class: usize, temperature: f64) -> f64 {
    let scaled = |logit: f32| f64::from(logit) / temperature;
    let top = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let sum: f64 = logits
        .iter()
        .map(|l| (scaled(*l) - scaled(top)).exp())
        .sum();
    sum.ln() + scaled(top) - scaled(logits[class])
}

/// The largest logit; the first of several.
pub fn largest(logits: &[f32]) -> usize {
    let mut best = 0;
    for (index, logit) in logits.iter().enumerate() {
        if *logit > logits[best] {
            best = index;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::synthetic;

    fn set() -> (Dataset, ValidationSet) {
        let data = Dataset::new(&[synthetic::demonstrations("a", 3, 12, 1)]).unwrap();
        let set = ValidationSet::new(&data, &[0, 2], &TrainingConfig::default()).unwrap();
        (data, set)
    }

    #[test]
    fn pairs_are_all_near_ones_and_as_much_weight_of_far_ones_as_beta_says() {
        let (_, set) = set();
        assert_eq!(set.near, 2 * (12 + 11 + 10 + 9 + 8));
        assert_eq!(set.policy.len(), 2 * (11 + 10 + 9 + 8));
        let near: f32 = set.weights[..set.near].iter().sum();
        let far: f32 = set.weights[set.near..].iter().sum();
        assert!(
            (near - 0.5).abs() < 1e-4 && (far - 2.5).abs() < 1e-2,
            "{near} {far}"
        );
    }

    #[test]
    fn a_held_out_part_that_only_misses_is_refused_with_a_way_out() {
        let names = ["gripper_close", "gripper_open", "up", "down"];
        let shown = synthetic::acting(&names, &[2, 2, 2, 2, 2, 2, 2, 0, 1]);
        let data = Dataset::new(&[shown]).unwrap();
        let mut config = TrainingConfig::default();
        config.imitation.missed_grasp_steps = 2;
        config.imitation.lead_steps = 9;
        let Err(error) = ValidationSet::new(&data, &[0], &config) else {
            panic!("nothing but its last action is to be imitated");
        };
        let message = error.to_string();
        assert!(
            message.contains("held-out") && message.contains("an action to imitate"),
            "{message}"
        );
        assert!(message.contains("another seed"), "{message}");
    }

    #[test]
    fn overconfident_logits_are_calibrated_by_a_temperature_above_one() {
        let (_, set) = set();
        // Right three times out of four, but with logits that claim to be almost always right.
        let logits: Vec<f32> = (set.classes.iter().enumerate())
            .flat_map(|(index, class)| {
                let said = if index % 4 == 0 {
                    (class + 1) % 5
                } else {
                    *class
                };
                (0..5).map(move |c| if c == said { 9.0 } else { 0.0 })
            })
            .collect();
        let temperature = set.calibrate(&logits, 5);
        assert!(temperature > 2.0, "{temperature}");
        assert!(set.loss(&logits, 5, temperature) < set.loss(&logits, 5, 1.0));
        let metrics = set.traversability(&logits, 5);
        assert!((metrics.traversability_accuracy - 0.75).abs() < 0.02);
        assert!((metrics.wormhole_rate - 0.25).abs() < 0.02);
    }
}
