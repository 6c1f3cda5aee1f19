//! A row of the paper's tables from nothing.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::{json_of, path, root, succeeded, text};
use crate::experiments::ensure_named;

/// Behaviour cloning with hardly any recordings and steps.
const LITTLE: [&str; 7] = [
    "--quick",
    "--methods",
    "bc",
    "--demonstrations",
    "2",
    "--baseline-steps",
    "2",
];

#[test]
fn a_row_is_recorded_trained_measured_and_drawn_and_other_experiments_take_its_network() {
    let folder = tempfile::tempdir().expect("a folder");
    let work = folder.path().join("work");
    let run = |experiment: &str| {
        let out = folder.path().join(experiment);
        let places = ["--work", path(&work), "--out", path(&out)];
        // Table II has one episode as it is.
        let episodes: &[&str] = if experiment == "table2" {
            &[]
        } else {
            &["--episodes", "1"]
        };
        let words = ["experiment", experiment];
        succeeded(&[&words[..], &LITTLE, episodes, &places].concat())
    };
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a file");
    let said = run("table1");
    for step in [
        "$ catena record sock --demos 2 ",
        "$ catena train ",
        "$ catena evaluate wine --policy ",
    ] {
        assert!(said.contains(step), "{step}: {said}");
    }
    for task in ["sock", "trash", "wine"] {
        let file = folder.path().join(format!("table1/bc_2_{task}.json"));
        ensure_named(
            &file,
            "catena train ... --preset bedroom --method bc --steps 2 --seed 1",
        );
        let cell = json_of(&file);
        assert_eq!(cell["evaluation"]["name"], task);
        assert_eq!(
            cell["evaluation"]["results"].as_array().map(Vec::len),
            Some(1)
        );
    }
    let table = read("table1/table.md");
    assert!(
        table.contains("| BC | 2 | **") && !table.contains("not measured"),
        "{table}"
    );
    assert!(read("table1/table1.svg").contains("BC, 2 demonstrations"));
    let again = run("table1");
    assert_eq!(again.matches("kept: ").count(), 3, "{again}");
    assert!(!again.contains("$ catena"), "{again}");

    let cells = [
        ("fig6", "fig6/bc.json", "catena train ... "),
        (
            "table2",
            "table2/bc_2_embedded.json",
            "catena evaluate trash ",
        ),
    ];
    for (experiment, name, command) in cells {
        let said = run(experiment);
        let made = ["$ catena record", "$ catena train"];
        assert!(made.iter().all(|step| !said.contains(*step)), "{said}");
        let file = folder.path().join(name);
        ensure_named(&file, command);
        assert_eq!(json_of(&file)["is_quick"], true, "{name}");
    }
    ensure_failures_told(folder.path());
    for experiment in ["table1", "table2", "fig6"] {
        let table = read(&format!("{experiment}/table.md"));
        assert!(table.starts_with("small version"), "{table}");
    }
}

/// A step that cannot be timed with one engine is timed with the other, and is no success.
fn ensure_failures_told(folder: &Path) {
    let out = folder.join("failing");
    let work = folder.join("work");
    let places = ["--work", path(&work), "--out", path(&out)];
    let mut command = Command::new(env!("CARGO_BIN_EXE_catena"));
    command
        .args(["experiment", "table2"])
        .args(LITTLE)
        .args(places);
    let output = command
        .current_dir(root())
        .env("ORT_DYLIB_PATH", "/nowhere/libonnxruntime.so")
        .output()
        .expect("the command starts");
    let said = text(&output.stderr);
    assert!(!output.status.success(), "{said}");
    assert!(
        said.contains("BC with ONNX Runtime: not measured") && said.contains("1 of 2 cells"),
        "{said}"
    );
    assert!(out.join("bc_2_embedded.json").is_file(), "{said}");
    assert!(!out.join("bc_2_native.json").exists(), "{said}");
    let table = fs::read_to_string(out.join("table.md")).expect("a table");
    assert!(table.contains("| BC | not measured | **"), "{table}");
}
