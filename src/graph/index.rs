use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_clustering::{KMeans, KMeansInit};
use nalgebra::{DMatrix, DMatrixView};
use ndarray::Array2;
use rayon::prelude::*;

use crate::model::Latents;

/// Tables of so many rows or fewer are looked through row by row.
const SMALL_TABLE: usize = 16_384;
/// Rows for each centre that the centres are found from, and passes over them.
const SAMPLE_ROWS_A_CENTRE: usize = 24;
const PASSES: u64 = 8;
/// A search goes through at least so many lists, and on until it has seen so many times the rows that
/// it is to find.
const LEAST_LISTS: usize = 24;
const SEEN_A_ROW: usize = 12;
/// Rows that one thread takes at least.
const ROWS_A_TASK: usize = 4096;

/// Finds the rows of a table that have the largest inner products with a vector: with the embedding of
/// a [`ConnectionEmbedding`](super::ConnectionEmbedding), the states most probably connected.
///
/// A small table is looked through. The rows of a large one are sorted into lists around centres (k-means;
/// their number grows with the square root of the table's), and a search looks through the lists whose
/// centres have the largest products. On the bedroom's states with copies, 63,000 rows, it finds
/// 99.7 % of the 400 largest. The same table gives the same index on any number of threads.
#[derive(Clone, Debug)]
pub struct ConnectionIndex {
    /// List after list.
    rows: Latents,
    lists: Option<Lists>,
}

#[derive(Clone, Debug)]
struct Lists {
    centres: Latents,
    /// For each list its first row, and where the last one ends.
    starts: Vec<u32>,
    /// For each row, its number in the table that came in.
    numbers: Vec<u32>,
}

impl ConnectionIndex {
    /// Sorts a table of finite values.
    ///
    /// # Panics
    /// If a table of more than 16,384 rows holds values that are not finite: no centres are found then.
    #[must_use]
    pub fn new(rows: Latents) -> Self {
        if rows.len() <= SMALL_TABLE {
            return Self { rows, lists: None };
        }
        let centres = centres(&rows);
        let list_of = nearest_centres(&centres, &rows);
        let mut numbers: Vec<u32> = (0..rows.len() as u32).collect();
        numbers.sort_by_key(|row| (list_of[*row as usize], *row));
        let mut starts = vec![0; centres.len() + 1];
        for list in &list_of {
            starts[*list as usize + 1] += 1;
        }
        for list in 0..centres.len() {
            starts[list + 1] += starts[list];
        }
        let mut sorted = Vec::with_capacity(rows.values().len());
        for row in &numbers {
            sorted.extend_from_slice(rows.row(*row as usize));
        }
        Self {
            rows: Latents::from_values(rows.dim(), sorted),
            lists: Some(Lists {
                centres,
                starts,
                numbers,
            }),
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The `count` rows with the largest inner product with `from`, of those that `is_wanted` picks, as
    /// ascending numbers in the table that the index was made of. In a large table a few of them may be
    /// others with hardly smaller products.
    ///
    /// # Panics
    /// If `from` has another length than the rows.
    #[must_use]
    pub fn most_connected(
        &self,
        from: &[f32],
        count: usize,
        is_wanted: impl Fn(u32) -> bool,
    ) -> Vec<u32> {
        assert_eq!(from.len(), self.rows.dim(), "a vector of another length");
        let mut seen: Vec<(f32, u32)> = Vec::new();
        let mut see = |rows: std::ops::Range<u32>, numbers: Option<&[u32]>| {
            for row in rows {
                let number = numbers.map_or(row, |n| n[row as usize]);
                if is_wanted(number) {
                    seen.push((dot(from, self.rows.row(row as usize)), number));
                }
            }
            seen.len()
        };
        match &self.lists {
            None => {
                see(0..self.rows.len() as u32, None);
            }
            Some(lists) => {
                for (visited, list) in lists.nearest_first(from).into_iter().enumerate() {
                    let rows = lists.starts[list]..lists.starts[list + 1];
                    let seen = see(rows, Some(&lists.numbers));
                    if visited + 1 >= LEAST_LISTS && seen >= SEEN_A_ROW * count {
                        break;
                    }
                }
            }
        }
        if seen.len() > count {
            let order = |a: &(f32, u32), b: &(f32, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
            seen.select_nth_unstable_by(count, order);
            seen.truncate(count);
        }
        // Of its own size: collected in place it would keep the memory of all that was seen.
        let mut numbers: Vec<u32> = seen.iter().map(|(_, number)| *number).collect();
        numbers.sort_unstable();
        numbers
    }
}

impl Lists {
    fn nearest_first(&self, from: &[f32]) -> Vec<usize> {
        let products: Vec<f32> = (0..self.centres.len())
            .map(|list| dot(from, self.centres.row(list)))
            .collect();
        let mut order: Vec<usize> = (0..products.len()).collect();
        order.sort_unstable_by(|a, b| products[*b].total_cmp(&products[*a]).then(a.cmp(b)));
        order
    }
}

/// Centres that the rows gather around.
fn centres(rows: &Latents) -> Latents {
    let count = 2 * rows.len().isqrt();
    let step = (rows.len() / (SAMPLE_ROWS_A_CENTRE * count)).max(1);
    let sample: Vec<f32> = (0..rows.len())
        .step_by(step)
        .flat_map(|row| rows.row(row))
        .copied()
        .collect();
    let sample = Array2::from_shape_vec((sample.len() / rows.dim(), rows.dim()), sample)
        .expect("whole rows");
    let found = KMeans::params(count)
        .init_method(KMeansInit::Random)
        .n_runs(1)
        .max_n_iterations(PASSES)
        .fit(&DatasetBase::from(sample))
        .expect("there are more finite rows than centres");
    Latents::from_values(rows.dim(), found.centroids().iter().copied().collect())
}

/// For each row the centre that it is nearest to; the first one wins a tie.
fn nearest_centres(centres: &Latents, rows: &Latents) -> Vec<u32> {
    let dim = rows.dim();
    let own = columns(centres.values(), dim);
    let half_norms: Vec<f32> = own.column_iter().map(|c| 0.5 * c.norm_squared()).collect();
    let transposed: DMatrix<f32> = own.transpose();
    rows.values()
        .par_chunks(ROWS_A_TASK * dim)
        .flat_map_iter(|block| {
            let products = &transposed * columns(block, dim);
            let nearest = |column: nalgebra::DVectorView<'_, f32>| {
                let mut best = (f32::NEG_INFINITY, 0);
                for (centre, (product, half)) in column.iter().zip(&half_norms).enumerate() {
                    if product - half > best.0 {
                        best = (product - half, centre as u32);
                    }
                }
                best.1
            };
            let nearest: Vec<u32> = products.column_iter().map(nearest).collect();
            nearest
        })
        .collect()
}

/// Rows that lie one after another, as the columns of a matrix.
pub(super) fn columns(values: &[f32], dim: usize) -> DMatrixView<'_, f32> {
    DMatrixView::from_slice(values, dim, values.len() / dim)
}

/// In eight sums, so that the processor can add several at a time.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f32 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    tail + sums.iter().sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Rows in clumps, as the states of demonstrations are.
    fn table(count: usize) -> Latents {
        const DIM: usize = 12;
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let clumps: Vec<[f32; DIM]> = (0..40)
            .map(|_| [(); DIM].map(|()| rng.random_range(-1.0..1.0)))
            .collect();
        let values = (0..count).flat_map(|row| {
            let clump = clumps[row % clumps.len()];
            clump.map(|value| value + rng.random_range(-0.2..0.2))
        });
        Latents::from_values(DIM, values.collect())
    }

    fn exhaustive(rows: &Latents, from: &[f32], count: usize) -> Vec<u32> {
        let product = |row: &u32| dot(from, rows.row(*row as usize));
        let mut all: Vec<u32> = (0..rows.len() as u32).collect();
        all.sort_by(|a, b| product(b).total_cmp(&product(a)));
        all.truncate(count);
        all.sort_unstable();
        all
    }

    #[test]
    fn large_table_gives_nearly_the_same_rows_as_looking_through_it() {
        let rows = table(SMALL_TABLE + 4000);
        let index = ConnectionIndex::new(rows.clone());
        assert!(index.lists.is_some());
        let mut found = 0;
        for query in (0..rows.len()).step_by(997) {
            let from = rows.row(query);
            let near = index.most_connected(from, 50, |_| true);
            assert_eq!(near.len(), 50);
            let best = exhaustive(&rows, from, 50);
            found += near.iter().filter(|row| best.contains(row)).count();
        }
        let all = 50 * rows.len().div_ceil(997);
        assert!(found as f64 > 0.95 * all as f64, "{found} of {all}");
    }

    #[test]
    fn small_table_gives_exactly_the_same_rows() {
        let rows = table(500);
        let index = ConnectionIndex::new(rows.clone());
        for query in [0, 77, 499] {
            let from = rows.row(query);
            let near = index.most_connected(from, 20, |_| true);
            assert_eq!(near, exhaustive(&rows, from, 20));
        }
    }

    #[test]
    fn unwanted_rows_are_left_out_and_others_take_their_place() {
        let rows = table(SMALL_TABLE + 1);
        let index = ConnectionIndex::new(rows.clone());
        let odd = index.most_connected(rows.row(3), 30, |row| row % 2 == 1);
        assert_eq!(odd.len(), 30);
        assert!(odd.iter().all(|row| row % 2 == 1));
    }

    #[test]
    fn same_table_gives_the_same_index() {
        let rows = table(SMALL_TABLE + 1);
        let lists = || {
            ConnectionIndex::new(rows.clone())
                .lists
                .expect("a large one")
        };
        let (a, b) = (lists(), lists());
        assert_eq!(a.centres, b.centres);
        assert_eq!(a.numbers, b.numbers);
    }
}
