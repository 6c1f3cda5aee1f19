//! The JSON Schemas that editors check tasks and compositions with say what the composer says.
//!
//! They use a small part of JSON Schema, which is checked here: a validator of all of it would have
//! `serde_json` compiled with other features for tests than for the program.

use std::fs;
use std::path::{Path, PathBuf};

use catena::composer::compose;
use catena::simulator::{BedroomConfig, Variation};
use catena::storage::{ReadOptions, Recordings};
use serde_json::Value;

use super::command::root;
use super::language::examples;

/// What is wrong with a value by a schema, if anything is.
fn fault(schema: &Value, value: &Value, whole: &Value) -> Option<String> {
    let rules = schema.as_object().expect("a schema is an object");
    rules
        .iter()
        .find_map(|(rule, given)| broken(rule, given, schema, value, whole))
}

fn broken(
    rule: &str,
    given: &Value,
    schema: &Value,
    value: &Value,
    whole: &Value,
) -> Option<String> {
    let told = |is_sound: bool| (!is_sound).then(|| format!("{value} breaks {rule}: {given}"));
    let number = || given.as_f64().expect("a bound is a number");
    let text = || value.as_str().unwrap_or_default();
    let count = given.as_u64().unwrap_or(0) as usize;
    match rule {
        "$schema" | "title" | "description" | "definitions" => None,
        "$ref" => {
            let place = given.as_str().expect("a place").trim_start_matches('#');
            fault(
                whole.pointer(place).expect("the definition is there"),
                value,
                whole,
            )
        }
        "type" => told(match given.as_str().expect("one type") {
            "object" => value.is_object(),
            "array" => value.is_array(),
            "string" => value.is_string(),
            "integer" => value.is_u64(),
            "number" => value.is_number(),
            "boolean" => value.is_boolean(),
            other => panic!("type {other}"),
        }),
        "enum" => told(given.as_array().expect("words").contains(value)),
        "anyOf" => told(
            given
                .as_array()
                .expect("schemas")
                .iter()
                .any(|one| fault(one, value, whole).is_none()),
        ),
        "exclusiveMinimum" => told(value.as_f64().is_none_or(|v| v > number())),
        "minimum" => told(value.as_f64().is_none_or(|v| v >= number())),
        "maximum" => told(value.as_f64().is_none_or(|v| v <= number())),
        "minItems" => told(value.as_array().is_none_or(|v| v.len() >= count)),
        "minLength" => told(!value.is_string() || text().chars().count() >= count),
        "maxLength" => told(!value.is_string() || text().chars().count() <= count),
        "minProperties" => told(value.as_object().is_none_or(|v| v.len() >= count)),
        "maxProperties" => told(value.as_object().is_none_or(|v| v.len() <= count)),
        "pattern" => told(!value.is_string() || matches(given.as_str().expect("text"), text())),
        "required" => given.as_array().expect("keys").iter().find_map(|key| {
            let is_missing = value.as_object()?.get(key.as_str()?).is_none();
            is_missing.then(|| format!("{key} is missing"))
        }),
        "items" => value
            .as_array()?
            .iter()
            .find_map(|item| fault(given, item, whole)),
        "properties" => value.as_object()?.iter().find_map(|(key, value)| {
            fault(given.get(key)?, value, whole).map(|f| format!("{key}: {f}"))
        }),
        "additionalProperties" => value.as_object()?.iter().find_map(|(key, value)| {
            let is_known = schema.get("properties").and_then(|p| p.get(key)).is_some();
            match given {
                _ if is_known => None,
                Value::Bool(false) => Some(format!("unknown key {key}")),
                other => fault(other, value, whole).map(|f| format!("{key}: {f}")),
            }
        }),
        "not" => told(fault(given, value, whole).is_some()),
        other => panic!("the check does not know the rule {other}"),
    }
}

/// The two patterns that the schemas use.
fn matches(pattern: &str, text: &str) -> bool {
    let is_number = |t: &str| t.chars().all(|c| c.is_ascii_digit());
    match pattern {
        "^[A-Za-z0-9_][A-Za-z0-9_-]*$" => {
            let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            !text.is_empty() && !text.starts_with('-') && text.chars().all(allowed)
        }
        r"^([0-9]+\.\.[0-9]*|\.\.[0-9]+)$" => text
            .split_once("..")
            .is_some_and(|(a, b)| is_number(a) && is_number(b) && !(a.is_empty() && b.is_empty())),
        other => panic!("the check does not know the pattern {other}"),
    }
}

fn schema(name: &str) -> Value {
    let path = root().join(format!("tasks/schema/{name}.schema.json"));
    serde_json::from_str(&fs::read_to_string(path).expect("the schema")).expect("JSON")
}

/// What the schema that a file is meant for says of it; `None` for what is no YAML at all.
fn judged(text: &str) -> Option<Result<(), String>> {
    let value: Value = serde_yaml::from_str(text).ok()?;
    let is_task = value.get("subgoals").is_some() && value.get("do").is_none();
    let schema = schema(if is_task { "task" } else { "composition" });
    Some(fault(&schema, &value, &schema).map_or(Ok(()), Err))
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("the folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths
        .filter(|p| p.extension().is_some_and(|e| e == "yaml"))
        .collect()
}

#[test]
fn shipped_files_and_examples_are_sound() {
    let shipped = ["tasks", "tasks/sequences"].map(files).concat();
    assert!(shipped.len() >= 7, "{shipped:?}");
    for path in shipped {
        let text = fs::read_to_string(&path).expect("the file");
        assert_eq!(judged(&text), Some(Ok(())), "{}", path.display());
        let named = text.lines().next().and_then(|l| l.split_once("$schema="));
        let (_, schema) = named.unwrap_or_else(|| panic!("{} names no schema", path.display()));
        let beside = path.parent().expect("a folder").join(schema);
        assert!(beside.is_file(), "{} is not there", beside.display());
    }
    for (name, text) in examples() {
        assert_eq!(judged(&text), Some(Ok(())), "{name}");
    }
}

/// The page on one's own robot shows files of the example as they are, and names every key of a mapping file.
#[test]
fn mapping_files_of_the_example_are_sound_and_stand_on_the_page() {
    let page = fs::read_to_string(root().join("docs/your-own-robot.md")).expect("the page");
    let schema = schema("recordings");
    for name in ["carrot", "cup"] {
        let file = root().join(format!("examples/bridge/{name}.yaml"));
        let value: Value =
            serde_yaml::from_str(&fs::read_to_string(&file).expect("the file")).expect("YAML");
        assert_eq!(fault(&schema, &value, &schema), None, "{name}");
        let recordings = Recordings::open(&[file], &ReadOptions::default()).expect("it is sound");
        assert_eq!(recordings.tasks(), [name]);
        let (set, _) = recordings.demonstrations(name).expect("they are read");
        assert_eq!((set.trajectories().len(), set.step_count()), (3, 30));
        assert_eq!((set.cameras()[0].height, set.cameras()[0].width), (48, 64));
    }
    for file in [
        "carrot.yaml",
        "tasks/carrot.yaml",
        "tasks/sequences/cup_then_carrot.yaml",
    ] {
        let text = fs::read_to_string(root().join("examples/bridge").join(file)).expect("the file");
        assert!(page.contains(&text), "the page shows another {file}");
    }
    let mut open = vec![&schema];
    while let Some(value) = open.pop() {
        let keys = value.get("properties").and_then(|p| p.as_object());
        for key in keys.into_iter().flat_map(|k| k.keys()) {
            let is_named = [
                format!("{key}`"),
                format!(".{key}"),
                format!("{key}:"),
                format!("`{key}"),
            ];
            assert!(is_named.iter().any(|k| page.contains(k)), "{key}");
        }
        open.extend(value.as_object().into_iter().flat_map(|o| o.values()));
        open.extend(value.as_array().into_iter().flatten());
    }
}

/// What the schema refuses, the reader refuses.
#[test]
fn broken_mapping_files_are_refused_by_the_schema_too() {
    let schema = schema("recordings");
    for text in [
        "recordings: []",
        "task: cup",
        "recordings: a\nevery: 0",
        "recordings: a\nrate_hz: fast",
        "recordings: a\ntopcis: {}",
        "recordings: a\nactions: {spacing: log}",
        "recordings: a\nactions: {bins: 0}",
        "recordings: a\nimage_size: {height: 4}",
        "recordings: a\nimage_sizes: {head: {height: 4}}",
        "recordings: a\nimage_sizes: {head: {height: 4, width: 0}}",
        "recordings: a\ntopics: {cameras: {head: [/a]}}",
        "recordings: a\nrate_hz: 0",
        "recordings: a\nrate_hz: 5\nevery: 2",
        "recordings: a\nactions: {dimensions: {x: {bin: 3}}}",
        "recordings: a\nactions: {dimensions: {x: {bins: 0}}}",
        "recordings: a\nactions: {dimensions: {x: {low: none}}}",
        "recordings: a\nactions: {dimensions: {x: {combine: all}}}",
    ] {
        let value: Value = serde_yaml::from_str(text).expect("YAML");
        assert!(fault(&schema, &value, &schema).is_some(), "{text}");
    }
}

/// What can be set in the bedroom has the limits of the simulator, in both schemas.
#[test]
fn settings_of_the_bedroom_are_those_of_the_simulator() {
    let most = serde_json::to_value(Variation::MOST).expect("it is data");
    let most = most.as_object().expect("a map");
    for name in ["task", "composition"] {
        let schema = schema(name);
        let bedroom = schema.pointer("/definitions/bedroom").expect("it is there");
        let ranges = bedroom["properties"]["variation"]["properties"].as_object();
        let ranges = ranges.expect("they are listed");
        assert_eq!(ranges.len(), most.len(), "{name}");
        for (key, largest) in most {
            let limit = ranges[key].get("maximum").and_then(Value::as_f64);
            let largest = largest.as_f64();
            let same = limit.zip(largest).map(|(a, b)| (a - b).abs() < 1e-6);
            assert!(same.unwrap_or(key == "appearance"), "{name}: {key}");
        }
        let judge = |settings: &str| {
            let value: Value = serde_yaml::from_str(settings).expect("YAML");
            (
                fault(bedroom, &value, &schema).is_none(),
                serde_json::from_value::<BedroomConfig>(value).is_ok(),
            )
        };
        for sound in [
            "{start: sock}",
            "{start: wine, level: hard, variation: {light: 0.1, appearance: false}}",
            "{start: trash, leftovers: varied, variation: {start_position_m: 0.3}}",
        ] {
            assert_eq!(judge(sound), (true, true), "{name}: {sound}");
        }
        for broken in [
            "{level: hard}",
            "{start: sok}",
            "{start: sock, levle: hard}",
            "{start: sock, leftovers: all}",
            "{start: sock, variation: {start_position_m: 3}}",
            "{start: sock, variation: {light: 1e39}}",
            "{start: sock, variation: {object_position_m: 0.08}}",
            "{start: sock, variation: {noise: 3}}",
            "{start: sock, variation: {appearance: 1}}",
        ] {
            assert_eq!(judge(broken), (false, false), "{name}: {broken}");
        }
    }
}

/// Faults in the shape of a file are faults by the schema too; what only the composer sees passes.
#[test]
fn broken_files_are_refused_where_their_shape_is_wrong() {
    let (mut refused, mut passed) = (Vec::new(), Vec::new());
    for path in files("tests/diagnostics/compositions") {
        let name = path
            .file_stem()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        match judged(&text) {
            None => {}
            Some(Ok(())) => passed.push(name),
            Some(Err(why)) => {
                let sound = compose(&path, Path::new("tests/diagnostics/project")).is_ok();
                assert!(!sound, "{name} is sound, but by the schema {why}");
                refused.push(name);
            }
        }
    }
    for name in [
        "misspelled_keys",
        "out_of_range",
        "wrong_types",
        "unknown_words",
        "empty_list",
        "repeat",
        "regions",
        "start",
        "start_from",
        "start_half_said",
        "regions_not_a_list",
    ] {
        assert!(
            refused.iter().any(|r| r == name),
            "{name} passes; refused are {refused:?}"
        );
    }
    for name in [
        "good_regions",
        "good_repeat",
        "good_containers",
        "unknown_task",
        "repeat_too_often",
    ] {
        assert!(passed.iter().any(|p| p == name), "{name} is refused");
    }
}
