#![no_main]
//! A recording of any bytes, read by one of several mapping files: an answer, never a panic.

use std::fs;

use catena::storage::{ReadOptions, Recordings};
use libfuzzer_sys::fuzz_target;

const MAPPINGS: [&str; 4] = [
    "recordings: demo.mcap\n",
    "recordings: demo.mcap\nevery: 3\nimage_size: {height: 8, width: 8}\n",
    "recordings: demo.mcap\nrate_hz: 2\ntopics: {action: /action}\nactions: {combine: sum}\n",
    "recordings: demo.mcap\ntopics: {cameras: {head: /camera/head/image_raw/compressed}, action: /joint_states}\n",
];

fuzz_target!(|data: &[u8]| {
    let Some((choice, recording)) = data.split_first() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let mapping = folder.path().join("demo.yaml");
    fs::write(&mapping, MAPPINGS[usize::from(*choice) % MAPPINGS.len()]).expect("written");
    fs::write(folder.path().join("demo.mcap"), recording).expect("written");
    if let Ok(recordings) = Recordings::open(&[mapping], &ReadOptions::default()) {
        drop(recordings.inspect());
        for recording in recordings.read() {
            drop(recording);
        }
    }
});
