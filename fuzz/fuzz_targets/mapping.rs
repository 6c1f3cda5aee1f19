#![no_main]
//! A mapping file with any bytes below the path of a real recording: an answer, never a panic.

use std::fs;
use std::path::Path;

use catena::storage::{ReadOptions, Recordings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder");
    let from = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/data/bridge/put_carrot_on_plate/episode_00.mcap");
    fs::copy(from, folder.path().join("demo.mcap")).expect("copied");
    let mapping = folder.path().join("demo.yaml");
    // A mapping may name any path, so that the one of the recording is given: in the data it would be there twice.
    let text = [&b"recordings: \"demo.mcap\"\n"[..], data].concat();
    fs::write(&mapping, text).expect("written");
    if let Ok(recordings) = Recordings::open(&[mapping], &ReadOptions::default()) {
        drop(recordings.inspect());
    }
});
