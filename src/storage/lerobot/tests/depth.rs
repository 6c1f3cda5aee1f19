//! Datasets of robots with depth cameras.

use arrow::datatypes::{Field, Schema};

use super::*;
use crate::storage::fixtures::depth_picture;

const TABLE: &str = "data/chunk-000/file-000.parquet";
const WRIST: &str = "observation.images.wrist";

/// A dataset with the cameras `head` and `wrist`.
fn with_two_cameras(folder: &Path) -> PathBuf {
    let dataset = folder.join("dataset");
    convert_to_lerobot(&open(&recorded(folder)), &dataset, PictureFormat::Png).unwrap();
    dataset
}

fn change_info(dataset: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let path = dataset.join(INFO);
    let text = fs::read_to_string(&path).unwrap();
    let mut info: serde_json::Value = serde_json::from_str(&text).unwrap();
    change(&mut info);
    fs::write(path, info.to_string()).unwrap();
}

/// A mapping file beside the dataset that names these cameras.
fn mapping(folder: &Path, cameras: &str) -> PathBuf {
    let path = folder.join("rgbd.yaml");
    let text = format!("recordings: dataset\ntopics: {{cameras: {{{cameras}}}}}\n");
    fs::write(&path, text).unwrap();
    path
}

fn cameras(recording: &Recording) -> Vec<String> {
    let cameras = recording.trajectory.cameras();
    cameras.iter().map(|c| c.name.clone()).collect()
}

fn refusal(path: &Path) -> String {
    let mut read = open(path).read().collect::<Vec<_>>();
    read.remove(0).unwrap_err().to_string()
}

#[test]
fn pictures_of_depths_are_left_out_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = with_two_cameras(folder.path());
    repaint(&dataset.join(TABLE), WRIST, |row, _| {
        (row > 0).then(|| depth_picture(45, 80))
    });
    let read = all(&dataset).remove(0);
    assert_eq!(cameras(&read), ["head"]);
    let note = "observation.images.wrist: values of more than 8 bits (PNG), as of a depth camera, are not used";
    assert_eq!(read.report.notes, [note]);
    let told = read.report.to_string();
    assert!(told.contains(&format!("  not used  {note}")), "{told}");
    let looked = open(&dataset).inspect().remove(0).unwrap();
    assert_eq!(looked, read.report);
    let (set, _) = open(&dataset).demonstrations("sock").unwrap();
    assert_eq!(set.trajectories().len(), 1);
    let back = folder.path().join("back");
    let conversion = convert_to_mcap(&open(&dataset), &back, PictureFormat::Png).unwrap();
    assert_eq!(conversion.lost, [format!("the topics {WRIST}")]);

    let head = "head: observation.images.head";
    let silent = all(&mapping(folder.path(), head)).remove(0);
    assert_eq!(
        (cameras(&silent), silent.report.notes.len()),
        (vec!["head".to_owned()], 0)
    );
    let both = mapping(folder.path(), &format!("{head}, deep: {WRIST}"));
    let error = refusal(&both);
    for part in [
        "rgbd.yaml:2:",
        "cannot be camera 'deep'",
        "(PNG)",
        "Leave it out",
    ] {
        assert!(error.contains(part), "{error}");
    }
    let other = mapping(folder.path(), &format!("{head}, time: timestamp"));
    let error = refusal(&other);
    assert!(error.contains("its dtype is 'float32'"), "{error}");
}

#[test]
fn what_info_json_calls_a_depth_map_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = with_two_cameras(folder.path());
    let is_depth = || serde_json::json!({"is_depth_map": true});
    change_info(&dataset, |info| {
        info["features"][WRIST]["info"] = is_depth();
    });
    let read = all(&dataset).remove(0);
    assert_eq!(cameras(&read), ["head"]);
    let note = format!("{WRIST}: info.json says that it is a depth map");
    assert_eq!(read.report.notes, [note]);
    let error = refusal(&mapping(folder.path(), &format!("wrist: {WRIST}")));
    assert!(
        error.contains("info.json says that it is a depth map"),
        "{error}"
    );
    let head = "observation.images.head";
    change_info(&dataset, |info| info["features"][head]["info"] = is_depth());
    let error = refusal(&dataset);
    let told = "info.json: no feature is a camera: observation.images.head: info.json says";
    assert!(error.contains(told), "{error}");
}

#[test]
fn what_is_called_a_depth_map_is_left_out_unless_a_mapping_file_names_it() {
    const CALLED: &str = "observation.images.wrist_depth";
    let folder = tempfile::tempdir().unwrap();
    let dataset = with_two_cameras(folder.path());
    change_info(&dataset, |info| {
        let features = info["features"].as_object_mut().unwrap();
        let wrist = features.remove(WRIST).unwrap();
        features.insert(CALLED.to_owned(), wrist);
    });
    rewrite(&dataset.join(TABLE), |batch| {
        let schema = batch.schema();
        let fields = schema.fields().iter().map(|field| {
            let name = field.name().replace(WRIST, CALLED);
            Field::clone(field).with_name(name)
        });
        let schema = Schema::new(fields.collect::<Vec<Field>>());
        RecordBatch::try_new(Arc::new(schema), batch.columns().to_vec()).unwrap()
    });
    let ours = all(&dataset).remove(0);
    assert_eq!(cameras(&ours), ["head", "wrist_depth"]);
    fs::remove_file(dataset.join("meta/catena.json")).unwrap();
    let read = all(&dataset).remove(0);
    assert_eq!(cameras(&read), ["head"]);
    assert!(read.report.notes[0].contains("it is called a depth map; a mapping file may"));
    let both = format!("head: observation.images.head, coloured: {CALLED}");
    let named = all(&mapping(folder.path(), &both)).remove(0);
    assert_eq!(cameras(&named), ["coloured", "head"]);
}
