//! What a topic is for, told by its name and its type.

use super::action_message::ActionFormat;

/// How images of a topic are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageFormat {
    /// `sensor_msgs/CompressedImage` as CDR.
    CompressedCdr,
    /// `sensor_msgs/Image` as CDR.
    RawCdr,
    /// `foxglove.CompressedImage` as protobuf.
    CompressedFoxglove,
    /// `foxglove.RawImage` as protobuf.
    RawFoxglove,
    /// The bytes of a JPEG or PNG file.
    File,
}

/// What a topic means to a demonstration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Camera(ImageFormat),
    /// Images or actions in a packing that is not understood, and why.
    UnreadableCamera(String),
    UnreadableAction(String),
    /// Depths instead of images, and how that is told.
    Depth(String),
    Action(ActionFormat),
    Task,
    Subgoal,
    Other,
}

/// A channel of a recording: its topic and how its messages are packed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Channel {
    pub topic: String,
    /// Name of the message type, as written in the file.
    pub type_name: String,
    /// Encoding of the messages, such as `cdr`.
    pub encoding: String,
}

impl Channel {
    /// What the channel is for.
    pub fn role(&self) -> Role {
        // `sensor_msgs/msg/Image` and `sensor_msgs/Image` are the same type.
        let type_name = self.type_name.replace("/msg/", "/");
        let encoding = self.encoding.as_str();
        if matches!(
            type_name.as_str(),
            "sensor_msgs/CompressedImage"
                | "sensor_msgs/Image"
                | "foxglove.CompressedImage"
                | "foxglove.RawImage"
        ) {
            return match image_format(&type_name, encoding) {
                Some(format) => Role::Camera(format),
                None => Role::UnreadableCamera(format!(
                    "{type_name} encoded as '{encoding}' is not supported (cdr and protobuf are)"
                )),
            };
        }
        match last_segment(&self.topic) {
            "action" => self.action_role(),
            "task" if encoding == "json" || type_name == "std_msgs/String" => Role::Task,
            "subgoal" if encoding == "json" || type_name == "std_msgs/String" => Role::Subgoal,
            _ => Role::Other,
        }
    }

    /// What the channel is for if it holds actions.
    pub fn action_role(&self) -> Role {
        let type_name = self.type_name.replace("/msg/", "/");
        match ActionFormat::of(&type_name, &self.encoding) {
            Some(format) => Role::Action(format),
            None => Role::UnreadableAction(format!(
                "type {type_name} encoded as '{}' is not understood as an action",
                self.encoding
            )),
        }
    }
}

fn image_format(type_name: &str, encoding: &str) -> Option<ImageFormat> {
    match (type_name, encoding) {
        ("sensor_msgs/CompressedImage", "cdr") => Some(ImageFormat::CompressedCdr),
        ("sensor_msgs/Image", "cdr") => Some(ImageFormat::RawCdr),
        ("foxglove.CompressedImage", "protobuf") => Some(ImageFormat::CompressedFoxglove),
        ("foxglove.RawImage", "protobuf") => Some(ImageFormat::RawFoxglove),
        _ => None,
    }
}

fn last_segment(topic: &str) -> &str {
    topic.rsplit('/').next().unwrap_or_default()
}

/// The camera that a topic belongs to: `/camera/head/image_raw/compressed` and `/head/image_raw` are
/// both of camera `head`; `/camera/image_raw` is of `camera`. What stands alone between `/camera/` and
/// `/image_raw/compressed`, where our recordings have the name, is taken as it is.
pub(super) fn camera_name(topic: &str) -> String {
    let ours = topic.strip_prefix("/camera/");
    let ours = ours.and_then(|rest| rest.strip_suffix("/image_raw/compressed"));
    if let Some(name) = ours.filter(|name| !name.is_empty() && !name.contains('/')) {
        return name.to_owned();
    }
    let mut segments: Vec<&str> = topic.split('/').filter(|s| !s.is_empty()).collect();
    while segments.last().is_some_and(|s| {
        matches!(
            *s,
            "compressed"
                | "image"
                | "image_raw"
                | "image_color"
                | "image_rect"
                | "image_rect_color"
        )
    }) {
        segments.pop();
    }
    let named = segments
        .iter()
        .position(|s| !matches!(*s, "camera" | "cameras"))
        .unwrap_or(segments.len());
    match segments[named..].join("_") {
        empty if empty.is_empty() => "camera".to_owned(),
        name => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn role(topic: &str, type_name: &str, encoding: &str) -> Role {
        Channel {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            encoding: encoding.to_owned(),
        }
        .role()
    }

    #[test]
    fn cameras_are_named_for_what_their_topics_differ_in() {
        for (topic, name) in [
            ("/camera/head/image_raw/compressed", "head"),
            ("/head/image_raw/compressed", "head"),
            ("/camera/image_raw", "camera"),
            ("/camera/camera/color/image_raw", "color"),
            ("/arm/wrist/image_rect_color", "arm_wrist"),
            ("image", "camera"),
            ("/camera/image/image_raw/compressed", "image"),
            ("/camera/compressed/image_raw/compressed", "compressed"),
            ("/camera/cameras/image_raw/compressed", "cameras"),
            ("/camera/camera/image_raw/compressed", "camera"),
            ("/camera//image_raw/compressed", "camera"),
            ("/camera/image_raw/compressed", "camera"),
            ("/camera/arm/wrist/image_raw/compressed", "arm_wrist"),
            ("/camera/camera/color/image_raw/compressed", "color"),
            ("/cameras/image/image_raw/compressed", "camera"),
            ("/camera/image/image_raw", "camera"),
        ] {
            assert_eq!(camera_name(topic), name, "{topic}");
        }
    }

    #[test]
    fn short_and_long_type_names_mean_the_same() {
        for name in ["sensor_msgs/msg/Image", "sensor_msgs/Image"] {
            assert_eq!(role("/x", name, "cdr"), Role::Camera(ImageFormat::RawCdr));
        }
        assert!(matches!(
            role("/x", "sensor_msgs/Image", "ros1"),
            Role::UnreadableCamera(reason) if reason.contains("ros1")
        ));
    }

    #[test]
    fn only_the_action_topic_holds_actions() {
        let joints = "sensor_msgs/msg/JointState";
        assert!(matches!(role("/action", joints, "cdr"), Role::Action(_)));
        assert!(matches!(
            role("/arm/action", joints, "cdr"),
            Role::Action(_)
        ));
        assert_eq!(role("/joint_states", joints, "cdr"), Role::Other);
        assert!(matches!(
            role("/action", "nav_msgs/msg/Path", "cdr"),
            Role::UnreadableAction(_)
        ));
    }
}
