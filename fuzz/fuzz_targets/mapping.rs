#![no_main]
//! A mapping file of any bytes, beside a real recording: an answer, never a panic.

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
    fs::write(&mapping, data).expect("written");
    // A mapping may name any path; only those in its folder are of interest here.
    if data.windows(2).any(|w| w == b"..") || data.contains(&b'/') && data.windows(2).any(|w| w == b" /") {
        return;
    }
    if let Ok(recordings) = Recordings::open(&[mapping], &ReadOptions::default()) {
        drop(recordings.inspect());
    }
});
