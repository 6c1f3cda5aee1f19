use super::ModelError;

/// A table of vectors of one length, a row a state.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Latents {
    dim: usize,
    values: Vec<f32>,
}

impl Latents {
    /// An empty table whose rows will have `dim` values.
    #[must_use]
    pub fn new(dim: usize) -> Self {
        Self {
            dim,
            values: Vec::new(),
        }
    }

    /// A table over values that lie row after row.
    ///
    /// # Panics
    /// If `values` is not a whole number of rows, or `dim` is 0.
    #[must_use]
    pub fn from_values(dim: usize, values: Vec<f32>) -> Self {
        assert!(
            dim > 0 && values.len().is_multiple_of(dim),
            "{} values are no whole number of rows of {dim}",
            values.len()
        );
        Self { dim, values }
    }

    /// Values in a row.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.dim).unwrap_or(0)
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// One row.
    ///
    /// # Panics
    /// If `row` is not below [`len`](Self::len).
    #[must_use]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.dim..(row + 1) * self.dim]
    }

    /// All rows, one after another.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Refuses what an encoder gave if it is not a row of `latent_dim` values for each of so many states.
    ///
    /// # Errors
    /// [`ModelError::Length`] with both numbers.
    pub(crate) fn ensure_of(&self, states: usize, latent_dim: usize) -> Result<(), ModelError> {
        ModelError::unless_as_many("the encoder's latents", latent_dim, self.dim)?;
        let expected = states * latent_dim;
        ModelError::unless_as_many("the encoder's latents in all", expected, self.values.len())
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If `row` has another length than the table's rows.
    pub fn push(&mut self, row: &[f32]) {
        assert_eq!(row.len(), self.dim, "a row of another length");
        self.values.extend_from_slice(row);
    }

    /// Adds all rows of another table.
    ///
    /// # Panics
    /// If the other table's rows have another length.
    pub fn extend(&mut self, other: &Self) {
        assert_eq!(other.dim, self.dim, "rows of another length");
        self.values.extend_from_slice(&other.values);
    }
}
