//! What a person is told of a broken file, and what becomes of a sound one. `tests/diagnostics` holds the
//! files: compositions, one a case, and the tasks that they use.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use catena::composer::{
    Calibration, Composition, Diagnostics, Rendering, Source, compose, compose_named,
    compose_source, load_task, load_task_named,
};
use catena::planner::{PlannerOptions, Start};
use catena::storage::load_graph;

const CASES: &str = "tests/diagnostics/compositions";
const ROOT: &str = "tests/diagnostics/project";

/// Far beyond what a case takes; a hang would take forever.
const MAX_TIME: Duration = Duration::from_secs(5);

fn snapshot(name: &str, text: &str) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots/diagnostics");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(name, text));
}

fn summary(composition: &Composition) -> String {
    let mut text = String::new();
    let c = composition;
    writeln!(text, "composition {} ({:?})", c.name, c.description).unwrap();
    for task in &c.tasks {
        writeln!(text, "task {} in {}", task.task.name, task.graph.display()).unwrap();
        for rule in &task.rules {
            writeln!(text, "  {}: {:?}", rule.subgoal.name, rule.detection).unwrap();
        }
        writeln!(text, "  from {:?}", task.demonstrations).unwrap();
    }
    writeln!(text, "stages {}", c.automaton.stage_count()).unwrap();
    writeln!(text, "model {}", c.model.display()).unwrap();
    writeln!(
        text,
        "final state {:?}, on shortcut {:?}",
        c.final_choice, c.on_shortcut
    )
    .unwrap();
    writeln!(text, "{:?}", c.limits).unwrap();
    if c.start != Start::Beginning {
        writeln!(text, "start {:?}", c.start).unwrap();
    }
    let (passed, avoided) = c.regions();
    for (what, regions) in [("via", passed), ("avoid", avoided)] {
        for region in regions {
            writeln!(text, "{what} {region}: {region:?}").unwrap();
        }
    }
    // The defaults are tuned now and then; that is no change of what a file says.
    if c.planner == PlannerOptions::default() {
        writeln!(text, "planner by default").unwrap();
    } else if c.planner == PlannerOptions::paper() {
        writeln!(text, "planner of the paper").unwrap();
    } else {
        writeln!(text, "{:#?}", c.planner).unwrap();
    }
    if c.calibration != Calibration::default() {
        writeln!(text, "calibration {:?}", c.calibration).unwrap();
    }
    if let Some(environment) = &c.environment {
        let settings = serde_json::Value::Object(environment.settings.clone());
        writeln!(text, "environment {} {settings}", environment.kind.value).unwrap();
    }
    for warning in &c.warnings {
        writeln!(text, "warning: {warning}").unwrap();
    }
    text
}

fn told(result: &Result<Composition, Diagnostics>) -> String {
    match result {
        Ok(composition) => summary(composition),
        Err(diagnostics) => diagnostics.render(Rendering::Plain),
    }
}

fn cases() -> Vec<PathBuf> {
    let mut files: Vec<_> = fs::read_dir(CASES)
        .expect("the cases")
        .map(|f| f.expect("a case").path())
        .collect();
    files.sort();
    files
}

#[test]
fn every_case_is_told_in_full() {
    let cases = cases();
    assert!(cases.len() >= 40, "cases have been lost: {}", cases.len());
    for path in cases {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let start = Instant::now();
        let result = compose(&path, Path::new(ROOT));
        assert!(
            start.elapsed() < MAX_TIME,
            "{name} took {:?}",
            start.elapsed()
        );
        assert_eq!(
            result.is_ok(),
            name.starts_with("good"),
            "{name}: {}",
            told(&result)
        );
        snapshot(name, &told(&result));
    }
}

/// What only a graph can tell of regions is told with their lines too.
#[test]
fn regions_that_a_graph_does_not_have_are_told() {
    let path = Path::new("tests/diagnostics/regions/not_in_the_graph.yaml");
    let mut composition = compose(path, Path::new("")).expect("it is sound in itself");
    let (graph, _) = load_graph(&composition.tasks[0].graph).expect("the shipped graph");
    let faults = composition
        .place_regions(graph)
        .expect_err("nothing of it is there");
    snapshot("regions_not_in_the_graph", &faults.render(Rendering::Plain));
}

#[test]
fn faults_are_data_too() {
    let path = Path::new(CASES).join("misspelled_keys.yaml");
    let diagnostics = compose(&path, Path::new(ROOT)).expect_err("it is broken");
    snapshot(
        "as_json",
        &serde_json::to_string_pretty(&diagnostics).unwrap(),
    );
    snapshot("as_lines", &diagnostics.to_string());
    let coloured = diagnostics.render(Rendering::Colour);
    assert!(coloured.contains("\u{1b}["), "no colour:\n{coloured}");
}

#[test]
fn a_missing_file_is_named() {
    let path = Path::new(CASES).join("nowhere.yaml");
    snapshot("missing_file", &told(&compose(&path, Path::new(ROOT))));
    snapshot(
        "missing_name",
        &told(&compose_named("plat", Path::new(ROOT))),
    );
    let elsewhere = compose_named("plate", Path::new("tests/snapshots"));
    snapshot("missing_tasks", &told(&elsewhere));
    assert!(
        compose(Path::new(CASES), Path::new(ROOT)).is_err(),
        "a folder is no file"
    );
}

#[test]
fn a_task_is_found_by_its_name_as_by_its_path() {
    let root = Path::new(ROOT);
    let path = Path::new(ROOT).join("tasks/plate.yaml");
    let by_path = load_task_named(&path.to_string_lossy(), root).expect("it is there");
    let by_name = load_task_named("plate", root).expect("it is there");
    assert_eq!(by_name.task, by_path.task);
    let error = load_task_named("plat", root).expect_err("there is none");
    let told = error.render(Rendering::Plain);
    for part in ["there is no task 'plat'", "did you mean 'plate'?"] {
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn huge_files_are_refused_quickly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.yaml");
    fs::write(&path, "do: [cup]\n".repeat(1_000_000)).unwrap();
    let start = Instant::now();
    let error = compose(&path, Path::new(ROOT)).expect_err("too large");
    assert!(error.to_string().contains("larger than 256 KiB"), "{error}");
    let many = format!("do: [{}]", "cup, ".repeat(30_000));
    let error = compose_source(&Source::new("many.yaml", many), Path::new(ROOT)).unwrap_err();
    assert!(
        error.to_string().contains("more than 10000 values"),
        "{error}"
    );
    let mut keys = String::new();
    for i in 0..9_000 {
        writeln!(keys, "key{}: 1", i / 2).unwrap();
    }
    let error = compose_source(&Source::new("keys.yaml", keys), Path::new(ROOT)).unwrap_err();
    assert!(error.len() > 2_000, "{}", error.len());
    assert!(error.render(Rendering::Plain).contains("more\n"));
    assert!(start.elapsed() < MAX_TIME, "{:?}", start.elapsed());
}

/// Every prefix of a sound file, and every file with one byte changed, gives an answer.
#[test]
fn no_damage_makes_it_panic() {
    let path = Path::new(CASES).join("good_with_everything.yaml");
    let text = fs::read_to_string(path).unwrap();
    for end in (0..text.len()).filter(|i| text.is_char_boundary(*i)) {
        let source = Source::new("prefix.yaml", &text[..end]);
        told(&compose_source(&source, Path::new(ROOT)));
    }
    for at in 0..text.len() {
        for damage in [":", "\"", "{", "]", "\n", "é", "*", "%"] {
            let damaged = format!("{}{damage}{}", &text[..at], &text[at + 1..]);
            let source = Source::new("damaged.yaml", damaged);
            told(&compose_source(&source, Path::new(ROOT)));
        }
    }
}

#[test]
fn shipped_files_resolve() {
    let root = Path::new("");
    for name in ["sock", "trash", "wine"] {
        let path = PathBuf::from(format!("tasks/{name}.yaml"));
        load_task(&path, root).unwrap_or_else(|e| panic!("{}", e.render(Rendering::Plain)));
        snapshot(
            &format!("shipped_{name}"),
            &told(&compose_named(name, root)),
        );
    }
    for name in ["sock_then_trash", "trash_then_sock", "tidy_room"] {
        let result = compose_named(name, root);
        assert!(
            result.as_ref().is_ok_and(|c| c.warnings.is_empty()),
            "{}",
            told(&result)
        );
        snapshot(&format!("shipped_{name}"), &told(&result));
    }
}
