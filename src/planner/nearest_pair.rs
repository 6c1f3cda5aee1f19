use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::graph::NodeId;
use crate::model::Latents;

/// Sums that run side by side, so that the processor can add several values at a time.
const LANES: usize = 8;
/// After so many values it is looked whether two rows are too far apart already.
const BLOCK: usize = 64;

/// The two states with the least Euclidean distance of their latents, one of `near` and one of `far`, and that
/// distance. Of pairs that are as near as each other the one with the lowest `far`, then the lowest `near`, on any
/// number of threads. None where no distance is a number.
pub(super) fn nearest_pair(
    latents: &Latents,
    near: &[NodeId],
    far: &[NodeId],
) -> Option<(NodeId, NodeId, f32)> {
    let in_order = |a: &(f32, NodeId, NodeId), b: &(f32, NodeId, NodeId)| {
        a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2)))
    };
    // The least square that any thread found so far: numbers that are not negative are in the order of their bits. Only
    // what is farther is left out, so that it does not matter which thread is first.
    let least = AtomicU32::new(f32::INFINITY.to_bits());
    let nearest_to = |far: &NodeId| {
        let row = latents.row(far.index());
        let pairs = near.iter().filter_map(|near| {
            let most = f32::from_bits(least.load(Ordering::Relaxed));
            let square = square_up_to(row, latents.row(near.index()), most)?;
            if square < most {
                least.fetch_min(square.to_bits(), Ordering::Relaxed);
            }
            Some((square, *far, *near))
        });
        pairs.min_by(in_order)
    };
    let nearest = far.par_iter().filter_map(nearest_to).min_by(in_order);
    nearest.map(|(square, far, near)| (near, far, square.sqrt()))
}

/// The squared distance of two rows; none where it is more than `most`, or no number.
fn square_up_to(a: &[f32], b: &[f32], most: f32) -> Option<f32> {
    let mut sum = 0.0;
    for (a, b) in a.chunks(BLOCK).zip(b.chunks(BLOCK)) {
        sum += square(a, b);
        if sum > most {
            return None;
        }
    }
    (sum <= most).then_some(sum)
}

fn square(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail = a.remainder().iter().zip(b.remainder());
    let tail: f32 = tail.map(|(a, b)| (a - b) * (a - b)).sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += (a - b) * (a - b);
        }
    }
    tail + sums.iter().sum::<f32>()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Rows of whole numbers: their squares are exact in whichever order they are added, and often the same.
    fn table(dim: usize, count: usize) -> Latents {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let values = (0..dim * count).map(|_| rng.random_range(0..4_u8));
        Latents::from_values(dim, values.map(f32::from).collect())
    }

    fn nodes(range: std::ops::Range<u32>) -> Vec<NodeId> {
        range.map(NodeId).collect()
    }

    /// The first of the nearest pairs, each one looked at.
    fn one_by_one(
        latents: &Latents,
        near: &[NodeId],
        far: &[NodeId],
    ) -> Option<(NodeId, NodeId, f32)> {
        let mut best: Option<(NodeId, NodeId, f32)> = None;
        for far in far {
            for near in near {
                let [a, b] = [near, far].map(|node| latents.row(node.index()));
                let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
                if best.is_none_or(|(_, _, least)| square.sqrt() < least) {
                    best = Some((*near, *far, square.sqrt()));
                }
            }
        }
        best
    }

    #[test]
    fn the_nearest_pair_is_that_of_all_pairs_on_any_number_of_threads() {
        let (near, far) = (nodes(0..50), nodes(50..130));
        for dim in [1, 3, 8, 64, 70, 200] {
            let latents = table(dim, 130);
            let wanted = one_by_one(&latents, &near, &far);
            for threads in [1, 4] {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .expect("threads");
                let found = pool.install(|| nearest_pair(&latents, &near, &far));
                assert_eq!(found, wanted, "{dim} values on {threads} threads");
            }
        }
    }

    #[test]
    fn what_is_no_number_is_near_nothing() {
        let latents = Latents::from_values(1, vec![0.0, f32::NAN, 7.0, 3.0]);
        let nearest = |near, far| nearest_pair(&latents, &nodes(near), &nodes(far));
        assert_eq!(nearest(0..2, 2..4), Some((NodeId(0), NodeId(3), 3.0)));
        assert_eq!(nearest(1..2, 2..4), None);
        assert_eq!(nearest_pair(&latents, &[], &nodes(2..4)), None);
    }
}
