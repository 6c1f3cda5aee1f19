//! The worlds that compositions may name here: the simulated bedroom, and what can be set in it.

use std::path::Path;

use crate::composer::{
    Composition, Diagnostics, KnownWorld, Setting, SettingKind, compose_named_knowing,
};
use crate::simulator::Variation;

/// The simulated bedroom, as [`BedroomConfig`](crate::simulator::BedroomConfig) reads it.
pub(super) const BEDROOM: KnownWorld = KnownWorld {
    name: "bedroom",
    settings: SETTINGS,
    example: "environment: {bedroom: {start: sock}}",
};

const SETTINGS: &[Setting] = &[
    Setting {
        key: "start",
        value: SettingKind::Word(&["sock", "trash", "wine"]),
        is_required: true,
    },
    optional("level", SettingKind::Word(&["paper", "hard"])),
    optional("variation", SettingKind::Map(VARIATION)),
    optional("leftovers", SettingKind::Word(&["at_start", "varied"])),
];

const MOST: Variation = Variation::MOST;

const VARIATION: &[Setting] = &[
    optional("start_position_m", SettingKind::UpTo(MOST.start_position_m)),
    optional(
        "start_heading_deg",
        SettingKind::UpTo(MOST.start_heading_deg),
    ),
    optional(
        "object_position_m",
        SettingKind::UpTo(MOST.object_position_m),
    ),
    optional("light", SettingKind::UpTo(MOST.light)),
    optional("noise_levels", SettingKind::UpTo(MOST.noise_levels)),
    optional("appearance", SettingKind::Truth),
];

const fn optional(key: &'static str, value: SettingKind) -> Setting {
    Setting {
        key,
        value,
        is_required: false,
    }
}

/// The composition that a person names, with what it and its tasks say of the bedroom checked.
pub(super) fn composed(name_or_path: &str, root: &Path) -> Result<Composition, Diagnostics> {
    compose_named_knowing(&[BEDROOM], name_or_path, root)
}

#[cfg(test)]
mod tests {
    use serde_json::{Map, Value, json};

    use super::*;
    use crate::simulator::{BedroomConfig, BedroomTask};

    fn words(key: &str) -> &'static [&'static str] {
        let setting = SETTINGS.iter().find(|s| s.key == key);
        match setting.expect("it can be set").value {
            SettingKind::Word(words) => words,
            other => panic!("{key} is {other:?}"),
        }
    }

    fn read(settings: &Value) -> Result<BedroomConfig, serde_json::Error> {
        serde_json::from_value(settings.clone())
    }

    #[test]
    fn what_can_be_set_is_what_the_bedroom_reads() {
        assert_eq!(words("start"), BedroomTask::ALL.map(BedroomTask::name));
        for key in ["start", "level", "leftovers"] {
            for word in words(key) {
                let mut settings = json!({"start": "sock"});
                settings[key] = (*word).into();
                assert!(read(&settings).is_ok(), "{settings}");
            }
        }
        let whole = serde_json::to_value(Variation::MOST).expect("it is data");
        let mut known: Vec<&String> = whole.as_object().expect("a map").keys().collect();
        known.sort_unstable();
        let mut keys: Vec<&str> = VARIATION.iter().map(|s| s.key).collect();
        keys.sort_unstable();
        assert_eq!(keys, known);
    }

    /// What the composer lets through the bedroom takes, and what it refuses the bedroom would refuse.
    #[test]
    fn the_largest_numbers_are_those_of_the_bedroom() {
        for setting in VARIATION {
            let SettingKind::UpTo(most) = setting.value else {
                continue;
            };
            let with = |value: f64| {
                let mut variation = Map::new();
                variation.insert(setting.key.to_owned(), value.into());
                read(&json!({"start": "sock", "variation": variation})).is_ok()
            };
            let most = f64::from(most);
            assert!(with(0.0) && with(most), "{}", setting.key);
            assert!(!with(1.01 * most) && !with(-0.01), "{}", setting.key);
        }
    }

    #[test]
    fn faults_of_the_bedroom_are_told_with_all_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("wrong.yaml");
        let written = "do: [sock]\non_shortcut: repan\n\
                       environment: {bedroom: {start: sok, level: papr, variation: {light: 1e39}}}\n";
        std::fs::write(&file, written).expect("written");
        let told = composed(&file.to_string_lossy(), Path::new(""));
        let told = told.expect_err("four values are wrong");
        let ways_out: Vec<&str> = told.iter().filter_map(|d| d.help.as_deref()).collect();
        assert_eq!(
            ways_out,
            [
                "did you mean 'replan'? choose one of replan, stop, report",
                "did you mean 'sock'? choose one of sock, trash, wine",
                "did you mean 'paper'? choose one of paper, hard",
                "choose a number within 0..=1",
            ]
        );
    }
}
