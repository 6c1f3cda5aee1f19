//! The schemas that recordings of ours carry, so that any tool can read them.

/// `sensor_msgs/msg/CompressedImage` with all that it refers to.
pub(super) const COMPRESSED_IMAGE: &str = "\
std_msgs/Header header
string format
uint8[] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// `std_msgs/msg/String`.
pub(super) const STRING: &str = "string data\n";

/// JSON schema of a message on `/action` for motion primitives.
pub(super) const PRIMITIVE_ACTION: &str = r#"{"title":"catena.PrimitiveAction","type":"object","properties":{"step":{"type":"integer","description":"step of the episode, from 0"},"index":{"type":"integer","description":"index into the primitives of the action space"},"name":{"type":"string","description":"the primitive's name"}},"required":["step","index","name"]}"#;

/// JSON schema of a message on `/action` for continuous actions.
pub(super) const CONTINUOUS_ACTION: &str = r#"{"title":"catena.ContinuousAction","type":"object","properties":{"step":{"type":"integer","description":"step of the episode, from 0"},"values":{"type":"array","items":{"type":"number"},"description":"one value a dimension of the action space"}},"required":["step","values"]}"#;

/// JSON schema of a message on `/subgoal`.
pub(super) const SUBGOAL: &str = r#"{"title":"catena.Subgoal","type":"object","properties":{"step":{"type":"integer","description":"first step that shows it"},"name":{"type":"string","description":"what is reached"}},"required":["step","name"]}"#;

/// JSON schema of an object about which nothing but its name is promised.
pub(super) fn open_object(name: &str) -> String {
    serde_json::json!({ "title": name, "type": "object" }).to_string()
}
