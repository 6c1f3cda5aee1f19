use nalgebra::{DMatrix, DMatrixView};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::index::columns;
use crate::model::{Latents, ModelError, Projections, Traversability, predict_in_blocks};

/// Largest number of states on either side of the sample that is scored in full.
const LARGEST_SAMPLE: usize = 400;
/// Values in an embedding; the network's answers for the bedroom's states have hardly more dimensions.
const RANK: usize = 64;
/// Log-odds beyond this are as good as certain.
const CERTAIN: f64 = 12.0;
/// What keeps the interpolation from following single states.
const RIDGE: f64 = 1e-3;
/// Rows that are embedded at once.
const EMBEDDED_ROWS: usize = 512;

/// An inexpensive likeness of a traversability function: the inner product of an embedding of the state
/// that is left and one of the state that is to be reached is about the log-odds of being connected.
///
/// Neighbours in the latent space itself do not tell: of the edges of the bedroom's graphs, the nearest
/// 5 % of the states hold 4 in 10. So the network is asked about all pairs of a sample of states on
/// either side, the answers are factorised, and the factors carried to all other states by kernel ridge
/// regression over the projected latents.
#[derive(Clone, Debug)]
pub struct ConnectionEmbedding {
    from: Tower,
    to: Tower,
    scored_pairs: u64,
}

/// One side: interpolates what is known at sampled states.
#[derive(Clone, Debug)]
struct Tower {
    sample: Latents,
    inverse_scale: f64,
    /// A row a value of the embedding, a column a sampled state.
    weights: DMatrix<f32>,
}

impl ConnectionEmbedding {
    /// The share of the states on either side of the sample that is enough for the bedroom's graphs.
    pub const SAMPLE_SHARE: f64 = 0.12;

    /// Learns from the network's answers for `share` (0..=1) of the states on either side, 400 at most,
    /// so for `share` squared of all pairs. The same seed gives the same embedding.
    ///
    /// # Errors
    /// [`ModelError`] when the network gives no answer.
    ///
    /// # Panics
    /// If there is no state.
    pub fn fit(
        traversability: &(dyn Traversability + Sync),
        projections: &Projections,
        share: f64,
        seed: u64,
    ) -> Result<Self, ModelError> {
        let count = projections.from.len();
        assert!(count > 0, "an embedding of no states");
        let size = ((share * count as f64) as usize).clamp(8.min(count), LARGEST_SAMPLE.min(count));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> Vec<u32> {
            let mut rows: Vec<u32> = index::sample(&mut rng, count, size)
                .into_iter()
                .map(|row| row as u32)
                .collect();
            rows.sort_unstable();
            rows
        };
        let [from, to] = [draw(), draw()];
        let odds = log_odds(traversability, projections, &from, &to)?;
        let svd = odds.svd(true, true);
        let rank = RANK.min(size);
        let roots = svd.singular_values.rows(0, rank).map(f64::sqrt);
        let left =
            svd.u.expect("it was asked for").columns(0, rank) * DMatrix::from_diagonal(&roots);
        let right = svd.v_t.expect("it was asked for").rows(0, rank).transpose()
            * DMatrix::from_diagonal(&roots);
        Ok(Self {
            from: Tower::new(&projections.from, &from, &left),
            to: Tower::new(&projections.to, &to, &right),
            scored_pairs: (size * size) as u64,
        })
    }

    /// How many pairs the network was asked about.
    #[must_use]
    pub fn scored_pairs(&self) -> u64 {
        self.scored_pairs
    }

    /// Embeds states as those that are left: projected rows [`Projections::from`].
    ///
    /// # Panics
    /// If the rows have another length than those that it was learnt from.
    #[must_use]
    pub fn embed_from(&self, rows: &Latents) -> Latents {
        self.from.embed(rows)
    }

    /// Embeds states as those that are to be reached: projected rows [`Projections::to`].
    ///
    /// # Panics
    /// If the rows have another length than those that it was learnt from.
    #[must_use]
    pub fn embed_to(&self, rows: &Latents) -> Latents {
        self.to.embed(rows)
    }
}

/// Log-odds of being connected for all pairs of two lists of states, above the least that counts.
fn log_odds(
    traversability: &(dyn Traversability + Sync),
    projections: &Projections,
    from: &[u32],
    to: &[u32],
) -> Result<DMatrix<f64>, ModelError> {
    let pairs: Vec<(u32, u32)> = from
        .iter()
        .flat_map(|a| to.iter().map(move |b| (*a, *b)))
        .collect();
    let predicted = predict_in_blocks(traversability, projections, projections, &pairs)?;
    let odds = predicted.rows().map(|row| {
        let far = f64::from(row[row.len() - 1]).clamp(1e-9, 1.0 - 1e-9);
        ((1.0 - far) / far).ln().clamp(-CERTAIN, CERTAIN) + CERTAIN
    });
    Ok(DMatrix::from_row_iterator(from.len(), to.len(), odds))
}

impl Tower {
    fn new(rows: &Latents, sampled: &[u32], values: &DMatrix<f64>) -> Self {
        let mut sample = Latents::new(rows.dim());
        for row in sampled {
            sample.push(rows.row(*row as usize));
        }
        let count = sample.len();
        let squared = DMatrix::from_fn(count, count, |a, b| {
            squared_distance(sample.row(a), sample.row(b))
        });
        let inverse_scale = median(squared.iter().copied().filter(|d| *d > 0.0))
            .max(1e-12)
            .recip();
        let mut kernel = squared.map(|d| (-d * inverse_scale).exp());
        for at in 0..count {
            kernel[(at, at)] += RIDGE;
        }
        let weights = kernel
            .cholesky()
            .expect("a Gaussian kernel with a ridge is positive definite")
            .solve(values)
            .transpose()
            .map(|weight| weight as f32);
        Self {
            sample,
            inverse_scale,
            weights,
        }
    }

    /// Rows of the embedding, in blocks: two products of matrices with a kernel between them.
    fn embed(&self, rows: &Latents) -> Latents {
        let dim = rows.dim();
        let own = columns(self.sample.values(), dim);
        let sample = own.transpose();
        let norms = squared_norms(own);
        let scale = self.inverse_scale as f32;
        let embedded: Vec<Vec<f32>> = rows
            .values()
            .par_chunks(EMBEDDED_ROWS * dim)
            .map(|block| {
                let block = columns(block, dim);
                let block_norms = squared_norms(block);
                let mut near = &sample * block;
                for (mut column, norm) in near.column_iter_mut().zip(&block_norms) {
                    for (value, own) in column.iter_mut().zip(&norms) {
                        let squared = (own + norm - 2.0 * *value).max(0.0);
                        *value = (-squared * scale).exp();
                    }
                }
                (&self.weights * near).as_slice().to_vec()
            })
            .collect();
        Latents::from_values(self.weights.nrows(), embedded.concat())
    }
}

fn squared_norms(columns: DMatrixView<'_, f32>) -> Vec<f32> {
    columns.column_iter().map(|c| c.norm_squared()).collect()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    f64::from(squares.sum::<f32>())
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::ConnectionIndex;
    use crate::graph::fakes::Oracle;

    /// States along a corridor that are connected where the second is up to 4 ahead.
    fn corridor(count: usize) -> (Oracle, Projections) {
        let oracle = Oracle::new(5, |a, b| {
            let ahead = b[0] - a[0];
            (0.0..4.5).contains(&ahead).then(|| ahead.round() as u32)
        });
        let mut latents = Latents::new(1);
        for at in 0..count {
            latents.push(&[0.5 * at as f32]);
        }
        let projections = oracle
            .project(&latents)
            .expect("an oracle projects everything");
        (oracle, projections)
    }

    #[test]
    fn the_most_connected_states_are_those_that_the_network_connects() {
        let (oracle, projections) = corridor(200);
        let embedding =
            ConnectionEmbedding::fit(&oracle, &projections, 0.5, 3).expect("it answers");
        assert_eq!(embedding.scored_pairs(), 100 * 100);
        let from = embedding.embed_from(&projections.from);
        let to = ConnectionIndex::new(embedding.embed_to(&projections.to));
        let (mut found, mut all) = (0, 0);
        for a in 0..200_u32 {
            // Nine states from itself on, of which a proposal may hold three more.
            let near = to.most_connected(from.row(a as usize), 12, |_| true);
            let true_ones = (a..(a + 9).min(200)).filter(|b| near.contains(b));
            found += true_ones.count();
            all += (a..(a + 9).min(200)).count();
        }
        assert!(found as f64 > 0.9 * all as f64, "{found} of {all}");
    }

    #[test]
    fn the_same_seed_proposes_the_same_and_what_is_unwanted_is_left_out() {
        let (oracle, projections) = corridor(60);
        let rows = || {
            let embedding = ConnectionEmbedding::fit(&oracle, &projections, 0.5, 3).unwrap();
            let from = embedding.embed_from(&projections.from);
            let to = ConnectionIndex::new(embedding.embed_to(&projections.to));
            to.most_connected(from.row(20), 8, |b| b != 21)
        };
        assert_eq!(rows(), rows());
        assert_eq!(rows().len(), 8);
        assert!(!rows().contains(&21));
    }

    #[test]
    fn few_states_are_all_proposed() {
        let (oracle, projections) = corridor(3);
        let embedding =
            ConnectionEmbedding::fit(&oracle, &projections, 0.1, 0).expect("it answers");
        let from = embedding.embed_from(&projections.from);
        let to = ConnectionIndex::new(embedding.embed_to(&projections.to));
        assert_eq!(to.most_connected(from.row(0), 10, |_| true), [0, 1, 2]);
    }
}
