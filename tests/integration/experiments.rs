//! Experiments that go on, on recordings of their own or given ones.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::command::{catena, json_of, path, root, text, wait_until};
use crate::training::recorded;

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

/// Holds a cell to naming the command behind it, its seed, and the model and recordings that it was measured with.
pub(crate) fn ensure_named(file: &Path, command: &str) {
    let cell = json_of(file);
    let first = cell["commands"][0].as_str().unwrap_or_default();
    assert!(first.starts_with(command), "{first}");
    assert!(cell["seed"].is_u64(), "{}", file.display());
    for name in ["model", "demonstrations of sock", "demonstrations of wine"] {
        let digest = cell["digests"][name].as_str().map(str::len);
        assert_eq!(digest, Some(64), "{name} in {}", file.display());
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
    wait_until(|| recordings() > 0);
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
    ensure_named(&out.join("siamese_seed1.json"), "catena train ... ");
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
    let record = of_wrist.join("run/run.json");
    let mut of_training = json_of(&record);
    of_training["commit"] = "an earlier one".into();
    fs::write(&record, of_training.to_string()).expect("written");
    run(&["--methods", "only_wrist"]);
    let measured = json_of(&out.join("only_wrist_seed1.json"));
    assert_eq!(measured["training_commit"], "an earlier one");
    let drawn = run(&["--only-draw"]);
    assert!(
        drawn.contains("| stacked frames | | 0 | not measured |"),
        "{drawn}"
    );
    assert!(!drawn.contains("| Siamese | | 0 |"), "{drawn}");
    let svg = fs::read_to_string(out.join("fig5.svg")).expect("a plot");
    assert!(svg.contains("wrist camera only") && !svg.contains("stacked frames"));
    ensure_told(folder.path());
}

/// What a table says where an encoder, a job beside others or recordings are of no use.
fn ensure_told(folder: &Path) {
    let refused = |more: &[&str]| {
        let output = experiment(folder, &[&["table1"], more].concat());
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let missing = folder.join("none.onnx");
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
    assert!(said.contains("the recordings of wine differ"), "{said}");
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
fn a_flag_that_an_experiment_has_no_use_for_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let flags = [
        ("table2", "--episodes", "3"),
        ("table3", "--baseline-steps", "3"),
        ("fig5", "--seed", "3"),
        ("fig6", "--frozen-encoder", "encoder.onnx"),
    ];
    for (name, flag, value) in flags {
        let output = experiment(folder.path(), &[name, "--only-draw", flag, value]);
        let said = text(&output.stderr);
        assert!(!output.status.success(), "{name} {flag}: {said}");
        assert!(said.contains(flag) && said.contains("table1"), "{said}");
    }
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
