//! Which pairs of held-out states a validation looks at, beside the near ones.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::alignment::Alignment;
use super::closings::Closings;
use super::look_alikes::LookAlikes;
use super::sampler::is_far;
use super::{Dataset, StateRef, TrainingConfig};

/// Far pairs that are scored in a validation.
const FAR_PAIRS: usize = 16_384;

/// Row of a held-out state.
fn row_of(states: &[StateRef], state: StateRef) -> u32 {
    let row = states.binary_search(&state);
    row.expect("trajectories are in rising order") as u32
}

/// Every state with the states that lie 1 to `d_max - 1` steps beyond its counterpart in each other
/// trajectory.
pub fn across(
    data: &Dataset,
    trajectories: &[u32],
    states: &[StateRef],
    config: &TrainingConfig,
) -> Vec<(u32, u32)> {
    let alignment = Alignment::find(data, trajectories);
    let mut pairs = Vec::new();
    for (row, state) in states.iter().enumerate() {
        if !data.is_imitated(*state, &config.imitation) {
            continue;
        }
        for (partner, _) in alignment.partners(state.trajectory) {
            let Some(step) = alignment.counterpart(*state, *partner) else {
                continue;
            };
            let end = (step as usize + config.d_max).min(data.steps(*partner)) as u32;
            pairs.extend((step + 1..end).map(|step| {
                let goal = StateRef {
                    trajectory: *partner,
                    step,
                };
                (row as u32, row_of(states, goal))
            }));
        }
    }
    pairs
}

/// Pairs of states of one trajectory that look alike and are far apart in time.
pub fn look_alikes(
    data: &Dataset,
    trajectories: &[u32],
    states: &[StateRef],
    d_max: usize,
) -> Vec<(u32, u32)> {
    let lengths: Vec<_> = trajectories.iter().map(|t| (*t, data.steps(*t))).collect();
    LookAlikes::find(data, &lengths, d_max)
        .pairs()
        .map(|(state, twin)| (row_of(states, state), row_of(states, twin)))
        .collect()
}

/// Far pairs of a gripper that closed on nothing and one that holds its thing.
pub fn missed_grasps(
    data: &Dataset,
    trajectories: &[u32],
    states: &[StateRef],
    config: &TrainingConfig,
) -> Vec<(u32, u32)> {
    Closings::find(data, trajectories, &config.imitation)
        .pairs()
        .filter(|(missed, held)| is_far(*missed, *held, config.d_max))
        .map(|(missed, held)| (row_of(states, missed), row_of(states, held)))
        .collect()
}

/// Far pairs, uniformly at random.
pub fn far_pairs(states: &[StateRef], config: &TrainingConfig) -> Vec<(u32, u32)> {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut pairs = Vec::with_capacity(FAR_PAIRS);
    for _ in 0..FAR_PAIRS * 4 {
        if pairs.len() == FAR_PAIRS {
            break;
        }
        let (from, to) = (
            rng.random_range(0..states.len()),
            rng.random_range(0..states.len()),
        );
        if is_far(states[from], states[to], config.d_max) {
            pairs.push((from as u32, to as u32));
        }
    }
    pairs
}
