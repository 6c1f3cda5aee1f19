//! What to write in the place of a value of the wrong kind.

use super::reader::listed;
use super::yaml::{Node, Value};

/// Longer values are not repeated.
const MAX_REPEATED_CHARS: usize = 60;

/// Where text is wanted: numbers and truth values are text in quotes.
pub(super) fn text(node: &Node) -> String {
    match &node.value {
        Value::Scalar { .. } if node.is_empty() => "write some text".to_owned(),
        Value::Scalar { text, .. } => {
            let quoted = repeated(text).map(|text| format!(": '{text}'"));
            format!("write it in quotes{}", quoted.unwrap_or_default())
        }
        _ => "write one text in its place".to_owned(),
    }
}

/// Where a list is wanted; `key` is what it is written behind.
pub(super) fn list(node: &Node, key: &str) -> String {
    let each = "write each item on a line of its own, after '- '".to_owned();
    match &node.value {
        Value::Scalar { .. } if node.is_empty() => "list at least one item".to_owned(),
        Value::Scalar { text, .. } => {
            repeated(text).map_or(each, |text| format!("write '{key}: [{text}]'"))
        }
        _ => each,
    }
}

/// Where a map with these keys is wanted.
pub(super) fn map(what: &str, keys: &[&str]) -> String {
    if keys.is_empty() {
        return "write a map, such as {key: value}".to_owned();
    }
    format!("the keys of {what} are {}", listed(keys.iter().copied()))
}

/// Where a number is wanted: one in quotes is text. Else `usual` is the way out.
pub(super) fn number(node: &Node, usual: &str) -> String {
    let is_number = |text: &&str| text.parse::<f64>().is_ok_and(f64::is_finite);
    let quoted = node.as_text().filter(is_number).and_then(repeated);
    quoted.map_or(usual.to_owned(), |text| {
        format!("write it without quotes: {text}")
    })
}

/// A value as it can stand in a help: short, and without what would reach the terminal.
fn repeated(text: &str) -> Option<&str> {
    let is_short = text.chars().count() <= MAX_REPEATED_CHARS;
    (is_short && !text.contains(char::is_control)).then_some(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::composer::diagnostic::Faults;
    use crate::composer::source::Source;
    use crate::composer::{compose_source, yaml};

    fn node(text: &str) -> Node {
        let mut faults = Faults::default();
        yaml::parse(&Source::new("value.yaml", text), &mut faults).expect("it is YAML")
    }

    #[test]
    fn what_is_written_otherwise_is_shown_as_it_should_be() {
        assert_eq!(text(&node("000012")), "write it in quotes: '000012'");
        assert_eq!(text(&node("true")), "write it in quotes: 'true'");
        assert_eq!(text(&node("[a]")), "write one text in its place");
        assert_eq!(list(&node("sock"), "do"), "write 'do: [sock]'");
        let each = "write each item on a line of its own, after '- '";
        assert_eq!(list(&node("{a: b}"), "via"), each);
        assert_eq!(
            number(&node("'40'"), "usual"),
            "write it without quotes: 40"
        );
        assert_eq!(number(&node("many"), "usual"), "usual");
        assert_eq!(map("limits", &["steps"]), "the keys of limits are steps");
    }

    #[test]
    fn what_a_terminal_would_obey_and_what_is_long_is_not_repeated() {
        let each = "write each item on a line of its own, after '- '";
        assert_eq!(list(&node(r#""\e[31m""#), "do"), each);
        assert_eq!(list(&node(&"a".repeat(61)), "do"), each);
    }

    #[test]
    fn every_value_of_the_wrong_kind_is_told_with_a_way_out() {
        let written = "do: sock\nfinal_state: {choose: {demonstration: 000012}}\n\
                       name: 3\nstart: [a]\nlimits: {steps: many}\nplanner: {join: 1}\n\
                       avoid: [{of: sock, steps: {}}]\nenvironment: [bedroom]\n";
        let source = Source::new("wrong.yaml", written);
        let faults = compose_source(&source, Path::new("")).expect_err("nothing fits");
        let misfits = faults.iter().filter(|d| d.message.contains("must be"));
        assert_eq!(misfits.clone().count(), 8, "{faults}");
        for fault in misfits {
            assert!(fault.help.is_some(), "{fault}");
        }
        let helps: Vec<&str> = faults.iter().filter_map(|d| d.help.as_deref()).collect();
        for help in ["write 'do: [sock]'", "write it in quotes: '000012'"] {
            assert!(helps.contains(&help), "{helps:?}");
        }
    }
}
