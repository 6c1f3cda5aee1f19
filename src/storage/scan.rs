//! One pass over a recording: its topics, and the messages that a demonstration is made of.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::decode::{decode_image, without_compression};
use super::depth::depths_in;
use super::salvage::{Salvage, salvage};
use super::topic::{Channel, Role};
use super::view::View;
use super::{Loss, StorageError, TopicReport, cdr};

/// Which images to keep in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// Of each camera only the first, and the first that can be decoded if that cannot, with the times of all.
    FirstImages,
    AllImages,
}

/// A message: its log time in nanoseconds, and its bytes as recorded.
pub(super) type Stamped = (u64, Vec<u8>);

/// A topic with the messages that were kept.
#[derive(Debug)]
pub(super) struct TopicScan {
    pub channel: Channel,
    pub role: Role,
    pub messages: usize,
    pub bytes: u64,
    pub first_nanos: u64,
    pub last_nanos: u64,
    /// Messages that are older than one before them.
    late: usize,
    /// By how much at most.
    latest_nanos: u64,
    /// In order of time; empty for topics that play no part.
    pub kept: Vec<Stamped>,
    /// Whether an image was kept that can be decoded; known where only the first are kept.
    has_image: bool,
}

/// Everything that one pass finds.
#[derive(Debug)]
pub(super) struct Scan {
    pub salvage: Salvage,
    /// By name.
    pub topics: BTreeMap<String, TopicScan>,
}

impl Scan {
    /// Reads the files of a recording once, one after another.
    pub fn of(files: &[impl AsRef<Path>], keep: Keep, view: &View) -> Result<Self, StorageError> {
        let mut topics: BTreeMap<String, TopicScan> = BTreeMap::new();
        let mut whole: Option<Salvage> = None;
        for file in files {
            let mut found = salvage(file.as_ref(), |channel, nanos, data| {
                if !topics.contains_key(&channel.topic) {
                    topics.insert(
                        channel.topic.clone(),
                        TopicScan::new(channel, view.role(channel), nanos),
                    );
                }
                if let Some(topic) = topics.get_mut(&channel.topic) {
                    topic.take(keep, nanos, data);
                }
            })?;
            if files.len() > 1 {
                found.tell_file(file.as_ref());
            }
            match &mut whole {
                None => whole = Some(found),
                Some(whole) => whole.take(found),
            }
        }
        let salvage = whole.unwrap_or_default();
        for topic in topics.values_mut() {
            topic.kept.sort_by_key(|(nanos, _)| *nanos);
        }
        Ok(Self { salvage, topics })
    }

    /// The text of the first message on a topic `/task`.
    pub fn task(&self) -> Option<String> {
        let topic = self.topics.values().find(|t| t.role == Role::Task)?;
        let (_, message) = topic.kept.first()?;
        text(topic, message).filter(|task| !task.is_empty())
    }

    /// The topics on which the task and the subgoals are told.
    pub fn text_topics(&self) -> Vec<String> {
        let is_text = |t: &&TopicScan| matches!(t.role, Role::Task | Role::Subgoal);
        let texts = self.topics.values().filter(is_text);
        texts.map(|t| t.channel.topic.clone()).collect()
    }

    /// Names and times of the subgoal markers, in order of time.
    pub fn markers(&self) -> Vec<(u64, String)> {
        let mut markers: Vec<_> = self
            .topics
            .values()
            .filter(|t| t.role == Role::Subgoal)
            .flat_map(|t| {
                t.kept
                    .iter()
                    .filter_map(|(nanos, message)| Some((*nanos, text(t, message)?)))
            })
            .collect();
        // Stable: markers of one step stay in the order in which they were written.
        markers.sort_by_key(|(nanos, _)| *nanos);
        markers
    }

    /// Seconds from the first message to the last.
    pub fn duration_secs(&self) -> f64 {
        let first = self.topics.values().map(|t| t.first_nanos).min();
        let last = self.topics.values().map(|t| t.last_nanos).max();
        match (first, last) {
            (Some(first), Some(last)) => seconds_between(first, last),
            _ => 0.0,
        }
    }
}

impl TopicScan {
    fn new(channel: &Channel, role: Role, nanos: u64) -> Self {
        Self {
            channel: channel.clone(),
            role,
            messages: 0,
            bytes: 0,
            first_nanos: nanos,
            last_nanos: nanos,
            late: 0,
            latest_nanos: 0,
            kept: Vec::new(),
            has_image: false,
        }
    }

    fn take(&mut self, keep: Keep, nanos: u64, mut data: Vec<u8>) {
        self.messages += 1;
        self.bytes += data.len() as u64;
        if nanos < self.last_nanos {
            self.late += 1;
            self.latest_nanos = self.latest_nanos.max(self.last_nanos - nanos);
        }
        self.first_nanos = self.first_nanos.min(nanos);
        self.last_nanos = self.last_nanos.max(nanos);
        // What no picture is made of is not kept in memory.
        if self.messages == 1
            && let Role::Camera(format) = self.role
            && let Some(how_told) = depths_in(format, &data)
        {
            self.role = Role::Depth(how_told);
        }
        match self.role {
            Role::Camera(format) => {
                if keep == Keep::FirstImages {
                    let is_sound = !self.has_image && decode_image(format, &data).is_ok();
                    self.has_image |= is_sound;
                    if !is_sound && !self.kept.is_empty() {
                        data = Vec::new();
                    }
                }
                self.kept.push((nanos, data));
            }
            Role::Action(_) | Role::Task | Role::Subgoal => self.kept.push((nanos, data)),
            Role::UnreadableCamera(_)
            | Role::UnreadableAction(_)
            | Role::Depth(_)
            | Role::Other => {}
        }
    }

    /// Log times of the kept messages.
    pub fn times(&self) -> Vec<u64> {
        self.kept.iter().map(|(nanos, _)| *nanos).collect()
    }

    /// Messages that came out of order, where the order matters.
    pub fn disorder(&self) -> Option<Loss> {
        let matters = matches!(self.role, Role::Camera(_) | Role::Action(_));
        (matters && self.late > 0).then(|| Loss::TimesGoBack {
            topic: self.channel.topic.clone(),
            messages: self.late,
            by_millis: self.latest_nanos / 1_000_000,
        })
    }

    /// The topic in numbers.
    pub fn report(&self) -> TopicReport {
        let secs = seconds_between(self.first_nanos, self.last_nanos);
        TopicReport {
            topic: self.channel.topic.clone(),
            type_name: self.channel.type_name.clone(),
            encoding: self.channel.encoding.clone(),
            messages: self.messages,
            bytes: self.bytes,
            rate_hz: if secs > 0.0 {
                (self.messages - 1) as f64 / secs
            } else {
                0.0
            },
        }
    }
}

/// Seconds from one time in nanoseconds to a later one.
pub(super) fn seconds_between(first: u64, last: u64) -> f64 {
    last.saturating_sub(first) as f64 / 1e9
}

#[derive(Deserialize)]
#[serde(untagged)]
enum JsonText {
    Bare(String),
    Named { name: String },
    Task { task: String },
    Data { data: String },
}

/// The text of a `std_msgs/String`, or of JSON: bare, or under `name`, `task` or `data`.
fn text(topic: &TopicScan, message: &[u8]) -> Option<String> {
    if topic.channel.encoding == "json" {
        return match serde_json::from_slice(message).ok()? {
            JsonText::Bare(text)
            | JsonText::Named { name: text }
            | JsonText::Task { task: text }
            | JsonText::Data { data: text } => Some(text),
        };
    }
    cdr::decode(&without_compression(message).ok()?).ok()
}
