//! What a person is told of recordings, datasets and mapping files that are wrong: a table of cases with the
//! error of each.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use arrow::array::{Array, ArrayRef, FixedSizeListArray, Float32Array, Int64Array, StringArray};
use arrow::datatypes::{Field, Schema};
use arrow::record_batch::RecordBatch;
use catena::storage::{PictureFormat, ReadOptions, Recordings, StorageError, convert_to_lerobot};
use mcap::records::MessageHeader;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};

use super::command::{path, root, text};

/// Far beyond what a case takes; a hang would take forever.
const MAX_TIME: Duration = Duration::from_secs(20);

/// A case: makes its files in a folder and says what is to be read.
type Case = (&'static str, fn(&Path) -> PathBuf);

fn read(at: &Path) -> Result<usize, StorageError> {
    let recordings = Recordings::open(&[at.to_owned()], &ReadOptions::default())?;
    let task = recordings.tasks().remove(0);
    Ok(recordings.demonstrations(&task)?.0.step_count())
}

// --- MCAP files ---------------------------------------------------------------------------------------

const IMAGES: (&str, &str, &str) = ("/camera/head", "foxglove.CompressedImage", "protobuf");
const ACTIONS: (&str, &str, &str) = ("/action", "any.Action", "json");

type Message = ((&'static str, &'static str, &'static str), u64, Vec<u8>);

fn mcap(path: &Path, messages: &[Message]) -> PathBuf {
    let mut writer = mcap::Writer::new(File::create(path).expect("a file")).expect("a writer");
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

fn with_image(folder: &Path, bytes: &[u8]) -> PathBuf {
    let image = (IMAGES, 0, image_message(bytes));
    mcap(
        &folder.join("demo.mcap"),
        &[image, told(1, r#"{"values": [1]}"#)],
    )
}

/// The header of a PNG that claims a size, with no pixels behind it.
fn lying_png() -> Vec<u8> {
    let mut bytes = png(4, 6);
    bytes[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
    bytes
}

fn raw_bytes(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("demo.mcap");
    fs::write(&path, bytes).expect("written");
    path
}

const MCAP_CASES: &[Case] = &[
    ("nothing there", |f| f.join("demo.mcap")),
    ("folder without recordings", Path::to_owned),
    ("empty file", |f| raw_bytes(f, b"")),
    ("text instead of MCAP", |f| raw_bytes(f, b"task: cup")),
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
    ("image is no picture", |f| with_image(f, b"not a picture")),
    ("image claims 65535x65535 pixels", |f| {
        with_image(f, &lying_png())
    }),
    ("images of two sizes", |f| {
        let small = (IMAGES, 100, image_message(&png(2, 2)));
        let act = |t| told(t, r#"{"values": [1]}"#);
        mcap(&f.join("demo.mcap"), &[shown(1), act(2), small, act(101)])
    }),
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

// --- mapping files ------------------------------------------------------------------------------------

/// A mapping file beside a real recording: `/camera/head/image_raw/compressed`, `/joint_states`, and `/action`
/// with seven values, ten steps at 5 Hz.
fn mapping(folder: &Path, keys: &str) -> PathBuf {
    let from = root().join("tests/data/bridge/put_carrot_on_plate/episode_00.mcap");
    fs::copy(from, folder.join("carrot.mcap")).expect("copied");
    let path = folder.join("carrot.yaml");
    fs::write(&path, format!("recordings: carrot.mcap\n{keys}\n")).expect("written");
    path
}

fn mapping_text(folder: &Path, text: impl AsRef<[u8]>) -> PathBuf {
    let path = mapping(folder, "");
    fs::write(&path, text).expect("written");
    path
}

const MAPPING_CASES: &[Case] = &[
    ("mapping: misspelled key", |f| {
        mapping(f, "topcis: {action: /action}")
    }),
    ("mapping: misspelled inner key", |f| {
        mapping(f, "actions: {bin: 3}")
    }),
    ("mapping: misspelled camera topic", |f| {
        mapping(
            f,
            "topics:\n  cameras: {head: /camera/haed/image_raw/compressed}",
        )
    }),
    ("mapping: misspelled action topic", |f| {
        mapping(f, "topics: {action: /actoin}")
    }),
    ("mapping: camera topic without images", |f| {
        mapping(f, "topics: {cameras: {head: /joint_states}}")
    }),
    ("mapping: action topic without actions", |f| {
        mapping(f, "topics: {action: /camera/head/image_raw/compressed}")
    }),
    ("mapping: one topic for two cameras", |f| {
        mapping(
            f,
            "topics: {cameras: {a: /camera/head/image_raw/compressed, b: /camera/head/image_raw/compressed}}",
        )
    }),
    ("mapping: camera name with a slash", |f| {
        mapping(
            f,
            "topics: {cameras: {a/b: /camera/head/image_raw/compressed}}",
        )
    }),
    ("mapping: no recordings", |f| {
        mapping_text(f, "task: carrot\n")
    }),
    ("mapping: empty list of recordings", |f| {
        mapping_text(f, "recordings: []\n")
    }),
    ("mapping: recordings that are not there", |f| {
        mapping_text(f, "recordings: [carot.mcap]\n")
    }),
    ("mapping: names a mapping file", |f| {
        mapping_text(f, "recordings: carrot.yaml\n")
    }),
    ("mapping: rate is a word", |f| mapping(f, "rate_hz: fast")),
    ("mapping: rate is 0", |f| mapping(f, "rate_hz: 0")),
    ("mapping: rate is not finite", |f| {
        mapping(f, "rate_hz: .nan")
    }),
    ("mapping: rate above that of the actions", |f| {
        mapping(f, "rate_hz: 50")
    }),
    ("mapping: rate and every", |f| {
        mapping(f, "rate_hz: 5\nevery: 2")
    }),
    ("mapping: every is 0", |f| mapping(f, "every: 0")),
    ("mapping: every is negative", |f| mapping(f, "every: -3")),
    ("mapping: image without height", |f| {
        mapping(f, "image_size: {width: 64}")
    }),
    ("mapping: image of 0 rows", |f| {
        mapping(f, "image_size: {height: 0, width: 64}")
    }),
    ("mapping: image of a million rows", |f| {
        mapping(f, "image_size: {height: 1000000, width: 64}")
    }),
    ("mapping: size of a camera that is none", |f| {
        mapping(
            f,
            "topics: {cameras: {head: /camera/head/image_raw/compressed}}\nimage_sizes: {haed: {height: 9, width: 9}}",
        )
    }),
    ("mapping: 0 bins", |f| mapping(f, "actions: {bins: 0}")),
    ("mapping: a billion bins", |f| {
        mapping(f, "actions: {dimensions: {x: {bins: 1000000000}}}")
    }),
    ("mapping: unknown spacing", |f| {
        mapping(f, "actions: {spacing: logarithmic}")
    }),
    ("mapping: unknown dimension", |f| {
        mapping(f, "actions: {dimensions: {griper: {bins: 2}}}")
    }),
    ("mapping: too few names", |f| {
        mapping(f, "actions: {names: [x, y, z]}")
    }),
    ("mapping: a name twice", |f| {
        mapping(f, "actions: {names: [x, y, z, x, p, q, g]}")
    }),
    ("mapping: keeps what is not there", |f| {
        mapping(f, "actions: {keep: [x, yew]}")
    }),
    ("mapping: describes what it does not keep", |f| {
        mapping(f, "actions: {keep: [x], dimensions: {yaw: {bins: 3}}}")
    }),
    ("mapping: empty range", |f| {
        mapping(f, "actions: {dimensions: {x: {low: 1, high: 1}}}")
    }),
    ("mapping: range that is not finite", |f| {
        mapping(f, "actions: {dimensions: {x: {low: -.inf}}}")
    }),
    ("mapping: key twice", |f| mapping(f, "every: 2\nevery: 3")),
    ("mapping: no YAML", |f| mapping(f, "actions: {bins: 3")),
    ("mapping: a list", |f| mapping_text(f, "- carrot.mcap\n")),
    ("mapping: empty", |f| mapping_text(f, "")),
    ("mapping: not UTF-8", |f| {
        mapping_text(f, b"recordings: \xff\xfe\n")
    }),
    ("mapping: a megabyte", |f| {
        mapping_text(f, "# much\n".repeat(150_000))
    }),
    ("mapping: aliases that explode", |f| {
        let mut text =
            "recordings: carrot.mcap\na0: &a0 [x, x, x, x, x, x, x, x, x, x]\n".to_owned();
        for i in 1..12 {
            let alias = format!("*a{}, ", i - 1).repeat(10);
            writeln!(text, "a{i}: &a{i} [{alias}]").expect("a string");
        }
        mapping_text(f, text)
    }),
];

// --- LeRobot datasets ---------------------------------------------------------------------------------

const DATA: &str = "data/chunk-000/file-000.parquet";

/// A sound dataset of three real episodes.
fn dataset(folder: &Path) -> PathBuf {
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
    let mut info: Value =
        serde_json::from_str(&fs::read_to_string(&path).expect("a file")).expect("JSON");
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
fn version_two(folder: &Path, lines: &str) -> PathBuf {
    let root = with_info(folder, |info| {
        info["codebase_version"] = json!("v2.1");
        info["data_path"] =
            json!("data/chunk-{episode_chunk:03d}/file-{episode_index:03d}.parquet");
    });
    fs::write(root.join("meta/episodes.jsonl"), lines).expect("written");
    root
}

/// The dataset with its camera as a video.
fn with_video(folder: &Path) -> PathBuf {
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

const DATASET_CASES: &[Case] = &[
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
        let mut ours: Value =
            serde_json::from_str(&fs::read_to_string(&path).expect("a file")).expect("JSON");
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

/// The text with everything that differs from one run to the next taken out.
fn comparable(error: &str, folder: &Path) -> String {
    error.replace(path(folder), "FOLDER")
}

#[test]
fn every_case_names_file_place_and_way_out() {
    let cases = [MCAP_CASES, MAPPING_CASES, DATASET_CASES].concat();
    assert!(cases.len() >= 90, "cases have been lost: {}", cases.len());
    let mut table = String::new();
    for (name, make) in cases {
        let folder = tempfile::tempdir().expect("a folder");
        let at = make(folder.path());
        let start = Instant::now();
        let error = match read(&at) {
            Ok(steps) => panic!("{name}: read as {steps} steps"),
            Err(error) => comparable(&error.to_string(), folder.path()),
        };
        let spent = start.elapsed();
        assert!(spent < MAX_TIME, "{name} took {spent:?}");
        assert!(error.contains("FOLDER"), "{name} names no file: {error}");
        assert_eq!(error.lines().count(), 1, "{name}: {error}");
        writeln!(table, "{name}\n  {error}").expect("a string");
    }
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots/bad_input");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!("cases", table));
}

/// Sizes that lie must not be believed: the command reads them with two gigabytes of address space.
#[test]
#[cfg(target_os = "linux")]
fn lying_sizes_take_no_memory() {
    let cases: &[Case] = &[
        ("image claims 65535x65535 pixels", |f| {
            with_image(f, &lying_png())
        }),
        ("a record claims 2^63 bytes", |f| {
            let mut bytes = mcap::MAGIC.to_vec();
            bytes.push(6);
            bytes.extend((1u64 << 63).to_le_bytes());
            bytes.extend([0; 64]);
            raw_bytes(f, &bytes)
        }),
        ("an episode of a huge number", |f| {
            version_two(
                f,
                "{\"episode_index\": 0, \"length\": 18000000000000000000}\n",
            )
        }),
        ("a footer claims 2 GiB", |f| {
            let root = dataset(f);
            let path = root.join(DATA);
            let mut bytes = fs::read(&path).expect("a file");
            let end = bytes.len() - 8;
            bytes[end..end + 4].copy_from_slice(&[0xff, 0xff, 0xff, 0x7f]);
            fs::write(&path, bytes).expect("written");
            root
        }),
    ];
    for (name, make) in cases {
        let folder = tempfile::tempdir().expect("a folder");
        let at = make(folder.path());
        let command = format!(
            "ulimit -v 2000000; exec {} convert \"$0\" --to mcap --out \"$1\"",
            env!("CARGO_BIN_EXE_catena")
        );
        let output = std::process::Command::new("sh")
            .args(["-c", &command, path(&at), path(&folder.path().join("out"))])
            .output()
            .expect("a shell");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{name}: {said}");
        assert!(
            said.starts_with("error: ") || said.starts_with("warning: "),
            "{name}: {said}"
        );
    }
}

#[test]
fn a_video_without_ffmpeg_says_what_to_install() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = with_video(folder.path());
    let video = root.join("videos/observation.images.head/chunk-000/file-000.mp4");
    fs::create_dir_all(video.parent().expect("a folder")).expect("made");
    fs::write(&video, b"no video").expect("written");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_catena"))
        .args([
            "convert",
            path(&root),
            "--to",
            "mcap",
            "--out",
            path(&folder.path().join("out")),
        ])
        .env("PATH", path(folder.path()))
        .output()
        .expect("the command starts");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for part in [
        "file-000.mp4",
        "camera 'head'",
        "no program `ffmpeg` on the PATH",
        "install ffmpeg",
    ] {
        assert!(said.contains(part), "{part} is missing: {said}");
    }
}

/// A stand-in for the program that gives so many pictures of 4x6 pixels, whatever it is asked.
#[cfg(unix)]
fn with_stand_in(folder: &Path, pictures: usize) -> PathBuf {
    use std::os::unix::fs::PermissionsExt as _;
    let root = with_video(folder);
    let video = root.join("videos/observation.images.head/chunk-000/file-000.mp4");
    fs::create_dir_all(video.parent().expect("a folder")).expect("made");
    fs::write(&video, b"not looked at").expect("written");
    let mut stream = Vec::new();
    for i in 0..pictures {
        stream.extend(b"P6\n6 4\n255\n");
        stream.extend([i as u8 * 8; 72]);
    }
    fs::write(folder.join("stream"), stream).expect("written");
    let program = folder.join("ffmpeg");
    let script = format!(
        "#!/bin/sh\necho 'it was damaged' >&2\nexec cat {}\n",
        path(&folder.join("stream"))
    );
    fs::write(&program, script).expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("executable");
    root
}

#[cfg(unix)]
fn trained_with_stand_in(pictures: usize) -> std::process::Output {
    let folder = tempfile::tempdir().expect("a folder");
    let root = with_stand_in(folder.path(), pictures);
    let paths = format!("{}:/usr/bin:/bin", path(folder.path()));
    let out = folder.path().join("model");
    std::process::Command::new(env!("CARGO_BIN_EXE_catena"))
        .args([
            "train",
            path(&root),
            "--preset",
            "tiny",
            "--steps",
            "1",
            "--image-size",
            "16x16",
        ])
        .args(["--out", path(&out)])
        .env("PATH", paths)
        .output()
        .expect("the command starts")
}

#[test]
#[cfg(unix)]
fn videos_are_read_through_the_program_and_their_end_is_noticed() {
    let whole = trained_with_stand_in(10);
    assert!(whole.status.success(), "{}", text(&whole.stderr));
    assert!(text(&whole.stdout).contains("training on 30 states of 1 tasks"));
    assert!(
        !text(&whole.stderr).contains("LOST"),
        "{}",
        text(&whole.stderr)
    );
    let short = trained_with_stand_in(7);
    assert!(short.status.success(), "{}", text(&short.stderr));
    let said = text(&short.stderr);
    let lost = "3 images of observation.images.head: the video ends after 7 frames. it was damaged";
    assert!(said.contains(lost), "{said}");
    let none = trained_with_stand_in(0);
    assert_eq!(none.status.code(), Some(1));
    let said = text(&none.stderr);
    assert!(
        said.contains("no frame of it can be read: it was damaged"),
        "{said}"
    );
}

/// A few bytes of each kind of file changed or cut off anywhere: an answer every time, and no panic.
#[test]
fn no_damage_makes_it_panic() {
    use rand::{Rng, SeedableRng};
    const ROUNDS: usize = 150;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = dataset(folder.path());
    fs::remove_file(dataset.join("meta/catena.json")).expect("it was there");
    let mapping = mapping(folder.path(), "every: 2\nactions: {spacing: quantiles}");
    for (file, whole) in [
        (folder.path().join("carrot.mcap"), &mapping),
        (dataset.join(DATA), &dataset),
        (
            dataset.join("meta/episodes/chunk-000/file-000.parquet"),
            &dataset,
        ),
        (dataset.join("meta/info.json"), &dataset),
    ] {
        let sound = fs::read(&file).expect("a file");
        read(whole).expect("it is sound");
        for _ in 0..ROUNDS {
            let mut bytes = sound.clone();
            if rng.random_bool(0.3) {
                bytes.truncate(rng.random_range(0..sound.len()));
            }
            // Footers are at the end, and say most.
            let from = if rng.random_bool(0.5) {
                bytes.len().saturating_sub(3000)
            } else {
                0
            };
            for _ in 0..rng.random_range(0..4) {
                if from < bytes.len() {
                    let at = rng.random_range(from..bytes.len());
                    bytes[at] = rng.random();
                }
            }
            fs::write(&file, &bytes).expect("written");
            let start = Instant::now();
            // Sound or not is no matter here: neither panics nor hangs.
            let _ = read(whole);
            assert!(start.elapsed() < MAX_TIME, "{} hangs", file.display());
        }
        fs::write(&file, &sound).expect("written");
    }
}
