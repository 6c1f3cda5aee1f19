use std::path::PathBuf;

use thiserror::Error;

use crate::model::{BaselineMethod, ManifestError, ModelError};
use crate::trajectory::TrajectoryError;

/// Why a training or an export did not come to its end.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainingError {
    /// Fewer than two demonstrations: none could be held out.
    #[error(
        "training needs at least 2 demonstrations, one of them held out for validation, but \
         has {found}: record more, or name more recordings"
    )]
    TooFewDemonstrations {
        /// How many there are.
        found: usize,
    },
    /// No trajectory of a part is long enough to hold a pair of states, or all actions in it are missed grasps, which are
    /// not imitated.
    #[error(
        "no demonstration of the {part} part has two steps and in the first of them an action to imitate, so there is nothing \
         to learn from: record longer ones, or draw the parts otherwise, by another seed or validation_share"
    )]
    NoPairs {
        /// Which part.
        part: &'static str,
    },
    /// Two sets show different cameras.
    #[error(
        "set '{set}' has the cameras {found}, set '{first_set}' has {expected}; one model needs the \
         same cameras everywhere, so train them apart or record them alike"
    )]
    CamerasDiffer {
        /// The first set.
        first_set: String,
        /// Its cameras, printed.
        expected: String,
        /// The set that differs.
        set: String,
        /// Its cameras, printed.
        found: String,
    },
    /// A camera was asked for that the demonstrations do not have.
    #[error("there is no camera '{camera}' to train with: the demonstrations have {present}")]
    CameraUnknown {
        /// The camera.
        camera: String,
        /// The cameras of the demonstrations, printed.
        present: String,
    },
    /// A camera has a name that the file of its encoder has for something else.
    #[error(
        "a camera is called '{camera}', as the output of the encoder that is to be trained: call it otherwise under \
         'cameras' of the 'topics' in a mapping file"
    )]
    CameraNameTaken {
        /// The camera.
        camera: String,
    },
    /// Batches are to be mirrored, but not the actions.
    #[error(
        "augmentation.mirror_share is {share}, but {space} have no other side: each primitive with `left` in its \
         name needs one with `right`; set mirror_share to 0"
    )]
    NotMirrored {
        /// The share of batches.
        share: f64,
        /// The actions, printed.
        space: String,
    },
    /// The motion to go is to be learnt of actions that have none.
    #[error(
        "motion_weight is {weight}, but {space} have no motion to go: that needs primitives that undo each other, such \
         as `up` and `down`, and `gripper_close` or `gripper_open`; set motion_weight to 0"
    )]
    NoMotionToGo {
        /// The weight.
        weight: f32,
        /// The actions, printed.
        space: String,
    },
    /// Landmarks are to be learnt where there are none.
    #[error(
        "landmarks cannot be learnt: {reason}; `robots/locobot.json` shows what landmarks.robot says of a robot, and \
         `landmarks: null` does without"
    )]
    NoLandmarks {
        /// What is missing.
        reason: String,
    },
    /// A model that is to be taught more cannot be used.
    #[error("the model in {} cannot be used: {source}", folder.display())]
    ModelRefused {
        /// The model's folder.
        folder: PathBuf,
        /// Why.
        source: ManifestError,
    },
    /// Nothing can be learnt of practice with the gripper.
    #[error(
        "nothing can be learnt of the practice with the gripper: {reason}; in it the robot goes through the motions of a \
         task, and closes the gripper beside things or takes them askew (`catena record --practice` shows how)"
    )]
    NoPractice {
        /// What is missing.
        reason: String,
    },
    /// Two sets have different action spaces.
    #[error(
        "set '{set}' has {found}, set '{first_set}' has {expected}; one model needs one action space"
    )]
    ActionSpacesDiffer {
        /// The first set.
        first_set: String,
        /// Its space, printed.
        expected: String,
        /// The set that differs.
        set: String,
        /// Its space, printed.
        found: String,
    },
    /// The action space has no classes to learn.
    #[error(
        "the actions of set '{set}' are {space}: cut them into bins first (`ActionSpace::binned`)"
    )]
    ActionsWithoutClasses {
        /// The set.
        set: String,
        /// Its space, printed.
        space: String,
    },
    /// A step's action or image does not fit its trajectory.
    #[error("trajectory '{trajectory}', step {step}: {source}")]
    Step {
        /// The trajectory.
        trajectory: String,
        /// The step.
        step: usize,
        /// What does not fit.
        source: TrajectoryError,
    },
    /// An image is not as large as its camera.
    #[error(
        "trajectory '{trajectory}', step {step}: camera '{camera}' shows {found}, its first image has {expected}"
    )]
    ImageSize {
        /// The trajectory.
        trajectory: String,
        /// The step.
        step: usize,
        /// The camera.
        camera: String,
        /// Rows and columns of the camera.
        expected: String,
        /// Rows and columns of this image.
        found: String,
    },
    /// A value of the configuration is out of its range.
    #[error("training configuration: {field} is {value}, but {demand}")]
    Config {
        /// The field, with its section.
        field: String,
        /// Its value, printed.
        value: String,
        /// What it has to be.
        demand: &'static str,
    },
    /// The method learns on features of an encoder that was not given.
    #[error(
        "the method {method} learns on features of a frozen encoder: give one as an ONNX file \
         (--frozen-encoder FILE.onnx)"
    )]
    FrozenEncoderNeeded {
        /// The method.
        method: BaselineMethod,
    },
    /// A frozen encoder was given to a method that trains its own.
    #[error(
        "the method {method} trains its own encoder: leave the frozen one (--frozen-encoder) out, or train mvp"
    )]
    FrozenEncoderUnused {
        /// The method.
        method: BaselineMethod,
    },
    /// The frozen encoder gave no features.
    #[error("the frozen encoder gave no features of the demonstrations: {source}")]
    FrozenEncoder {
        /// What it said.
        source: ModelError,
    },
    /// The encoder of a model that is to be taught more gave no latents.
    #[error("the model's encoder gave no latents of the demonstrations: {source}")]
    Encoder {
        /// What it said.
        source: ModelError,
    },
    /// The loss is no finite number any more.
    #[error(
        "the loss became {loss} at step {step}, with a learning rate of {learning_rate}; begin anew in another run folder, \
         with a lower optimiser.learning_rate"
    )]
    Diverged {
        /// The optimiser step.
        step: u64,
        /// The loss.
        loss: f32,
        /// The learning rate at that step.
        learning_rate: f64,
    },
    /// The checkpoint cannot be read back.
    #[error("the checkpoint {path} cannot be used: {reason}; delete it to start anew")]
    CheckpointUnusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A checkpoint could not be written in the place of an earlier one, which is still there.
    #[error(
        "cannot write {path}: {source}; the checkpoint of an earlier step is still there, and --resume goes on from it"
    )]
    CheckpointNotReplaced {
        /// The file.
        path: PathBuf,
        /// What the system said, such as a full disk.
        source: std::io::Error,
    },
    /// The checkpoint was written for other demonstrations or another configuration.
    #[error(
        "the checkpoint {path} belongs to another training: its {what} differ{why}; give the same, use another run folder, \
         or delete it to start anew"
    )]
    CheckpointOfAnother {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
        /// Why that makes another training, in brackets; empty where it is plain.
        why: &'static str,
    },
    /// Another training works in the run folder.
    #[error(
        "another training is at work in the run folder {run_folder}: wait until it ends, or stop it and go on with --resume, \
         or name another folder with --run"
    )]
    RunInUse {
        /// The folder.
        run_folder: PathBuf,
    },
    /// Another process writes the folder of a model.
    #[error(
        "another process is writing a model to {folder}: call again once it has ended (a training with --resume), or name \
         another folder with --out"
    )]
    ModelInUse {
        /// The folder.
        folder: PathBuf,
    },
    /// A file or folder could not be read or written.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said, such as a full disk.
        source: std::io::Error,
    },
    /// The observer asked to stop; the last checkpoint can be resumed.
    #[error("stopped at step {step} as asked; the checkpoint in {run_folder} goes on from there")]
    Stopped {
        /// The last finished step.
        step: u64,
        /// Where the checkpoint is.
        run_folder: PathBuf,
    },
}
