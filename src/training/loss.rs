//! The objective: `J_traversability + alpha * J_policy` (Fu & Finn, sections III-C, III-E, III-F).

use std::ops::Range;

use burn::tensor::activation::log_softmax;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::distr::Distribution;
use rand::distr::weighted::WeightedIndex;
use rand_chacha::ChaCha8Rng;

use super::sampler::Draw;
use super::{Dataset, TrainingConfig};

/// Pairs of rows of a batch with their classes and weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WeightedPairs {
    /// Rows of the states that are left.
    pub from: Vec<i32>,
    /// Rows of the states that are to be reached.
    pub to: Vec<i32>,
    /// For each head, the class of each pair, counted from 0.
    pub classes: Vec<Vec<i32>>,
    /// Weight of each pair in the sum of cross-entropies.
    pub weights: Vec<f32>,
}

impl WeightedPairs {
    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    fn push(&mut self, (from, to): (usize, usize), classes: &[usize], weight: f32) {
        self.from.push(from as i32);
        self.to.push(to as i32);
        self.classes.resize(classes.len(), Vec::new());
        for (head, class) in self.classes.iter_mut().zip(classes) {
            head.push(*class as i32);
        }
        self.weights.push(weight);
    }

    /// Keeps `count` of the pairs within a range, drawn in proportion to their weights, and gives each the
    /// same share of what they weighed together. The expected loss stays.
    fn thin(&self, range: Range<usize>, count: usize, rng: &mut ChaCha8Rng) -> Self {
        let weights = &self.weights[range.clone()];
        let total: f32 = weights.iter().sum();
        let mut kept = Self::default();
        let Ok(draw) = WeightedIndex::new(weights) else {
            return kept;
        };
        for _ in 0..count {
            let pair = range.start + draw.sample(rng);
            let classes: Vec<usize> = self.classes.iter().map(|c| c[pair] as usize).collect();
            let rows = (self.from[pair] as usize, self.to[pair] as usize);
            kept.push(rows, &classes, total / count as f32);
        }
        kept
    }

    fn extend(&mut self, other: &Self) {
        if other.len() == 0 {
            return;
        }
        self.from.extend(&other.from);
        self.to.extend(&other.to);
        self.classes.resize(other.classes.len(), Vec::new());
        for (head, more) in self.classes.iter_mut().zip(&other.classes) {
            head.extend(more);
        }
        self.weights.extend(&other.weights);
    }
}

/// What a batch is to be scored on.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    /// Near pairs first, then far ones.
    pub traversability: WeightedPairs,
    /// How many of the traversability pairs are near.
    pub near: usize,
    /// Near pairs whose second state is later than the first.
    pub policy: WeightedPairs,
}

impl Targets {
    /// Classes and weights of the pairs of a draw.
    ///
    /// Near and far pairs each stand for one half of the paper's mini-batch. Of the near half every
    /// class that occurs has the same share; of the far half `hard_share` goes to hard pairs and
    /// `missed_grasp_share` to closings that missed beside closings that held.
    pub fn of(draw: &Draw, data: &Dataset, config: &TrainingConfig) -> Self {
        let mut targets = Self {
            traversability: WeightedPairs::default(),
            near: draw.near.len(),
            policy: WeightedPairs::default(),
        };
        let weights = near_class_weights(
            config.d_max,
            draw.near.iter().map(|p| near_class(p.gap_steps)),
        );
        let aligned_share = if draw.aligned.is_empty() {
            0.0
        } else {
            config.sampling.aligned_policy_share as f32
        };
        for pair in &draw.near {
            let class = near_class(pair.gap_steps);
            let rows = (pair.from, pair.to);
            targets.traversability.push(rows, &[class], weights[class]);
            let from = draw.states[pair.from];
            if pair.gap_steps > 0 && data.is_imitated(from, &config.imitation) {
                let weight = weights[class] * (1.0 - aligned_share);
                let actions = data.classes(from);
                targets.policy.push(rows, actions, weight);
            }
        }
        targets.add_aligned(draw, data, config, aligned_share);
        let sampling = &config.sampling;
        let kinds = [
            (
                &draw.far,
                1.0 - sampling.hard_share - sampling.missed_grasp_share,
            ),
            (&draw.hard, sampling.hard_share),
            (&draw.grasps, sampling.missed_grasp_share),
        ];
        let present = kinds.iter().filter(|(pairs, _)| !pairs.is_empty());
        let total: f64 = present.map(|(_, share)| share).sum();
        for (pairs, share) in kinds {
            let share = if total > 0.0 {
                (share / total) as f32
            } else {
                0.0
            };
            let weight = 0.5 * config.far_weight * share / pairs.len().max(1) as f32;
            for rows in pairs.iter().filter(|_| weight > 0.0) {
                let far = [config.d_max - 1];
                targets.traversability.push(*rows, &far, weight);
            }
        }
        targets
    }

    /// Keeps `count` near pairs, as many others, and as many of the policy, drawn with replacement in
    /// proportion to their weights: for networks for which each pair is costly. The expected loss stays.
    pub fn thin(&mut self, count: usize, rng: &mut ChaCha8Rng) {
        let all = self.traversability.len();
        let mut kept = self.traversability.thin(0..self.near, count, rng);
        let near = kept.len();
        kept.extend(&self.traversability.thin(self.near..all, count, rng));
        self.policy = self.policy.thin(0..self.policy.len(), count, rng);
        (self.traversability, self.near) = (kept, near);
    }

    /// Goal states of other demonstrations, with the action that the state's own demonstration took.
    fn add_aligned(&mut self, draw: &Draw, data: &Dataset, config: &TrainingConfig, share: f32) {
        let classes = draw.aligned.iter().map(|p| near_class(p.gap_steps));
        let weights = near_class_weights(config.d_max, classes);
        for pair in draw.aligned.iter().filter(|_| share > 0.0) {
            let from = draw.states[pair.from];
            if data.is_imitated(from, &config.imitation) {
                let weight = weights[near_class(pair.gap_steps)] * share;
                let rows = (pair.from, pair.to);
                self.policy.push(rows, data.classes(from), weight);
            }
        }
    }
}

/// The traversability class of two states `gap_steps` apart, counted from 0: a state is one step away
/// from itself.
pub fn near_class(gap_steps: usize) -> usize {
    gap_steps.max(1) - 1
}

/// The weight of a pair of each near class, so that every class that occurs has the same share of one
/// half.
pub fn near_class_weights(d_max: usize, classes: impl Iterator<Item = usize>) -> Vec<f32> {
    let mut counts = vec![0_usize; d_max];
    for class in classes {
        counts[class] += 1;
    }
    let present = counts.iter().filter(|c| **c > 0).count().max(1);
    counts
        .iter()
        .map(|count| match count {
            0 => 0.0,
            count => 0.5 / (present * count) as f32,
        })
        .collect()
}

/// Cross-entropy of each pair, `[pairs, classes]` to `[pairs]`.
pub fn cross_entropies(logits: Tensor<2>, classes: &[i32]) -> Tensor<1> {
    let device = logits.device();
    let [pairs, _] = logits.dims();
    let classes = indices(classes, &device).reshape([pairs, 1]);
    let taken: Tensor<1> = log_softmax(logits, 1).gather(1, classes).reshape([pairs]);
    -taken
}

/// Policy cross-entropy of each pair: the mean over the heads, whose logits lie side by side.
pub fn policy_entropies(logits: &Tensor<2>, classes: &[Vec<i32>], heads: &[usize]) -> Tensor<1> {
    let [pairs, _] = logits.dims();
    let mut sum: Option<Tensor<1>> = None;
    let mut start = 0;
    for (head, classes) in heads.iter().zip(classes) {
        let part = logits.clone().slice([0..pairs, start..start + head]);
        let entropies = cross_entropies(part, classes);
        sum = Some(match sum {
            Some(sum) => sum + entropies,
            None => entropies,
        });
        start += head;
    }
    sum.expect("an action space has a head") / heads.len() as f64
}

/// Row or class numbers on a device.
pub fn indices(values: &[i32], device: &Device) -> Tensor<1, Int> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len()]), device)
}

/// Weights on a device.
pub fn weights(values: &[f32], device: &Device) -> Tensor<1> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len()]), device)
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::training::sampler::NearPair;
    use crate::training::{StateRef, synthetic};

    fn at(trajectory: u32, step: u32) -> StateRef {
        StateRef { trajectory, step }
    }

    fn near(from: usize, to: usize) -> NearPair {
        NearPair {
            from,
            to,
            gap_steps: to - from,
        }
    }

    fn draw() -> Draw {
        Draw {
            states: vec![at(0, 3), at(0, 4), at(0, 5), at(1, 0)],
            window_of: vec![0, 0, 0, 1],
            near: vec![near(0, 0), near(0, 1), near(1, 2), near(0, 2)],
            far: vec![(0, 3), (3, 1)],
            hard: vec![(2, 0)],
            grasps: Vec::new(),
            aligned: Vec::new(),
        }
    }

    #[test]
    fn weights_give_each_class_and_each_half_its_share() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
        let mut config = TrainingConfig::default();
        config.sampling.hard_share = 0.4;
        let targets = Targets::of(&draw(), &data, &config);
        // Two classes occur: three pairs of class 0 share 0.25, one of class 1 has 0.25.
        let twelfth = 0.25 / 3.0;
        let expected = [twelfth, twelfth, twelfth, 0.25, 0.75, 0.75, 1.0];
        for (weight, expected) in targets.traversability.weights.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-6, "{weight} {expected}");
        }
        assert_eq!(targets.traversability.classes, [[0, 0, 0, 1, 4, 4, 4]]);
        assert_eq!(targets.policy.from, [0, 1, 0]);
        assert_eq!(targets.policy.to, [1, 2, 2]);
        let action = data.classes(at(0, 3))[0] as i32;
        assert_eq!(targets.policy.classes[0][0], action);
    }

    #[test]
    fn goal_states_of_other_demonstrations_take_their_share_of_the_policy() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
        let mut config = TrainingConfig::default();
        config.sampling.aligned_policy_share = 0.25;
        let mut draw = draw();
        draw.aligned = vec![near(1, 3)];
        let policy = Targets::of(&draw, &data, &config).policy;
        assert_eq!((policy.from[3], policy.to[3]), (1, 3));
        assert_eq!(policy.classes[0][3], data.classes(at(0, 4))[0] as i32);
        // One pair of class 1 has the whole half of its kind; own pairs: 1/12, 1/12 and 0.25 as above.
        let expected = [0.75 / 12.0, 0.75 / 12.0, 0.75 * 0.25, 0.25 * 0.5];
        for (weight, expected) in policy.weights.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-6, "{weight} {expected}");
        }
    }

    #[test]
    fn a_missed_grasp_is_left_out_of_the_policy_and_of_nothing_else() {
        let names = ["gripper_close", "gripper_open", "up", "down"];
        let set = synthetic::acting(&names, &[2, 2, 3, 3, 0, 1, 2, 2, 2]);
        let data = Dataset::new(&[set]).unwrap();
        let mut config = TrainingConfig::default();
        let all = Targets::of(&draw(), &data, &config);
        assert_eq!(all.policy.from, [0, 1, 0]);
        config.imitation.missed_grasp_steps = 2;
        config.imitation.lead_steps = 2;
        let without = Targets::of(&draw(), &data, &config);
        assert!(
            without.policy.from.is_empty(),
            "steps 3 and 4 led to the miss and were it"
        );
        assert_eq!(without.traversability, all.traversability);
        let opening = at(0, 5);
        assert!(data.is_imitated(opening, &config.imitation));
    }

    #[test]
    fn closings_that_missed_take_their_share_of_the_far_half() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
        let mut config = TrainingConfig::default();
        (
            config.sampling.hard_share,
            config.sampling.missed_grasp_share,
        ) = (0.4, 0.2);
        let mut draw = draw();
        draw.grasps = vec![(0, 3), (3, 0)];
        let targets = Targets::of(&draw, &data, &config);
        let far = &targets.traversability.weights[4..];
        for (weight, expected) in far.iter().zip([0.5, 0.5, 1.0, 0.25, 0.25]) {
            assert!((weight - expected).abs() < 1e-6, "{weight} {expected}");
        }
    }

    #[test]
    fn thinned_pairs_weigh_what_all_did_and_are_drawn_by_weight() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
        let mut config = TrainingConfig::default();
        config.sampling.hard_share = 0.4;
        let whole = Targets::of(&draw(), &data, &config);
        let mut thin = whole.clone();
        thin.thin(4_000, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!((thin.near, thin.traversability.len()), (4_000, 8_000));
        let sum = |w: &[f32]| w.iter().sum::<f32>();
        let (near, far) = thin.traversability.weights.split_at(thin.near);
        assert!((sum(near) - 0.5).abs() < 1e-3 && (sum(far) - 2.5).abs() < 1e-2);
        assert!((sum(&thin.policy.weights) - sum(&whole.policy.weights)).abs() < 1e-3);
        // One pair in four is of class 1, and it weighs as much as the other three.
        let later = thin.traversability.classes[0][..thin.near].iter();
        let share = later.filter(|class| **class == 1).count() as f32 / 4_000.0;
        assert!((share - 0.5).abs() < 0.03, "{share}");
    }

    #[test]
    fn without_hard_pairs_the_far_half_is_uniform() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
        let mut draw = draw();
        draw.hard.clear();
        let targets = Targets::of(&draw, &data, &TrainingConfig::default());
        assert_eq!(targets.traversability.weights[4..], [1.25, 1.25]);
    }

    #[test]
    fn cross_entropy_by_hand() {
        let device = Device::flex();
        let logits = Tensor::<2>::from_data([[0.0, 0.0], [2.0, 0.0]], &device);
        let values: Vec<f32> = cross_entropies(logits, &[1, 0])
            .into_data()
            .try_to_vec()
            .unwrap();
        assert!((values[0] - 2.0_f32.ln()).abs() < 1e-6);
        assert!((values[1] - (1.0 + (-2.0_f32).exp()).ln()).abs() < 1e-6);
    }

    #[test]
    fn policy_loss_is_the_mean_over_heads() {
        let device = Device::flex();
        let logits = Tensor::<2>::from_data([[0.0, 0.0, 0.0, 0.0, 0.0]], &device);
        let loss = policy_entropies(&logits, &[vec![1], vec![2]], &[2, 3]);
        let expected = 2.0_f32.ln().midpoint(3.0_f32.ln());
        assert!((loss.into_scalar::<f32>() - expected).abs() < 1e-6);
    }
}
