//! Trainings that can be repeated, and experiments that go on.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use crate::command::{catena, path, root, succeeded, text};

/// Records demonstrations of a task in a folder of its name.
fn recorded(folder: &Path, task: &str, demonstrations: &str) -> PathBuf {
    let out = folder.join(task);
    let words = ["record", task, "--demos", demonstrations, "--out"];
    succeeded(&[&words[..], &[path(&out)]].concat());
    out
}

fn manifest(model: &Path) -> serde_json::Value {
    let text = fs::read(model.join("manifest.json")).expect("a manifest");
    serde_json::from_slice(&text).expect("JSON")
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

    let record = fs::read(at("run").join("run.json")).expect("a record");
    let record: serde_json::Value = serde_json::from_slice(&record).expect("JSON");
    assert_eq!(record["seed"], 5);
    assert_eq!(record["version"], env!("CARGO_PKG_VERSION"));
    let digest = record["demonstrations"]["wine"].as_str().map(str::len);
    assert_eq!(digest, Some(64));
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
    }
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
    for _ in 0..600 {
        if run.join("run.json").exists() {
            break;
        }
        thread::sleep(Duration::from_millis(100));
    }
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
        // Often, since a baseline's training ends by itself when steps bring nothing better.
        for _ in 0..6000 {
            if run.join("checkpoint.safetensors").is_file() {
                break;
            }
            thread::sleep(Duration::from_millis(10));
        }
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

#[test]
fn what_an_experiment_runs_ends_when_it_is_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let [work, out] = ["work", "out"].map(|name| folder.path().join(name));
    let words = ["experiment", "table1", "--quick", "--methods", "bc"];
    let flags = ["--demonstrations", "2000", "--work", path(&work)];
    let started = Command::new(env!("CARGO_BIN_EXE_catena"))
        .args([&words[..], &flags, &["--out", path(&out)]].concat())
        .current_dir(root())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut started = started.expect("the command starts");
    let recordings = || {
        let entries = fs::read_dir(work.join("demos/sock")).into_iter().flatten();
        let paths = entries.flatten().map(|entry| entry.path());
        paths
            .filter(|p| p.extension().is_some_and(|e| e == "mcap"))
            .count()
    };
    for _ in 0..600 {
        if recordings() > 0 {
            break;
        }
        thread::sleep(Duration::from_millis(100));
    }
    assert!(recordings() > 0, "it records");
    started.kill().expect("it is killed");
    // What it runs prints there, too, so that this waits for both.
    let output = started.wait_with_output().expect("they have ended");
    assert!(text(&output.stdout).contains("$ catena record sock"));
    let recordings = recordings();
    assert!(recordings < 2000, "all {recordings} were recorded");
}

#[test]
fn an_experiment_whose_training_is_at_work_says_what_it_can_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let [work, out] = ["work", "out"].map(|name| folder.path().join(name));
    for task in ["sock", "trash", "wine"] {
        let demos = work.join("demos").join(task);
        fs::create_dir_all(&demos).expect("a folder");
        for name in ["a.mcap", "b.mcap"] {
            fs::write(demos.join(name), "no MCAP file").expect("written");
        }
    }
    let run = work.join("bc_2_seed1_steps200").join("run");
    let held = catena::training::RunFolder::open(&run).expect("nobody has it");
    let words = ["experiment", "table1", "--quick", "--methods", "bc"];
    let flags = ["--demonstrations", "2", "--work", path(&work)];
    let output = catena(&[&words[..], &flags, &["--out", path(&out)]].concat());
    let said = text(&output.stderr);
    assert!(!output.status.success(), "{said}");
    assert!(
        said.contains(path(&run))
            && said.contains("call this one again")
            && said.contains("--work"),
        "{said}"
    );
    assert!(
        !said.contains("--resume") && !said.contains("--run"),
        "{said}"
    );
    drop(held);
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

/// An experiment on the recordings in a folder's `demos`, which works in `work` and keeps its cells in `out`.
fn experiment(folder: &Path, words: &[&str]) -> Output {
    let [demos, work, out] = ["demos", "work", "out"].map(|name| folder.join(name));
    let places = [
        "--demos",
        path(&demos),
        "--work",
        path(&work),
        "--out",
        path(&out),
    ];
    catena(&[&["experiment"], words, &places].concat())
}

#[test]
fn an_experiment_that_was_cut_goes_on_with_what_is_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for task in ["sock", "trash", "wine"] {
        recorded(&at("demos"), task, "2");
    }
    // What was cut off is no demonstration, and does not count as one.
    let whole = fs::read_dir(at("demos/sock")).expect("recordings").next();
    let whole = fs::read(whole.expect("one").expect("an entry").path()).expect("a file");
    fs::write(at("demos/sock/a_cut.mcap"), &whole[..whole.len() / 2]).expect("written");
    let (work, out) = (at("work"), at("out"));
    let run = |more: &[&str]| {
        let words = ["fig5", "--quick", "--demonstrations", "2", "--steps", "3"];
        let output = experiment(folder.path(), &[&words[..], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let first = run(&["--methods", "siamese"]);
    assert!(
        first.contains("catena train") && first.contains("small version"),
        "{first}"
    );
    let both = run(&["--methods", "siamese,only_wrist", "--jobs", "2"]);
    assert!(
        both.contains("kept: ") && both.contains("--camera wrist"),
        "{both}"
    );
    let folders_of = |method: &str| -> Vec<PathBuf> {
        let entries = fs::read_dir(&work).expect("the folder is there").flatten();
        let is_of = |entry: &fs::DirEntry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            name.starts_with(&format!("{method}_2_")) && name.ends_with("_seed1_steps3")
        };
        entries.filter(is_of).map(|entry| entry.path()).collect()
    };
    let [of_wrist] = &folders_of("only_wrist")[..] else {
        panic!("a folder of the training");
    };
    let taken = fs::read_dir(of_wrist.join("demos/sock")).expect("recordings");
    let taken: Vec<_> = taken.flatten().map(|entry| entry.file_name()).collect();
    assert!(
        taken.len() == 2 && taken.iter().all(|name| name != "a_cut.mcap"),
        "{taken:?}"
    );
    let log = fs::read_to_string(of_wrist.join("log.txt"));
    let log = log.expect("what a job beside others prints");
    assert!(
        log.contains("states to train on") && !both.contains("states to train on"),
        "{log}"
    );
    assert!(
        !both.contains("--variant siamese"),
        "it is trained already: {both}"
    );
    let lock = fs::File::create(of_wrist.join("experiment.lock")).expect("a lock");
    lock.lock().expect("nobody holds it");
    fs::remove_file(out.join("only_wrist_seed1.json")).expect("a cell");
    let words = ["fig5", "--quick", "--demonstrations", "2", "--steps", "3"];
    let beside = experiment(
        folder.path(),
        &[&words[..], &["--methods", "only_wrist"]].concat(),
    );
    let said = text(&beside.stderr);
    assert!(
        !beside.status.success() && said.contains("another experiment") && said.contains("--work"),
        "{said}"
    );
    lock.unlock().expect("it is held");
    run(&["--methods", "only_wrist"]);
    let drawn = run(&["--only-draw"]);
    assert!(
        drawn.contains("| stacked frames | | 0 | not measured |"),
        "{drawn}"
    );
    assert!(!drawn.contains("| Siamese | | 0 |"), "{drawn}");
    let svg = fs::read_to_string(out.join("fig5.svg")).expect("a plot");
    assert!(svg.contains("wrist camera only") && !svg.contains("stacked frames"));

    let refused = |more: &[&str]| {
        let output = experiment(folder.path(), &[&["table1"], more].concat());
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let missing = at("none.onnx");
    let refused_at_once = ["--demonstrations", "2", "--frozen-encoder", path(&missing)];
    let said = refused(&refused_at_once);
    assert!(said.contains("none.onnx: No such file"), "{said}");
    fs::write(&missing, "no network").expect("writing a file");
    let beside = ["--demonstrations", "2", "--jobs", "2"];
    let without_encoder = ["--methods", "mvp", "--frozen-encoder", path(&missing)];
    let said = refused(&[&beside[..], &without_encoder].concat());
    assert!(
        said.contains("log.txt") && said.contains("none.onnx"),
        "a job beside others says why it failed: {said}"
    );
    let said = refused(&["--demonstrations", "5"]);
    assert!(
        said.contains("has 2 MCAP recordings") && said.contains("a_cut.mcap is left out"),
        "{said}"
    );
}

#[test]
fn other_recordings_are_another_training_and_replace_nothing_unasked() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for task in ["sock", "trash", "wine"] {
        recorded(&at("demos"), task, "1");
    }
    let (demos, work) = (at("demos"), at("work"));
    let fig5 = |more: &[&str]| {
        let words = ["fig5", "--quick", "--steps", "2", "--methods", "siamese"];
        experiment(folder.path(), &[&words[..], more].concat())
    };
    let folders = || fs::read_dir(&work).expect("a folder").count();
    assert!(fig5(&["--demonstrations", "1"]).status.success());
    fs::remove_dir_all(demos.join("wine")).expect("removing recordings");
    fs::rename(demos.join("trash"), demos.join("wine")).expect("renaming recordings");
    recorded(&demos, "trash", "1");
    let said = text(&fig5(&["--demonstrations", "1"]).stderr);
    assert!(
        said.contains("siamese_seed1.json") && said.contains("--replace"),
        "{said}"
    );
    assert!(said.contains("does not name: the recordings"), "{said}");
    let of_more_steps = ["fig5", "--quick", "--steps", "3", "--methods", "siamese"];
    let words = [&of_more_steps[..], &["--demonstrations", "1"]].concat();
    let said = text(&experiment(folder.path(), &words).stderr);
    assert!(
        said.contains("the commands differ") && said.contains("--steps 3 --seed 1` here"),
        "{said}"
    );
    let said = text(&fig5(&["--demonstrations", "1,2"]).stderr);
    assert!(said.contains("one number of demonstrations"), "{said}");
    assert_eq!(folders(), 1);
    assert!(
        fig5(&["--demonstrations", "1", "--replace"])
            .status
            .success()
    );
    assert_eq!(folders(), 2);
}

#[test]
fn an_experiment_takes_bags_as_wholes() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let metadata =
        "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap, run_1.mcap]\n";
    let files = [
        ("single.mcap", "no MCAP file, for the training to refuse"),
        ("run/run_0.mcap", "nor this"),
        ("run/run_1.mcap", "nor this"),
        ("run/metadata.yaml", metadata),
    ];
    for task in ["sock", "trash", "wine"] {
        let demos = at("demos").join(task);
        fs::create_dir_all(demos.join("run")).expect("a folder");
        for (name, text) in files {
            fs::write(demos.join(name), text).expect("written");
        }
    }
    let encoder = at("encoder.onnx");
    fs::write(&encoder, "no network").expect("written");
    let refused = |demonstrations: &str| {
        let methods = ["table1", "--quick", "--methods", "mvp"];
        let encoder = ["--frozen-encoder", path(&encoder)];
        let number = ["--demonstrations", demonstrations];
        let words = [&methods[..], &encoder, &number].concat();
        let output = experiment(folder.path(), &words);
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let said = refused("3");
    assert!(said.contains("has 2 MCAP recordings"), "{said}");
    let said = refused("2");
    assert!(said.contains("encoder.onnx"), "{said}");
    let made = fs::read_dir(at("work")).expect("a folder").flatten();
    let mut of_two = made.filter(|e| e.file_name().to_string_lossy().starts_with("mvp_2_"));
    let root = of_two.next().expect("the folder of the training").path();
    for (name, _) in files {
        let taken = root.join("demos/sock").join(name);
        assert!(taken.is_file(), "{} is missing", taken.display());
    }
}
