//! Writing episodes as MCAP, step by step or at once.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions, Writer};
use serde_json::{Value, json};

use super::messages::{CompressedImage, Header, Time};
use super::pixels::{encode_jpeg, encode_png};
use super::replace::Draft;
use super::{StorageError, cdr, schemas};
use crate::trajectory::{Action, ActionSpace, Marker, Step, Trajectory};

/// Metadata record with what is known when an episode starts.
pub(super) const HEADER_RECORD: &str = "catena";
/// Metadata record with what is known when it has ended.
pub(super) const EPISODE_RECORD: &str = "catena_episode";
/// Keys of the metadata records.
pub(super) mod keys {
    pub const TASK: &str = "task";
    pub const ACTION_SPACE: &str = "action_space";
    pub const VERSION: &str = "catena_version";
    pub const ROBOT: &str = "robot";
    pub const SEED: &str = "seed";
    pub const STEPS: &str = "steps";
    pub const SUCCESS: &str = "success";
}

/// Note in the metadata of practice with the gripper, which is no demonstration: which kind it is.
pub const PRACTICE_NOTE: &str = "practice";

const JPEG_QUALITY: u8 = 92;
const CHUNK_BYTES: u64 = 1 << 20;

/// What a recording says of itself besides its steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingMetadata {
    /// The robot or simulator, such as `LoCoBot (simulated)`.
    pub robot: String,
    /// The seed of the episode where it was simulated.
    pub seed: Option<u64>,
    /// Whether the task was done, where somebody judged it.
    pub success: Option<bool>,
    /// Anything else worth keeping, by name; `task`, `steps` and the other names above are taken.
    pub notes: BTreeMap<String, String>,
}

/// Writes a trajectory as one MCAP file, with the same bytes every time.
///
/// See [`EpisodeWriter`] for what the file holds.
///
/// # Errors
/// [`StorageError::Io`] or [`StorageError::Write`] when the file cannot be written or an image cannot
/// be encoded; what was at `path` before stays.
pub fn write_trajectory(
    path: &Path,
    trajectory: &Trajectory,
    metadata: &RecordingMetadata,
) -> Result<(), StorageError> {
    let mut writer = EpisodeWriter::create(path, &trajectory.task, &trajectory.action_space)?;
    writer.add_all(trajectory)?;
    writer.finish(metadata)
}

/// Writes an episode while it happens; nothing is at its path until [`finish`](Self::finish).
///
/// The file has the profile `ros2`, chunks of 1 MiB compressed with zstd, and as times the seconds of
/// the steps, so that equal episodes give equal bytes:
/// - `/camera/NAME/image_raw/compressed`: `sensor_msgs/msg/CompressedImage` as CDR, JPEG of quality 92,
/// - `/action`: JSON with a schema, `{"step", "index", "name"}` or `{"step", "values"}`,
/// - `/subgoal`: JSON with a schema, `{"step", "name"}`, at the first step that shows it,
/// - `/task`: `std_msgs/msg/String` as CDR,
/// - whatever [`add_json`](Self::add_json) adds,
/// - metadata records `catena` (task, action space, version) and `catena_episode` (steps, seed, success
///   and the like).
pub struct EpisodeWriter {
    writer: Writer<BufWriter<File>>,
    draft: Draft,
    path: PathBuf,
    action_space: ActionSpace,
    channels: HashMap<String, ChannelState>,
    steps: usize,
    nanos: u64,
    keeps_pixels: bool,
}

struct ChannelState {
    id: u16,
    messages: u32,
}

/// How the messages of a topic are described when it first appears.
struct Schema<'a> {
    name: &'a str,
    encoding: &'a str,
    text: &'a str,
    message_encoding: &'a str,
}

impl EpisodeWriter {
    /// Starts an episode; missing folders are made.
    ///
    /// # Errors
    /// [`StorageError::Io`] or [`StorageError::Write`] when the file cannot be made.
    pub fn create(
        path: &Path,
        task: &str,
        action_space: &ActionSpace,
    ) -> Result<Self, StorageError> {
        let draft = Draft::create(path)?;
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("catena ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            // Bytes must not depend on the number of processors.
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .create(BufWriter::new(draft.file()?))
            .map_err(|e| write_error(path, e))?;
        let mut episode = Self {
            writer,
            draft,
            path: path.to_owned(),
            action_space: action_space.clone(),
            channels: HashMap::new(),
            steps: 0,
            nanos: 0,
            keeps_pixels: false,
        };
        episode.write_metadata(
            HEADER_RECORD,
            [
                (keys::TASK, task.to_owned()),
                (keys::ACTION_SPACE, json!(action_space).to_string()),
                (keys::VERSION, env!("CARGO_PKG_VERSION").to_owned()),
            ],
        )?;
        let text = cdr::encode(&task, task.len()).map_err(|e| episode.failure(&e))?;
        episode.write("/task", &STRING, 0, &text)?;
        Ok(episode)
    }

    /// Whether images of the steps to come are kept as PNG, which loses nothing, instead of JPEG.
    pub(super) fn keep_every_pixel(&mut self, is_wanted: bool) {
        self.keeps_pixels = is_wanted;
    }

    /// Adds all steps of a trajectory with their markers.
    pub(super) fn add_all(&mut self, trajectory: &Trajectory) -> Result<(), StorageError> {
        for (i, step) in trajectory.steps.iter().enumerate() {
            self.add_step(step)?;
            for marker in trajectory.markers.iter().filter(|m| m.step == i) {
                self.add_marker(&marker.name)?;
            }
        }
        Ok(())
    }

    /// Adds a step: an image of each camera, then the action.
    ///
    /// # Errors
    /// [`StorageError::Write`] when the step is earlier than the one before it, the action is not of
    /// the episode's space, or an image cannot be encoded, [`StorageError::Io`] when the file cannot be written.
    pub fn add_step(&mut self, step: &Step) -> Result<(), StorageError> {
        let nanos = self.nanos_of(step.time_secs)?;
        self.nanos = nanos;
        for (camera, image) in step.observation.iter() {
            let (encoded, format) = if self.keeps_pixels {
                (encode_png(image), "png")
            } else {
                (encode_jpeg(image, JPEG_QUALITY), "jpeg")
            };
            let data =
                encoded.map_err(|e| self.failure(&format!("image of camera '{camera}': {e}")))?;
            let message = CompressedImage {
                header: Header {
                    stamp: Time::from_nanos(nanos),
                    frame_id: camera.to_owned(),
                },
                format: format.to_owned(),
                data: &data,
            };
            let bytes = cdr::encode(&message, data.len() + 64).map_err(|e| self.failure(&e))?;
            let topic = format!("/camera/{camera}/image_raw/compressed");
            self.write(&topic, &IMAGE, nanos, &bytes)?;
        }
        let (schema, action) = self.action_json(&step.action)?;
        self.write("/action", schema, nanos, action.to_string().as_bytes())?;
        self.steps += 1;
        Ok(())
    }

    /// Marks that the newest step is the first that shows `name`.
    ///
    /// # Errors
    /// [`StorageError::Write`] before the first step, [`StorageError::Io`] when the file cannot be written.
    pub fn add_marker(&mut self, name: &str) -> Result<(), StorageError> {
        let Some(step) = self.steps.checked_sub(1) else {
            return Err(self.failure(&format!("marker '{name}' before the first step")));
        };
        let marker = json!(Marker {
            step,
            name: name.to_owned()
        });
        self.write(
            "/subgoal",
            &SUBGOAL,
            self.nanos,
            marker.to_string().as_bytes(),
        )
    }

    /// Adds a JSON object on a topic of its own, such as a plan or an event, at the time of the newest
    /// step. `schema_name` names the kind of object for viewers.
    ///
    /// # Errors
    /// [`StorageError::Write`] when `value` is no object, [`StorageError::Io`] when the file cannot be written.
    pub fn add_json(
        &mut self,
        topic: &str,
        schema_name: &str,
        value: &Value,
    ) -> Result<(), StorageError> {
        if !value.is_object() {
            return Err(self.failure(&format!("{topic}: {value} is no JSON object")));
        }
        let schema = Schema {
            name: schema_name,
            encoding: "jsonschema",
            text: &schemas::open_object(schema_name),
            message_encoding: "json",
        };
        self.write(topic, &schema, self.nanos, value.to_string().as_bytes())
    }

    /// Ends the episode and puts the file in its place.
    ///
    /// # Errors
    /// [`StorageError::Io`] or [`StorageError::Write`] when the file cannot be written.
    pub fn finish(mut self, metadata: &RecordingMetadata) -> Result<(), StorageError> {
        let mut entries: Vec<(&str, String)> = metadata
            .notes
            .iter()
            .map(|(key, value)| (key.as_str(), value.clone()))
            .collect();
        entries.push((keys::STEPS, self.steps.to_string()));
        entries.push((keys::ROBOT, metadata.robot.clone()));
        entries.extend(metadata.seed.map(|seed| (keys::SEED, seed.to_string())));
        entries.extend(
            metadata
                .success
                .map(|done| (keys::SUCCESS, done.to_string())),
        );
        self.write_metadata(EPISODE_RECORD, entries)?;
        let Self {
            mut writer,
            draft,
            path,
            ..
        } = self;
        writer.finish().map_err(|e| write_error(&path, e))?;
        writer
            .into_inner()
            .into_inner()
            .map_err(|e| StorageError::io("write", &path)(e.into_error()))?;
        draft.commit()
    }

    fn nanos_of(&self, time_secs: f64) -> Result<u64, StorageError> {
        let nanos = (time_secs * 1e9).round();
        if nanos.is_finite() && nanos >= self.nanos as f64 && nanos < u64::MAX as f64 {
            return Ok(nanos as u64);
        }
        Err(self.failure(&format!(
            "step {} is at {time_secs} s, before the step at {} s",
            self.steps,
            self.nanos as f64 / 1e9
        )))
    }

    fn action_json(
        &self,
        action: &Action,
    ) -> Result<(&'static Schema<'static>, Value), StorageError> {
        match (&self.action_space, action) {
            (ActionSpace::Primitives { names }, Action::Primitive(index))
                if *index < names.len() =>
            {
                let name = &names[*index];
                let value = json!({ "step": self.steps, "index": index, "name": name });
                Ok((&PRIMITIVE_ACTION, value))
            }
            (
                ActionSpace::Binned { .. } | ActionSpace::Continuous { .. },
                Action::Continuous(values),
            ) if values.len() == self.action_space.dimension_count()
                && values.iter().all(|v| v.is_finite()) =>
            {
                let value = json!({ "step": self.steps, "values": values });
                Ok((&CONTINUOUS_ACTION, value))
            }
            (space, action) => Err(self.failure(&format!(
                "{action} of step {} is not one of {space}",
                self.steps
            ))),
        }
    }

    fn write(
        &mut self,
        topic: &str,
        schema: &Schema,
        nanos: u64,
        data: &[u8],
    ) -> Result<(), StorageError> {
        self.channel(topic, schema)
            .and_then(|(channel_id, sequence)| {
                let header = MessageHeader {
                    channel_id,
                    sequence,
                    log_time: nanos,
                    publish_time: nanos,
                };
                self.writer.write_to_known_channel(&header, data)
            })
            .map_err(|e| write_error(&self.path, e))
    }

    /// Id of a topic's channel, which is described when it first appears, and the next sequence number.
    fn channel(&mut self, topic: &str, schema: &Schema) -> Result<(u16, u32), McapError> {
        if !self.channels.contains_key(topic) {
            let schema_id =
                self.writer
                    .add_schema(schema.name, schema.encoding, schema.text.as_bytes())?;
            let id = self.writer.add_channel(
                schema_id,
                topic,
                schema.message_encoding,
                &BTreeMap::new(),
            )?;
            let state = ChannelState { id, messages: 0 };
            self.channels.insert(topic.to_owned(), state);
        }
        let channel = self.channels.get_mut(topic).expect("it was just added");
        channel.messages += 1;
        Ok((channel.id, channel.messages - 1))
    }

    fn write_metadata<'a>(
        &mut self,
        name: &str,
        entries: impl IntoIterator<Item = (&'a str, String)>,
    ) -> Result<(), StorageError> {
        let metadata = entries
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value))
            .collect();
        let record = Metadata {
            name: name.to_owned(),
            metadata,
        };
        self.writer
            .write_metadata(&record)
            .map_err(|e| write_error(&self.path, e))
    }

    fn failure(&self, reason: &str) -> StorageError {
        StorageError::Write {
            path: self.path.clone(),
            reason: reason.to_owned(),
        }
    }
}

impl fmt::Debug for EpisodeWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EpisodeWriter")
            .field("path", &self.path)
            .field("steps", &self.steps)
            .finish_non_exhaustive()
    }
}

const IMAGE: Schema = Schema {
    name: "sensor_msgs/msg/CompressedImage",
    encoding: "ros2msg",
    text: schemas::COMPRESSED_IMAGE,
    message_encoding: "cdr",
};
const STRING: Schema = Schema {
    name: "std_msgs/msg/String",
    encoding: "ros2msg",
    text: schemas::STRING,
    message_encoding: "cdr",
};
const PRIMITIVE_ACTION: Schema = json_schema("catena.PrimitiveAction", schemas::PRIMITIVE_ACTION);
const CONTINUOUS_ACTION: Schema =
    json_schema("catena.ContinuousAction", schemas::CONTINUOUS_ACTION);
const SUBGOAL: Schema = json_schema("catena.Subgoal", schemas::SUBGOAL);

const fn json_schema(name: &'static str, text: &'static str) -> Schema<'static> {
    Schema {
        name,
        encoding: "jsonschema",
        text,
        message_encoding: "json",
    }
}

fn write_error(path: &Path, error: McapError) -> StorageError {
    match error {
        // The library's own words leave out what happened, such as a full disk.
        McapError::Io(source) => StorageError::io("write the recording", path)(source),
        other => StorageError::Write {
            path: path.to_owned(),
            reason: other.to_string(),
        },
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io;

    use super::*;

    #[test]
    fn what_the_system_refuses_is_the_cause_of_a_recording_that_cannot_be_written() {
        let full = McapError::Io(io::Error::from(io::ErrorKind::StorageFull));
        let error = write_error(Path::new("demos/sock.mcap"), full);
        let cause = error.source().and_then(|e| e.downcast_ref::<io::Error>());
        let cause = cause.expect("the system's own error");
        assert_eq!(cause.kind(), io::ErrorKind::StorageFull);
        let told = format!("cannot write the recording demos/sock.mcap: {cause}");
        assert_eq!(error.to_string(), told);
    }
}
