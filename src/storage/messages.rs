//! Messages of other systems, field for field as their definitions have them.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/Time`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

impl Time {
    pub fn from_nanos(nanos: u64) -> Self {
        Self {
            sec: (nanos / 1_000_000_000) as i32,
            nanosec: (nanos % 1_000_000_000) as u32,
        }
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

/// `sensor_msgs/CompressedImage`; the data stays in the message's buffer.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct CompressedImage<'a> {
    pub header: Header,
    pub format: String,
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

/// `sensor_msgs/Image`; the data stays in the message's buffer.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct RawImage<'a> {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub encoding: String,
    pub is_bigendian: u8,
    pub step: u32,
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

/// `sensor_msgs/JointState`.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct JointState {
    pub header: Header,
    pub name: Vec<String>,
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    pub effort: Vec<f64>,
}

/// `std_msgs/MultiArrayDimension`.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct MultiArrayDimension {
    pub label: String,
    pub size: u32,
    pub stride: u32,
}

/// `std_msgs/Float32MultiArray` and its siblings: `T` is the type of a value.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct MultiArray<T> {
    pub dimensions: Vec<MultiArrayDimension>,
    pub data_offset: u32,
    pub data: Vec<T>,
}

/// `geometry_msgs/Twist`: linear x y z, angular x y z.
pub(super) type Twist = [f64; 6];

/// `geometry_msgs/TwistStamped`.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TwistStamped {
    pub header: Header,
    pub twist: Twist,
}

/// `foxglove.CompressedImage`; the time stamp and the frame are not needed.
#[derive(Clone, PartialEq, prost::Message)]
pub(super) struct FoxgloveCompressedImage {
    #[prost(bytes = "vec", tag = "2")]
    pub data: Vec<u8>,
    #[prost(string, tag = "3")]
    pub format: String,
}

/// `foxglove.RawImage`; the time stamp and the frame are not needed.
#[derive(Clone, PartialEq, prost::Message)]
pub(super) struct FoxgloveRawImage {
    #[prost(fixed32, tag = "2")]
    pub width: u32,
    #[prost(fixed32, tag = "3")]
    pub height: u32,
    #[prost(string, tag = "4")]
    pub encoding: String,
    #[prost(fixed32, tag = "5")]
    pub step: u32,
    #[prost(bytes = "vec", tag = "6")]
    pub data: Vec<u8>,
}
