use thiserror::Error;

/// Why a model gave no answer.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum ModelError {
    /// An observation lacks a camera that the model was trained with.
    #[error(
        "the model needs camera '{camera}' at {height}x{width}; the observation has: {present}"
    )]
    CameraMissing {
        /// The camera.
        camera: String,
        /// Rows that the model expects.
        height: u32,
        /// Columns that the model expects.
        width: u32,
        /// What was there instead.
        present: String,
    },
    /// Vectors of the wrong length were given.
    #[error("{what} have {found} values, the model expects {expected}")]
    Length {
        /// Which vectors.
        what: String,
        /// The model's length.
        expected: usize,
        /// The length that was given.
        found: usize,
    },
    /// A network gave something that is no number, with which nothing can be compared.
    #[error(
        "value {place} of {what} is {value}: the model or its normalisation is broken, train or export it again"
    )]
    NotFinite {
        /// Which vector.
        what: String,
        /// Which of its values, from 0.
        place: usize,
        /// The value, printed.
        value: String,
    },
    /// The engine that computes the network failed.
    #[error("the inference engine failed in {stage}: {reason}")]
    Engine {
        /// Which network.
        stage: String,
        /// What the engine said.
        reason: String,
    },
}

impl ModelError {
    /// Refuses more or fewer values than there should be.
    ///
    /// # Errors
    /// [`ModelError::Length`] with both numbers.
    pub(crate) fn unless_as_many(what: &str, expected: usize, found: usize) -> Result<(), Self> {
        if expected == found {
            return Ok(());
        }
        Err(Self::Length {
            what: what.to_owned(),
            expected,
            found,
        })
    }
}
