//! Mapping files that are wrong, or do not fit their recording.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::Case;
use crate::command::root;

/// A mapping file beside a real recording: `/camera/head/image_raw/compressed`, `/joint_states`, and `/action`
/// with seven values, ten steps at 5 Hz.
pub(super) fn mapping(folder: &Path, keys: &str) -> PathBuf {
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

pub(super) const CASES: &[Case] = &[
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
    ("mapping: size of a camera that no topic gives", |f| {
        mapping(f, "image_sizes: {haed: {height: 9, width: 9}}")
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
