//! Reads typed values off a tree and reports everything that does not fit, at its place.

use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;

use super::diagnostic::{Diagnostic, Faults};
use super::source::{Located, Origin, Source};
use super::way_out;
use super::world::KnownWorld;
use super::yaml::{Entry, Node, Value};
use crate::storage::nearest;
use crate::wording;

/// Longest name of a task, a subgoal or a composition: they become parts of paths and of pictures.
const MAX_NAME_CHARS: usize = 64;

pub(super) struct Reader<'a> {
    pub source: &'a Source,
    pub faults: &'a mut Faults,
    /// Worlds whose settings are checked.
    pub worlds: &'a [KnownWorld],
}

/// A map whose keys are known ones.
pub(super) struct Fields<'n> {
    what: String,
    origin: Origin,
    entries: Vec<(&'static str, &'n Entry)>,
}

impl<'n> Fields<'n> {
    /// The value of a key, if it is there.
    pub(super) fn value(&self, key: &str) -> Option<&'n Node> {
        let (_, entry) = self.entries.iter().find(|(k, _)| *k == key)?;
        Some(&entry.value)
    }
}

impl Reader<'_> {
    pub(super) fn origin(&self, span: &Range<usize>) -> Origin {
        Origin {
            source: self.source.clone(),
            span: span.clone(),
        }
    }

    pub(super) fn located<T>(&self, node: &Node, value: T) -> Located<T> {
        Located {
            value,
            origin: Some(self.origin(&node.span)),
        }
    }

    fn fault(&mut self, span: &Range<usize>, message: impl Into<String>, help: impl Into<String>) {
        let fault = Diagnostic::error(message).at(&self.origin(span));
        self.faults.add(fault.help(help));
    }

    /// A value that does not say enough, or too much.
    pub(super) fn ambiguous(&mut self, node: &Node, message: &str, help: &str) {
        self.fault(&node.span, message, help);
    }

    /// `what` is to be `wanted`, but the node is something else; `help` says what to write instead.
    pub(super) fn misfit(
        &mut self,
        node: &Node,
        what: &str,
        wanted: &str,
        help: impl Into<String>,
    ) {
        if matches!(node.value, Value::Reported) {
            return;
        }
        let message = format!("{what} must be {wanted}, but is {}", node.describe());
        let fault = Diagnostic::error(message).at(&self.origin(&node.span));
        let fault = fault.label(format!("not {wanted}"));
        self.faults.add(fault.help(help));
    }

    /// A map with keys out of `keys`. A misspelled key is reported and its value is read all the same.
    pub(super) fn fields<'n>(
        &mut self,
        node: &'n Node,
        what: &str,
        keys: &[&'static str],
    ) -> Option<Fields<'n>> {
        let Value::Map(entries) = &node.value else {
            self.misfit(node, what, "a map of keys", way_out::map(what, keys));
            return None;
        };
        let known = |key: &str| keys.iter().copied().find(|k| *k == key);
        let mut found: Vec<_> = entries
            .iter()
            .filter_map(|e| Some((known(&e.key)?, e)))
            .collect();
        for entry in entries.iter().filter(|e| known(&e.key).is_none()) {
            let open = keys
                .iter()
                .copied()
                .filter(|k| found.iter().all(|(f, _)| f != k));
            let meant = nearest(&entry.key, open).and_then(&known);
            self.unknown_key(entry, what, meant, keys);
            found.extend(meant.map(|m| (m, entry)));
        }
        Some(Fields {
            what: what.to_owned(),
            origin: self.origin(&node.span),
            entries: found,
        })
    }

    fn unknown_key(&mut self, entry: &Entry, what: &str, meant: Option<&str>, keys: &[&str]) {
        let all = format!("the keys of {what} are {}", listed(keys.iter().copied()));
        let help = meant.map_or(all.clone(), |m| format!("did you mean '{m}'? {all}"));
        let message = format!("{what} has no key '{}'", entry.key);
        let fault = Diagnostic::error(message).at(&self.origin(&entry.key_span));
        self.faults.add(fault.label("unknown key").help(help));
    }

    /// The value of a key that must be there.
    pub(super) fn required<'n>(
        &mut self,
        fields: &Fields<'n>,
        key: &str,
        help: &str,
    ) -> Option<&'n Node> {
        let value = fields.value(key);
        if value.is_none() {
            let message = format!("{} lacks the key '{key}'", fields.what);
            let fault = Diagnostic::error(message).at(&fields.origin);
            self.faults.add(fault.help(help));
        }
        value
    }

    /// Any text that is not empty.
    pub(super) fn text(&mut self, node: &Node, what: &str) -> Option<Located<String>> {
        match node.as_text() {
            Some(text) if !text.trim().is_empty() => Some(self.located(node, text.to_owned())),
            Some(_) => {
                self.fault(&node.span, format!("{what} is empty"), "write some text");
                None
            }
            None => {
                self.misfit(node, what, "text", way_out::text(node));
                None
            }
        }
    }

    /// A name that can be part of a path.
    pub(super) fn name(&mut self, node: &Node, what: &str) -> Option<Located<String>> {
        let name = self.text(node, what)?;
        if let Some(fault) = name_fault(&name.value, what) {
            self.faults.add(fault.at_any(name.origin.as_ref()));
            return None;
        }
        Some(name)
    }

    pub(super) fn path(&mut self, node: &Node, what: &str) -> Option<Located<PathBuf>> {
        Some(self.text(node, what)?.map(PathBuf::from))
    }

    /// The items of a list that has some.
    pub(super) fn list<'n>(&mut self, node: &'n Node, what: &str) -> Option<&'n [Node]> {
        match &node.value {
            Value::List(items) if items.is_empty() => {
                let help = "list at least one item";
                self.fault(&node.span, format!("{what} is an empty list"), help);
                None
            }
            Value::List(items) => Some(items),
            _ => {
                self.misfit(node, what, "a list", way_out::list(node, what));
                None
            }
        }
    }

    pub(super) fn integer(
        &mut self,
        node: &Node,
        what: &str,
        range: &RangeInclusive<u32>,
    ) -> Option<u32> {
        self.integer_or(node, what, range, None)
    }

    /// A whole number where a word is possible, too, which the caller has looked for.
    pub(super) fn integer_or(
        &mut self,
        node: &Node,
        what: &str,
        range: &RangeInclusive<u32>,
        word: Option<&'static str>,
    ) -> Option<u32> {
        let (low, high) = (range.start(), range.end());
        let or = word.map_or_else(String::new, |word| format!(" or '{word}'"));
        let wanted = format!("a whole number{or}");
        let usual = format!("choose a whole number within {low}..={high}{or}");
        let help = || way_out::number(node, &usual);
        let Some(text) = node.as_number_text() else {
            self.misfit(node, what, &wanted, help());
            return None;
        };
        match text.parse::<u32>() {
            Ok(number) if range.contains(&number) => Some(number),
            Err(_) if text.contains(['.', 'e', 'E']) => {
                self.misfit(node, what, &wanted, help());
                None
            }
            _ => {
                self.outside(node, what, &format!("{low}..={high}"));
                None
            }
        }
    }

    pub(super) fn number(
        &mut self,
        node: &Node,
        what: &str,
        range: &RangeInclusive<f64>,
    ) -> Option<f64> {
        let Some(number) = node.as_number_text().and_then(|t| t.parse::<f64>().ok()) else {
            let help = way_out::number(node, "write a number, such as 0.5");
            self.misfit(node, what, "a number", help);
            return None;
        };
        if !range.contains(&number) {
            self.outside(node, what, &format!("{}..={}", range.start(), range.end()));
            return None;
        }
        Some(number)
    }

    pub(super) fn outside(&mut self, node: &Node, what: &str, range: &str) {
        let message = format!("{what} is {}, out of range", node.describe());
        let fault = Diagnostic::error(message).at(&self.origin(&node.span));
        self.faults.add(
            fault
                .label(format!("not within {range}"))
                .help(format!("choose a number within {range}")),
        );
    }

    /// One of several words.
    pub(super) fn choice<T: Copy>(
        &mut self,
        node: &Node,
        what: &str,
        choices: &[(&'static str, T)],
    ) -> Option<T> {
        self.choice_or(node, what, choices, &[])
    }

    /// One of several words where maps are possible, too, which the caller has looked for: an example of each.
    pub(super) fn choice_or<T: Copy>(
        &mut self,
        node: &Node,
        what: &str,
        choices: &[(&'static str, T)],
        maps: &[&'static str],
    ) -> Option<T> {
        let words = || choices.iter().map(|(w, _)| *w);
        let all = listed(words().chain(maps.iter().copied()));
        let Some(text) = node.as_text() else {
            let help = format!("choose one of {all}");
            self.misfit(node, what, &format!("one of {all}"), help);
            return None;
        };
        let found = choices.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let help = suggestion(text, words(), "choose one of");
            let help = [&[help.as_str()], maps].concat().join(", ");
            self.fault(&node.span, format!("{what} cannot be '{text}'"), help);
        }
        found.map(|(_, value)| *value)
    }
}

/// `did you mean 'x'?` if a name is near, and the list of all names.
pub(super) fn suggestion<'a>(
    word: &str,
    names: impl IntoIterator<Item = &'a str>,
    lead: &str,
) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let all = format!("{lead} {}", listed(names.iter().copied()));
    match nearest(word, names) {
        Some(near) => format!("did you mean '{near}'? {all}"),
        None => all,
    }
}

/// The names with commas; a long list is cut.
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const MAX_LISTED: usize = 14;
    wording::listed(names, MAX_LISTED)
}

/// What is wrong with a name, if anything is.
pub(super) fn name_fault(name: &str, what: &str) -> Option<Diagnostic> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let is_long = name.chars().count() > MAX_NAME_CHARS;
    let is_sound = name.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_')
        && name.chars().all(allowed);
    if is_sound && !is_long {
        return None;
    }
    let message = if is_long {
        format!("{what} is longer than {MAX_NAME_CHARS} characters")
    } else {
        format!("'{name}' cannot be {what}")
    };
    Some(Diagnostic::error(message).help("use letters, digits, '_' and '-', such as sock_in_box"))
}
