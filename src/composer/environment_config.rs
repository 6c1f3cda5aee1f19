use serde::de::DeserializeOwned;

use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::reader::{Reader, suggestion};
use super::source::{Located, Origin};
use super::world::check_world;
use super::yaml::{Node, Value};

/// Which simulated world a task or a composition runs in, as data that only that world understands:
/// `environment: {bedroom: {start: sock}}`.
#[derive(Clone, Debug)]
pub struct EnvironmentConfig {
    /// Name of the world, such as `bedroom`.
    pub kind: Located<String>,
    /// What it is to be like.
    pub settings: serde_json::Map<String, serde_json::Value>,
    /// Keys and scalars of the settings with their places, for messages.
    words: Vec<Located<String>>,
    origin: Option<Origin>,
}

impl EnvironmentConfig {
    /// A world with settings that were made in Rust.
    #[must_use]
    pub fn new(
        kind: impl Into<String>,
        settings: serde_json::Map<String, serde_json::Value>,
    ) -> Self {
        Self {
            kind: kind.into().into(),
            settings,
            words: Vec::new(),
            origin: None,
        }
    }

    /// The settings as the type that the world expects.
    ///
    /// # Errors
    /// One diagnostic at the setting that does not fit.
    pub fn settings_as<T: DeserializeOwned>(&self) -> Result<T, Diagnostics> {
        let value = serde_json::Value::Object(self.settings.clone());
        serde_json::from_value(value).map_err(|error| {
            let message = error.to_string();
            let quoted = |w: &&Located<String>| {
                let found = format!("`{}`", w.value);
                message
                    .find(&found)
                    .is_some_and(|at| !message[..at].contains("expected"))
            };
            let origin = self.words.iter().find(quoted).map(|w| &w.origin);
            let origin = origin.unwrap_or(&self.origin).as_ref();
            let text = format!(
                "the settings of '{}' do not fit: {message}",
                self.kind.value
            );
            let mut faults = Faults::default();
            faults.add(Diagnostic::error(text).at_any(origin));
            Diagnostics::new(faults)
        })
    }

    /// That the world is none of those that are `known` to whoever is to run it.
    #[must_use]
    pub fn unknown(&self, known: &[&str]) -> Diagnostics {
        let text = format!("the world '{}' is not known here", self.kind.value);
        let fault = Diagnostic::error(text).at_any(self.kind.origin.as_ref());
        let names = known.iter().copied();
        let help = suggestion(&self.kind.value, names, "known worlds:");
        let mut faults = Faults::default();
        faults.add(fault.label("unknown world").help(help));
        Diagnostics::new(faults)
    }

    pub(super) fn read(node: &Node, reader: &mut Reader<'_>) -> Option<Self> {
        if let Some(kind) = node.as_text().map(str::to_owned) {
            let kind = reader.located(node, kind);
            check_world(&kind, None, reader);
            return Some(Self {
                origin: kind.origin.clone(),
                kind,
                settings: serde_json::Map::new(),
                words: Vec::new(),
            });
        }
        let Value::Map(entries) = &node.value else {
            reader.misfit(
                node,
                "the environment",
                "the name of a world, or a map of it",
                "write the world with its settings, such as {bedroom: {start: sock}}",
            );
            return None;
        };
        let [entry] = entries.as_slice() else {
            let message = format!("the environment names {} worlds", entries.len());
            reader.ambiguous(node, &message, "name one, such as 'bedroom: {start: sock}'");
            return None;
        };
        let kind = Located {
            value: entry.key.clone(),
            origin: Some(reader.origin(&entry.key_span)),
        };
        check_world(&kind, Some(&entry.value), reader);
        let mut words = Vec::new();
        let settings = match json(&entry.value, reader, &mut words) {
            serde_json::Value::Object(settings) => settings,
            serde_json::Value::Null => serde_json::Map::new(),
            _ if reader.worlds.iter().any(|w| w.name == entry.key) => return None,
            _ => {
                let what = format!("the settings of '{}'", entry.key);
                reader.fields(&entry.value, &what, &[]);
                return None;
            }
        };
        Some(Self {
            kind,
            settings,
            words,
            origin: Some(reader.origin(&entry.value.span)),
        })
    }
}

/// A tree as JSON; keys and scalars are noted in `words`. The depth is bounded by the parser.
fn json(node: &Node, reader: &Reader<'_>, words: &mut Vec<Located<String>>) -> serde_json::Value {
    match &node.value {
        Value::Reported => serde_json::Value::Null,
        Value::List(items) => items.iter().map(|n| json(n, reader, words)).collect(),
        Value::Map(entries) => {
            let mut map = serde_json::Map::new();
            for entry in entries {
                words.push(Located {
                    value: entry.key.clone(),
                    origin: Some(reader.origin(&entry.key_span)),
                });
                map.insert(entry.key.clone(), json(&entry.value, reader, words));
            }
            map.into()
        }
        Value::Scalar { text, .. } => {
            words.push(reader.located(node, text.clone()));
            scalar(node, text)
        }
    }
}

fn scalar(node: &Node, text: &str) -> serde_json::Value {
    if let Some(number) = node.as_number_text() {
        if let Ok(whole) = number.parse::<i64>() {
            return whole.into();
        }
        return number
            .parse::<f64>()
            .map_or(serde_json::Value::Null, Into::into);
    }
    match node.as_text() {
        Some(text) => text.into(),
        None if text.eq_ignore_ascii_case("true") => true.into(),
        None if text.eq_ignore_ascii_case("false") => false.into(),
        None => serde_json::Value::Null,
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::composer::diagnostic::Severity;
    use crate::composer::source::Source;
    use crate::composer::world::{KnownWorld, Setting, SettingKind};
    use crate::composer::yaml;

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(deny_unknown_fields, rename_all = "snake_case")]
    struct Settings {
        light: f32,
        level: Level,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(rename_all = "snake_case")]
    enum Level {
        Paper,
        Hard,
    }

    const KITCHEN: KnownWorld = KnownWorld {
        name: "kitchen",
        settings: &[
            Setting {
                key: "level",
                value: SettingKind::Word(&["paper", "hard"]),
                is_required: true,
            },
            Setting {
                key: "range",
                value: SettingKind::Map(&[
                    Setting {
                        key: "light",
                        value: SettingKind::UpTo(0.3),
                        is_required: false,
                    },
                    Setting {
                        key: "fixed",
                        value: SettingKind::Truth,
                        is_required: false,
                    },
                ]),
                is_required: false,
            },
        ],
        example: "environment: {kitchen: {level: hard}}",
    };

    /// What is read where these worlds are known, and the faults, each with its help.
    fn read_knowing(
        text: &str,
        worlds: &[KnownWorld],
    ) -> (Option<EnvironmentConfig>, Vec<Diagnostic>) {
        let source = Source::new("task.yaml", text);
        let mut faults = Faults::default();
        let node = yaml::parse(&source, &mut faults).unwrap();
        let mut reader = Reader {
            source: &source,
            faults: &mut faults,
            worlds,
        };
        let config = EnvironmentConfig::read(&node, &mut reader);
        (config, faults.into_sorted())
    }

    fn read(text: &str) -> EnvironmentConfig {
        read_knowing(text, &[]).0.unwrap()
    }

    fn told(text: &str) -> Vec<String> {
        let (_, faults) = read_knowing(text, &[KITCHEN]);
        let told = faults.into_iter();
        told.map(|d| format!("{} ({})", d.line(), d.help.unwrap_or_default()))
            .collect()
    }

    #[test]
    fn settings_become_the_type_of_the_world() {
        let config = read("kitchen: {light: 0.5, level: hard}");
        let expected = Settings {
            light: 0.5,
            level: Level::Hard,
        };
        assert_eq!(config.settings_as::<Settings>().unwrap(), expected);
        assert_eq!(config.kind.value, "kitchen");
        assert!(read("kitchen").settings.is_empty());
    }

    #[test]
    fn a_setting_that_does_not_fit_is_found() {
        let wrong_value = read("kitchen:\n  light: 1\n  level: papr\n");
        let fault = wrong_value
            .settings_as::<Settings>()
            .unwrap_err()
            .to_string();
        assert!(fault.starts_with("task.yaml:3:10: "), "{fault}");
        let wrong_key = read("kitchen:\n  light: 1\n  levle: paper\n");
        let fault = wrong_key.settings_as::<Settings>().unwrap_err().to_string();
        assert!(fault.starts_with("task.yaml:3:3: "), "{fault}");
    }

    #[test]
    fn all_faults_of_a_known_world_are_told_with_a_way_out() {
        let sound = "kitchen: {level: hard, range: {light: 0.3, fixed: false}}";
        assert_eq!(told(sound), Vec::<String>::new());
        assert_eq!(
            told("kitchen:\n  level: papr\n  rang: {light: 3, fixed: 1}\n  lights: 2\n"),
            [
                "task.yaml:2:10: level cannot be 'papr' (did you mean 'paper'? choose one of paper, hard)",
                "task.yaml:3:3: the world 'kitchen' has no key 'rang' (did you mean 'range'? the keys of \
                 the world 'kitchen' are level, range)",
                "task.yaml:3:17: light is the number 3, out of range (choose a number within 0..=0.3)",
                "task.yaml:3:27: fixed must be true or false, but is the number 1 (write true or false, \
                 without quotes)",
                "task.yaml:4:3: the world 'kitchen' has no key 'lights' (the keys of the world 'kitchen' \
                 are level, range)",
            ]
        );
        assert!(told("kitchen: {level: hard, range: {light: 1e39}}")[0].contains("0..=0.3"));
        let quoted = told("kitchen: {level: hard, range: {light: '0.1'}}");
        assert!(
            quoted[0].ends_with("(write it without quotes: 0.1)"),
            "{quoted:?}"
        );
    }

    #[test]
    fn a_known_world_without_what_must_be_there_is_told_how_it_is_written() {
        for text in ["kitchen", "kitchen:", "kitchen: {}"] {
            let told = told(text);
            assert_eq!(told.len(), 1, "{text}: {told:?}");
            assert!(told[0].contains("the world 'kitchen' lacks the key 'level'"));
            assert!(told[0].ends_with("(write 'environment: {kitchen: {level: hard}}')"));
        }
        let (config, faults) = read_knowing("kitchen: [hard]", &[KITCHEN]);
        assert!(config.is_none() && faults.len() == 1, "{faults:?}");
    }

    #[test]
    fn a_world_that_is_almost_known_is_warned_of_and_refused_where_it_is_to_run() {
        let (config, faults) = read_knowing("kichen: {start: cup}", &[KITCHEN]);
        assert_eq!(faults[0].severity, Severity::Warning);
        assert_eq!(faults[0].help.as_deref(), Some("did you mean 'kitchen'?"));
        let refused = config
            .expect("others have worlds of their own")
            .unknown(&["kitchen"]);
        let refused = refused.iter().next().expect("a fault");
        assert_eq!(
            refused.line(),
            "task.yaml:1:1: the world 'kichen' is not known here"
        );
        let help = refused.help.as_deref();
        assert_eq!(help, Some("did you mean 'kitchen'? known worlds: kitchen"));
        assert!(told("garden: {start: cup}").is_empty());
    }
}
