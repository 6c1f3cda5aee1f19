//! Trainings that can be repeated, stopped and gone on from.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::command::{catena, json_of, path, succeeded, text, wait_until};

/// Records demonstrations of a task in a folder of its name.
pub(crate) fn recorded(folder: &Path, task: &str, demonstrations: &str) -> PathBuf {
    let out = folder.join(task);
    let words = ["record", task, "--demos", demonstrations, "--out"];
    succeeded(&[&words[..], &[path(&out)]].concat());
    out
}

fn manifest(model: &Path) -> serde_json::Value {
    json_of(&model.join("manifest.json"))
}

#[test]
fn a_run_folder_is_enough_to_repeat_its_training() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "3");
    let train = |out: &Path, run: &Path, more: &[&str]| {
        let words = [
            "train",
            path(&demos),
            "--out",
            path(out),
            "--run",
            path(run),
        ];
        succeeded(&[&words[..], more].concat())
    };
    let flags = [
        "--preset",
        "tiny",
        "--steps",
        "12",
        "--seed",
        "5",
        "--variant",
        "siamese",
        "--camera",
        "head",
    ];
    train(&at("model"), &at("run"), &flags);
    let resumed = [&flags[..], &["--resume"]].concat();
    let ended = train(&at("model"), &at("run"), &resumed);
    assert!(ended.contains("has ended before"), "{ended}");
    let checkpoint = at("run").join("checkpoint.safetensors");
    let before = fs::read(&checkpoint).expect("a checkpoint");
    for (more, way_out) in [
        (&["--steps", "24"][..], "--resume and the flags"),
        (
            &["--steps", "24", "--resume"],
            "the learning rate falls over all steps",
        ),
    ] {
        let words = ["train", path(&demos), "--preset", "tiny", "--seed", "5"];
        let (model, run) = (at("model"), at("run"));
        let places = ["--out", path(&model), "--run", path(&run)];
        let output = catena(&[&words[..], &places, &flags[6..], more].concat());
        let said = text(&output.stderr);
        assert!(
            !output.status.success() && said.contains(way_out) && said.contains(path(&run)),
            "{said}"
        );
    }
    assert_eq!(fs::read(&checkpoint).expect("still there"), before);
    let config = at("run").join("config.json");
    train(&at("again"), &at("run2"), &["--config", path(&config)]);
    let (first, second) = (manifest(&at("model")), manifest(&at("again")));
    assert_eq!(
        first["files"], second["files"],
        "the same weights to the last bit"
    );
    assert_eq!(first["training"]["config"]["network"]["variant"], "siamese");
    assert_eq!(first["spec"]["cameras"].as_array().map(Vec::len), Some(1));

    let record = json_of(&at("run").join("run.json"));
    assert_eq!(record["seed"], 5);
    assert_eq!(record["version"], env!("CARGO_PKG_VERSION"));
    let digest = record["demonstrations"]["wine"].as_str().map(str::len);
    assert_eq!(digest, Some(64));
    assert!(record.get("frozen_encoder").is_none(), "{record}");
    train(
        &at("other"),
        &at("run3"),
        &["--config", path(&config), "--seed", "6"],
    );
    assert_ne!(first["files"], manifest(&at("other"))["files"]);
}

#[test]
fn a_camera_or_variant_that_is_not_there_is_named_with_those_that_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = recorded(folder.path(), "wine", "2");
    let out = folder.path().join("model");
    for (flag, wrong, right) in [
        ("--camera", "chest", "wrist 90x160"),
        ("--variant", "diamese", "pixel_difference"),
        ("--preset", "bedrom", "bedroom"),
    ] {
        let output = catena(&["train", path(&demos), "--out", path(&out), flag, wrong]);
        let said = text(&output.stderr);
        assert!(
            !output.status.success() && said.contains(wrong) && said.contains(right),
            "{said}"
        );
        let run = out.with_extension("run");
        assert!(!run.exists(), "{flag} leaves no run folder");
    }
    let config = folder.path().join("config.yaml");
    fs::write(&config, "validation_share: 2.0\n").expect("written");
    for method in ["ours", "bc"] {
        let words = ["train", path(&demos), "--out", path(&out), "--preset"];
        let flags = ["tiny", "--method", method, "--config", path(&config)];
        let output = catena(&[&words[..], &flags].concat());
        assert!(!output.status.success(), "{method}");
        assert!(!out.with_extension("run").exists(), "{method}");
    }
}

#[test]
fn a_place_that_cannot_be_had_is_told_before_recordings_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("notes.txt"), "no folder").expect("written");
    let recordings = at("recordings-nowhere");
    let [model, below] = ["model", "notes.txt/run"].map(at);
    for method in ["ours", "bc"] {
        for places in [
            vec!["--out", path(&below)],
            vec!["--out", path(&model), "--run", path(&below)],
        ] {
            let words = ["train", path(&recordings), "--method", method];
            let output = catena(&[&words[..], &places].concat());
            let said = text(&output.stderr);
            assert!(
                !output.status.success() && said.contains("cannot create"),
                "{said}"
            );
            assert!(
                said.contains("not a directory") && !said.contains("recordings-nowhere"),
                "{said}"
            );
        }
    }
    let left = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 1, "nothing was made");
}

#[test]
fn a_training_keeps_another_one_out_of_its_run_folder_until_it_ends_or_is_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "2");
    let run = at("run");
    let of_steps = |steps: &'static str, out: &Path, more: &[&'static str]| -> Vec<String> {
        let flags = ["--preset", "tiny", "--steps", steps, "--run", path(&run)];
        let places = ["train", path(&demos), "--out", path(out)];
        let words = [&places[..], &flags, more].concat();
        words.into_iter().map(str::to_owned).collect()
    };
    let started = Command::new(env!("CARGO_BIN_EXE_catena"))
        .args(of_steps("1000000", &at("model"), &[]))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let mut training = started.expect("the command starts");
    // Written once the folder is taken and the demonstrations are read.
    wait_until(|| run.join("run.json").exists());
    let config = fs::read(run.join("config.json")).expect("a training that is at work");
    let alone: &[&str] = &[];
    for more in [alone, &["--resume"], &["--method", "bc"]] {
        let words = of_steps("3", &at("other"), more);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let output = catena(&words);
        let said = text(&output.stderr);
        assert!(!output.status.success(), "{said}");
        assert!(
            said.contains("at work in the run folder") && said.contains(path(&run)),
            "{said}"
        );
    }
    let kept = fs::read(run.join("config.json")).expect("its configuration");
    assert_eq!(kept, config, "nothing was written over it");
    training.kill().expect("it is killed");
    training.wait().expect("it has ended");
    // It may have come to its first checkpoint.
    let _ = fs::remove_file(run.join("checkpoint.safetensors"));
    let words = of_steps("3", &at("model"), &[]);
    succeeded(&words.iter().map(String::as_str).collect::<Vec<_>>());
}

#[test]
fn recordings_that_are_not_there_leave_no_run_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "2");
    fs::write(at("notes.txt"), "no recording").expect("written");
    let [none, notes] = ["demos/none", "notes.txt"].map(at);
    let wrong = [
        vec![path(&none)],
        vec![path(&notes)],
        vec![path(&demos), path(&none)],
        vec![path(&demos), "--practice", path(&none)],
        vec![path(&none), "--method", "bc"],
    ];
    for words in wrong {
        let (model, run) = (at("model"), at("model.run"));
        let flags = ["--preset", "tiny", "--out", path(&model)];
        let output = catena(&[&["train"], &words[..], &flags].concat());
        let said = text(&output.stderr);
        assert!(
            !output.status.success() && (said.contains("none") || said.contains("notes.txt")),
            "{words:?}: {said}"
        );
        assert!(!model.exists() && !run.exists(), "{words:?}");
    }
}

/// More than a training comes to in a test, and a time after which it ends all the same.
const LONG: [&str; 6] = ["--preset", "tiny", "--steps", "1000000", "--minutes", "2"];

#[test]
fn a_training_that_is_to_end_with_its_input_stops_at_a_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = recorded(folder.path(), "wine", "2");
    for method in ["ours", "bc"] {
        let model = folder.path().join(method);
        let run = model.with_extension("run");
        let words = ["train", path(&demos), "--ends-with-stdin"];
        let flags = ["--method", method, "--out", path(&model)];
        let started = Command::new(env!("CARGO_BIN_EXE_catena"))
            .args([&words[..], &LONG, &flags].concat())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut training = started.expect("the command starts");
        // A baseline's training ends by itself when steps bring nothing better, but not so soon.
        wait_until(|| run.join("checkpoint.safetensors").is_file());
        drop(training.stdin.take());
        let output = training.wait_with_output().expect("it has ended");
        let said = text(&output.stderr);
        assert!(!output.status.success(), "{said}");
        // The losses are written with a checkpoint.
        let losses = fs::read_to_string(run.join("losses.csv")).expect("losses");
        let last = losses
            .lines()
            .next_back()
            .and_then(|row| row.split(',').next());
        let stopped = format!("stopped at step {} as asked", last.unwrap_or_default());
        assert!(said.contains(&stopped), "{stopped}: {said}");
    }
}

#[test]
fn a_training_that_has_not_begun_ends_at_once_with_its_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = recorded(folder.path(), "wine", "2");
    let model = folder.path().join("model");
    for method in ["ours", "bc"] {
        // The command is given no input.
        let words = ["train", path(&demos), "--ends-with-stdin"];
        let flags = ["--method", method, "--out", path(&model)];
        let output = catena(&[&words[..], &LONG, &flags].concat());
        let said = text(&output.stderr);
        let checkpoint = folder.path().join("model.run/checkpoint.safetensors");
        assert!(!output.status.success() && !checkpoint.exists(), "{said}");
    }
}

/// The words of a training of 200 steps on demonstrations, which writes a checkpoint after every twentieth.
fn of_ten_checkpoints(demos: &Path, out: &Path, more: &[&str]) -> Vec<String> {
    let words = ["train", path(demos), "--preset", "tiny"];
    let flags = ["--steps", "200", "--seed", "5", "--out", path(out)];
    let words = [&words[..], &flags, more].concat();
    words.into_iter().map(str::to_owned).collect()
}

/// Kills a training that writes to a folder after its first checkpoint. Tells whether it was in the middle: on a machine with
/// much else to do it may end before it is looked at.
fn is_killed_in_the_middle(demos: &Path, out: &Path) -> bool {
    let started = Command::new(env!("CARGO_BIN_EXE_catena"))
        .args(of_ten_checkpoints(demos, out, &[]))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let mut training = started.expect("the command starts");
    // Where the run folder is, unless it is named.
    let checkpoint = out.with_extension("run").join("checkpoint.safetensors");
    wait_until(|| checkpoint.is_file());
    training.kill().expect("it is killed");
    training.wait().expect("it has ended");
    assert!(checkpoint.is_file(), "it came to a checkpoint");
    !out.exists()
}

#[test]
fn a_training_that_is_killed_after_a_checkpoint_goes_on_to_the_same_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "2");
    let done = |words: &[String]| {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        succeeded(&words)
    };
    done(&of_ten_checkpoints(&demos, &at("once"), &[]));
    let attempts = ["cut", "cut_again", "cut_once_more"].map(at);
    let cut = (attempts.iter()).find(|cut| is_killed_in_the_middle(&demos, cut));
    let cut = cut.expect("one of three is killed in the middle");
    let said = done(&of_ten_checkpoints(&demos, cut, &["--resume"]));
    assert!(!said.contains("the training begins"), "{said}");
    for name in [
        "encoder.onnx",
        "projection.onnx",
        "traversability.onnx",
        "policy.onnx",
        "manifest.json",
    ] {
        let [once, cut] = [&at("once"), cut].map(|model| fs::read(model.join(name)));
        let [once, cut] = [once, cut].map(|bytes| bytes.expect(name));
        assert!(once == cut, "{name} differs");
    }
}

/// A limit on the size of files is what a shell can set of a disk that is full.
#[cfg(unix)]
#[test]
fn a_training_that_cannot_write_says_so_and_goes_on_when_it_can() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "3");
    let run = at("run");
    let words = [
        "train",
        path(&demos),
        "--preset",
        "tiny",
        "--steps",
        "40",
        "--run",
        path(&run),
        "--out",
        path(&at("model")),
        "--resume",
    ]
    .map(str::to_owned);
    let limited = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_catena"))
        .args(&words)
        .output()
        .expect("a shell");
    let said = text(&limited.stderr);
    assert!(!limited.status.success(), "nothing could be written");
    assert!(
        said.contains("checkpoint.safetensors") && said.contains("too large"),
        "{said}"
    );
    let left: Vec<String> = fs::read_dir(&run)
        .expect("the run folder")
        .flatten()
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    assert!(
        left.iter().all(|name| !name.contains("partial")),
        "{left:?}"
    );
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    succeeded(&words);
    assert!(at("model").join("manifest.json").exists());
}

#[cfg(unix)]
#[test]
fn a_model_in_the_folder_where_its_user_stands_is_replaced_within_it() {
    use std::os::unix::fs::MetadataExt;

    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(folder.path(), "wine", "2");
    let (model, run, other) = (at("model"), at("run"), at("other"));
    let flags = ["--preset", "tiny", "--steps", "2", "--run"];
    let words = ["train", path(&demos), "--out", path(&model)];
    succeeded(&[&words[..], &flags, &[path(&run)]].concat());
    let identity = || fs::metadata(&model).expect("the folder").ino();
    let before = (identity(), manifest(&model));
    let words = ["train", path(&demos), "--seed", "6", "--out", "."];
    let output = Command::new(env!("CARGO_BIN_EXE_catena"))
        .args([&words[..], &flags, &[path(&other)]].concat())
        .current_dir(&model)
        .output()
        .expect("the command starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(identity(), before.0, "it is still the same folder");
    assert_ne!(manifest(&model)["files"], before.1["files"]);
}
