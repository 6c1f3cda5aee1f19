mod depth;
mod rates;
mod texts;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use byteorder::BigEndian;
use mcap::records::MessageHeader;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::storage::fixtures::{picture, trajectory};
use crate::storage::messages::{FoxgloveCompressedImage, Header, JointState, RawImage};
use crate::storage::pixels::encode_png;
use crate::storage::{EpisodeWriter, Loss, RecordingMetadata, write_trajectory};
use crate::trajectory::{Action, ActionSpace, Observation};

fn metadata() -> RecordingMetadata {
    RecordingMetadata {
        robot: "LoCoBot (simulated)".to_owned(),
        seed: Some(17),
        success: Some(true),
        notes: [("vary".to_owned(), "leftovers".to_owned())].into(),
    }
}

fn written(folder: &Path, steps: usize) -> (PathBuf, Trajectory) {
    let original = trajectory(steps);
    let path = folder.join("demo.mcap");
    write_trajectory(&path, &original, &metadata()).unwrap();
    (path, original)
}

fn bridge(task: &str, episode: usize) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!(
        "tests/data/bridge/{task}/episode_{episode:02}.mcap"
    ))
}

#[test]
fn trajectory_comes_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let (path, original) = written(folder.path(), 12);
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    assert_eq!(trajectory.id, "demo");
    assert_eq!(trajectory.task, original.task);
    assert_eq!(trajectory.action_space, original.action_space);
    assert_eq!(trajectory.markers, original.markers);
    assert_eq!(trajectory.cameras(), original.cameras());
    assert_eq!(trajectory.steps.len(), 12);
    for (read, wrote) in trajectory.steps.iter().zip(&original.steps) {
        assert!((read.time_secs - wrote.time_secs).abs() < 1e-9);
        assert_eq!(read.action, wrote.action);
        for (camera, image) in wrote.observation.iter() {
            let pixels = read.observation.image(camera).unwrap().rgb().iter();
            let difference: u32 = pixels
                .zip(image.rgb())
                .map(|(a, b)| u32::from(a.abs_diff(*b)))
                .sum();
            let mean = f64::from(difference) / image.rgb().len() as f64;
            assert!(
                mean < 3.0,
                "camera {camera} is off by {mean} of 255 on average"
            );
        }
    }
    assert_eq!(report.losses, []);
    assert_eq!(report.metadata["seed"], "17");
    assert_eq!(report.metadata["success"], "true");
    assert_eq!(report.metadata["vary"], "leftovers");
    assert_eq!(report.metadata["steps"], "12");
    assert_eq!(inspect(&path).unwrap(), report);
    let text = report.to_string();
    for part in [
        "sock",
        "12 on /action: 3 primitives",
        "head 90x160",
        "grasped at step 4",
    ] {
        assert!(text.contains(part), "'{part}' is missing in:\n{text}");
    }
}

#[test]
fn cameras_that_are_called_as_parts_of_topics_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let names = [
        "camera",
        "cameras",
        "compressed",
        "image",
        "image_color",
        "image_raw",
        "image_rect",
        "image_rect_color",
    ];
    let mut original = trajectory(2);
    for (i, step) in original.steps.iter_mut().enumerate() {
        let images = names.map(|name| (name.to_owned(), picture(4, 6, i)));
        step.observation = Arc::new(Observation::new(images));
    }
    write_trajectory(&path, &original, &metadata()).unwrap();
    let read = read_trajectory(&path).unwrap();
    assert_eq!(read.trajectory.cameras(), original.cameras());
    assert_eq!(read.report.notes, Vec::<String>::new());
}

/// Begins a file with channels, each of a topic, a name of its messages and their encoding.
fn begin<const N: usize>(
    path: &Path,
    channels: [[&str; 3]; N],
) -> (mcap::Writer<fs::File>, [u16; N]) {
    let mut writer = mcap::Writer::new(fs::File::create(path).unwrap()).unwrap();
    let ids = channels.map(|[topic, name, encoding]| {
        let schema = writer.add_schema(name, "", b"").unwrap();
        writer
            .add_channel(schema, topic, encoding, &[].into())
            .unwrap()
    });
    (writer, ids)
}

/// The head of a message of a channel at a time in nanoseconds.
fn at(channel_id: u16, log_time: u64) -> MessageHeader {
    MessageHeader {
        channel_id,
        sequence: 0,
        log_time,
        publish_time: 0,
    }
}

#[test]
fn a_camera_outlives_a_damaged_first_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let (mut writer, [camera, actions]) = begin(
        &path,
        [
            ["/camera/top", "foxglove.CompressedImage", "protobuf"],
            ["/action", "any.Action", "json"],
        ],
    );
    for i in 0..4 {
        let image = FoxgloveCompressedImage {
            data: if i == 0 {
                b"damaged".to_vec()
            } else {
                encode_png(&picture(4, 6, i)).unwrap()
            },
            format: "png".to_owned(),
        };
        let nanos = 10 * i as u64;
        writer
            .write_to_known_channel(&at(camera, nanos), &prost::Message::encode_to_vec(&image))
            .unwrap();
        writer
            .write_to_known_channel(&at(actions, nanos + 5), br#"{"values": [1, 2]}"#)
            .unwrap();
    }
    writer.finish().unwrap();
    let looked = inspect(&path).unwrap();
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    assert_eq!(looked.cameras, report.cameras);
    assert_eq!(trajectory.cameras()[0].name, "top");
    assert_eq!(trajectory.steps.len(), 3);
    let first = &trajectory.steps[0].observation;
    assert_eq!(first.image("top").unwrap(), &picture(4, 6, 1));
    let is_told = |loss: &Loss| matches!(loss, Loss::UndecodableImages { images: 1, .. });
    assert!(report.losses.iter().any(is_told), "{:?}", report.losses);
}

#[test]
fn equal_episodes_give_equal_bytes_and_no_leftover() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), 8);
    let first = fs::read(&path).unwrap();
    written(folder.path(), 8);
    assert_eq!(first, fs::read(&path).unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    let unfinished = EpisodeWriter::create(&path, "sock", &trajectory(1).action_space).unwrap();
    drop(unfinished);
    assert_eq!(first, fs::read(&path).unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn continuous_actions_and_json_topics_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rollout.mcap");
    let names = vec!["x".to_owned(), "gripper".to_owned()];
    let space = ActionSpace::Continuous { names };
    let mut writer = EpisodeWriter::create(&path, "pour", &space).unwrap();
    for step in &mut trajectory(3).steps {
        step.action = Action::Continuous(vec![0.1, -1.0 / 3.0]);
        writer.add_step(step).unwrap();
        let plan = serde_json::json!({ "goal": 4 });
        writer.add_json("/plan", "catena.Plan", &plan).unwrap();
    }
    assert!(
        writer
            .add_json("/plan", "catena.Plan", &serde_json::json!([1]))
            .is_err()
    );
    writer.finish(&RecordingMetadata::default()).unwrap();
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    assert_eq!(trajectory.action_space, space);
    assert_eq!(
        trajectory.steps[2].action,
        Action::Continuous(vec![0.1, -1.0 / 3.0])
    );
    let plan = report.topics.iter().find(|t| t.topic == "/plan").unwrap();
    assert_eq!((plan.messages, plan.type_name.as_str()), (3, "catena.Plan"));
}

#[test]
fn wrong_steps_are_refused_while_writing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let mut original = trajectory(3);
    original.steps[2].time_secs = 0.1;
    let error = write_trajectory(&path, &original, &metadata()).unwrap_err();
    assert!(error.to_string().contains("step 2 is at 0.1 s"), "{error}");
    original.steps[2] = original.steps[1].clone();
    original.steps[1].action = Action::Primitive(3);
    let error = write_trajectory(&path, &original, &metadata()).unwrap_err();
    assert!(
        error.to_string().contains("primitive 3 of step 1"),
        "{error}"
    );
    assert!(!path.exists());
}

#[test]
fn an_action_without_a_value_for_each_dimension_is_refused_while_writing() {
    let folder = tempfile::tempdir().unwrap();
    let names = vec!["x".to_owned(), "gripper".to_owned()];
    let space = ActionSpace::Continuous { names };
    let path = folder.path().join("rollout.mcap");
    let mut writer = EpisodeWriter::create(&path, "pour", &space).unwrap();
    let mut step = trajectory(1).steps.remove(0);
    for values in [vec![0.1], vec![0.1, 0.2, 0.3], vec![0.1, f32::NAN]] {
        step.action = Action::Continuous(values);
        let error = writer.add_step(&step).unwrap_err().to_string();
        assert!(error.contains("of step 0 is not one of"), "{error}");
    }
}

#[test]
fn file_cut_off_anywhere_yields_its_complete_steps() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), 240);
    let whole = read_trajectory(&path).unwrap().trajectory;
    let bytes = fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    let mut previous = 0;
    for tenth in 1..10 {
        fs::write(&cut, &bytes[..bytes.len() * tenth / 10]).unwrap();
        let report = inspect(&cut).unwrap();
        assert!(
            matches!(report.losses[..], [Loss::CutOff { .. }]),
            "{:?}",
            report.losses
        );
        let steps = match read_trajectory(&cut) {
            Ok(recording) => recording.trajectory.steps,
            Err(StorageError::NoImages { lost, .. }) if lost.contains("cut off") => Vec::new(),
            Err(error) => panic!("{error}"),
        };
        assert_eq!(steps, whole.steps[..steps.len()], "at {tenth} tenths");
        assert!(steps.len() >= previous, "{} at {tenth} tenths", steps.len());
        previous = steps.len();
    }
    assert!(
        previous >= 190,
        "only {previous} of 240 steps at nine tenths"
    );
}

#[test]
fn damaged_chunk_is_left_out_and_the_others_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), 240);
    let whole = read_trajectory(&path).unwrap().trajectory;
    let mut bytes = fs::read(&path).unwrap();
    // The first chunk: the channels are described in it and nowhere else but in the summary.
    bytes[50_000] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    assert!(
        matches!(&report.losses[0], Loss::DamagedChunk { bytes, .. } if *bytes > 500_000),
        "{:?}",
        report.losses
    );
    let count = trajectory.steps.len();
    assert!((20..200).contains(&count), "{count} steps");
    let tail = &whole.steps[240 - count..];
    assert_eq!(trajectory.steps[1].observation, tail[1].observation);
    assert_eq!(trajectory.steps[count - 1].action, tail[count - 1].action);
    assert_eq!(trajectory.markers.last().unwrap().step, count - 1);
}

#[test]
fn no_flipped_byte_goes_unnoticed() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), 3);
    let whole = read_trajectory(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..400 {
        let at = rng.random_range(0..bytes.len());
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << rng.random_range(0..8);
        fs::write(&path, &flipped).unwrap();
        if let Ok(recording) = read_trajectory(&path) {
            assert!(
                recording.trajectory == whole.trajectory || !recording.report.losses.is_empty(),
                "byte {at} of {} was flipped without notice",
                bytes.len()
            );
        }
    }
}

#[test]
fn foreign_episode_of_bridge_loads() {
    let Recording { trajectory, report } =
        read_trajectory(&bridge("put_carrot_on_plate", 1)).unwrap();
    assert_eq!(trajectory.steps.len(), 10);
    assert_eq!(trajectory.task, "put carrot on plate");
    let camera = &trajectory.cameras()[0];
    assert_eq!(
        (camera.name.as_str(), camera.height, camera.width),
        ("head", 64, 64)
    );
    let names = ["x", "y", "z", "roll", "pitch", "yaw", "gripper"]
        .map(str::to_owned)
        .to_vec();
    assert_eq!(trajectory.action_space, ActionSpace::Continuous { names });
    assert!((trajectory.steps[9].time_secs - 1.8).abs() < 1e-9);
    assert_eq!(report.losses, []);
    assert_eq!(inspect(&bridge("put_carrot_on_plate", 1)).unwrap(), report);
}

/// Writes raw images on `/robot/image_raw` and, if asked, actions, all as big-endian CDR and with the
/// short type names of old recorders.
fn write_big_endian(path: &Path, with_actions: bool) {
    fn message<T: serde::Serialize>(value: &T) -> Vec<u8> {
        let mut bytes = vec![0, 0, 0, 0];
        cdr_encoding::to_writer::<_, BigEndian, _>(&mut bytes, value).unwrap();
        bytes
    }
    let mut writer = mcap::Writer::new(fs::File::create(path).unwrap()).unwrap();
    let channel = |writer: &mut mcap::Writer<_>, topic: &str, type_name: &str| {
        let schema = writer.add_schema(type_name, "ros2msg", b"").unwrap();
        writer
            .add_channel(schema, topic, "cdr", &[].into())
            .unwrap()
    };
    let images = channel(&mut writer, "/robot/image_raw", "sensor_msgs/Image");
    let actions = channel(&mut writer, "/robot/action", "sensor_msgs/JointState");
    for step in 0..4u64 {
        let image = picture(4, 6, step as usize);
        let raw = RawImage {
            header: Header::default(),
            height: 4,
            width: 6,
            encoding: "rgb8".to_owned(),
            is_bigendian: 1,
            step: 18,
            data: image.rgb(),
        };
        let joints = JointState {
            position: vec![step as f64, 0.5],
            ..JointState::default()
        };
        let header = |channel_id, log_time| MessageHeader {
            channel_id,
            sequence: 0,
            log_time,
            publish_time: 0,
        };
        writer
            .write_to_known_channel(&header(images, 100 + step * 10), &message(&raw))
            .unwrap();
        if with_actions {
            let late = header(actions, 95 + step * 10);
            writer
                .write_to_known_channel(&late, &message(&joints))
                .unwrap();
        }
    }
    writer.finish().unwrap();
}

#[test]
fn big_endian_images_of_a_short_type_name_are_read_and_aligned() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pick_up/old.mcap");
    fs::create_dir(path.parent().unwrap()).unwrap();
    write_big_endian(&path, true);
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    assert_eq!(trajectory.task, "pick_up");
    assert_eq!(report.losses, [Loss::ActionsWithoutImages { actions: 1 }]);
    assert_eq!(trajectory.steps.len(), 3);
    // The action at 105 belongs to the image at 100.
    let first = &trajectory.steps[0];
    assert_eq!(first.action, Action::Continuous(vec![1.0, 0.5]));
    assert_eq!(first.observation.image("robot").unwrap(), &picture(4, 6, 0));
}

#[test]
fn images_without_actions_say_what_to_record() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera_only.mcap");
    write_big_endian(&path, false);
    let error = read_trajectory(&path).unwrap_err().to_string();
    for part in [
        "camera_only.mcap",
        "/robot/image_raw",
        "/action",
        "JointState",
    ] {
        assert!(error.contains(part), "{error}");
    }
    assert_eq!(inspect(&path).unwrap().steps, 0);
}

#[test]
fn files_that_are_no_recordings_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mcap");
    fs::write(&path, "").unwrap();
    assert!(matches!(
        read_trajectory(&path),
        Err(StorageError::EmptyFile { .. })
    ));
    fs::write(&path, "name: sock").unwrap();
    let error = inspect(&path).unwrap_err().to_string();
    assert!(error.contains("6e 61 6d 65 3a 20 73 6f"), "{error}");
    assert!(error.contains("x.mcap"), "{error}");
    let missing = read_trajectory(&folder.path().join("none.mcap")).unwrap_err();
    assert!(missing.to_string().contains("none.mcap"), "{missing}");
}
