use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::trajectory::TrajectoryError;

/// Why a recording or a graph folder could not be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StorageError {
    /// The operating system refused.
    #[error("cannot {doing} {path}: {source}", path = path.display())]
    Io {
        /// What was tried, such as `read`.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file without a byte, often what is left of a full disk or an interrupted copy.
    #[error("{path} is empty (0 bytes): record or copy it again", path = path.display())]
    EmptyFile {
        /// The file.
        path: PathBuf,
    },
    /// The file does not start as an MCAP file does.
    #[error(
        "{path} is no MCAP recording: it starts with {found}, an MCAP file with 89 4d 43 41 50 30 0d 0a{way_out}",
        path = path.display()
    )]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes in hexadecimal.
        found: String,
        /// What the file seems to be and how it becomes one, after a full stop; empty where nobody can tell.
        way_out: &'static str,
    },
    /// The recording could not be written.
    #[error("cannot write the recording {path}: {reason}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What failed.
        reason: String,
    },
    /// No topic of the recording carries images.
    #[error(
        "{path}: no topic carries images; its topics are {topics}. Images are read from \
         sensor_msgs CompressedImage or Image (CDR) and foxglove.CompressedImage or RawImage \
         (protobuf){lost}",
        path = path.display()
    )]
    NoImages {
        /// The file.
        path: PathBuf,
        /// All topics with their types.
        topics: String,
        /// What could not be read, after a full stop; empty if nothing was lost.
        lost: String,
    },
    /// Topics carry images, but none could be decoded.
    #[error("{path}: no camera can be used: {reasons}", path = path.display())]
    UnusableCameras {
        /// The file.
        path: PathBuf,
        /// Each topic with its reason.
        reasons: String,
    },
    /// Topics are called `/action`, but none can be read as actions.
    #[error("{path}: no actions can be read: {reasons}", path = path.display())]
    UnusableActions {
        /// The file.
        path: PathBuf,
        /// Each topic with its reason.
        reasons: String,
    },
    /// There are images and no topic `/action`.
    #[error(
        "{path}: images of {cameras}, but no actions: no topic ends in /action. Record what the robot \
         was told on /action as sensor_msgs/JointState, std_msgs/Float32MultiArray or Float64MultiArray, \
         geometry_msgs/Twist, or JSON {{\"values\": [..]}}; an existing topic can be renamed while replaying{lost}",
        path = path.display()
    )]
    NoActions {
        /// The file.
        path: PathBuf,
        /// The cameras that were found.
        cameras: String,
        /// What could not be read, after a full stop; empty if nothing was lost.
        lost: String,
    },
    /// A message of the action topic does not say what was done.
    #[error("{path}: message {message} of {topic}: {reason}", path = path.display())]
    BadAction {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Which message of the topic, from 0.
        message: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// Images of one camera have different sizes.
    #[error(
        "{path}: camera '{camera}' ({topic}) gives {}x{} first and {}x{} at {at_secs:.3} s: \
         record one size, or split the recording there",
        first.0, first.1, other.0, other.1, path = path.display()
    )]
    SizeChanges {
        /// The file.
        path: PathBuf,
        /// The camera's name.
        camera: String,
        /// Its topic.
        topic: String,
        /// Rows and columns of its first image.
        first: (u32, u32),
        /// Rows and columns of the other one.
        other: (u32, u32),
        /// Seconds since the first step.
        at_secs: f64,
    },
    /// A camera has one size in one recording of a task and another in another one.
    #[error(
        "{recording}: camera '{camera}' gives {}x{}, and {height}x{width} in {first}, which is of the same task '{task}': \
         resize both by 'image_size: {{height: {height}, width: {width}}}' in a mapping file that names them, or by \
         --image-size {height}x{width}, or leave one of them out",
        size.0, size.1, height = first_size.0, width = first_size.1
    )]
    SizesDiffer {
        /// The task.
        task: String,
        /// The camera's name.
        camera: String,
        /// The first recording of the task.
        first: String,
        /// Rows and columns in the first.
        first_size: (u32, u32),
        /// The recording that differs.
        recording: String,
        /// Rows and columns in this one.
        size: (u32, u32),
    },
    /// All actions have one log time.
    #[error(
        "{path}: all {messages} messages of {topic} have the log time {secs} s, so that nothing tells which image \
         belongs to which action: record it again with the time at which each message came as its log time",
        path = path.display()
    )]
    NoTimes {
        /// The file.
        path: PathBuf,
        /// The topic of the actions.
        topic: String,
        /// How many there are.
        messages: usize,
        /// The time, in seconds.
        secs: f64,
    },
    /// A bag of several files lacks one.
    #[error(
        "{path}: the bag holds {part}, which is not there; put it back, or move the other files to a folder of their own to \
         read each as a recording",
        path = path.display(),
        part = part.display()
    )]
    PartMissing {
        /// Where the bag names its files.
        path: PathBuf,
        /// The one that is missing.
        part: PathBuf,
    },
    /// A bag's metadata does not name its files, and there are several.
    #[error(
        "{path}: the metadata of a bag, of which it cannot be read which files it consists of ({fault}), while {files} MCAP \
         files lie beside it: write it anew (`ros2 bag reindex`), or take it away to read each file as a recording",
        path = path.display()
    )]
    BagDamaged {
        /// The metadata.
        path: PathBuf,
        /// How many files lie beside it.
        files: usize,
        /// What is wrong with it.
        fault: String,
    },
    /// There is a bag's metadata, and no file of the bag.
    #[error(
        "{path}: the metadata of a bag, {reason}, and no recording lies beside it: copy the bag again with all its files, or \
         name the folder or the files that hold what it recorded",
        path = path.display()
    )]
    BagWithoutFiles {
        /// The metadata.
        path: PathBuf,
        /// Which file is missing, or why nothing tells which.
        reason: String,
    },
    /// No action comes after the first image of every camera.
    #[error(
        "{path}: none of the {actions} actions comes after the first image of every camera ({cameras}), \
         so there is no step",
        path = path.display()
    )]
    NoSteps {
        /// The file.
        path: PathBuf,
        /// How many actions there are.
        actions: usize,
        /// The cameras.
        cameras: String,
    },
    /// A mapping file is wrong, or does not fit a recording.
    #[error("{path}{place}: {message}. {help}", path = path.display())]
    Mapping {
        /// The mapping file.
        path: PathBuf,
        /// `:line:column`, or empty where the file as a whole is meant.
        place: String,
        /// What is wrong.
        message: String,
        /// The way out.
        help: String,
    },
    /// Several motion primitives cannot be one step.
    #[error(
        "{path}: its actions are motion primitives, each of which is a step; leave out --every, every and rate_hz",
        path = path.display()
    )]
    PrimitivesThinned {
        /// The recording.
        path: PathBuf,
    },
    /// A LeRobot dataset does not hold what it should.
    #[error("{path}: {reason}", path = path.display())]
    Dataset {
        /// The file of the dataset.
        path: PathBuf,
        /// Where in it, what is wrong, and the way out.
        reason: String,
    },
    /// A video cannot be read.
    #[error("{path}: camera '{camera}' is a video, and {reason}", path = path.display())]
    Video {
        /// The file.
        path: PathBuf,
        /// The camera.
        camera: String,
        /// What failed, and the way out.
        reason: String,
        /// What the system said, where the program that reads videos is there and cannot be started.
        source: Option<io::Error>,
    },
    /// A dataset holds several tasks, none of which is the one that was asked for.
    #[error(
        "there is no task '{task}' in {paths}; its tasks are {known}. Call the task as one of them is called"
    )]
    NoSuchTask {
        /// What was asked for.
        task: String,
        /// What was looked at.
        paths: String,
        /// The tasks, by the names that work.
        known: String,
    },
    /// What a conversion would write to is there.
    #[error("{path} is there already: name a folder that is not, or remove it", path = path.display())]
    OutExists {
        /// The folder.
        path: PathBuf,
    },
    /// What a graph would replace is no graph.
    #[error(
        "{path} {what}, and a graph would replace it: name a folder of its own, one that is empty or not there, or one \
         with a graph",
        path = path.display()
    )]
    NoGraphToReplace {
        /// The place.
        path: PathBuf,
        /// What is there.
        what: String,
    },
    /// The graph that another one would replace is of other tasks.
    #[error(
        "{path} holds the graph of {found}, and that of {wanted} would replace it: name another folder, or remove this one",
        path = path.display()
    )]
    OtherTasks {
        /// The place.
        path: PathBuf,
        /// The tasks of the graph that is there.
        found: String,
        /// Those of the graph that was to be saved there.
        wanted: String,
    },
    /// What the beginnings of a graph would replace is none.
    #[error(
        "{path} {what}, and what is done of a graph is kept there until it is built: move that elsewhere, or build the \
         graph under another name",
        path = path.display()
    )]
    NoBuildToReplace {
        /// The place.
        path: PathBuf,
        /// What is there.
        what: String,
    },
    /// Another build of the same graph is at work.
    #[error(
        "another build of the same graph is at work in {folder}: wait until it ends, or stop it and build again, which goes \
         on with what it did; or build the graph under another name",
        folder = folder.display()
    )]
    BuildInUse {
        /// Where it keeps what is done.
        folder: PathBuf,
    },
    /// Recordings cannot be written as one dataset.
    #[error("{recording} cannot be part of the dataset: {reason}")]
    Conversion {
        /// The recording.
        recording: String,
        /// What does not fit, and the way out.
        reason: String,
    },
    /// None of the given paths is or holds a recording.
    #[error(
        "no recordings in {paths}: make some with `catena record`, or name a folder of *.mcap files, a LeRobot \
         dataset (a folder with meta/info.json), or a mapping file (*.yaml)"
    )]
    NoRecordings {
        /// The paths that were looked at.
        paths: String,
    },
    /// Every recording was left out.
    #[error("none of the {count} recordings of '{task}' can be a demonstration: {reasons}")]
    NoDemonstrations {
        /// The task.
        task: String,
        /// How many recordings there are.
        count: usize,
        /// Each file with its reason.
        reasons: String,
    },
    /// The recordings of one set do not fit together.
    #[error("the demonstrations of '{task}' do not fit together: {source}")]
    Set {
        /// The task.
        task: String,
        /// What differs.
        source: TrajectoryError,
    },
    /// A folder that should hold a graph has no manifest.
    #[error(
        "{folder} is no graph folder: manifest.json is missing. Build it with `catena graph build`",
        folder = folder.display()
    )]
    NoGraph {
        /// The folder.
        folder: PathBuf,
    },
    /// The manifest cannot be understood.
    #[error("{path}: {reason}", path = path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong, with line and column where it is JSON.
        reason: String,
        /// What serde said, where it is no manifest.
        source: Option<serde_json::Error>,
    },
    /// The folder was written by another version of the format.
    #[error(
        "{path} has format version {found}, this program reads {expected}: build the graph again",
        path = path.display()
    )]
    FormatVersion {
        /// The manifest.
        path: PathBuf,
        /// The file's version.
        found: u32,
        /// The version that this program writes.
        expected: u32,
    },
    /// A file is not the one that the manifest names.
    #[error(
        "{path} was changed after it was written: the manifest says sha256 {expected}, the file has {found}. \
         Build the graph again, or restore the file",
        path = path.display()
    )]
    DigestMismatch {
        /// The file.
        path: PathBuf,
        /// Digest in the manifest.
        expected: String,
        /// Digest of the file.
        found: String,
    },
    /// Graph and model do not belong together.
    #[error(
        "the graph in {folder} was built with model {graph_digest}, this model is {model_digest}: its latents \
         mean nothing here. Build the graph again with this model (`catena graph build`), or take the model \
         that it was built with",
        folder = folder.display()
    )]
    ModelMismatch {
        /// The graph's folder.
        folder: PathBuf,
        /// Digest of the model that made the graph's latents.
        graph_digest: String,
        /// Digest of the model at hand.
        model_digest: String,
    },
    /// A table does not hold what a graph needs.
    #[error("{path}: {reason}", path = path.display())]
    Table {
        /// The Parquet file.
        path: PathBuf,
        /// Column and reason.
        reason: String,
    },
    /// A picture could not be encoded or decoded.
    #[error("{path}: image of {what}: {reason}", path = path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Which picture.
        what: String,
        /// What failed.
        reason: String,
    },
}

impl StorageError {
    /// Whether it says that there is no trajectory in a recording, not that something in it is wrong.
    pub(super) fn tells_of_too_little(&self) -> bool {
        matches!(
            self,
            Self::NoImages { .. }
                | Self::UnusableCameras { .. }
                | Self::NoActions { .. }
                | Self::UnusableActions { .. }
                | Self::NoSteps { .. }
        )
    }

    /// For `map_err` on what the operating system refuses.
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            doing,
            path,
            source,
        }
    }
}
