//! The house keeps its floors: imports go strictly downward, and crates stay in their rooms.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms with their floors; a room may import from lower floors only.
const FLOORS: &[(&str, u32)] = &[
    ("wording", 0),
    ("lock", 0),
    ("hidden", 0),
    ("trajectory", 0),
    ("task", 1),
    ("model", 1),
    ("environment", 1),
    ("graph", 2),
    ("planner", 3),
    ("inference", 3),
    ("training", 3),
    ("simulator", 3),
    ("storage", 3),
    ("composer", 4),
    ("loading", 5),
    ("rollout", 5),
    ("experiment", 6),
    ("serve", 6),
    ("view", 6),
    ("cli", 7),
];

/// Crates with the rooms that may name them.
const CONFINED: &[(&str, &[&str])] = &[
    ("rerun", &["view"]),
    ("mcap", &["storage"]),
    ("parquet", &["storage"]),
    ("arrow", &["storage"]),
    ("serde_yaml", &["composer", "storage"]),
    ("burn", &["training"]),
    ("ort", &["inference"]),
    ("ort_tract", &["inference"]),
    ("libloading", &["inference"]),
    ("rapier3d", &["simulator"]),
    ("axum", &["serve"]),
    ("hyper", &["serve"]),
    ("hyper_util", &["serve"]),
    ("tokio", &["serve"]),
    ("rmp_serde", &["serve"]),
    ("subtle", &["serve"]),
    ("clap", &["cli"]),
    ("indicatif", &["cli"]),
    ("petgraph", &["graph", "planner"]),
    ("linfa", &["graph"]),
    ("linfa_clustering", &["graph"]),
    ("linfa_logistic", &["graph"]),
    ("ndarray", &["graph"]),
];

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the entry can be read").path();
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Room of a source file, its path for messages, and its lines of code.
fn sources() -> Vec<(String, String, Vec<String>)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let relative = path.strip_prefix(&src).expect("below src").to_owned();
            let first = relative.components().next().expect("a name");
            let room = Path::new(first.as_os_str())
                .file_stem()
                .expect("a stem")
                .to_string_lossy()
                .into_owned();
            let text = fs::read_to_string(&path).expect("a source file");
            (room, relative.display().to_string(), code_lines(&text))
        })
        .filter(|(room, ..)| room != "lib" && room != "main")
        // Tests of a room may compare it with another one of its floor.
        .filter(|(_, file, _)| !file.contains("/tests/") && !file.ends_with("/tests.rs"))
        .collect()
}

/// The lines of a formatted source file without comments; those of items that only tests have are empty.
fn code_lines(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    // How far the item that is left out is indented.
    let mut left_out: Option<usize> = None;
    for line in text.lines() {
        let code = line.trim_start();
        let indent = line.len() - code.len();
        if left_out.is_none() && code.starts_with("#[cfg(test)]") {
            left_out = Some(indent);
        } else if left_out.is_none() {
            lines.push(line.split("//").next().unwrap_or_default().to_owned());
            continue;
        } else if left_out == Some(indent) && !code.starts_with('#') && code.ends_with([';', '}']) {
            left_out = None;
        }
        lines.push(String::new());
    }
    lines
}

#[test]
fn code_between_items_of_tests_is_looked_at() {
    let text = "use a;\n#[cfg(test)]\nmod fakes;\nuse b; // c\n#[cfg(test)]\n#[d]\nmod tests {\n    use e;\n}\nuse f;";
    let lines = code_lines(text);
    assert_eq!(
        lines,
        ["use a;", "", "", "use b; ", "", "", "", "", "", "use f;"]
    );
}

fn floor(room: &str) -> u32 {
    FLOORS
        .iter()
        .find(|(name, _)| *name == room)
        .unwrap_or_else(|| panic!("room '{room}' has no floor: add it to FLOORS"))
        .1
}

/// Identifiers that follow `prefix` in a line, with what stands before the prefix.
fn names_after<'a>(line: &'a str, prefix: &str) -> Vec<&'a str> {
    line.match_indices(prefix)
        .map(|(at, _)| {
            let rest = &line[at + prefix.len()..];
            let end = rest
                .find(|c: char| !c.is_alphanumeric() && c != '_')
                .unwrap_or(rest.len());
            &rest[..end]
        })
        .collect()
}

#[test]
fn imports_go_down() {
    let mut faults = Vec::new();
    for (room, file, lines) in sources() {
        for (number, line) in lines.iter().enumerate() {
            for used in names_after(line, "crate::") {
                let goes_down = used == room
                    || FLOORS.iter().all(|(name, _)| *name != used)
                    || floor(used) < floor(&room);
                if !goes_down {
                    faults.push(format!("{file}:{}: {room} uses {used}", number + 1));
                }
            }
        }
    }
    assert!(
        faults.is_empty(),
        "imports that go up:\n{}",
        faults.join("\n")
    );
}

#[test]
fn crates_stay_in_their_rooms() {
    let mut faults = Vec::new();
    for (room, file, lines) in sources() {
        for (number, line) in lines.iter().enumerate() {
            for (name, rooms) in CONFINED {
                let path = format!("{name}::");
                let named = line.match_indices(&path).any(|(at, _)| {
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
                });
                if named && !rooms.contains(&room.as_str()) {
                    faults.push(format!("{file}:{}: {room} uses {name}", number + 1));
                }
            }
        }
    }
    assert!(
        faults.is_empty(),
        "crates out of their rooms:\n{}",
        faults.join("\n")
    );
}

#[test]
fn no_mod_rs_and_no_catch_all_rooms() {
    for (_, file, _) in sources() {
        assert!(
            !file.ends_with("mod.rs"),
            "{file}: write foo.rs beside foo/"
        );
        for word in ["util", "common", "helper"] {
            assert!(
                !file.contains(word),
                "{file}: name the concept, not '{word}'"
            );
        }
    }
}

#[test]
fn errors_may_grow() {
    let mut faults = Vec::new();
    for (_, file, lines) in sources() {
        for (at, line) in lines.iter().enumerate() {
            let is_error = |name: &&str| name.ends_with("Error");
            let Some(name) = names_after(line, "pub enum ").into_iter().find(is_error) else {
                continue;
            };
            let above = lines[..at].iter().rev().map(|l| l.trim());
            let mut attributes = above.take_while(|l| l.is_empty() || l.starts_with('#'));
            if !attributes.any(|l| l == "#[non_exhaustive]") {
                faults.push(format!("{file}:{}: {name}", at + 1));
            }
        }
    }
    assert!(
        faults.is_empty(),
        "errors without #[non_exhaustive], to which nothing can be added:\n{}",
        faults.join("\n")
    );
}
