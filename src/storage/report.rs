//! What is in a recording, as data and as a block of text.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::trajectory::{ActionSpace, CameraSpec, Marker};

/// What a recording holds and what was lost of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordingReport {
    /// The file.
    pub path: PathBuf,
    /// Which episode of the dataset at `path`; `None` for a file with one episode.
    pub episode: Option<usize>,
    /// Its size in bytes.
    pub bytes: u64,
    /// The profile in its header, such as `ros2`.
    pub profile: String,
    /// The program that wrote it.
    pub library: String,
    /// The task: of the mapping file, else of the metadata, else of the topic `/task`, else the folder's name.
    pub task: String,
    /// Seconds from the first message to the last, over all topics.
    pub duration_secs: f64,
    /// How many steps a trajectory of it has: actions after the first image of every camera.
    pub steps: usize,
    /// The actions, if there are any that can be read.
    pub actions: Option<ActionReport>,
    /// The cameras that can be used.
    pub cameras: Vec<CameraReport>,
    /// Subgoals and other named moments.
    pub markers: Vec<Marker>,
    /// All topics by name.
    pub topics: Vec<TopicReport>,
    /// Those that tell the task and the markers.
    #[serde(skip)]
    pub(super) texts: Vec<String>,
    /// What the file says of itself; of metadata records other than ours with the record's name.
    pub metadata: BTreeMap<String, String>,
    /// What could not be read.
    pub losses: Vec<Loss>,
    /// What is there and not used, each with its reason.
    pub notes: Vec<String>,
    /// How steps were chosen and aligned where that is not plain, which texts are at no step or not read, and which values
    /// of actions lie beyond the ranges that a mapping file gives.
    pub remarks: Vec<String>,
    /// Why the recording was left out of a set of demonstrations; `None` where it was not.
    pub left_out: Option<String>,
}

/// The actions of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ActionReport {
    /// The topic that holds them.
    pub topic: String,
    /// What they mean.
    pub space: ActionSpace,
}

/// A camera of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraReport {
    /// Name and size.
    pub spec: CameraSpec,
    /// The topic that holds its images.
    pub topic: String,
    /// How many images there are.
    pub images: usize,
}

/// A topic of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicReport {
    /// Its name.
    pub topic: String,
    /// Its message type as the file names it.
    pub type_name: String,
    /// How its messages are encoded, such as `cdr`.
    pub encoding: String,
    /// How many messages there are.
    pub messages: usize,
    /// Bytes of all messages together.
    pub bytes: u64,
    /// Messages a second, 0 for a single one.
    pub rate_hz: f64,
}

/// Something of a recording that could not be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
#[non_exhaustive]
pub enum Loss {
    /// Any of the others, in one of the files of a bag.
    InFile {
        /// Its name.
        file: String,
        /// What could not be read of it.
        loss: Box<Loss>,
    },
    /// The file ends in the middle of a record or without its footer.
    CutOff {
        /// Where the incomplete record starts.
        at_byte: u64,
        /// Length of the file.
        of_bytes: u64,
        /// Messages taken from the incomplete chunk, whose checksum cannot be checked.
        unchecked_messages: usize,
    },
    /// A record makes no sense, and what follows cannot be found.
    UnreadableRest {
        /// Where it starts.
        at_byte: u64,
        /// Bytes from there to the end.
        bytes: u64,
        /// What is wrong.
        reason: String,
    },
    /// A chunk whose checksum or compression is wrong was left out.
    DamagedChunk {
        /// Where it starts.
        at_byte: u64,
        /// Its length in the file.
        bytes: u64,
        /// What is wrong.
        reason: String,
    },
    /// A record outside the chunks was left out.
    UnreadableRecord {
        /// Where it starts.
        at_byte: u64,
        /// What is wrong.
        reason: String,
    },
    /// Every chunk is right, but something outside them changed after it was written.
    DataChecksum {
        /// Checksum in the file.
        saved: u32,
        /// Checksum of its bytes.
        calculated: u32,
    },
    /// Messages of channels that are described nowhere.
    UnknownChannel {
        /// How many.
        messages: usize,
    },
    /// Images that are complete but cannot be decoded; the camera's image before them stands in.
    UndecodableImages {
        /// The camera's topic.
        topic: String,
        /// How many.
        images: usize,
        /// Why the first of them cannot be decoded.
        reason: String,
    },
    /// Messages with a time before that of a message before them; they are put in the order of their times.
    TimesGoBack {
        /// The topic, or the column of a table.
        topic: String,
        /// How many.
        messages: usize,
        /// How far back at most, in thousandths of a second.
        by_millis: u64,
    },
    /// Frames that a dataset's metadata or their numbers promise.
    MissingFrames {
        /// How many.
        frames: u64,
    },
    /// Images that a camera should have given by its own rate; steps show the image before the gap.
    MissingImages {
        /// The camera's topic.
        topic: String,
        /// How many.
        images: u64,
        /// The longest gap, in thousandths of a second.
        longest_millis: u64,
    },
    /// A camera gave no image any more long before the last action; the steps from there on show its last one, so that
    /// how the demonstration ends is not seen.
    CameraStopped {
        /// The camera's topic.
        topic: String,
        /// How many images are missing.
        images: u64,
        /// From its last image to the last action, in thousandths of a second.
        millis: u64,
    },
    /// Actions before the first image of every camera.
    ActionsWithoutImages {
        /// How many.
        actions: usize,
    },
}

impl Loss {
    /// Whether steps may be missing, so that neighbouring steps need not follow each other and the
    /// last one need not be, or need not show, the end of the demonstration.
    #[must_use]
    pub fn breaks_the_sequence(&self) -> bool {
        match self {
            Self::InFile { loss, .. } => loss.breaks_the_sequence(),
            Self::UndecodableImages { .. }
            | Self::ActionsWithoutImages { .. }
            | Self::TimesGoBack { .. }
            | Self::MissingImages { .. } => false,
            _ => true,
        }
    }

    /// Whether messages are gone, so that what is not there may have been.
    pub(super) fn takes_messages(&self) -> bool {
        match self {
            Self::InFile { loss, .. } => loss.takes_messages(),
            Self::DataChecksum { .. } | Self::CameraStopped { .. } => false,
            other => other.breaks_the_sequence(),
        }
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InFile { file, loss } => write!(f, "{file}: {loss}"),
            Self::CutOff {
                at_byte,
                of_bytes,
                unchecked_messages,
            } => {
                write!(
                    f,
                    "the file is cut off: the record at byte {at_byte} of {of_bytes} is incomplete"
                )?;
                if *unchecked_messages > 0 {
                    write!(
                        f,
                        "; {unchecked_messages} complete messages were taken from it, their checksum is gone"
                    )?;
                }
                Ok(())
            }
            Self::UnreadableRest {
                at_byte,
                bytes,
                reason,
            } => write!(f, "{bytes} bytes from byte {at_byte} on: {reason}"),
            Self::DamagedChunk {
                at_byte,
                bytes,
                reason,
            } => write!(f, "the chunk of {bytes} bytes at byte {at_byte}: {reason}"),
            Self::UnreadableRecord { at_byte, reason } => {
                write!(f, "the record at byte {at_byte}: {reason}")
            }
            Self::DataChecksum { saved, calculated } => write!(
                f,
                "something outside the chunks was changed: checksum {saved:08x} in the file, \
                 {calculated:08x} of its bytes"
            ),
            Self::UnknownChannel { messages } => {
                write!(
                    f,
                    "{messages} messages of channels that are described nowhere"
                )
            }
            Self::UndecodableImages {
                topic,
                images,
                reason,
            } => write!(f, "{images} images of {topic}: {reason}"),
            Self::TimesGoBack {
                topic,
                messages,
                by_millis,
            } => write!(
                f,
                "{messages} messages of {topic} are older than one before them, by up to {} s; \
                 they were put in order of time",
                *by_millis as f64 / 1e3
            ),
            Self::MissingFrames { frames } => {
                write!(f, "{frames} frames of the episode are missing")
            }
            Self::MissingImages {
                topic,
                images,
                longest_millis,
            } => write!(
                f,
                "about {images} images of {topic} are missing by its own rate, the longest gap is {} s; \
                 steps in a gap show the image before it",
                *longest_millis as f64 / 1e3
            ),
            Self::CameraStopped {
                topic,
                images,
                millis,
            } => write!(
                f,
                "{topic} gave its last image {} s before the last action, about {images} images are missing and the \
                 steps after it show that one: record it again, or leave this camera out in a mapping file",
                *millis as f64 / 1e3
            ),
            Self::ActionsWithoutImages { actions } => {
                write!(
                    f,
                    "{actions} actions before the first image of every camera"
                )
            }
        }
    }
}

impl fmt::Display for RecordingReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}  {} kB, {:.1} s, written by {}",
            self.place(),
            self.bytes.div_ceil(1000),
            self.duration_secs,
            self.library
        )?;
        writeln!(f, "  task      {}", self.task)?;
        match &self.actions {
            Some(a) => writeln!(f, "  steps     {} on {}: {}", self.steps, a.topic, a.space)?,
            None => writeln!(f, "  steps     none: no actions were found")?,
        }
        for camera in &self.cameras {
            writeln!(
                f,
                "  camera    {} {}x{}, {} images on {}",
                camera.spec.name,
                camera.spec.height,
                camera.spec.width,
                camera.images,
                camera.topic
            )?;
        }
        if !self.markers.is_empty() {
            let markers: Vec<_> = self
                .markers
                .iter()
                .map(|m| format!("{} at step {}", m.name, m.step))
                .collect();
            writeln!(f, "  markers   {}", markers.join(", "))?;
        }
        self.write_metadata(f)?;
        self.write_topics(f)?;
        for note in &self.notes {
            writeln!(f, "  not used  {note}")?;
        }
        for remark in &self.remarks {
            writeln!(f, "  note      {remark}")?;
        }
        for loss in &self.losses {
            writeln!(f, "  LOST      {loss}")?;
        }
        if let Some(reason) = &self.left_out {
            writeln!(f, "  LEFT OUT  {reason}")?;
        }
        Ok(())
    }
}

impl RecordingReport {
    /// The file, or the dataset with the episode.
    #[must_use]
    pub fn place(&self) -> String {
        match self.episode {
            Some(episode) => format!("{} episode {episode}", self.path.display()),
            None => self.path.display().to_string(),
        }
    }

    fn write_metadata(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN_CHARACTERS: usize = 60;
        for (key, value) in &self.metadata {
            let line = value.split_whitespace().collect::<Vec<_>>().join(" ");
            let shown: String = line.chars().take(SHOWN_CHARACTERS).collect();
            let more = if shown.len() < line.len() { " ..." } else { "" };
            writeln!(f, "  metadata  {key}: {shown}{more}")?;
        }
        Ok(())
    }

    fn write_topics(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN_TOPICS: usize = 16;
        let shown = &self.topics[..self.topics.len().min(SHOWN_TOPICS)];
        let width =
            |of: fn(&TopicReport) -> &str| shown.iter().map(|t| of(t).len()).max().unwrap_or(0);
        let (topics, types) = (width(|t| &t.topic), width(|t| &t.type_name));
        for t in shown {
            writeln!(
                f,
                "  topic     {:topics$}  {:types$}  {:8} {:6} messages {:8.2} Hz",
                t.topic, t.type_name, t.encoding, t.messages, t.rate_hz
            )?;
        }
        if self.topics.len() > SHOWN_TOPICS {
            writeln!(
                f,
                "  topic     and {} more",
                self.topics.len() - SHOWN_TOPICS
            )?;
        }
        Ok(())
    }
}
