//! Worlds that are known to whoever composes, so that faults of their settings are told with all others.

use super::diagnostic::Diagnostic;
use super::reader::Reader;
use super::source::Located;
use super::yaml::Node;
use crate::storage::nearest;

/// A simulated world that a task or a composition may name, and what can be set in it: the composer itself
/// knows none.
#[derive(Clone, Copy, Debug)]
pub struct KnownWorld {
    /// Its name.
    pub name: &'static str,
    /// What can be set.
    pub settings: &'static [Setting],
    /// How it is best written, for whoever leaves out what must be there, such as
    /// `environment: {bedroom: {start: sock}}`.
    pub example: &'static str,
}

/// Something that can be set in a world.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its key.
    pub key: &'static str,
    /// What its value may be.
    pub value: SettingKind,
    /// Whether it must be there.
    pub is_required: bool,
}

/// What the value of a [`Setting`] may be.
#[derive(Clone, Copy, Debug)]
pub enum SettingKind {
    /// One of these words.
    Word(&'static [&'static str]),
    /// A number from 0 to this one.
    UpTo(f32),
    /// `true` or `false`.
    Truth,
    /// A map of these.
    Map(&'static [Setting]),
}

/// Checks the settings of a world that is known, and warns of a name that is almost known: others have worlds of
/// their own. `settings` are `None` where its name stands alone.
pub(super) fn check_world(
    name: &Located<String>,
    settings: Option<&Node>,
    reader: &mut Reader<'_>,
) {
    let worlds = reader.worlds;
    if let Some(world) = worlds.iter().find(|w| w.name == name.value) {
        world.check(name, settings.filter(|s| !s.is_empty()), reader);
        return;
    }
    let known = worlds.iter().map(|w| w.name);
    if let Some(meant) = nearest(&name.value, known) {
        let message = format!("the world '{}' is not known here", name.value);
        let fault = Diagnostic::warning(message).at_any(name.origin.as_ref());
        let fault = fault.label("unknown world");
        reader
            .faults
            .add(fault.help(format!("did you mean '{meant}'?")));
    }
}

impl KnownWorld {
    fn check(&self, name: &Located<String>, settings: Option<&Node>, reader: &mut Reader<'_>) {
        let what = format!("the world '{}'", self.name);
        let help = format!("write '{}'", self.example);
        if let Some(settings) = settings {
            check_map(settings, &what, self.settings, &help, reader);
            return;
        }
        for setting in self.settings.iter().filter(|s| s.is_required) {
            let message = format!("{what} lacks the key '{}'", setting.key);
            let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
            reader.faults.add(fault.help(help.as_str()));
        }
    }
}

fn check_map(
    node: &Node,
    what: &str,
    settings: &'static [Setting],
    help: &str,
    reader: &mut Reader<'_>,
) {
    let keys: Vec<&'static str> = settings.iter().map(|s| s.key).collect();
    let Some(fields) = reader.fields(node, what, &keys) else {
        return;
    };
    for setting in settings {
        let value = if setting.is_required {
            reader.required(&fields, setting.key, help)
        } else {
            fields.value(setting.key)
        };
        if let Some(value) = value {
            setting.check(value, help, reader);
        }
    }
}

impl Setting {
    fn check(&self, node: &Node, help: &str, reader: &mut Reader<'_>) {
        match self.value {
            SettingKind::Word(words) => {
                let choices: Vec<(&'static str, &str)> = words.iter().map(|w| (*w, *w)).collect();
                reader.choice(node, self.key, &choices);
            }
            SettingKind::UpTo(most) => self.check_number(node, most, reader),
            SettingKind::Truth => {
                if !node.is_truth() {
                    let help = "write true or false, without quotes";
                    reader.misfit(node, self.key, "true or false", help);
                }
            }
            SettingKind::Map(settings) => check_map(node, self.key, settings, help, reader),
        }
    }

    /// As the world reads it, with its number of digits.
    fn check_number(&self, node: &Node, most: f32, reader: &mut Reader<'_>) {
        let number = node.as_number_text().and_then(|t| t.parse::<f32>().ok());
        match number {
            Some(number) if (0.0..=most).contains(&number) => {}
            Some(_) => reader.outside(node, self.key, &format!("0..={most}")),
            None => {
                let usual = format!("choose a number within 0..={most}");
                let help = super::way_out::number(node, &usual);
                reader.misfit(node, self.key, "a number", help);
            }
        }
    }
}
