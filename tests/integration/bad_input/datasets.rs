//! LeRobot datasets that are wrong.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, FixedSizeListArray, Float32Array, Int64Array, StringArray};
use arrow::datatypes::{Field, Schema};
use arrow::record_batch::RecordBatch;
use catena::storage::{PictureFormat, ReadOptions, Recordings, convert_to_lerobot};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};

use super::Case;
use crate::command::{json_of, root};

pub(super) const DATA: &str = "data/chunk-000/file-000.parquet";

/// A sound dataset of three real episodes.
pub(super) fn dataset(folder: &Path) -> PathBuf {
    let from = root().join("tests/data/bridge/put_carrot_on_plate");
    let recordings = Recordings::open(&[from], &ReadOptions::default()).expect("recordings");
    let out = folder.join("carrot");
    convert_to_lerobot(&recordings, &out, PictureFormat::Png).expect("a dataset");
    out
}

/// The dataset with another `info.json`.
fn with_info(folder: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let root = dataset(folder);
    let path = root.join("meta/info.json");
    let mut info = json_of(&path);
    change(&mut info);
    fs::write(path, info.to_string()).expect("written");
    root
}

/// The dataset with another table of frames.
fn with_table(folder: &Path, change: impl FnOnce(&mut BTreeMap<String, ArrayRef>)) -> PathBuf {
    let root = dataset(folder);
    change_table(&root.join(DATA), change);
    root
}

fn change_table(path: &Path, change: impl FnOnce(&mut BTreeMap<String, ArrayRef>)) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path).expect("a table"));
    let reader = reader.expect("a table").build().expect("a table");
    let batches: Vec<RecordBatch> = reader.map(|b| b.expect("rows")).collect();
    let batch = arrow::compute::concat_batches(&batches[0].schema(), &batches).expect("one batch");
    let fields = batch.schema();
    let names = fields.fields().iter().map(|f| f.name().clone());
    let mut columns: BTreeMap<String, ArrayRef> =
        names.zip(batch.columns().iter().cloned()).collect();
    change(&mut columns);
    let fields: Vec<Field> = columns
        .iter()
        .map(|(name, column)| Field::new(name, column.data_type().clone(), true))
        .collect();
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(Arc::clone(&schema), columns.into_values().collect());
    let file = File::create(path).expect("a file");
    let mut writer = ArrowWriter::try_new(file, schema, None).expect("a writer");
    writer.write(&batch.expect("rows")).expect("written");
    writer.close().expect("closed");
}

/// Thirty actions of seven values, of which one is this.
fn actions_with(value: f32) -> ArrayRef {
    let mut values = vec![0.5; 210];
    values[17] = value;
    let item = Arc::new(Field::new_list_field(
        arrow::datatypes::DataType::Float32,
        true,
    ));
    Arc::new(FixedSizeListArray::new(
        item,
        7,
        Arc::new(Float32Array::from(values)),
        None,
    ))
}

fn with_file(folder: &Path, file: &str, bytes: &[u8]) -> PathBuf {
    let root = dataset(folder);
    fs::write(root.join(file), bytes).expect("written");
    root
}

fn without(folder: &Path, file: &str) -> PathBuf {
    let root = dataset(folder);
    fs::remove_file(root.join(file)).expect("it was there");
    root
}

fn cut(folder: &Path, file: &str) -> PathBuf {
    let root = dataset(folder);
    let bytes = fs::read(root.join(file)).expect("a file");
    fs::write(root.join(file), &bytes[..bytes.len() / 2]).expect("written");
    root
}

/// The dataset in version 2.1 with these lines of episodes.
pub(super) fn version_two(folder: &Path, lines: &str) -> PathBuf {
    let root = with_info(folder, |info| {
        info["codebase_version"] = json!("v2.1");
        info["data_path"] =
            json!("data/chunk-{episode_chunk:03d}/file-{episode_index:03d}.parquet");
    });
    fs::write(root.join("meta/episodes.jsonl"), lines).expect("written");
    root
}

/// The dataset with its camera as a video.
pub(super) fn with_video(folder: &Path) -> PathBuf {
    let root = with_info(folder, |info| {
        info["features"]["observation.images.head"]["dtype"] = json!("video");
        info["video_path"] =
            json!("videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4");
    });
    change_table(
        &root.join("meta/episodes/chunk-000/file-000.parquet"),
        |columns| {
            let zero: ArrayRef = Arc::new(Int64Array::from(vec![0; 3]));
            for name in ["chunk_index", "file_index", "from_timestamp"] {
                let name = format!("videos/observation.images.head/{name}");
                columns.insert(name, Arc::clone(&zero));
            }
        },
    );
    root
}

pub(super) const CASES: &[Case] = &[
    ("dataset: info is no JSON", |f| {
        with_file(f, "meta/info.json", b"{\"fps\": 5,")
    }),
    ("dataset: info is not UTF-8", |f| {
        with_file(f, "meta/info.json", b"{\"fps\": \xff}")
    }),
    ("dataset: info without fps", |f| {
        with_info(f, |i| {
            i.as_object_mut().expect("a map").remove("fps");
        })
    }),
    ("dataset: fps is 0", |f| {
        with_info(f, |i| i["fps"] = json!(0))
    }),
    ("dataset: fps is a text", |f| {
        with_info(f, |i| i["fps"] = json!("5"))
    }),
    ("dataset: fps is a billion", |f| {
        with_info(f, |i| i["fps"] = json!(1e9))
    }),
    ("dataset: version 1", |f| {
        with_info(f, |i| i["codebase_version"] = json!("v1.6"))
    }),
    ("dataset: chunks of 0 files", |f| {
        with_info(f, |i| i["chunks_size"] = json!(0))
    }),
    ("dataset: no actions", |f| {
        with_info(f, |i| {
            i["features"]
                .as_object_mut()
                .expect("a map")
                .remove("action");
        })
    }),
    ("dataset: no cameras", |f| {
        with_info(f, |i| {
            i["features"]["observation.images.head"]["dtype"] = json!("float32");
        })
    }),
    ("dataset: actions are texts", |f| {
        with_info(f, |i| i["features"]["action"]["dtype"] = json!("string"))
    }),
    ("dataset: actions are matrices", |f| {
        with_info(f, |i| i["features"]["action"]["shape"] = json!([7, 2]))
    }),
    ("dataset: actions of no value", |f| {
        with_info(f, |i| i["features"]["action"]["shape"] = json!([0]))
    }),
    ("dataset: actions of another width", |f| {
        with_info(f, |i| i["features"]["action"]["shape"] = json!([6]))
    }),
    ("dataset: shape is negative", |f| {
        with_info(f, |i| i["features"]["action"]["shape"] = json!([-7]))
    }),
    ("dataset: path out of the dataset", |f| {
        with_info(f, |i| i["data_path"] = json!("../../{chunk_index}.parquet"))
    }),
    ("dataset: path with an unknown name", |f| {
        with_info(f, |i| i["data_path"] = json!("data/{chunk}.parquet"))
    }),
    ("dataset: episodes are missing", |f| {
        without(f, "meta/episodes/chunk-000/file-000.parquet")
    }),
    ("dataset: episodes cut off", |f| {
        cut(f, "meta/episodes/chunk-000/file-000.parquet")
    }),
    ("dataset: frames are missing", |f| without(f, DATA)),
    ("dataset: frames cut off", |f| cut(f, DATA)),
    ("dataset: frames are empty", |f| with_file(f, DATA, b"")),
    ("dataset: frames are text", |f| {
        with_file(f, DATA, b"PAR1 is how it begins, but this is text PAR1")
    }),
    ("dataset: action is not a number", |f| {
        with_table(f, |c| {
            c.insert("action".to_owned(), actions_with(f32::NAN));
        })
    }),
    ("dataset: action is infinite", |f| {
        with_table(f, |c| {
            c.insert("action".to_owned(), actions_with(f32::INFINITY));
        })
    }),
    ("dataset: no column of actions", |f| {
        with_table(f, |c| {
            c.remove("action");
        })
    }),
    ("dataset: actions are texts in the table", |f| {
        with_table(f, |c| {
            c.insert(
                "action".to_owned(),
                Arc::new(StringArray::from(vec!["left"; 30])),
            );
        })
    }),
    ("dataset: time is not a number", |f| {
        with_table(f, |c| {
            let times = Float32Array::from(vec![f32::NAN; 30]);
            c.insert("timestamp".to_owned(), Arc::new(times));
        })
    }),
    ("dataset: frames count backwards", |f| {
        with_table(f, |c| {
            let numbers: Int64Array = (0..30).rev().map(Some).collect();
            c.insert("frame_index".to_owned(), Arc::new(numbers));
        })
    }),
    ("dataset: frames of other episodes", |f| {
        with_table(f, |c| {
            c.insert(
                "episode_index".to_owned(),
                Arc::new(Int64Array::from(vec![9; 30])),
            );
        })
    }),
    ("dataset: frames of an episode apart", |f| {
        with_table(f, |c| {
            let numbers: Int64Array = (0..30).map(|i| Some(i % 3)).collect();
            c.insert("episode_index".to_owned(), Arc::new(numbers));
        })
    }),
    ("dataset: images are numbers", |f| {
        with_table(f, |c| {
            let key = "observation.images.head".to_owned();
            c.insert(key, Arc::new(Int64Array::from(vec![9; 30])));
        })
    }),
    ("dataset: images are no pictures", |f| {
        with_table(f, |c| {
            let bytes = arrow::array::BinaryArray::from_iter_values(vec![b"no picture"; 30]);
            c.insert("observation.images.head".to_owned(), Arc::new(bytes));
        })
    }),
    ("dataset: images are missing", |f| {
        with_table(f, |c| {
            let none = arrow::array::BinaryArray::from(vec![None; 30]);
            c.insert("observation.images.head".to_owned(), Arc::new(none));
        })
    }),
    ("dataset: metadata of ours is broken", |f| {
        with_file(f, "meta/catena.json", b"{\"episodes\": 3}")
    }),
    ("dataset: metadata of ours says primitives", |f| {
        let root = dataset(f);
        let path = root.join("meta/catena.json");
        let mut ours = json_of(&path);
        ours["action_space"] =
            json!({ "kind": "primitives", "names": ["a", "b", "c", "d", "e", "f", "g"] });
        fs::write(path, ours.to_string()).expect("written");
        root
    }),
    ("dataset: a line of episodes is broken", |f| {
        version_two(
            f,
            "{\"episode_index\": 0, \"length\": 10}\n{\"episode_index\": one}\n",
        )
    }),
    ("dataset: an episode twice", |f| {
        version_two(f, &"{\"episode_index\": 0, \"length\": 10}\n".repeat(2))
    }),
    ("dataset: no episodes", |f| version_two(f, "\n")),
    ("dataset: more frames than said", |f| {
        version_two(f, "{\"episode_index\": 0, \"length\": 4}\n")
    }),
    ("dataset: fewer frames than said", |f| {
        version_two(
            f,
            "{\"episode_index\": 0, \"length\": 18000000000000000000}\n",
        )
    }),
    ("dataset: an episode of a huge number", |f| {
        version_two(
            f,
            "{\"episode_index\": 18000000000000000000, \"length\": 4}\n",
        )
    }),
    ("dataset: the video is missing", with_video),
    ("dataset: mapping names a feature that is not there", |f| {
        dataset(f);
        let path = f.join("carrot.yaml");
        let text = "recordings: carrot\ntopics: {cameras: {head: observation.image.head}}\n";
        fs::write(&path, text).expect("written");
        path
    }),
];
