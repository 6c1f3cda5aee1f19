//! MCAP files that are wrong.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;

use super::Case;
use crate::command::root;

const IMAGES: (&str, &str, &str) = ("/camera/head", "foxglove.CompressedImage", "protobuf");
const ACTIONS: (&str, &str, &str) = ("/action", "any.Action", "json");

type Message = ((&'static str, &'static str, &'static str), u64, Vec<u8>);

fn mcap(path: &Path, messages: &[Message]) -> PathBuf {
    mcap_saying(path, &[], messages)
}

/// A recording with these pairs in the record of ours.
fn mcap_saying(path: &Path, said: &[(&str, &str)], messages: &[Message]) -> PathBuf {
    let mut writer = mcap::Writer::new(File::create(path).expect("a file")).expect("a writer");
    if !said.is_empty() {
        let pairs = said.iter();
        let record = mcap::records::Metadata {
            name: "catena".to_owned(),
            metadata: pairs
                .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
                .collect(),
        };
        writer.write_metadata(&record).expect("a record");
    }
    let mut channels = BTreeMap::new();
    for ((topic, type_name, encoding), log_time, data) in messages {
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let schema = writer.add_schema(type_name, "", b"").expect("a schema");
            let metadata = BTreeMap::new();
            writer
                .add_channel(schema, topic, encoding, &metadata)
                .expect("a channel")
        });
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer
            .write_to_known_channel(&header, data)
            .expect("a message");
    }
    writer.finish().expect("it is finished");
    path.to_owned()
}

/// `foxglove.CompressedImage` with these bytes.
fn image_message(bytes: &[u8]) -> Vec<u8> {
    let mut message = vec![0x12];
    let mut length = bytes.len();
    while length > 127 {
        message.push((length % 128) as u8 | 0x80);
        length /= 128;
    }
    message.push(length as u8);
    message.extend(bytes);
    message
}

fn png(height: u32, width: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(width, height)
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("a picture");
    bytes.into_inner()
}

fn shown(time: u64) -> Message {
    (IMAGES, time, image_message(&png(4, 6)))
}

fn told(time: u64, action: &str) -> Message {
    (ACTIONS, time, action.as_bytes().to_vec())
}

/// A sound recording but for its last action.
fn with_action(folder: &Path, action: &str) -> PathBuf {
    let good = |i: u64| [shown(i * 100), told(i * 100 + 1, r#"{"values": [0.5, 1]}"#)];
    let mut messages: Vec<Message> = (0..4).flat_map(good).collect();
    messages.push(told(401, action));
    mcap(&folder.join("demo.mcap"), &messages)
}

/// A recording that declares two primitives, with this one done last.
fn with_primitive(folder: &Path, index: usize) -> PathBuf {
    let space = r#"{"kind": "primitives", "names": ["left", "right"]}"#;
    let last = format!(r#"{{"index": {index}}}"#);
    let mut messages = vec![shown(0), told(1, r#"{"index": 1}"#)];
    messages.extend([shown(100), told(101, &last)]);
    let path = folder.join("demo.mcap");
    mcap_saying(&path, &[("action_space", space)], &messages)
}

/// A recording that declares a dimension without a bin.
fn without_bins(folder: &Path) -> PathBuf {
    let dimension = r#"{"name": "x", "low": 0, "high": 1, "bins": 0}"#;
    let space = format!(r#"{{"kind": "binned", "dimensions": [{dimension}]}}"#);
    let messages = [shown(0), told(1, r#"{"values": [0.5]}"#)];
    let path = folder.join("demo.mcap");
    mcap_saying(&path, &[("action_space", &space)], &messages)
}

/// Two recordings of one task, of which the second has smaller images.
pub(super) fn of_two_sizes(folder: &Path) -> PathBuf {
    let task = folder.join("cup");
    fs::create_dir(&task).expect("a folder");
    for (name, height, width) in [("a.mcap", 4, 6), ("b.mcap", 2, 3)] {
        let image = (IMAGES, 1, image_message(&png(height, width)));
        let messages = [image, told(2, r#"{"values": [1]}"#)];
        mcap(&task.join(name), &messages);
    }
    task
}

pub(super) fn with_image(folder: &Path, bytes: &[u8]) -> PathBuf {
    let image = (IMAGES, 0, image_message(bytes));
    mcap(
        &folder.join("demo.mcap"),
        &[image, told(1, r#"{"values": [1]}"#)],
    )
}

/// A PNG whose header claims a size, with a right checksum and hardly a pixel behind it.
pub(super) fn lying_png() -> Vec<u8> {
    let mut bytes = png(4, 6);
    bytes[16..24].copy_from_slice(&[0, 0, 0x3f, 0xff, 0, 0, 0x3f, 0xff]);
    let checksum = crc32(&bytes[12..29]).to_be_bytes();
    bytes[29..33].copy_from_slice(&checksum);
    bytes
}

/// The checksum of PNG's chunks.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1));
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), step)
    })
}

pub(super) fn raw_bytes(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("demo.mcap");
    fs::write(&path, bytes).expect("written");
    path
}

pub(super) const CASES: &[Case] = &[
    ("nothing there", |f| f.join("demo.mcap")),
    ("folder without recordings", Path::to_owned),
    ("empty file", |f| raw_bytes(f, b"")),
    ("text instead of MCAP", |f| raw_bytes(f, b"task: cup")),
    ("a bag of SQLite instead of MCAP", |f| {
        raw_bytes(f, b"SQLite format 3\0")
    }),
    ("only the magic number", |f| raw_bytes(f, mcap::MAGIC)),
    ("cut off in the first record", |f| {
        let path = with_action(f, "{}");
        let bytes = fs::read(&path).expect("a file");
        raw_bytes(f, &bytes[..40])
    }),
    ("chunk cut in half", |f| {
        let from = root().join("tests/data/bridge/put_carrot_on_plate/episode_00.mcap");
        let bytes = fs::read(from).expect("a file");
        raw_bytes(f, &bytes[..bytes.len() / 2])
    }),
    ("no images", |f| {
        mcap(&f.join("demo.mcap"), &[told(1, r#"{"values": [1]}"#)])
    }),
    ("no actions", |f| mcap(&f.join("demo.mcap"), &[shown(1)])),
    ("actions before the first image", |f| {
        mcap(
            &f.join("demo.mcap"),
            &[told(1, r#"{"values": [1]}"#), shown(2)],
        )
    }),
    ("all actions at one time", |f| {
        let act = || told(0, r#"{"values": [1]}"#);
        mcap(&f.join("demo.mcap"), &[shown(0), act(), shown(0), act()])
    }),
    ("action is no JSON", |f| {
        with_action(f, r#"{"values": [1, "#)
    }),
    ("action without values", |f| {
        with_action(f, r#"{"speed": 3}"#)
    }),
    ("action is not finite as a 32-bit float", |f| {
        with_action(f, r#"{"values": [0, 1e300]}"#)
    }),
    ("action with another number of values", |f| {
        with_action(f, r#"{"values": [1, 2, 3]}"#)
    }),
    ("primitive among values", |f| {
        with_action(f, r#"{"index": 3}"#)
    }),
    ("primitive that the recording does not have", |f| {
        with_primitive(f, 9)
    }),
    ("declared dimension of 0 bins", without_bins),
    ("image is no picture", |f| with_image(f, b"not a picture")),
    ("image claims 16383x16383 pixels", |f| {
        with_image(f, &lying_png())
    }),
    ("images of two sizes", |f| {
        let small = (IMAGES, 100, image_message(&png(2, 2)));
        let act = |t| told(t, r#"{"values": [1]}"#);
        mcap(&f.join("demo.mcap"), &[shown(1), act(2), small, act(101)])
    }),
    ("images of two sizes in two recordings", of_two_sizes),
    ("images in an unknown packing", |f| {
        let message = (
            ("/camera/head", "sensor_msgs/msg/Image", "ros1"),
            1,
            vec![0; 20],
        );
        mcap(
            &f.join("demo.mcap"),
            &[message, told(1, r#"{"values": [1]}"#)],
        )
    }),
    ("actions of a type that holds none", |f| {
        let message = (("/action", "nav_msgs/msg/Path", "cdr"), 2, vec![0; 20]);
        mcap(&f.join("demo.mcap"), &[shown(1), message])
    }),
];
