use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::hidden::way_back;
use crate::model::ManifestError;

/// Why no engine or no model could be had.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum InferenceError {
    /// A file of the model cannot be read.
    #[error("cannot read {path}: {source}; a model folder is written by `catena train`")]
    FileUnreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The folder was moved away by a command that was killed before another took its place.
    #[error("there is no {}: {}", folder.display(), way_back(folder, previous))]
    MovedAway {
        /// The folder of the model or the baseline.
        folder: PathBuf,
        /// Where it lies now.
        previous: PathBuf,
    },
    /// The manifest is not one, or a file is not the one that the manifest was written with.
    #[error("the model in {folder} was refused: {source}")]
    ManifestRefused {
        /// The model's folder.
        folder: PathBuf,
        /// What is wrong, with both digests where they differ.
        source: ManifestError,
    },
    /// The manifest promises something impossible.
    #[error("{path}: {what} is {found}, which no model has; train or export the model again")]
    SpecImpossible {
        /// The manifest.
        path: PathBuf,
        /// Which value.
        what: String,
        /// The value.
        found: String,
    },
    /// `ORT_DYLIB_PATH` names a library that cannot be used.
    #[error(
        "ORT_DYLIB_PATH: {reason}; correct the path, or unset it to use the compiled-in engine"
    )]
    LibraryUnusable {
        /// What is wrong, with the library's path.
        reason: String,
    },
    /// The native engine was asked for and is nowhere to be found.
    #[error(
        "no usable ONNX Runtime library found; tried: {tried}. Set ORT_DYLIB_PATH to the library, or \
         choose the embedded engine (--engine embedded)"
    )]
    NativeMissing {
        /// The places, each with what was wrong there.
        tried: String,
    },
    /// A process keeps its first engine.
    #[error("this process computes with '{running}' already and cannot change to '{wanted}'")]
    EngineAlreadyChosen {
        /// The engine in use.
        running: String,
        /// The engine that was asked for.
        wanted: String,
    },
    /// An engine of that name does not exist.
    #[error("no engine '{name}'; there are: auto, native, tract (or embedded)")]
    EngineUnknown {
        /// The name that was given.
        name: String,
    },
    /// The engine could not be set up, or refused a network.
    #[error("the engine '{engine}' failed on {place}: {reason}")]
    EngineFailed {
        /// The engine.
        engine: String,
        /// The file, or the step of the set-up.
        place: String,
        /// What the engine said.
        reason: String,
    },
    /// A network lacks an input or output, or the manifest and the network disagree.
    #[error("{path}: {what} should be {expected}, but is {found}; the folder mixes two models")]
    NetworkMisfit {
        /// The network's file.
        path: PathBuf,
        /// What does not fit.
        what: String,
        /// What the manifest asks for.
        expected: String,
        /// What the network has.
        found: String,
    },
    /// The file of a frozen encoder, or the one beside it, cannot be read.
    #[error("cannot read {path}: {source}; name the ONNX file of a visual encoder")]
    FrozenEncoderUnreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A frozen encoder is not what a baseline can be trained on.
    #[error(
        "the frozen encoder {path}: {what} should be {expected}, but is {found}; export it with one input \
         [n, 3, height, width] and one output [n, features], both float32"
    )]
    FrozenEncoderMisfit {
        /// The ONNX file.
        path: PathBuf,
        /// What does not fit.
        what: &'static str,
        /// What a baseline needs.
        expected: String,
        /// What the network has.
        found: String,
    },
    /// The file beside a frozen encoder does not say how its pictures are made.
    #[error(
        "{path}: {reason}; it may hold \"mean\" and \"deviation\" (three values of 0 to 255 each), and \"height\" \
         and \"width\" in pixels where the network leaves them open"
    )]
    PicturesMalformed {
        /// The JSON file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// What serde said, where it is no JSON of this form.
        source: Option<serde_json::Error>,
    },
}
