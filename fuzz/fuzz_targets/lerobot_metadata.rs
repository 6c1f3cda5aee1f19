#![no_main]
//! Metadata of a dataset of any bytes: an answer, never a panic.

use std::fs;

use catena::storage::{ReadOptions, Recordings};
use libfuzzer_sys::fuzz_target;

const INFO: &str = r#"{"codebase_version": "v3.0", "fps": 5, "chunks_size": 1000,
    "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "features": {"observation.images.a": {"dtype": "image", "shape": [4, 4, 3]},
                 "action": {"dtype": "float32", "shape": [7]}}}"#;

// The reader catches what Parquet's decoder panics on, and only what is not caught counts: the fuzzer's hook,
// which ends the process at once, is taken off.
fuzz_target!(init: drop(std::panic::take_hook()), |data: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |file: &str| folder.path().join(file);
    fs::create_dir_all(at("meta/episodes/chunk-000")).expect("made");
    if let Some((0xfe, table)) = data.split_first() {
        fs::write(at("meta/info.json"), INFO).expect("written");
        fs::write(at("meta/episodes/chunk-000/file-000.parquet"), table).expect("written");
    } else {
        let mut parts = data.splitn(2, |byte| *byte == 0xff);
        fs::write(at("meta/info.json"), parts.next().unwrap_or_default()).expect("written");
        fs::write(at("meta/episodes.jsonl"), parts.next().unwrap_or_default()).expect("written");
    }
    if let Ok(recordings) = Recordings::open(&[folder.path().to_owned()], &ReadOptions::default()) {
        drop(recordings.inspect());
    }
});
