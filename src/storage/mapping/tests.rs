use std::fs;

use super::*;
use crate::trajectory::{Action, ActionDimension, Decoding, Spacing};

fn parsed(text: &str) -> Result<Mapping, StorageError> {
    Mapping::parse(Path::new("Cargo.toml.yaml"), text)
}

fn sound(keys: &str) -> Mapping {
    parsed(&format!("recordings: Cargo.toml\n{keys}")).unwrap()
}

fn names(names: &[&str]) -> ActionSpace {
    ActionSpace::Continuous {
        names: names.iter().map(|n| (*n).to_owned()).collect(),
    }
}

#[test]
fn every_key_is_read() {
    let mapping = sound(
        "task: cup
topics:
  cameras: {head: /head/image, wrist: /wrist/image}
  action: /command
  task: /language
  subgoal: /reached
every: 3
image_size: {height: 90, width: 160}
image_sizes: {wrist: {height: 64, width: 64}}
actions:
  names: [x, y, spin, gripper]
  keep: [x, gripper]
  combine: sum
  bins: 11
  spacing: quantiles
  decoding: expectation
  dimensions:
    gripper: {bins: 2, spacing: uniform, low: 0, high: 1, decoding: centre, combine: last}
",
    );
    assert_eq!(mapping.task(), "cup");
    assert_eq!((mapping.every(), mapping.rate_hz()), (Some(3), None));
    assert_eq!(
        mapping.camera_of("/wrist/image"),
        SaidOfTopic::Camera("wrist")
    );
    assert_eq!(mapping.camera_of("/other"), SaidOfTopic::NoCamera);
    assert_eq!(mapping.image_size("wrist").map(|s| s.height), Some(64));
    assert_eq!(mapping.image_size("head").map(|s| s.width), Some(160));
    let binning = mapping.binning(21);
    assert_eq!(
        (binning.default.bins, binning.default.spacing),
        (11, Spacing::Quantiles)
    );
    let gripper = binning.of("gripper");
    assert_eq!((gripper.bins, gripper.high), (2, Some(1.0)));
    assert_eq!(gripper.decoding, Decoding::Centre);
    let recorded = names(&["action_0", "action_1", "action_2", "action_3"]);
    let shape = mapping.shape(Path::new("a.mcap"), &recorded).unwrap();
    assert_eq!(shape.space, names(&["x", "gripper"]));
    let actions = [
        Action::Continuous(vec![1.0, 9.0, 9.0, 0.0]),
        Action::Continuous(vec![2.0, 9.0, 9.0, 1.0]),
    ];
    let combined = shape.combined(&actions).unwrap();
    assert_eq!(combined, Action::Continuous(vec![3.0, 1.0]));
}

#[test]
fn what_is_not_said_is_left_as_it_is() {
    let mapping = sound("");
    assert_eq!(mapping.task(), "Cargo.toml");
    assert_eq!(mapping.camera_of("/any"), SaidOfTopic::Nothing);
    assert_eq!(mapping.binning(21), Binning::uniform(21));
    let space = names(&["x"]);
    assert_eq!(mapping.shape(Path::new("a"), &space).unwrap().space, space);
}

#[test]
fn paths_are_relative_to_the_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("cup")).unwrap();
    let path = folder.path().join("cup.yaml");
    fs::write(&path, "recordings: [cup]\n").unwrap();
    let mapping = Mapping::load(&path).unwrap();
    assert_eq!(mapping.recordings, [folder.path().join("cup")]);
    fs::write(&path, "recordings: [cupp]\n").unwrap();
    let error = Mapping::load(&path).unwrap_err().to_string();
    assert!(
        error.contains("cup.yaml:1:13") && error.contains("cupp"),
        "{error}"
    );
}

#[test]
fn the_mean_and_the_first_of_several_actions() {
    let shape = |combine: &str| {
        let mapping = sound(&format!("actions: {{combine: {combine}}}"));
        mapping.shape(Path::new("a"), &names(&["x"])).unwrap()
    };
    let actions = [1.0, 4.0, 7.0].map(|v| Action::Continuous(vec![v]));
    for (combine, expected) in [("mean", 4.0), ("first", 1.0), ("last", 7.0), ("sum", 12.0)] {
        let combined = shape(combine).combined(&actions).unwrap();
        assert_eq!(combined, Action::Continuous(vec![expected]), "{combine}");
    }
}

#[test]
fn keys_of_continuous_values_are_refused_where_actions_have_classes() {
    let names = ["left", "right"].map(str::to_owned).to_vec();
    let dimensions = vec![ActionDimension::uniform("x", 0.0, 1.0, 3)];
    let primitives = ActionSpace::Primitives { names };
    let binned = ActionSpace::Binned { dimensions };
    for (key, value) in [
        ("combine", "sum"),
        ("bins", "3"),
        ("spacing", "quantiles"),
        ("decoding", "expectation"),
        ("dimensions", "{x: {low: 0}}"),
    ] {
        let mapping = sound(&format!("actions:\n  {key}: {value}\n"));
        for space in [&primitives, &binned] {
            let shape = mapping.shape(Path::new("a.mcap"), space);
            let error = shape.unwrap_err().to_string();
            let told =
                format!(": the actions of a.mcap are {space}, to which '{key}' does not apply. ");
            assert!(error.starts_with("Cargo.toml.yaml:3:"), "{error}");
            assert!(error.contains(&told), "{error}");
        }
        assert!(
            mapping
                .shape(Path::new("a.mcap"), &self::names(&["x"]))
                .is_ok()
        );
    }
    let mapping = sound("every: 2");
    let shape = mapping.shape(Path::new("a.mcap"), &binned).unwrap();
    assert_eq!(shape.space, binned);
}

/// Every prefix of a sound file, and every file with one byte changed, gives an answer.
#[test]
fn no_damage_makes_it_panic() {
    let text = "recordings: [Cargo.toml]\ntopics: {cameras: {a: /a}, action: /b}\nrate_hz: 5\n\
                actions: {bins: 3, dimensions: {x: {low: 0, high: 1.5}}}\n";
    assert!(parsed(text).is_ok());
    for end in 0..text.len() {
        let _ = parsed(&text[..end]);
        for damage in [":", "\"", "{", "]", "\n", "é", "*a", "%", "-", "9"] {
            let _ = parsed(&format!("{}{damage}{}", &text[..end], &text[end + 1..]));
        }
    }
}
