mod depth;

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, BinaryArray, StringArray, StructArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Int64Type};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::*;
use crate::storage::fixtures::trajectory;
use crate::storage::{
    ImageSize, Loss, PictureFormat, ReadOptions, Recording, RecordingMetadata, Recordings,
    convert_to_lerobot, convert_to_mcap, write_trajectory,
};
use crate::trajectory::{Action, ActionSpace, Trajectory};

fn open(path: &Path) -> Recordings {
    Recordings::open(&[path.to_owned()], &ReadOptions::default()).unwrap()
}

fn all(path: &Path) -> Vec<Recording> {
    open(path).read().map(|r| r.unwrap()).collect()
}

fn bridge() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/bridge")
}

/// Two recordings of motion primitives: one failed, one with times that are not regular.
fn recorded(folder: &Path) -> PathBuf {
    let demos = folder.join("demos");
    let metadata = |seed, success| RecordingMetadata {
        robot: "LoCoBot (simulated)".to_owned(),
        seed: Some(seed),
        success: Some(success),
        notes: [("vary".to_owned(), "leftovers".to_owned())].into(),
    };
    write_trajectory(&demos.join("a.mcap"), &trajectory(9), &metadata(7, true)).unwrap();
    let mut irregular = trajectory(7);
    irregular.steps[6].time_secs += 0.07;
    write_trajectory(&demos.join("b.mcap"), &irregular, &metadata(8, false)).unwrap();
    demos
}

/// Equal but for the metadata that every file writes anew.
fn assert_same(before: &[Recording], after: &[Recording]) {
    assert_eq!(before.len(), after.len());
    for (a, b) in before.iter().zip(after) {
        let (ours, theirs) = (&a.trajectory, &b.trajectory);
        assert_eq!(ours.id, theirs.id);
        assert_eq!(ours.task, theirs.task);
        assert_eq!(ours.action_space, theirs.action_space);
        assert_eq!(ours.markers, theirs.markers);
        assert_eq!(ours.steps.len(), theirs.steps.len());
        for (x, y) in ours.steps.iter().zip(&theirs.steps) {
            assert!(
                (x.time_secs - y.time_secs).abs() < 1e-6,
                "{} {}",
                x.time_secs,
                y.time_secs
            );
            assert_eq!(x.action, y.action);
            assert!(
                x.observation == y.observation,
                "other pixels at {} s",
                x.time_secs
            );
        }
        for key in ["robot", "seed", "success", "vary"] {
            assert_eq!(
                a.report.metadata.get(key),
                b.report.metadata.get(key),
                "{key}"
            );
        }
    }
}

#[test]
fn primitives_go_there_and_back_without_a_loss() {
    let folder = tempfile::tempdir().unwrap();
    let demos = recorded(folder.path());
    let (dataset, back) = (folder.path().join("dataset"), folder.path().join("back"));
    let before = all(&demos);
    let conversion = convert_to_lerobot(&open(&demos), &dataset, PictureFormat::Png).unwrap();
    assert_eq!(
        (conversion.episodes, conversion.steps, conversion.fps),
        (2, 16, Some(5))
    );
    assert!(conversion.lost.is_empty(), "{:?}", conversion.lost);
    let within = all(&dataset);
    assert_same(&before, &within);
    assert_eq!(within[0].report.task, "sock");
    assert_eq!(within[0].report.cameras.len(), 2);
    convert_to_mcap(&open(&dataset), &back, PictureFormat::Png).unwrap();
    assert_same(&before, &all(&back));
    let (set, reports) = open(&dataset).demonstrations("sock").unwrap();
    assert_eq!(set.trajectories().len(), 1, "the failed one is left out");
    assert!(reports[1].left_out.is_some());
}

#[test]
fn real_episodes_go_there_and_back_without_a_loss() {
    let folder = tempfile::tempdir().unwrap();
    let (dataset, back) = (folder.path().join("dataset"), folder.path().join("back"));
    let before = all(&bridge());
    let conversion = convert_to_lerobot(&open(&bridge()), &dataset, PictureFormat::Png).unwrap();
    assert_eq!(conversion.tasks.len(), 2);
    assert_eq!(conversion.lost, ["the topics /joint_states"]);
    let recordings = open(&dataset);
    let tasks = recordings.tasks();
    assert_eq!(tasks.len(), 2, "{tasks:?}");
    let (set, _) = recordings.demonstrations(&tasks[0]).unwrap();
    assert_eq!(
        (tasks[0].as_str(), set.trajectories().len()),
        ("put_carrot_on_plate", 3)
    );
    let (same, _) = recordings.demonstrations("put carrot on plate").unwrap();
    assert_eq!(same.trajectories().len(), 3);
    let error = recordings
        .demonstrations("put_carot")
        .unwrap_err()
        .to_string();
    assert!(error.contains("put_carrot_on_plate"), "{error}");
    convert_to_mcap(&recordings, &back, PictureFormat::Png).unwrap();
    let after = all(&back);
    assert_eq!(after.len(), before.len());
    for recording in &before {
        let t = &recording.trajectory;
        let same = |r: &&Recording| {
            r.trajectory.task == t.task && r.trajectory.steps[3].action == t.steps[3].action
        };
        let again = &after.iter().find(same).expect("it came back").trajectory;
        assert_eq!(again.action_space, t.action_space);
        assert!(
            again
                .steps
                .iter()
                .zip(&t.steps)
                .all(|(a, b)| { a.action == b.action && a.observation == b.observation })
        );
    }
}

#[test]
fn episodes_of_more_steps_than_are_written_at_once_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (demos, dataset) = (folder.path().join("demos"), folder.path().join("dataset"));
    let metadata = RecordingMetadata::default();
    for (name, steps) in [("a.mcap", 70), ("b.mcap", 33)] {
        write_trajectory(&demos.join(name), &trajectory(steps), &metadata).unwrap();
    }
    convert_to_lerobot(&open(&demos), &dataset, PictureFormat::Png).unwrap();
    assert_same(&all(&demos), &all(&dataset));
    let file = fs::File::open(dataset.join("data/chunk-000/file-000.parquet")).unwrap();
    let rows = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let numbers = |name: &str, batch: &RecordBatch| {
        let column = batch.column_by_name(name).unwrap();
        column.as_primitive::<Int64Type>().values().to_vec()
    };
    let (mut frames, mut indices) = (Vec::new(), Vec::new());
    for batch in rows.build().unwrap() {
        let batch = batch.unwrap();
        frames.extend(numbers("frame_index", &batch));
        indices.extend(numbers("index", &batch));
    }
    assert!(frames.into_iter().eq((0..70).chain(0..33)));
    assert!(indices.into_iter().eq(0..103));
}

/// As those of a recorder that counts its log times in microseconds.
#[test]
fn steps_that_follow_faster_than_any_robot_go_there_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let (demos, dataset) = (folder.path().join("demos"), folder.path().join("dataset"));
    let mut fast = trajectory(9);
    for step in &mut fast.steps {
        step.time_secs *= 1e-3 / 6.0;
    }
    let metadata = RecordingMetadata::default();
    write_trajectory(&demos.join("a.mcap"), &fast, &metadata).unwrap();
    let conversion = convert_to_lerobot(&open(&demos), &dataset, PictureFormat::Png).unwrap();
    assert_eq!(conversion.fps, Some(10_000));
    assert_same(&all(&demos), &all(&dataset));
}

#[test]
fn jpeg_is_smaller_and_said_to_lose_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let demos = recorded(folder.path());
    let size = |pictures, name: &str| {
        let out = folder.path().join(name);
        let conversion = convert_to_lerobot(&open(&demos), &out, pictures).unwrap();
        let table = out.join("data/chunk-000/file-000.parquet");
        (fs::metadata(table).unwrap().len(), conversion.lost)
    };
    let (png, nothing) = size(PictureFormat::Png, "png");
    let (jpeg, pixels) = size(PictureFormat::Jpeg, "jpeg");
    assert!(
        nothing.is_empty() && pixels[0].contains("JPEG"),
        "{pixels:?}"
    );
    assert!(jpeg * 2 < png, "{jpeg} {png}");
    let error = convert_to_mcap(
        &open(&demos),
        &folder.path().join("png"),
        PictureFormat::Png,
    );
    assert!(error.unwrap_err().to_string().contains("is there already"));
}

#[test]
fn recordings_that_differ_make_no_dataset_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let demos = recorded(folder.path());
    let mut other = trajectory(4);
    for step in &mut other.steps {
        let head = step.observation.image("head").unwrap().resized(9, 16);
        step.observation = Arc::new(crate::trajectory::Observation::new([(
            "head".to_owned(),
            head,
        )]));
    }
    let metadata = RecordingMetadata::default();
    write_trajectory(&demos.join("c.mcap"), &other, &metadata).unwrap();
    let out = folder.path().join("dataset");
    let error = convert_to_lerobot(&open(&demos), &out, PictureFormat::Png).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("c.mcap") && error.contains("head 9x16"),
        "{error}"
    );
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "nothing but the recordings"
    );
}

/// The same dataset in version 2.1, without what only ours says.
fn as_version_two(three: &Path, two: &Path) {
    let text = fs::read_to_string(three.join("meta/info.json")).unwrap();
    let mut info: serde_json::Value = serde_json::from_str(&text).unwrap();
    info["codebase_version"] = "v2.1".into();
    info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet".into();
    fs::create_dir_all(two.join("meta")).unwrap();
    fs::create_dir_all(two.join("data/chunk-000")).unwrap();
    fs::write(two.join("meta/info.json"), info.to_string()).unwrap();
    let table = three.join("data/chunk-000/file-000.parquet");
    let dataset = Dataset::open(three).unwrap();
    let mut lines = String::new();
    for episode in &dataset.episodes {
        let line = serde_json::json!({
            "episode_index": episode.index, "tasks": episode.tasks, "length": episode.length,
        });
        lines += &line.to_string();
        lines.push('\n');
        // A file may hold the rows of others too; they are passed over.
        let name = format!("data/chunk-000/episode_{:06}.parquet", episode.index);
        fs::copy(&table, two.join(name)).unwrap();
    }
    fs::write(two.join("meta/episodes.jsonl"), lines).unwrap();
}

/// The episodes of the bridge as datasets of version 3 and of version 2.
fn in_both_versions(folder: &Path) -> [PathBuf; 2] {
    let [three, two] = ["three", "two"].map(|name| folder.join(name));
    convert_to_lerobot(&open(&bridge()), &three, PictureFormat::Png).unwrap();
    as_version_two(&three, &two);
    [three, two]
}

#[test]
fn version_two_reads_like_version_three() {
    let folder = tempfile::tempdir().unwrap();
    let (three, two) = (folder.path().join("three"), folder.path().join("two"));
    convert_to_lerobot(&open(&bridge()), &three, PictureFormat::Png).unwrap();
    // Else the episodes would bear the names and stand in the order of the recordings.
    fs::remove_file(three.join("meta/catena.json")).unwrap();
    as_version_two(&three, &two);
    let (new, old) = (all(&three), all(&two));
    assert_eq!(old.len(), 6);
    for (new, old) in new.iter().zip(&old) {
        assert_eq!(old.report.library, "LeRobot v2.1");
        assert_eq!(new.trajectory.steps, old.trajectory.steps);
        assert_eq!(new.trajectory.task, old.trajectory.task);
        assert_eq!(new.trajectory.action_space, old.trajectory.action_space);
    }
    assert_eq!(old[4].trajectory.id, "episode_000004");
}

#[test]
fn tasks_in_other_letters_are_numbered() {
    let folder = tempfile::tempdir().unwrap();
    let [_, two] = in_both_versions(folder.path());
    let path = two.join("meta/episodes.jsonl");
    let lines = fs::read_to_string(&path).unwrap();
    let lines = lines.lines().enumerate().map(|(episode, _)| {
        let task = if episode < 2 {
            "皿に置く"
        } else {
            "コップを取る"
        };
        format!("{{\"episode_index\": {episode}, \"tasks\": [\"{task}\"], \"length\": 10}}\n")
    });
    fs::write(&path, lines.collect::<String>()).unwrap();
    let recordings = open(&two);
    assert_eq!(recordings.tasks(), ["task", "task_2"]);
    let count = |task: &str| {
        let (set, _) = recordings.demonstrations(task).unwrap();
        set.trajectories().len()
    };
    assert_eq!((count("task"), count("task_2")), (4, 2));
    assert_eq!(count("皿に置く"), 2);
    let error = recordings.demonstrations("cup").unwrap_err().to_string();
    assert!(error.contains("task_2 ('皿に置く')"), "{error}");
    recordings.demonstrations("箱を開ける").unwrap_err();
}

#[test]
fn primitives_without_our_metadata_are_columns() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    convert_to_lerobot(
        &open(&recorded(folder.path())),
        &dataset,
        PictureFormat::Jpeg,
    )
    .unwrap();
    fs::remove_file(dataset.join("meta/catena.json")).unwrap();
    let Trajectory {
        action_space,
        steps,
        ..
    } = &all(&dataset)[0].trajectory;
    let names = ["ahead", "left", "right"].map(str::to_owned).to_vec();
    assert_eq!(*action_space, ActionSpace::Continuous { names });
    assert_eq!(steps[1].action, Action::Continuous(vec![0.0, 1.0, 0.0]));
}

#[test]
fn every_and_image_size_thin_out_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    convert_to_lerobot(&open(&bridge()), &dataset, PictureFormat::Png).unwrap();
    let options = ReadOptions {
        every: Some(4),
        image_size: Some(ImageSize {
            height: 32,
            width: 48,
        }),
    };
    let thin = Recordings::open(std::slice::from_ref(&dataset), &options).unwrap();
    let recording = thin.read().next().unwrap().unwrap();
    let whole = &all(&dataset)[0].trajectory;
    // Ten steps: 1, 5 and 9.
    let kept = &recording.trajectory.steps;
    assert_eq!(kept.len(), 3);
    assert!((kept[2].time_secs - 1.6).abs() < 1e-9);
    assert_eq!(kept[2].action, whole.steps[9].action);
    assert_eq!(
        kept[0].action, whole.steps[4].action,
        "the last of its four"
    );
    let seen = whole.steps[5].observation.image("head").unwrap();
    assert_eq!(
        kept[1].observation.image("head").unwrap(),
        &seen.resized(32, 48)
    );
    assert!(recording.report.remarks[0].contains("3 of 10 actions"));
    assert_ne!(thin.digest().unwrap(), open(&dataset).digest().unwrap());
    let looked = thin.inspect().remove(0).unwrap();
    assert_eq!(looked, recording.report);
}

#[test]
fn a_mapping_file_names_the_task_of_a_dataset_that_has_one() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let carrots = bridge().join("put_carrot_on_plate");
    convert_to_lerobot(&open(&carrots), &one, PictureFormat::Png).unwrap();
    convert_to_lerobot(&open(&bridge()), &two, PictureFormat::Png).unwrap();
    let mapping = folder.path().join("fetch.yaml");
    let first_task = |dataset: &str| {
        fs::write(&mapping, format!("recordings: {dataset}\ntask: fetch\n")).unwrap();
        all(&mapping).remove(0).trajectory.task
    };
    assert_eq!(first_task("one"), "fetch");
    assert_eq!(first_task("two"), "put carrot on plate");
}

#[test]
fn values_whose_names_are_numbered_are_called_by_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    convert_to_lerobot(&open(&bridge()), &dataset, PictureFormat::Png).unwrap();
    fs::remove_file(dataset.join("meta/catena.json")).unwrap();
    let path = dataset.join(INFO);
    let text = fs::read_to_string(&path).unwrap();
    let mut info: serde_json::Value = serde_json::from_str(&text).unwrap();
    let names = &mut info["features"]["action"]["names"];
    let listed: Vec<String> = serde_json::from_value(names.take()).unwrap();
    let numbered = listed.into_iter().zip(0_u64..);
    *names = numbered.collect();
    fs::write(&path, info.to_string()).unwrap();
    let mapping = folder.path().join("grip.yaml");
    let text = "recordings: dataset\nactions: {keep: [gripper]}\n";
    fs::write(&mapping, text).unwrap();
    let (whole, kept) = (all(&dataset).remove(0), all(&mapping).remove(0));
    for (whole, kept) in whole.trajectory.steps.iter().zip(&kept.trajectory.steps) {
        let Action::Continuous(values) = &whole.action else {
            panic!("values")
        };
        assert_eq!(kept.action, Action::Continuous(vec![values[6]]));
    }
}

#[test]
fn topics_of_texts_in_a_mapping_file_are_told_not_to_count() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    convert_to_lerobot(&open(&bridge()), &dataset, PictureFormat::Png).unwrap();
    let mapping = folder.path().join("dataset.yaml");
    let text = "recordings: dataset\ntopics: {task: language, subgoal: reached}\n";
    fs::write(&mapping, text).unwrap();
    let told = [
        "language, the topic of the task by the mapping file, is not read: the metadata of a dataset tell its tasks",
        "reached, the topic of subgoals by the mapping file, is not read: of a dataset meta/catena.json alone tells them",
    ];
    let looked = open(&mapping).inspect().remove(0).unwrap();
    assert_eq!(looked.remarks, told);
    assert_eq!(all(&mapping)[0].report.remarks, told);
    assert!(all(&dataset)[0].report.remarks.is_empty());
}

#[test]
fn what_describes_the_episodes_is_part_of_the_digest() {
    let folder = tempfile::tempdir().unwrap();
    let [three, two] = in_both_versions(folder.path());
    let tables = Path::new("meta/episodes/chunk-000/file-000.parquet");
    let files = Dataset::open(&three).unwrap().files();
    assert!(files.iter().any(|f| f == tables), "{files:?}");
    let before = open(&two).digest().unwrap();
    let path = two.join("meta/episodes.jsonl");
    let lines = fs::read_to_string(&path).unwrap();
    let called_otherwise = lines.replacen("carrot", "potato", 1);
    assert_ne!(lines, called_otherwise);
    fs::write(&path, called_otherwise).unwrap();
    assert_ne!(open(&two).digest().unwrap(), before);
}

#[test]
fn missing_frames_leave_an_episode_out() {
    let folder = tempfile::tempdir().unwrap();
    let [_, two] = in_both_versions(folder.path());
    let path = two.join("meta/episodes.jsonl");
    let lines = fs::read_to_string(&path)
        .unwrap()
        .replacen("\"length\":10", "\"length\":12", 1);
    fs::write(&path, lines).unwrap();
    let recording = &all(&two)[0];
    assert_eq!(recording.report.losses, [Loss::MissingFrames { frames: 2 }]);
    assert!(recording.report.left_out.is_some());
}

/// Writes a table anew.
fn rewrite(table: &Path, change: impl FnOnce(&RecordBatch) -> RecordBatch) {
    let file = fs::File::open(table).unwrap();
    let rows = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let batch = rows.build().unwrap().next().unwrap().unwrap();
    let changed = change(&batch);
    let out = fs::File::create(table).unwrap();
    let mut writer = ArrowWriter::try_new(out, changed.schema(), None).unwrap();
    writer.write(&changed).unwrap();
    writer.close().unwrap();
}

/// Polars writes lists so.
#[test]
fn tasks_in_lists_of_large_offsets_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    convert_to_lerobot(&open(&bridge()), &dataset, PictureFormat::Png).unwrap();
    fs::remove_file(dataset.join("meta/catena.json")).unwrap();
    let tasks = || -> Vec<String> {
        let recordings = all(&dataset).into_iter();
        recordings.map(|r| r.trajectory.task).collect()
    };
    let before = tasks();
    let table = dataset.join("meta/episodes/chunk-000/file-000.parquet");
    rewrite(&table, |batch| {
        let item = Arc::new(Field::new_list_field(DataType::LargeUtf8, true));
        let large = DataType::LargeList(item);
        let schema = batch.schema();
        let names = schema.fields().iter().map(|field| field.name().clone());
        let columns = names.zip(batch.columns()).map(|(name, column)| {
            let column = if name == "tasks" {
                cast(column, &large).unwrap()
            } else {
                Arc::clone(column)
            };
            (name, column)
        });
        let columns: Vec<(String, ArrayRef)> = columns.collect();
        RecordBatch::try_from_iter(columns).unwrap()
    });
    assert_eq!(tasks(), before);
}

/// Gives the rows of a table of frames other images, or none.
fn repaint(table: &Path, key: &str, other: impl Fn(usize, &[u8]) -> Option<Vec<u8>>) {
    rewrite(table, |batch| {
        let place = batch.schema().index_of(key).unwrap();
        let mut columns = batch.columns().to_vec();
        let pictures = columns[place].as_struct();
        let (bytes, paths) = (pictures.column(0).as_binary::<i32>(), pictures.column(1));
        let paths = paths.as_string::<i32>();
        let rows = 0..pictures.len();
        let painted: Vec<Option<Vec<u8>>> = rows.map(|row| other(row, bytes.value(row))).collect();
        let paths: StringArray = painted
            .iter()
            .enumerate()
            .map(|(row, image)| image.as_ref().map(|_| paths.value(row)))
            .collect();
        let bytes: BinaryArray = painted.iter().map(Option::as_deref).collect();
        let arrays: Vec<Arc<dyn Array>> = vec![Arc::new(bytes), Arc::new(paths)];
        columns[place] = Arc::new(StructArray::new(pictures.fields().clone(), arrays, None));
        RecordBatch::try_new(batch.schema(), columns).unwrap()
    });
}

/// Takes the images of some rows out of a table of frames.
fn forget_images(table: &Path, key: &str, is_forgotten: impl Fn(usize) -> bool) {
    repaint(table, key, |row, image| {
        (!is_forgotten(row)).then(|| image.to_vec())
    });
}

#[test]
fn rows_without_an_image_are_told_and_a_camera_that_stops_leaves_the_episode_out() {
    let folder = tempfile::tempdir().unwrap();
    let (demos, dataset) = (folder.path().join("demos"), folder.path().join("dataset"));
    let metadata = RecordingMetadata::default();
    write_trajectory(&demos.join("a.mcap"), &trajectory(40), &metadata).unwrap();
    convert_to_lerobot(&open(&demos), &dataset, PictureFormat::Png).unwrap();
    let table = dataset.join("data/chunk-000/file-000.parquet");
    let key = "observation.images.wrist";
    forget_images(&table, key, |row| row == 7);
    let told = |images, reason: &str| Loss::UndecodableImages {
        topic: key.to_owned(),
        images,
        reason: reason.to_owned(),
    };
    let once = all(&dataset).remove(0);
    assert_eq!(
        once.report.losses,
        [told(1, "row 7 of the episode holds no image")]
    );
    assert!(once.report.left_out.is_none());
    let steps = &once.trajectory.steps;
    let seen = |step: usize| steps[step].observation.image("wrist");
    assert_eq!(seen(7), seen(6), "the image before stands in");
    let back = folder.path().join("back");
    let conversion = convert_to_mcap(&open(&dataset), &back, PictureFormat::Png).unwrap();
    let is_told = |lost: &String| lost.contains("row 7 of the episode holds no image");
    assert!(conversion.lost.iter().any(is_told), "{:?}", conversion.lost);
    forget_images(&table, key, |row| row == 7 || row >= 20);
    let stopped = all(&dataset).remove(0).report;
    assert!(
        stopped
            .losses
            .contains(&told(21, "row 7 of the episode holds no image"))
    );
    let is_stop = |loss: &Loss| matches!(loss, Loss::CameraStopped { images: 20, .. });
    assert!(stopped.losses.iter().any(is_stop), "{:?}", stopped.losses);
    assert!(stopped.left_out.is_some());
}
