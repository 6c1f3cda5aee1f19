//! Texts in a recording: the task, and the subgoals.

use prost::Message as _;

use super::*;
use crate::storage::{PictureFormat, ReadOptions, Recordings, convert_to_mcap};

const MILLIS: u64 = 1_000_000;

/// Four steps from 0 to 300 ms, and texts on topics, each at its time in milliseconds.
fn write<const N: usize>(path: &Path, texts: [(&str, u64, &str); N]) {
    let (mut writer, [camera, actions]) = begin(
        path,
        [
            ["/camera/top", "foxglove.CompressedImage", "protobuf"],
            ["/action", "any.Action", "json"],
        ],
    );
    for step in 0..4 {
        let image = FoxgloveCompressedImage {
            data: encode_png(&picture(4, 6, step)).unwrap(),
            format: "png".to_owned(),
        };
        let nanos = step as u64 * 100 * MILLIS;
        writer
            .write_to_known_channel(&at(camera, nanos), &image.encode_to_vec())
            .unwrap();
        writer
            .write_to_known_channel(&at(actions, nanos), br#"{"values": [1, 2]}"#)
            .unwrap();
    }
    for (topic, millis, text) in texts {
        let schema = writer.add_schema("any.Text", "", b"").unwrap();
        let channel = writer
            .add_channel(schema, topic, "json", &[].into())
            .unwrap();
        let message = format!("\"{text}\"");
        writer
            .write_to_known_channel(&at(channel, millis * MILLIS), message.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn the_task_on_a_topic_of_the_mapping_file_is_converted_and_that_on_another_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let texts = [("/language", 0, "fetch the cup"), ("/task", 0, "other")];
    write(&folder.path().join("arm.mcap"), texts);
    let mapping = folder.path().join("arm.yaml");
    let keys = "recordings: arm.mcap\ntopics: {task: /language}\n";
    fs::write(&mapping, keys).unwrap();
    let recordings = Recordings::open(&[mapping], &ReadOptions::default()).unwrap();
    let out = folder.path().join("out");
    let conversion = convert_to_mcap(&recordings, &out, PictureFormat::Png).unwrap();
    assert_eq!(conversion.tasks, ["fetch the cup"]);
    assert_eq!(conversion.lost, ["the topics /task"]);
}

#[test]
fn a_subgoal_after_the_last_action_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.mcap");
    let mut texts = [
        ("/subgoal", 100, "grasped"),
        ("/subgoal", 250, "lifted"),
        ("/subgoal", 301, "stowed"),
    ];
    write(&path, texts);
    let looked = inspect(&path).unwrap();
    let markers = looked.markers.iter().map(|m| (m.step, m.name.as_str()));
    assert_eq!(markers.collect::<Vec<_>>(), [(1, "grasped"), (3, "lifted")]);
    assert_eq!(
        looked.remarks,
        ["1 subgoal after the last action, and so at no step: stowed"]
    );
    assert_eq!(read_trajectory(&path).unwrap().report, looked);
    texts[2].1 = 300;
    write(&path, texts);
    let looked = inspect(&path).unwrap();
    assert_eq!(looked.markers.len(), 3);
    assert!(looked.remarks.is_empty(), "{:?}", looked.remarks);
}
