//! What a person is told of recordings, datasets and mapping files that are wrong: a table of cases with the
//! error of each.

mod datasets;
mod mappings;
mod recordings;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use catena::storage::{ReadOptions, Recordings, StorageError};

use self::datasets::{DATA, dataset, version_two, with_video};
use self::mappings::mapping;
use self::recordings::{lying_png, of_two_sizes, raw_bytes, with_image};
use super::command::{catena, path, root, text};

/// Far beyond what a case takes; a hang would take forever.
const MAX_TIME: Duration = Duration::from_secs(20);

/// A case: makes its files in a folder and says what is to be read.
type Case = (&'static str, fn(&Path) -> PathBuf);

fn read(at: &Path) -> Result<usize, StorageError> {
    let recordings = Recordings::open(&[at.to_owned()], &ReadOptions::default())?;
    let task = recordings.tasks().remove(0);
    Ok(recordings.demonstrations(&task)?.0.step_count())
}

/// The text with everything that differs from one run to the next taken out.
fn comparable(error: &str, folder: &Path) -> String {
    error.replace(path(folder), "FOLDER")
}

#[test]
fn every_case_names_file_place_and_way_out() {
    let cases = [recordings::CASES, mappings::CASES, datasets::CASES].concat();
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

#[test]
fn recordings_of_two_sizes_are_read_in_the_one_that_is_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let task = of_two_sizes(folder.path());
    let mapping = folder.path().join("cup.yaml");
    let keys = "recordings: cup\nimage_size: {height: 4, width: 6}\n";
    fs::write(&mapping, keys).expect("written");
    assert_eq!(read(&mapping).expect("one size"), 2);
    let options = ReadOptions {
        image_size: Some("4x6".parse().expect("a size")),
        ..ReadOptions::default()
    };
    let recordings = Recordings::open(&[task], &options).expect("recordings");
    let (set, _) = recordings.demonstrations("cup").expect("one size");
    assert_eq!(set.step_count(), 2);
}

#[test]
fn one_demonstration_alone_is_not_trained_on() {
    let demo = root().join("tests/data/bridge/put_carrot_on_plate/episode_00.mcap");
    for method in ["ours", "bc"] {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("model");
        let words = ["train", path(&demo), "--method", method, "--preset", "tiny"];
        let output = catena(&[&words[..], &["--out", path(&out)]].concat());
        assert_eq!(output.status.code(), Some(1), "{method}");
        assert_eq!(
            text(&output.stderr),
            "error: training needs at least 2 demonstrations, one of them held out for validation, but has 1: \
             record more, or name more recordings\n"
        );
        assert!(!out.exists(), "{method}");
    }
}

/// Sizes that lie must not be believed: the command reads them with two gigabytes of address space.
#[test]
#[cfg(target_os = "linux")]
fn lying_sizes_take_no_memory() {
    let cases: &[Case] = &[
        ("image claims 16383x16383 pixels", |f| {
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
    assert!(text(&whole.stdout).contains("training on 30 states of 1 task;"));
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
