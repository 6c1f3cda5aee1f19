use burn::tensor::activation::log_softmax;
use burn::tensor::{Device, Tensor, TensorData};

use super::batch::{Pictures, StepInput};
use super::encodings::Encodings;
use super::loss::{WeightedPairs, cross_entropies, indices, policy_entropies, weights};
use super::motion_to_go::MotionTargets;
use super::network::{HeadKind, PairMasks};
use super::{LatentFlowNetwork, StepLosses, TrainingConfig};

/// The objective of a step, ready for its gradient.
pub struct Objective {
    /// `J_traversability + alpha * J_policy`, and the auxiliary loss where there is one.
    pub total: Tensor<1>,
    /// Its parts as numbers.
    pub losses: StepLosses,
    /// What the encoders made of the states.
    pub encodings: Encodings,
}

impl Objective {
    /// Encodes the states of a step once, scores its pairs, and adds the weighted cross-entropies up.
    pub fn of(
        input: StepInput,
        network: &LatentFlowNetwork,
        pictures: &Pictures,
        config: &TrainingConfig,
        heads: &[usize],
        device: &Device,
    ) -> Self {
        let blocks = input.masks.blocks.tensors(device);
        let patches = pictures.tensors(input.patches, input.states, device);
        let encodings = if network.joins_pixels() {
            Encodings::uncut(network.encode(patches, Some(&blocks)))
        } else {
            let encode = |camera| network.encode_camera(camera, &patches, Some(&blocks));
            Encodings::of(patches.len(), encode)
        };
        let (encoded, landmark_logits) = network.part(&encodings.latents());
        let latents = network.with_motion(encoded);

        let targets = &input.targets;
        let pairs = &targets.traversability;
        let masks = PairMasks {
            head: &input.masks.traversability.tensors(device),
            blocks: &blocks,
        };
        let logits = score(network, HeadKind::Traversability, &latents, pairs, masks);
        let weighted = cross_entropies(logits, &pairs.classes[0]) * weights(&pairs.weights, device);
        let near = sum_of(&weighted, 0, targets.near, device);
        let far = sum_of(&weighted, targets.near, pairs.len(), device);

        let pairs = &targets.policy;
        let policy = if pairs.len() == 0 {
            Tensor::zeros([1], device)
        } else {
            let masks = PairMasks {
                head: &input.masks.policy.tensors(device),
                blocks: &input.masks.policy_blocks.tensors(device),
            };
            let logits = score(network, HeadKind::Policy, &latents, pairs, masks);
            let entropies = policy_entropies(&logits, &pairs.classes, heads);
            (entropies * weights(&pairs.weights, device)).sum()
        };

        let motion = match network.motion_of(&latents) {
            Some(told) if !input.motion.rows.is_empty() => motion_error(&told, &input.motion),
            _ => Tensor::zeros([1], device),
        };

        let landmarks = if landmark_logits.is_empty() {
            Tensor::zeros([1], device)
        } else {
            landmark_error(&landmark_logits, input.landmarks, device)
        };
        let landmark_weight = config.landmarks.as_ref().map_or(0.0, |l| l.weight);

        let total = near.clone()
            + far.clone()
            + policy.clone() * config.policy_weight
            + motion.clone() * config.motion_weight
            + landmarks.clone() * landmark_weight;
        let policy_share = pairs.weights.iter().sum::<f32>().max(f32::MIN_POSITIVE);
        let far_share = (0.5 * config.far_weight).max(f32::MIN_POSITIVE);
        Self {
            losses: StepLosses {
                total: total.clone().into_scalar::<f32>(),
                near: near.into_scalar::<f32>() / 0.5,
                far: far.into_scalar::<f32>() / far_share,
                policy: policy.into_scalar::<f32>() / policy_share,
                motion: motion.into_scalar::<f32>(),
                landmarks: landmarks.into_scalar::<f32>(),
            },
            total,
            encodings,
        }
    }
}

fn score(
    network: &LatentFlowNetwork,
    head: HeadKind,
    latents: &Tensor<2>,
    pairs: &WeightedPairs,
    masks: PairMasks<'_>,
) -> Tensor<2> {
    let device = latents.device();
    let (from, to) = network.project(head, latents.clone());
    let from = from.select(0, indices(&pairs.from, &device));
    let to = to.select(0, indices(&pairs.to, &device));
    network.score(head, from, to, Some(masks))
}

/// Mean over states and axes of the squared error of the motion to go.
fn motion_error(told: &Tensor<2>, targets: &MotionTargets) -> Tensor<1> {
    let device = told.device();
    let told = told.clone().select(0, indices(&targets.rows, &device));
    let wanted = TensorData::new(targets.values.clone(), told.dims());
    let error = told - Tensor::from_data(wanted, &device);
    (error.clone() * error).mean()
}

/// Mean over cameras of the cross-entropy between where landmarks are and where they are told to be.
fn landmark_error(logits: &[Tensor<3>], wanted: Vec<Vec<f32>>, device: &Device) -> Tensor<1> {
    let cameras = logits.len();
    let of_cameras = logits.iter().zip(wanted).map(|(logits, wanted)| {
        let wanted = Tensor::<3>::from_data(TensorData::new(wanted, logits.dims()), device);
        (log_softmax(logits.clone(), 2) * wanted).sum()
    });
    -of_cameras.fold(Tensor::zeros([1], device), |sum, one| sum + one) / cameras as f64
}

fn sum_of(values: &Tensor<1>, start: usize, end: usize, device: &Device) -> Tensor<1> {
    if start == end {
        return Tensor::zeros([1], device);
    }
    values.clone().narrow(0, start, end - start).sum()
}
