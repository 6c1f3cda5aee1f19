//! Times that go backwards, cameras that leave images out, actions at another rate than images.

use prost::Message as _;

use super::*;
use crate::storage::{ImageSize, ReadOptions, Recordings};

const MILLIS: u64 = 1_000_000;

/// Images on `/camera/top` and actions `[i, 1]` on `/arm/command`, in the order given, at these milliseconds.
fn write(path: &Path, images: &[u64], actions: &[u64]) {
    let images = images.iter().enumerate();
    let images = images.map(|(i, millis)| (*millis, encode_png(&picture(6, 8, i)).unwrap()));
    write_files(path, images, actions);
}

/// The same with what is in the image messages.
fn write_files(path: &Path, images: impl Iterator<Item = (u64, Vec<u8>)>, actions: &[u64]) {
    let (mut writer, [camera, command]) = begin(
        path,
        [
            ["/camera/top", "foxglove.CompressedImage", "protobuf"],
            ["/arm/command", "any.Command", "json"],
        ],
    );
    let header = |channel_id, millis: u64| at(channel_id, millis * MILLIS);
    for (millis, data) in images {
        let image = FoxgloveCompressedImage {
            data,
            format: "png".to_owned(),
        };
        let bytes = image.encode_to_vec();
        writer
            .write_to_known_channel(&header(camera, millis), &bytes)
            .unwrap();
    }
    for (i, millis) in actions.iter().enumerate() {
        let action = format!("{{\"values\": [{i}, 1]}}");
        writer
            .write_to_known_channel(&header(command, *millis), action.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
}

fn read(folder: &Path, keys: &str, options: &ReadOptions) -> Recording {
    let mapping = folder.join("arm.yaml");
    let topics = "topics: {cameras: {top: /camera/top}, action: /arm/command}";
    fs::write(
        &mapping,
        format!("recordings: arm.mcap\n{topics}\n{keys}\n"),
    )
    .unwrap();
    let recordings = Recordings::open(&[mapping], options).unwrap();
    let looked = recordings.inspect().remove(0).unwrap();
    let recording = recordings.read().next().unwrap().unwrap();
    assert_eq!(looked.steps, recording.trajectory.steps.len());
    recording
}

fn values(recording: &Recording) -> Vec<Vec<f32>> {
    let steps = recording.trajectory.steps.iter();
    steps
        .map(|s| match &s.action {
            Action::Continuous(values) => values.clone(),
            Action::Primitive(_) => panic!("values"),
        })
        .collect()
}

#[test]
fn fast_actions_become_steps_of_the_rate_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let images: Vec<u64> = (0..11).map(|i| i * 100).collect();
    let actions: Vec<u64> = (0..51).map(|i| i * 20).collect();
    write(&folder.path().join("arm.mcap"), &images, &actions);
    let keys =
        "rate_hz: 10\nactions: {names: [x, y], combine: sum, dimensions: {y: {combine: mean}}}";
    let recording = read(folder.path(), keys, &ReadOptions::default());
    let steps = &recording.trajectory.steps;
    assert_eq!(steps.len(), 11);
    assert!((steps[10].time_secs - 1.0).abs() < 1e-9);
    for (i, step) in steps.iter().enumerate() {
        assert_eq!(step.observation.image("top").unwrap(), &picture(6, 8, i));
    }
    // 0 + 1 + 2 + 3 + 4, then 5 + 6 + 7 + 8 + 9, and 50 alone.
    let values = values(&recording);
    assert_eq!(
        (values[0][0], values[1][0], values[10][0]),
        (10.0, 35.0, 50.0)
    );
    assert!(values.iter().all(|v| v[1] == 1.0));
    let remarks = recording.report.remarks.join("\n");
    assert!(remarks.contains("11 of 51 actions"), "{remarks}");
    assert!(
        remarks.contains("50.0 Hz, images of camera 'top' at 10.0 Hz"),
        "{remarks}"
    );
}

#[test]
fn times_that_go_back_are_sorted_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let images = [0, 100, 300, 200, 400, 500, 600];
    write(
        &folder.path().join("arm.mcap"),
        &images,
        &[50, 150, 450, 250, 350],
    );
    let recording = read(folder.path(), "", &ReadOptions::default());
    let back = |topic: &str, by_millis| Loss::TimesGoBack {
        topic: topic.to_owned(),
        messages: if topic == "/camera/top" { 1 } else { 2 },
        by_millis,
    };
    assert_eq!(
        recording.report.losses,
        [back("/camera/top", 100), back("/arm/command", 200)]
    );
    let first: Vec<f32> = values(&recording).iter().map(|v| v[0]).collect();
    assert_eq!(first, [0.0, 1.0, 3.0, 4.0, 2.0]);
    let seen = recording.trajectory.steps[2]
        .observation
        .image("top")
        .unwrap()
        .clone();
    assert_eq!(
        seen,
        picture(6, 8, 3),
        "the image of 200 ms was written fourth"
    );
    assert!(recording.report.left_out.is_none());
}

#[test]
fn images_that_a_camera_left_out_are_counted_and_the_last_one_stands() {
    let folder = tempfile::tempdir().unwrap();
    let images = [0, 100, 200, 300, 400, 800, 900];
    let actions: Vec<u64> = (0..10).map(|i| i * 100).collect();
    write(&folder.path().join("arm.mcap"), &images, &actions);
    let options = ReadOptions {
        every: None,
        image_size: Some(ImageSize {
            height: 3,
            width: 4,
        }),
    };
    let recording = read(folder.path(), "", &options);
    let missing = Loss::MissingImages {
        topic: "/camera/top".to_owned(),
        images: 3,
        longest_millis: 400,
    };
    assert_eq!(recording.report.losses, [missing]);
    let steps = &recording.trajectory.steps;
    assert_eq!(steps.len(), 10);
    for step in &steps[4..8] {
        assert_eq!(
            step.observation.image("top").unwrap(),
            &picture(6, 8, 4).resized(3, 4)
        );
    }
    assert_eq!(recording.trajectory.cameras()[0].height, 3);
}

#[test]
fn a_camera_that_stops_long_before_the_actions_leaves_the_recording_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.mcap");
    let every_100 = |count: u64| -> Vec<u64> { (0..count).map(|i| i * 100).collect() };
    let topic = || "/camera/top".to_owned();
    let read_with = |images: u64, actions: u64| {
        write(&path, &every_100(images), &every_100(actions));
        let recording = read(folder.path(), "", &ReadOptions::default());
        assert_eq!(recording.trajectory.steps.len() as u64, actions);
        (recording.report.losses, recording.report.left_out)
    };
    let (losses, left_out) = read_with(6, 31);
    let stopped = Loss::CameraStopped {
        topic: topic(),
        images: 25,
        millis: 2500,
    };
    assert_eq!(losses, [stopped]);
    let left_out = left_out.unwrap_or_default();
    assert!(
        left_out.contains("/camera/top gave its last image 2.5 s before the last action"),
        "{left_out}"
    );
    let (losses, left_out) = read_with(6, 11);
    let missing = Loss::MissingImages {
        topic: topic(),
        images: 5,
        longest_millis: 500,
    };
    assert_eq!((losses, left_out), (vec![missing], None));
    assert_eq!(read_with(6, 9), (Vec::new(), None), "a little earlier");
    let (losses, _) = read_with(1, 31);
    assert!(
        matches!(losses[..], [Loss::CameraStopped { millis: 3000, .. }]),
        "{losses:?}"
    );
}

#[test]
fn a_camera_whose_last_images_are_damaged_leaves_the_recording_out_as_if_it_had_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.mcap");
    let times: Vec<u64> = (0..31).map(|i| i * 100).collect();
    let read_with = |sound: usize| {
        let images = times.iter().enumerate().map(|(i, millis)| {
            let damaged = || b"damaged".to_vec();
            let sound = (i < sound).then(|| encode_png(&picture(6, 8, i)).unwrap());
            (*millis, sound.unwrap_or_else(damaged))
        });
        write_files(&path, images, &times);
        let recording = read(folder.path(), "", &ReadOptions::default());
        (recording.report.losses.len(), recording.report.left_out)
    };
    assert_eq!(
        read_with(28),
        (1, None),
        "three images are told and no more"
    );
    let (losses, left_out) = read_with(11);
    let left_out = left_out.unwrap_or_default();
    assert_eq!(losses, 2);
    assert!(
        left_out.contains("/camera/top gave its last image 2 s before the last action"),
        "{left_out}"
    );
}

#[test]
fn topics_of_texts_that_say_nothing_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let times = [0, 100, 200];
    write(&folder.path().join("arm.mcap"), &times, &times);
    let mapping = folder.path().join("arm.yaml");
    let topics = "topics: {action: /arm/command, subgoal: /subgaol}";
    fs::write(&mapping, format!("recordings: arm.mcap\n{topics}\n")).unwrap();
    let recordings = Recordings::open(&[mapping], &ReadOptions::default()).unwrap();
    let looked = recordings.inspect().remove(0).unwrap();
    assert_eq!(
        looked.remarks,
        ["there is no message on /subgaol, the topic of subgoals by the mapping file"]
    );
}

#[test]
fn values_beyond_the_range_of_a_mapping_file_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let times = [0, 100, 200, 300, 400, 500];
    write(&folder.path().join("arm.mcap"), &times[1..], &times);
    let told = |keys: &str| {
        let recording = read(folder.path(), keys, &ReadOptions::default());
        recording.report.remarks
    };
    let dimension = "actions: {dimensions: {action_0: {low: 1, high: 3}}}";
    assert_eq!(
        told(dimension),
        [
            "2 of 5 values of 'action_0' beyond the range that is given (below 1 or above 3), and so in its outermost \
             bins"
        ]
    );
    let wide = "actions: {dimensions: {action_0: {low: 0, high: 5}}}";
    assert!(told(wide).is_empty());
}

#[test]
fn the_task_of_a_mapping_file_stands_before_that_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let times = [0, 100, 200];
    write(&folder.path().join("arm.mcap"), &times, &times);
    let task = |keys: &str| {
        let recording = read(folder.path(), keys, &ReadOptions::default());
        let mapping = folder.path().join("arm.yaml");
        let recordings = Recordings::open(&[mapping], &ReadOptions::default()).unwrap();
        let looked = recordings.inspect().remove(0).unwrap();
        assert_eq!(recording.report.task, recording.trajectory.task);
        assert_eq!(recording.report.task, looked.task);
        (looked.task, recordings.tasks())
    };
    let folders_name = folder.path().file_name().unwrap().to_string_lossy();
    assert_eq!(
        task(""),
        (folders_name.into_owned(), vec!["arm".to_owned()])
    );
    let named = "fetch the cup".to_owned();
    assert_eq!(task("task: fetch the cup"), (named.clone(), vec![named]));
}

#[test]
fn primitives_are_not_thinned_out() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), 9);
    let options = ReadOptions {
        every: Some(3),
        image_size: None,
    };
    let recordings = Recordings::open(&[path], &options).unwrap();
    let error = recordings.read().next().unwrap().unwrap_err().to_string();
    assert!(
        error.contains("demo.mcap") && error.contains("motion primitives"),
        "{error}"
    );
}
