use thiserror::Error;

/// Why a model gave no answer.
#[derive(Debug, Error, Clone, PartialEq)]
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
    /// The engine that computes the network failed.
    #[error("the inference engine failed in {stage}: {reason}")]
    Engine {
        /// Which network.
        stage: String,
        /// What the engine said.
        reason: String,
    },
}
