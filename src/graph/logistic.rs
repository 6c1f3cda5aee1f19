use linfa::traits::Fit;
use linfa::{Dataset, ParamGuard};
use linfa_logistic::MultiLogisticRegression;
use ndarray::{Array1, Array2};

use crate::model::softmax;

/// Rows of each class to learn from: those of rare classes are repeated, so that all are equally probable beforehand.
pub(crate) const ROWS_A_CLASS: usize = 300;
/// Iterations of the quasi-Newton search; more change nothing that can be seen.
const MOST_ITERATIONS: u64 = 60;

/// A multinomial logistic regression.
#[derive(Clone)]
pub(crate) struct Logistic {
    /// Values of a row by classes.
    weights: Array2<f64>,
    intercepts: Array1<f64>,
}

impl Logistic {
    /// One that tells nothing: all classes are equally probable.
    pub(super) fn of_nothing(values: usize, classes: usize) -> Self {
        Self {
            weights: Array2::zeros((values, classes)),
            intercepts: Array1::zeros(classes),
        }
    }

    /// Learns from a value of each row and column, and the class of each row; `ridge` weighs the squared weights
    /// against the summed loss.
    ///
    /// # Errors
    /// Why the search for the weights failed, as where values are not finite.
    pub(crate) fn fit(
        values: usize,
        value: impl Fn(usize, usize) -> f64,
        targets: Vec<usize>,
        ridge: f64,
    ) -> Result<Self, String> {
        let records = Array2::from_shape_fn((targets.len(), values), |(row, k)| value(row, k));
        let params = MultiLogisticRegression::default()
            .alpha(ridge)
            .max_iterations(MOST_ITERATIONS)
            .check()
            .map_err(|e| e.to_string())?;
        let fitted = params.fit(&Dataset::new(records, Array1::from(targets)));
        let fitted = fitted.map_err(|e| e.to_string())?;
        Ok(Self {
            weights: fitted.params().clone(),
            intercepts: fitted.intercept().clone(),
        })
    }

    /// The probability of each class.
    pub(super) fn probabilities(&self, row: impl Iterator<Item = f64>) -> Vec<f64> {
        let logits = Array1::from_iter(row).dot(&self.weights) + &self.intercepts;
        softmax(&logits.to_vec())
    }

    /// What a class begins with.
    pub(crate) fn intercept(&self, class: usize) -> f64 {
        self.intercepts[class]
    }

    /// The weight of each value of a row for a class.
    pub(crate) fn weights_of(&self, class: usize) -> impl Iterator<Item = f64> {
        self.weights.column(class).into_iter().copied()
    }
}

/// So many of some members, spread over all of them; some more than once where there are not as many.
pub(crate) fn evenly<T: Copy>(members: &[T], count: usize) -> impl Iterator<Item = T> {
    (0..count).map(move |i| members[i * members.len() / count])
}
