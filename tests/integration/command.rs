//! The command as a user types it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread;
use std::time::Duration;

use catena::experiment::ChainingMethod;

pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

pub(crate) fn catena(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_catena"))
        .args(arguments)
        .current_dir(root())
        .output()
        .expect("the command starts")
}

/// Waits until something is so, looking often, a minute at most.
pub(crate) fn wait_until(is_so: impl Fn() -> bool) {
    for _ in 0..6000 {
        if is_so() {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
}

pub(crate) fn text(output: &[u8]) -> String {
    String::from_utf8_lossy(output).into_owned()
}

pub(crate) fn succeeded(arguments: &[&str]) -> String {
    let output = catena(arguments);
    assert!(
        output.status.success(),
        "catena {arguments:?}\n{}{}",
        text(&output.stdout),
        text(&output.stderr)
    );
    text(&output.stdout)
}

pub(crate) fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// What a file of JSON holds.
pub(crate) fn json_of(file: &Path) -> serde_json::Value {
    let bytes = fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    serde_json::from_slice(&bytes).expect("JSON")
}

fn bytes_of(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(folder)
        .expect("the folder is there")
        .map(|entry| entry.expect("an entry"))
        .map(|e| {
            (
                e.file_name().to_string_lossy().into_owned(),
                fs::read(e.path()).expect("a file"),
            )
        })
        .collect();
    files.sort();
    files
}

/// The shipped chain with at most 8 steps, as a file in a folder.
fn short_run(folder: &Path) -> PathBuf {
    run_of_steps(folder, 8)
}

fn run_of_steps(folder: &Path, steps: u32) -> PathBuf {
    let file = folder.join("short_run.yaml");
    let yaml = fs::read_to_string(root().join("tasks/sequences/sock_then_trash.yaml"))
        .expect("the composition")
        .replace("name: sock_then_trash", "name: short_run")
        .replace(
            "limits: {steps: 400}",
            &format!("limits: {{steps: {steps}}}"),
        );
    fs::write(&file, yaml).expect("written");
    file
}

#[test]
fn recording_goes_on_where_it_was_killed_and_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (once, twice) = (folder.path().join("once"), folder.path().join("twice"));
    let record = |demos: &str, out: &Path| {
        succeeded(&[
            "record",
            "wine",
            "--demos",
            demos,
            "--seed",
            "3",
            "--out",
            path(out),
        ])
    };
    record("2", &once);
    record("1", &twice);
    // What a killed process leaves: a draft beside the finished recordings.
    fs::write(twice.join(".wine_03000001.mcap.draft"), b"half a recording").expect("written");
    record("2", &twice);
    let finished = |folder: &Path| {
        let mut files = bytes_of(folder);
        files.retain(|(name, _)| !name.starts_with('.'));
        files
    };
    assert_eq!(finished(&once).len(), 2);
    assert_eq!(finished(&once), finished(&twice));
    let report = succeeded(&["demos", path(&twice)]);
    assert!(
        report.contains("head 90x160") && report.contains("15 primitives"),
        "{report}"
    );
}

#[test]
fn demonstrations_become_a_model_and_a_graph_that_belong_together() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    succeeded(&[
        "record",
        "wine",
        "--demos",
        "3",
        "--seed",
        "4",
        "--out",
        path(&at("wine")),
    ]);
    let train = |model: &Path, seed: &str| {
        succeeded(&[
            "train",
            path(&at("wine")),
            "--out",
            path(model),
            "--preset",
            "tiny",
            "--steps",
            "20",
            "--seed",
            seed,
        ])
    };
    train(&at("model"), "1");
    train(&at("other"), "2");
    let build = |model: &Path, out: &Path| {
        catena(&[
            "graph",
            "build",
            "tasks/wine.yaml",
            "--demos",
            path(&at("wine")),
            "--model",
            path(model),
            "--out",
            path(out),
        ])
    };
    assert!(build(&at("model"), &at("graph")).status.success());
    assert!(build(&at("other"), &at("other_graph")).status.success());
    let again = text(&build(&at("model"), &at("graph")).stdout);
    assert!(again.contains("up to date"), "{again}");
    let shown = succeeded(&["graph", "show", path(&at("graph"))]);
    assert!(shown.contains("wine"), "{shown}");
    let merged = catena(&[
        "graph",
        "merge",
        path(&at("graph")),
        path(&at("other_graph")),
        "--model",
        path(&at("model")),
        "--out",
        path(&at("merged")),
    ]);
    assert!(!merged.status.success(), "graphs of two models were merged");
    assert!(
        text(&merged.stderr).contains("model"),
        "{}",
        text(&merged.stderr)
    );
    assert!(!at("merged").exists(), "a refused merge leaves nothing");
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_enough_ends_the_command_without_a_word() {
    let piped = Command::new("sh")
        .args([
            "-c",
            "\"$0\" graph show graphs/bedroom/sock --json | head -c 1",
        ])
        .arg(env!("CARGO_BIN_EXE_catena"))
        .current_dir(root())
        .output()
        .expect("a shell");
    assert_eq!(text(&piped.stdout), "{");
    assert_eq!(text(&piped.stderr), "");
}

#[test]
fn suspect_edges_of_a_shipped_graph_are_listed() {
    let show = |more: &[&str]| {
        let words = [&["graph", "show", "graphs/bedroom/sock"], more].concat();
        succeeded(&words)
    };
    let json = show(&["--suspects", "--json"]);
    let shown: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let suspects = shown["suspects"].as_array().expect("a list");
    assert!(!suspects.is_empty(), "the shipped graph has some");
    for suspect in suspects {
        let steps = suspect["edge"]["steps"].as_f64().expect("a number");
        let progress = suspect["progress_steps"].as_f64().expect("a number");
        assert!(progress - steps >= 12.0, "{suspect}");
    }
    let text = show(&["--suspects"]);
    let counted = format!("\n{} of ", suspects.len());
    assert!(text.contains(&counted), "{text}");
    assert!(!show(&["--json"]).contains("suspects"));
}

#[test]
fn the_shipped_chain_is_planned_without_a_shortcut() {
    let json = succeeded(&["compose", "tasks/sequences/sock_then_trash.yaml", "--json"]);
    let plan: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(plan["tasks"], serde_json::json!(["sock", "trash"]));
    assert_eq!(plan["audit"]["shortcuts"], serde_json::json!([]));
    assert_eq!(plan["audit"]["missed"], serde_json::json!([]));
    let last = plan["final_state"].as_str().expect("a state");
    assert!(last.starts_with("trash"), "{last}");
}

#[test]
fn any_order_finds_the_order_in_which_the_shipped_tasks_connect() {
    let plan = |file: &str| -> serde_json::Value {
        serde_json::from_str(&succeeded(&["compose", file, "--json"])).expect("JSON")
    };
    let found = plan("tasks/sequences/tidy_any_order.yaml");
    assert_eq!(found["orders"], 6);
    assert_eq!(found["tasks"], serde_json::json!(["sock", "trash", "wine"]));
    let written = plan("tasks/sequences/tidy_room.yaml");
    assert_eq!(written["orders"], 1);
    assert_eq!(found["route"], written["route"]);
}

#[test]
fn a_run_leaves_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = short_run(folder.path());
    let out = folder.path().join("out");
    let printed = succeeded(&["run", path(&file), "--out", path(&out)]);
    assert!(
        printed.contains("missed") && printed.contains("drawer_open"),
        "{printed}"
    );
    for name in [
        "rollout.mcap",
        "rollout.rrd",
        "merged_graph.svg",
        "summary.json",
    ] {
        let length = fs::metadata(out.join(name)).expect(name).len();
        assert!(length > 1000, "{name} has {length} bytes");
    }
    let summary = json_of(&out.join("summary.json"));
    assert_eq!(summary["result"]["steps"], 8);
    assert_eq!(summary["success"], false);
    let report = succeeded(&["demos", path(&out.join("rollout.mcap"))]);
    assert!(report.contains("/plan"), "{report}");
}

#[test]
fn a_run_goes_on_from_the_stage_that_an_earlier_one_had_come_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = run_of_steps(folder.path(), 30);
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    succeeded(&["run", path(&file), "--out", path(&first)]);
    let recording = first.join("rollout.mcap");
    let resume = |stage: &str, more: &[&str]| {
        let words = [
            "run",
            path(&file),
            "--resume",
            stage,
            "--out",
            path(&second),
        ];
        catena(&[&words[..], more].concat())
    };
    let output = resume("drawer_open", &["--from", path(&recording)]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let [before, after] = [&first, &second].map(|folder| json_of(&folder.join("summary.json")));
    let reached = &before["subgoals"][0]["step"];
    assert!(reached.is_u64(), "the drawer was opened: {before}");
    assert_eq!(&after["resumed"]["replayed_steps"], reached);
    assert_eq!(&after["subgoals"][0]["step"], reached);
    assert_eq!(after["resumed"]["stage"], 1);
    assert_eq!(after["seed"], before["seed"]);
    // Each event has the time of its own step.
    let bytes = fs::read(&recording).expect("the recording");
    let messages = mcap::MessageStream::new(&bytes).expect("an MCAP file");
    let mut events = 0;
    for message in messages {
        let message = message.expect("a message");
        if message.channel.topic == "/event" {
            let event: serde_json::Value = serde_json::from_slice(&message.data).expect("JSON");
            let step = event["step"].as_u64().expect("a number");
            let secs = step as f64 * catena::simulator::PRIMITIVE_SECS;
            assert_eq!(message.log_time, (secs * 1e9).round() as u64, "{event}");
            events += 1;
        }
    }
    assert!(events > 0, "at least that the drawer is open");
    // The recording that is gone on from is not replaced.
    let into_itself = ["--from", path(&recording), "--out", path(&first)];
    let words = ["run", path(&file), "--resume", "drawer_open"];
    let output = catena(&[&words[..], &into_itself].concat());
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("would take its place"),
        "{said}"
    );
    assert_eq!(fs::read(&recording).expect("the recording"), bytes);
    // The recording of a run that was gone on with has no beginning.
    let (resumed, third) = (second.join("rollout.mcap"), folder.path().join("third"));
    let from_resumed = ["--from", path(&resumed), "--out", path(&third)];
    let output = catena(&[&words[..], &from_resumed].concat());
    let said = text(&output.stderr);
    assert!(
        said.contains("begins in the middle of a run") && said.contains(path(&recording)),
        "{said}"
    );
    // What had not been reached cannot be gone on from, nor what is not there.
    let output = resume("4", &["--from", path(&recording)]);
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("never reached"),
        "{said}"
    );
    let output = resume("drawer_opened", &[]);
    assert!(text(&output.stderr).contains("it can from: the beginning (0), drawer_open (1)"));
    let output = resume("1", &[]);
    assert!(text(&output.stderr).contains("no recording to resume from"));
}

#[test]
fn a_plan_is_explained_in_words_and_as_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let compose = |more: &[&str]| {
        let words = [
            "compose",
            "tasks/sequences/tidy_any_order.yaml",
            "--explain",
            "--out",
        ];
        succeeded(&[&words[..], &[path(&out)], more].concat())
    };
    let explained: serde_json::Value = serde_json::from_str(&compose(&["--json"])).expect("JSON");
    let explanation = &explained["explanation"];
    assert_eq!(explanation["orders"]["planned"], 6);
    let orders = explanation["orders"]["listed"].as_array().expect("orders");
    assert_eq!(orders[0]["is_chosen"], true);
    assert_eq!(orders[0]["tasks"], explained["tasks"]);
    let parts = explanation["parts"].as_array().expect("parts");
    let steps: u64 = parts
        .iter()
        .map(|p| p["steps"].as_u64().expect("a number"))
        .sum();
    assert_eq!(explained["steps"], steps);
    let edges = explanation["odds"]["predicted_edges"]
        .as_array()
        .expect("edges");
    let product: f64 = edges
        .iter()
        .map(|e| e["connected_probability"].as_f64().expect("a probability"))
        .product();
    let holds = explanation["odds"]["probability"]
        .as_f64()
        .expect("a probability");
    assert!((holds - product).abs() < 1e-6, "{holds} for {product}");
    let words = compose(&[]);
    for part in [
        "in any order",
        "does not connect",
        "the end of sock",
        "onward",
        "the end of wine",
    ] {
        assert!(words.contains(part), "{part} is missing:\n{words}");
    }
    assert!(out.join("automaton.svg").is_file());
}

#[test]
fn a_choice_of_tasks_has_no_seam_between_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("one_of_two.yaml");
    let yaml = "name: one_of_two\n\
                model: graphs/bedroom/model\n\
                environment: {bedroom: {start: sock}}\n\
                do: {choice: [sock, trash]}\n";
    fs::write(&file, yaml).expect("written");
    let words = succeeded(&["compose", path(&file)]);
    assert!(words.contains("audit of the plan"), "{words}");
    assert!(!words.contains("seam "), "{words}");
}

#[test]
fn gaps_name_every_seam_with_its_near_misses_and_the_demonstration_to_record() {
    let sequence = "tasks/sequences/tidy_room.yaml";
    let json = succeeded(&["graph", "gaps", sequence, "--json"]);
    let report: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let seams = report["seams"].as_array().expect("seams");
    let ends: Vec<_> = seams
        .iter()
        .map(|s| (s["from_task"].as_str(), s["to_task"].as_str()))
        .collect();
    let expected = [("sock", "trash"), ("trash", "wine")].map(|(a, b)| (Some(a), Some(b)));
    assert_eq!(ends, expected);
    for seam in seams {
        let misses = seam["near_misses"].as_array().expect("near misses");
        let place = |miss: &serde_json::Value, end: &str, task: &str| {
            assert!(miss[end].as_str().expect("a place").starts_with(task));
        };
        for miss in misses {
            place(miss, "from", seam["from_task"].as_str().expect("a task"));
            place(miss, "to", seam["to_task"].as_str().expect("a task"));
            assert!(miss["pictures"][0].is_string() && miss["pictures"][1].is_string());
        }
        let sure: Vec<_> = misses
            .iter()
            .map(|m| m["connected_probability"].as_f64().expect("a probability"))
            .collect();
        assert!(
            !sure.is_empty() && sure.is_sorted_by(|a, b| a >= b),
            "{sure:?}"
        );
    }
    let wish = &report["most_helpful"];
    assert!(wish["from"].is_string() && wish["to"].is_string(), "{wish}");
    let words = succeeded(&["graph", "gaps", sequence]);
    assert!(words.contains("sock -> trash: connect in"), "{words}");
    assert!(words.contains("one more demonstration would help most from"));
}

#[test]
fn a_task_that_is_done_twice_is_judged_on_one_folder_of_recordings() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("twice.yaml");
    let yaml =
        "name: twice\nmodel: graphs/bedroom/model\ndo:\n  - repeat: {times: 2, do: [trash]}\n";
    fs::write(&file, yaml).expect("written");
    let refused = |recordings: &[&str]| {
        let words = ["graph", "trust", path(&file), "--demos"];
        let output = catena(&[&words[..], recordings].concat());
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let said = refused(&["/nowhere/trash", "/nowhere/again"]);
    assert!(said.contains("names 2 folders for 1 task; "), "{said}");
    let said = refused(&["/nowhere/trash"]);
    assert!(said.contains("/nowhere/trash"), "{said}");
}

#[test]
fn shortcuts_are_looked_for_with_the_planner_and_the_states_that_are_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = short_run(folder.path());
    let evaluate = |more: &[&str]| {
        let words = ["evaluate", "shortcuts", "--composition", path(&file)];
        succeeded(&[&words[..], &["--nearest-states", "50"], more].concat())
    };
    let json = evaluate(&["--episodes", "3", "--planner", "unconstrained", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let drives: Vec<_> = report["drives"]
        .as_array()
        .expect("drives")
        .iter()
        .collect();
    let names: Vec<_> = drives
        .iter()
        .map(|d| d["drive"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, ["papers_way", "last_task", "skipper"]);
    assert!(drives.iter().all(|d| d["episodes"] == 1), "{drives:?}");
    let words = evaluate(&["--episodes", "1"]);
    assert!(words.contains("short_run: 1 episode from seed"), "{words}");
    assert!(words.contains("subgoals in order (1 episode)"), "{words}");
}

#[test]
fn an_evaluation_leads_the_robot_over_the_last_steps_or_leaves_them_to_the_policy() {
    let evaluated = |last_steps: &str| {
        let words = [
            "evaluate",
            "wine",
            "--episodes",
            "1",
            "--seed",
            "500",
            "--json",
        ];
        let json = succeeded(&[&words[..], &["--last-steps", last_steps]].concat());
        let evaluation: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        evaluation["results"][0].clone()
    };
    let [led, alone] = ["led", "policy"].map(evaluated);
    assert_eq!(led["success"], true, "{led}");
    assert_ne!(led["steps"], alone["steps"], "{alone}");
}

#[test]
fn guards_that_were_measured_on_another_number_of_episodes_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (short_run(folder.path()), folder.path().join("cells"));
    let chaining = |episodes: &str| {
        let words = ["experiment", "chaining", path(&file), "--episodes"];
        succeeded(&[&words[..], &[episodes, "--out", path(&out)]].concat())
    };
    chaining("1");
    let cell = json_of(&out.join("no_filter.json"));
    let command = cell["commands"][0].as_str().unwrap_or_default();
    assert!(
        command.starts_with("catena experiment chaining ") && command.contains("--episodes 1"),
        "{command}"
    );
    assert!(cell["digests"]["graph of trash"].is_string());
    let before = bytes_of(&out);
    let said = chaining("2");
    let kept = said.matches("(1 episode, not 2; --replace").count();
    assert_eq!(kept, ChainingMethod::ALL.len(), "{said}");
    assert_eq!(bytes_of(&out), before);
}

#[test]
fn a_wrong_composition_is_refused_with_its_line() {
    let output = catena(&[
        "compose",
        "tests/diagnostics/compositions/unknown_task.yaml",
    ]);
    assert!(!output.status.success());
    let said = text(&output.stderr);
    assert!(said.contains("unknown_task.yaml"), "{said}");
}

#[test]
fn what_would_be_lost_is_refused_before_anything_is_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("precious")).expect("a folder");
    fs::write(at("precious/thesis.tex"), "years").expect("a file");
    fs::create_dir(at("trash")).expect("a folder");
    for (name, bytes) in bytes_of(&root().join("graphs/bedroom/trash")) {
        fs::write(at("trash").join(name), bytes).expect("a copy");
    }
    let before = bytes_of(&at("trash"));
    let merged_into = |out: &Path| {
        let trash = at("trash");
        let graphs = ["graph", "merge", path(&trash), "graphs/bedroom/wine"];
        let words = ["--model", "graphs/bedroom/model", "--out", path(out)];
        let output = catena(&[graphs, words].concat());
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let said = merged_into(&at("precious"));
    assert!(said.contains("holds thesis.tex"), "{said}");
    let trained_into = |out: &Path, more: &[&str]| {
        let words = ["train", "demos/none", "--out", path(out)];
        let output = catena(&[&words[..], more].concat());
        assert!(!output.status.success());
        text(&output.stderr)
    };
    let practised = [
        "--practice",
        "demos/none",
        "--keep-networks",
        "graphs/bedroom/model",
    ];
    let ours: &[&str] = &[];
    for more in [ours, &["--method", "bc"], &practised] {
        let said = trained_into(&at("precious"), more);
        assert!(said.contains("holds thesis.tex"), "{said}");
    }
    let run = at("model").join("run");
    let said = trained_into(&at("model"), &["--run", path(&run)]);
    assert!(said.contains("lies in the model's folder"), "{said}");
    let said = merged_into(&at("trash"));
    assert!(said.contains("is one of the graphs to be merged"), "{said}");
    assert_eq!(bytes_of(&at("trash")), before);
    assert!(at("precious/thesis.tex").exists());
}

#[test]
fn numbers_that_measure_nothing_are_refused_by_name() {
    let refused = |words: &[&str]| {
        let output = catena(words);
        assert!(!output.status.success(), "{words:?}");
        text(&output.stderr)
    };
    let numbers = [
        (&["evaluate", "sock", "--episodes", "0"][..], "--episodes"),
        (&["experiment", "chaining", "--episodes", "0"], "--episodes"),
        (
            &["experiment", "fig6", "--demonstrations", "0"],
            "--demonstrations",
        ),
        (&["experiment", "table1", "--steps", "0"], "--steps"),
        (
            &["train", "demos", "--out", "model", "--minutes=-5"],
            "--minutes",
        ),
        (
            &["train", "demos", "--out", "model", "--bins", "0"],
            "--bins",
        ),
        (
            &["serve", "sock", "--max-connections", "0"],
            "--max-connections",
        ),
    ];
    for (words, flag) in numbers {
        let said = refused(words);
        assert!(said.contains(flag), "{words:?}: {said}");
    }
    let said = refused(&["evaluate", "sock", "--composition", "chain.yaml"]);
    assert!(said.contains("catena evaluate chain.yaml"), "{said}");
}
