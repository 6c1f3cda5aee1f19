//! Which topics of a recording make its trajectory.

use std::path::Path;

use super::action_message::{ActionFormat, ActionMessage, action, action_space};
use super::align::{align, images_left_out};
use super::declared_space::declared_space;
use super::decode::decode_image;
use super::scan::{Scan, TopicScan};
use super::steps::Steps;
use super::topic::{ImageFormat, Role};
use super::view::{View, typical_rate_hz};
use super::{ActionReport, CameraReport, Loss, StorageError};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Marker};
use crate::wording::{counted, listed};

/// A camera topic of which an image can be decoded.
pub(super) struct CameraTopic<'a> {
    pub name: String,
    pub format: ImageFormat,
    /// Rows and columns of its first image that can be decoded.
    pub recorded_size: (u32, u32),
    /// Its size in the trajectory.
    pub spec: CameraSpec,
    pub scan: &'a TopicScan,
}

/// The action topic.
pub(super) struct ActionTopic<'a> {
    pub scan: &'a TopicScan,
    pub space: ActionSpace,
    messages: Vec<Result<ActionMessage, String>>,
}

/// A topic with images or actions that is not used.
struct Unused {
    topic: String,
    is_camera: bool,
    reason: String,
}

/// The topics of a trajectory.
pub(super) struct Layout<'a> {
    view: &'a View,
    /// By name.
    pub cameras: Vec<CameraTopic<'a>>,
    pub actions: Option<ActionTopic<'a>>,
    unused: Vec<Unused>,
}

impl<'a> Layout<'a> {
    pub fn of(scan: &'a Scan, view: &'a View) -> Self {
        let mut layout = Self {
            view,
            cameras: Vec::new(),
            actions: None,
            unused: Vec::new(),
        };
        for topic in scan.topics.values() {
            match &topic.role {
                Role::Camera(format) => layout.add_camera(*format, topic),
                Role::Action(format) => layout.add_actions(*format, topic, scan),
                Role::UnreadableCamera(reason) | Role::Depth(reason) => {
                    layout.leave(topic, true, reason);
                }
                Role::UnreadableAction(reason) => layout.leave(topic, false, reason),
                Role::Task | Role::Subgoal | Role::Other => {}
            }
        }
        layout.cameras.sort_by(|a, b| a.name.cmp(&b.name));
        layout
    }

    fn leave(&mut self, scan: &TopicScan, is_camera: bool, reason: &str) {
        self.unused.push(Unused {
            topic: scan.channel.topic.clone(),
            is_camera,
            reason: reason.to_owned(),
        });
    }

    fn add_camera(&mut self, format: ImageFormat, scan: &'a TopicScan) {
        let mut images = scan.kept.iter().map(|(_, m)| decode_image(format, m));
        let first = match images.next() {
            None => return,
            Some(Ok(image)) => image,
            // One that is damaged takes no sound one with it.
            Some(Err(reason)) => match images.find_map(Result::ok) {
                Some(image) => image,
                None => return self.leave(scan, true, &format!("its first image: {reason}")),
            },
        };
        let name = self.view.camera_name(&scan.channel.topic);
        let recorded_size = (first.height(), first.width());
        let sized = self.view.sized(&name, first);
        let camera = CameraTopic {
            spec: CameraSpec {
                name: name.clone(),
                height: sized.height(),
                width: sized.width(),
            },
            name,
            format,
            recorded_size,
            scan,
        };
        // One camera is often recorded twice, raw and compressed; the topic with more images is used.
        let rival = self.cameras.iter_mut().find(|c| c.name == camera.name);
        let Some(rival) = rival else {
            return self.cameras.push(camera);
        };
        let other = if camera.scan.messages > rival.scan.messages {
            std::mem::replace(rival, camera).scan
        } else {
            scan
        };
        let reason = format!(
            "is camera '{}' as well, taken from {}",
            rival.name, rival.scan.channel.topic
        );
        self.leave(other, true, &reason);
    }

    fn add_actions(&mut self, format: ActionFormat, scan: &'a TopicScan, file: &Scan) {
        let declared = match declared_space(file) {
            Ok(declared) => declared,
            Err(reason) => return self.leave(scan, false, &reason),
        };
        let messages: Vec<_> = scan.kept.iter().map(|(_, m)| format.decode(m)).collect();
        let readable: Vec<_> = messages.iter().flatten().cloned().collect();
        let Some(space) = action_space(declared, &readable) else {
            let reason = messages
                .into_iter()
                .find_map(Result::err)
                .unwrap_or_default();
            return self.leave(scan, false, &format!("its first action: {reason}"));
        };
        let actions = ActionTopic {
            scan,
            space,
            messages,
        };
        let other = match &mut self.actions {
            None => {
                self.actions = Some(actions);
                return;
            }
            // `/action` is shorter than `/left_arm/action`.
            Some(used) if used.scan.channel.topic.len() > scan.channel.topic.len() => {
                std::mem::replace(used, actions).scan
            }
            Some(_) => scan,
        };
        self.leave(other, false, "actions are taken from a shorter topic");
    }

    /// Why this layout makes no trajectory, if it does not.
    pub fn check(&self, path: &Path, scan: &Scan) -> Result<&ActionTopic<'a>, StorageError> {
        let path = path.to_owned();
        if self.cameras.is_empty() {
            return Err(match self.reasons(true) {
                Some(reasons) => StorageError::UnusableCameras { path, reasons },
                None if self.reasons(false).is_some() => StorageError::UnusableActions {
                    path,
                    reasons: self.reasons(false).unwrap_or_default(),
                },
                None => StorageError::NoImages {
                    path,
                    topics: topic_list(scan),
                    lost: lost(scan),
                },
            });
        }
        self.actions
            .as_ref()
            .ok_or_else(|| match self.reasons(false) {
                Some(reasons) => StorageError::UnusableActions { path, reasons },
                None => StorageError::NoActions {
                    path,
                    cameras: self.camera_names(),
                    lost: lost(scan),
                },
            })
    }

    fn reasons(&self, cameras: bool) -> Option<String> {
        let reasons: Vec<_> = self
            .unused
            .iter()
            .filter(|u| u.is_camera == cameras)
            .map(Unused::to_string)
            .collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    /// What is there and not used, each with its reason.
    pub fn notes(&self) -> Vec<String> {
        self.unused.iter().map(Unused::to_string).collect()
    }

    /// The cameras with their topics, for messages.
    pub fn camera_names(&self) -> String {
        let names: Vec<_> = self
            .cameras
            .iter()
            .map(|c| format!("{} ({})", c.name, c.scan.channel.topic))
            .collect();
        names.join(", ")
    }

    /// The steps by times alone, and what becomes of the actions.
    pub fn steps(&self, path: &Path) -> Result<Option<Steps>, StorageError> {
        let Some(actions) = self.actions.as_ref().filter(|_| !self.cameras.is_empty()) else {
            return Ok(None);
        };
        let shape = self.view.shape(path, &actions.space)?;
        let times = actions.scan.times();
        let chosen = self.view.chosen(path, &shape.space, &times)?;
        Ok(Some(Steps {
            shape,
            times,
            chosen,
        }))
    }

    /// How many of the chosen actions come before the first image of every camera.
    pub fn unseen(&self, steps: &Steps) -> usize {
        let images: Vec<_> = self.cameras.iter().map(|c| c.scan.times()).collect();
        align(&steps.chosen_times(), &images).first_action
    }

    /// What came out of order or not at all, given the times at which the steps begin.
    pub fn losses(&self, step_times: &[u64]) -> Vec<Loss> {
        let scans = self.cameras.iter().map(|c| c.scan);
        let disorder = scans
            .clone()
            .chain(self.actions.as_ref().map(|a| a.scan))
            .filter_map(TopicScan::disorder);
        let gaps = scans.flat_map(|s| images_left_out(&s.channel.topic, &s.times(), step_times));
        disorder.chain(gaps).collect()
    }

    /// How steps were chosen, and which rates differ.
    pub fn remarks(&self, steps: Option<&Steps>) -> Vec<String> {
        let Some(steps) = steps else {
            return Vec::new();
        };
        let rates = self
            .cameras
            .iter()
            .filter_map(|c| Some((c.name.as_str(), typical_rate_hz(&c.scan.times())?)));
        steps.remarks(rates)
    }

    /// The topics of texts that the mapping file names and on which nothing was said, which can be meant or a slip.
    pub fn silent_topics(&self, scan: &Scan) -> Vec<String> {
        let mapping = self.view.mapping.as_ref();
        let task = mapping.and_then(|m| m.task_topic());
        let subgoal = mapping.and_then(|m| m.subgoal_topic());
        let named = [("the task", task), ("subgoals", subgoal)].into_iter();
        named
            .filter_map(|(what, topic)| {
                let topic = topic.filter(|topic| !scan.topics.contains_key(*topic))?;
                Some(format!(
                    "there is no message on {topic}, the topic of {what} by the mapping file"
                ))
            })
            .collect()
    }

    /// Which values of the actions lie beyond the ranges that the mapping file gives.
    pub fn values_beyond(&self, path: &Path, steps: Option<&Steps>) -> Vec<String> {
        // Without a range the actions need not be read a second time.
        let (Some(topic), Some(steps), Some(ranges)) = (&self.actions, steps, self.view.ranges())
        else {
            return Vec::new();
        };
        // An action that cannot be understood is told when the recording is read.
        let actions = topic.actions(path);
        actions.map_or_else(
            |_| Vec::new(),
            |actions| steps.values_beyond(&ranges, &actions, self.unseen(steps)),
        )
    }

    /// The subgoals after the last action, which are at no step.
    pub fn late_subgoals(scan: &Scan, step_times: &[u64]) -> Option<String> {
        const SHOWN: usize = 12;
        let last = *step_times.last()?;
        let late = scan
            .markers()
            .into_iter()
            .filter(|(nanos, _)| *nanos > last);
        let late: Vec<String> = late.map(|(_, name)| name).collect();
        (!late.is_empty()).then(|| {
            let (count, names) = (counted(late.len(), "subgoal"), listed(&late, SHOWN));
            format!("{count} after the last action, and so at no step: {names}")
        })
    }

    /// The markers, each at the first step at or after it.
    pub fn markers(scan: &Scan, step_times: &[u64]) -> Vec<Marker> {
        scan.markers()
            .into_iter()
            .map(|(nanos, name)| Marker {
                step: step_times.partition_point(|t| *t < nanos),
                name,
            })
            .filter(|marker| marker.step < step_times.len())
            .collect()
    }
}

impl std::fmt::Display for Unused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.topic, self.reason)
    }
}

impl CameraTopic<'_> {
    pub fn report(&self) -> CameraReport {
        CameraReport {
            spec: self.spec.clone(),
            topic: self.scan.channel.topic.clone(),
            images: self.scan.messages,
        }
    }
}

impl ActionTopic<'_> {
    pub fn report(&self, steps: Option<&Steps>) -> ActionReport {
        let space = steps.map_or(&self.space, |s| &s.shape.space);
        ActionReport {
            topic: self.scan.channel.topic.clone(),
            space: space.clone(),
        }
    }

    /// All actions, or the first that does not belong to the space.
    pub fn actions(&self, path: &Path) -> Result<Vec<Action>, StorageError> {
        self.messages
            .iter()
            .enumerate()
            .map(|(message, decoded)| {
                decoded
                    .clone()
                    .and_then(|m| action(&self.space, m))
                    .map_err(|reason| StorageError::BadAction {
                        path: path.to_owned(),
                        topic: self.scan.channel.topic.clone(),
                        message,
                        reason,
                    })
            })
            .collect()
    }
}

/// What of the file could not be read, as the end of an error's text.
fn lost(scan: &Scan) -> String {
    let losses: Vec<_> = scan.salvage.losses.iter().map(Loss::to_string).collect();
    if losses.is_empty() {
        String::new()
    } else {
        format!(". Lost: {}", losses.join("; "))
    }
}

fn topic_list(scan: &Scan) -> String {
    const SHOWN: usize = 12;
    let mut topics: Vec<_> = scan
        .topics
        .values()
        .take(SHOWN)
        .map(|t| format!("{} ({})", t.channel.topic, t.channel.type_name))
        .collect();
    if topics.is_empty() {
        return "none: it holds no message".to_owned();
    }
    if scan.topics.len() > SHOWN {
        topics.push(format!("and {} more", scan.topics.len() - SHOWN));
    }
    topics.join(", ")
}
