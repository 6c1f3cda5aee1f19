use rayon::prelude::*;

use super::{Latents, ModelError};

/// Pairs in one call of the network: engines are fastest at one to two thousand.
pub(crate) const BLOCK_PAIRS: usize = 2048;

/// States made ready for [`Traversability::predict`]: what the model wants of a state when it is the
/// first of a pair, and when it is the second. Rows are states; only the model knows their meaning.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Projections {
    /// A state as the one that is left.
    pub from: Latents,
    /// A state as the one that is to be reached.
    pub to: Latents,
}

impl Projections {
    /// Adds the rows of another table made by the same model.
    ///
    /// # Panics
    /// If the other table's rows have another length.
    pub fn extend(&mut self, other: &Self) {
        if self.from.is_empty() {
            self.clone_from(other);
        } else {
            self.from.extend(&other.from);
            self.to.extend(&other.to);
        }
    }
}

/// Class probabilities of pairs: a row of `d_max` values a pair, summing to 1. Column `k` is the
/// probability that the second state lies `k + 1` time steps after the first; the last column is the
/// probability that it is `d_max` or more steps away or cannot be reached at all.
#[derive(Clone, Debug, PartialEq)]
pub struct StepDistributions {
    d_max: usize,
    probabilities: Vec<f32>,
}

impl StepDistributions {
    /// Wraps probabilities that lie row after row.
    ///
    /// # Panics
    /// If they are not a whole number of rows of `d_max`, or `d_max` is 0.
    #[must_use]
    pub fn new(d_max: usize, probabilities: Vec<f32>) -> Self {
        assert!(d_max > 0 && probabilities.len().is_multiple_of(d_max));
        Self {
            d_max,
            probabilities,
        }
    }

    /// Refuses an answer that is not a row of `d_max` values for each of so many pairs.
    ///
    /// # Errors
    /// [`ModelError::Length`] with both numbers.
    pub(crate) fn ensure_of(&self, pairs: usize, d_max: usize) -> Result<(), ModelError> {
        ModelError::unless_as_many("the class probabilities of a pair", d_max, self.d_max)?;
        let (expected, found) = (pairs * d_max, self.probabilities.len());
        ModelError::unless_as_many("the class probabilities of all pairs", expected, found)
    }

    /// Number of classes: values in a row.
    #[must_use]
    pub fn d_max(&self) -> usize {
        self.d_max
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.probabilities.len() / self.d_max
    }

    /// Whether there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.probabilities.is_empty()
    }

    /// The probabilities of one pair.
    ///
    /// # Panics
    /// If `pair` is not below [`len`](Self::len).
    #[must_use]
    pub fn row(&self, pair: usize) -> &[f32] {
        &self.probabilities[pair * self.d_max..(pair + 1) * self.d_max]
    }

    /// The probabilities, row after row.
    #[must_use]
    pub fn into_values(self) -> Vec<f32> {
        self.probabilities
    }

    /// All rows in the order of the pairs.
    pub fn rows(&self) -> impl Iterator<Item = &[f32]> {
        self.probabilities.chunks_exact(self.d_max)
    }
}

/// The learned traversability function: how many time steps lead from one state to another
/// (Fu & Finn, section III-C). It is directed.
pub trait Traversability {
    /// Number of classes.
    fn d_max(&self) -> usize;

    /// Makes states ready for [`predict`](Self::predict); done once a state, not once a pair.
    ///
    /// # Errors
    /// [`ModelError::Length`] for latents of another length, [`ModelError::Engine`] when the network
    /// cannot be run.
    fn project(&self, latents: &Latents) -> Result<Projections, ModelError>;

    /// Class probabilities for pairs `(row of from, row of to)`, a row of [`d_max`](Self::d_max) values a pair, in
    /// the order of the pairs. Whoever asks refuses any other number of them.
    ///
    /// # Errors
    /// [`ModelError`] as for [`project`](Self::project).
    ///
    /// # Panics
    /// If a pair names a row that is not there.
    fn predict(
        &self,
        from: &Projections,
        to: &Projections,
        pairs: &[(u32, u32)],
    ) -> Result<StepDistributions, ModelError>;
}

/// [`Traversability::predict`] for any number of pairs, in blocks and on all cores. The result does not
/// depend on the number of threads.
///
/// # Errors
/// [`ModelError`] as for [`Traversability::predict`], and [`ModelError::Length`] for an answer that is not a row of
/// [`d_max`](Traversability::d_max) values for each pair.
///
/// # Panics
/// If a pair names a row that is not there.
pub fn predict_in_blocks(
    traversability: &(dyn Traversability + Sync),
    from: &Projections,
    to: &Projections,
    pairs: &[(u32, u32)],
) -> Result<StepDistributions, ModelError> {
    let d_max = traversability.d_max();
    let blocks: Vec<Vec<f32>> = pairs
        .par_chunks(BLOCK_PAIRS)
        .map(|block| {
            let predicted = traversability.predict(from, to, block)?;
            predicted.ensure_of(block.len(), d_max)?;
            Ok(predicted.probabilities)
        })
        .collect::<Result<_, ModelError>>()?;
    Ok(StepDistributions::new(d_max, blocks.concat()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Has three classes, and answers with so many values for all pairs together, in rows of so many.
    struct Careless {
        row: usize,
        values: usize,
    }

    impl Traversability for Careless {
        fn d_max(&self) -> usize {
            3
        }

        fn project(&self, latents: &Latents) -> Result<Projections, ModelError> {
            Ok(Projections {
                from: latents.clone(),
                to: latents.clone(),
            })
        }

        fn predict(
            &self,
            _: &Projections,
            _: &Projections,
            _: &[(u32, u32)],
        ) -> Result<StepDistributions, ModelError> {
            Ok(StepDistributions::new(self.row, vec![0.5; self.values]))
        }
    }

    #[test]
    fn an_answer_that_is_not_a_row_a_pair_is_refused() {
        let nothing = Projections::default();
        let ask = |row, values| {
            let careless = Careless { row, values };
            predict_in_blocks(&careless, &nothing, &nothing, &[(0, 0), (0, 1)])
        };
        let sound = ask(3, 6).expect("two rows of three");
        assert_eq!((sound.len(), sound.d_max()), (2, 3));
        for (row, values, said) in [
            (2, 4, "of a pair have 2 values, the model expects 3"),
            (3, 3, "of all pairs have 3 values, the model expects 6"),
            (3, 9, "of all pairs have 9 values, the model expects 6"),
        ] {
            let error = ask(row, values).expect_err(said).to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
