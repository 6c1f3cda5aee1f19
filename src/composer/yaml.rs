//! YAML as a tree in which every node knows its place, so that all faults can be found in one pass;
//! a deserializer would stop at the first.

mod builder;

use std::ops::Range;

use serde_yaml::granit_parser::{self, Parser};

use self::builder::Builder;
use super::diagnostic::Faults;
use super::source::Source;

/// Lists and maps within each other. The language needs about six.
const MAX_DEPTH: usize = 24;
/// Scalars, lists and maps in one file.
const MAX_NODES: usize = 10_000;

/// A value and the bytes of the text that it stands for.
#[derive(Debug)]
pub(super) struct Node {
    pub span: Range<usize>,
    pub value: Value,
}

#[derive(Debug)]
pub(super) enum Value {
    /// A scalar; quoted ones are always text.
    Scalar {
        text: String,
        is_plain: bool,
    },
    List(Vec<Node>),
    Map(Vec<Entry>),
    /// Something that was reported already, so that nothing more is said of it.
    Reported,
}

/// A key with its value.
#[derive(Debug)]
pub(super) struct Entry {
    pub key: String,
    pub key_span: Range<usize>,
    pub value: Node,
}

/// What YAML takes a scalar for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Empty,
    Truth,
    Number,
    Text,
}

fn kind(text: &str, is_plain: bool) -> Kind {
    match text {
        _ if !is_plain => Kind::Text,
        "" | "~" | "null" | "Null" | "NULL" => Kind::Empty,
        "true" | "True" | "TRUE" | "false" | "False" | "FALSE" => Kind::Truth,
        _ if is_number(text) => Kind::Number,
        _ => Kind::Text,
    }
}

impl Node {
    /// What it is, for messages: `a list`, `the number 3`.
    pub(super) fn describe(&self) -> String {
        match &self.value {
            Value::List(_) => "a list".to_owned(),
            Value::Map(_) => "a map of keys".to_owned(),
            Value::Reported => "unusable".to_owned(),
            Value::Scalar { text, is_plain } => match kind(text, *is_plain) {
                Kind::Empty => "empty".to_owned(),
                Kind::Truth => format!("the truth value {text}"),
                Kind::Number => format!("the number {text}"),
                Kind::Text => format!("the text '{text}'"),
            },
        }
    }

    /// Whether nothing is written, or `null`.
    pub(super) fn is_empty(&self) -> bool {
        self.scalar_of(Kind::Empty).is_some()
    }

    /// Whether it is `true` or `false`.
    pub(super) fn is_truth(&self) -> bool {
        self.scalar_of(Kind::Truth).is_some()
    }

    /// The text of a scalar that YAML takes for text.
    pub(super) fn as_text(&self) -> Option<&str> {
        self.scalar_of(Kind::Text)
    }

    /// The text of a scalar that YAML takes for a number.
    pub(super) fn as_number_text(&self) -> Option<&str> {
        self.scalar_of(Kind::Number)
    }

    fn scalar_of(&self, wanted: Kind) -> Option<&str> {
        match &self.value {
            Value::Scalar { text, is_plain } if kind(text, *is_plain) == wanted => Some(text),
            _ => None,
        }
    }
}

/// Decimal numbers; other notations of YAML (hexadecimal, infinity) are read as text.
fn is_number(text: &str) -> bool {
    text.parse::<f64>().is_ok_and(f64::is_finite) && text.contains(|c: char| c.is_ascii_digit())
}

/// The tree of a file with one document; faults of the notation go to `faults`. None when there is no
/// telling what was meant.
pub(super) fn parse(source: &Source, faults: &mut Faults) -> Option<Node> {
    let mut options = granit_parser::Options::default();
    options.set_emit_comments(false);
    options.flow_nesting_limit = MAX_DEPTH;
    options.block_nesting_limit = MAX_DEPTH;
    options.emit_unresolved_aliases = true;
    let mut builder = Builder::new(source, faults);
    for next in Parser::new_from_str_with_options(source.text(), options) {
        match next {
            Ok((event, span)) => builder.take(&event, &span)?,
            Err(error) => return builder.syntax_fault(&error),
        }
    }
    builder.finish()
}
