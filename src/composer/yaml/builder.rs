use std::ops::Range;

use serde_yaml::granit_parser::{ErrorKind, Event, ScalarStyle, ScanError, Span as ParserSpan};

use super::{Entry, MAX_DEPTH, MAX_NODES, Node, Value};
use crate::composer::diagnostic::{Diagnostic, Faults};
use crate::composer::source::{Origin, Source};

/// A list or map that is not closed yet.
struct Open {
    start: usize,
    content: OpenContent,
}

enum OpenContent {
    List(Vec<Node>),
    Map {
        entries: Vec<Entry>,
        key: Option<Node>,
    },
}

/// Puts the events of a parser together to a tree.
pub(super) struct Builder<'a> {
    source: &'a Source,
    faults: &'a mut Faults,
    open: Vec<Open>,
    root: Option<Node>,
    node_count: usize,
    document_count: usize,
}

impl<'a> Builder<'a> {
    pub(super) fn new(source: &'a Source, faults: &'a mut Faults) -> Self {
        Self {
            source,
            faults,
            open: Vec::new(),
            root: None,
            node_count: 0,
            document_count: 0,
        }
    }

    /// None stops the reading.
    pub(super) fn take(&mut self, event: &Event<'_>, span: &ParserSpan) -> Option<()> {
        let span = span.byte_range().unwrap_or(0..0);
        match event {
            Event::DocumentStart(..) => self.start_document(span),
            Event::Scalar(text, style, anchor, tag) => {
                self.refuse_properties(&span, *anchor, tag.is_some());
                let value = Value::Scalar {
                    text: text.to_string(),
                    is_plain: *style == ScalarStyle::Plain,
                };
                self.place(Node { span, value })
            }
            Event::SequenceStart(_, anchor, tag) => {
                self.refuse_properties(&span, *anchor, tag.is_some());
                self.push(span, OpenContent::List(Vec::new()))
            }
            Event::MappingStart(_, anchor, tag) => {
                self.refuse_properties(&span, *anchor, tag.is_some());
                let content = OpenContent::Map {
                    entries: Vec::new(),
                    key: None,
                };
                self.push(span, content)
            }
            Event::SequenceEnd | Event::MappingEnd => self.pop(span.end),
            Event::Alias(_) | Event::UnresolvedAlias(_) => {
                self.fault(
                    span.clone(),
                    "aliases are not part of this language",
                    "write the value out where it is used",
                );
                self.place(Node {
                    span,
                    value: Value::Reported,
                })
            }
            _ => Some(()),
        }
    }

    fn start_document(&mut self, span: Range<usize>) -> Option<()> {
        self.document_count += 1;
        if self.document_count == 1 {
            return Some(());
        }
        self.fault(
            span,
            "a second document begins here",
            "keep one document a file: remove the line '---' and what follows it",
        );
        None
    }

    fn refuse_properties(&mut self, span: &Range<usize>, anchor: usize, has_tag: bool) {
        if anchor != 0 {
            self.fault(
                span.clone(),
                "anchors are not part of this language",
                "remove the '&name' and write the value out where it is used",
            );
        }
        if has_tag {
            self.fault(
                span.clone(),
                "tags are not part of this language",
                "remove the '!tag'",
            );
        }
    }

    fn push(&mut self, span: Range<usize>, content: OpenContent) -> Option<()> {
        if self.open.len() >= MAX_DEPTH {
            self.depth_fault(span);
            return None;
        }
        self.open.push(Open {
            start: span.start,
            content,
        });
        Some(())
    }

    fn pop(&mut self, end: usize) -> Option<()> {
        let Open { start, content } = self.open.pop()?;
        let value = match content {
            OpenContent::List(items) => Value::List(items),
            OpenContent::Map { entries, .. } => Value::Map(entries),
        };
        self.place(Node {
            span: start..end.max(start),
            value,
        })
    }

    /// Puts a finished node where it belongs.
    fn place(&mut self, node: Node) -> Option<()> {
        self.node_count += 1;
        if self.node_count > MAX_NODES {
            self.fault(
                node.span,
                format!("more than {MAX_NODES} values in one file"),
                "no task and no composition needs this; is this the right file?",
            );
            return None;
        }
        match self.open.last_mut().map(|o| &mut o.content) {
            None => self.root = Some(node),
            Some(OpenContent::List(items)) => items.push(node),
            Some(OpenContent::Map { key, .. }) if key.is_none() => *key = Some(node),
            Some(OpenContent::Map { entries, key }) => {
                let key = key.take()?;
                if let Some(fault) = add_entry(self.source, entries, key, node) {
                    self.faults.add(fault);
                }
            }
        }
        Some(())
    }

    fn fault(&mut self, span: Range<usize>, message: impl Into<String>, help: &str) {
        let origin = Origin {
            source: self.source.clone(),
            span,
        };
        self.faults
            .add(Diagnostic::error(message).at(&origin).help(help));
    }

    fn depth_fault(&mut self, span: Range<usize>) {
        self.fault(
            span,
            format!("nested more than {MAX_DEPTH} levels deep"),
            "no task and no composition needs this; is this the right file?",
        );
    }

    pub(super) fn syntax_fault(&mut self, error: &ScanError) -> Option<Node> {
        let text = self.source.text();
        let mark = error.marker();
        let at = mark.byte_offset().unwrap_or(text.len()).min(text.len());
        let next = text
            .get(at..)
            .and_then(|t| t.chars().next())
            .map_or(0, char::len_utf8);
        if *error.kind() == ErrorKind::RecursionLimitExceeded {
            self.depth_fault(at..at + next);
            return None;
        }
        self.fault(
            at..at + next,
            format!("this is not YAML: {}", error.info()),
            "look at this line and the one before it: indentation, colons, brackets, quotes",
        );
        None
    }

    pub(super) fn finish(mut self) -> Option<Node> {
        if self.root.as_ref().is_none_or(Node::is_empty) {
            self.fault(
                0..0,
                "the file is empty",
                "tasks and compositions are described in the README, with examples",
            );
            return None;
        }
        self.root.take()
    }
}

/// Adds a key with its value unless the key is no text or stands there already, which is a fault.
fn add_entry(
    source: &Source,
    entries: &mut Vec<Entry>,
    key: Node,
    mut value: Node,
) -> Option<Diagnostic> {
    let origin = |span: &Range<usize>| Origin {
        source: source.clone(),
        span: span.clone(),
    };
    let Value::Scalar { text, .. } = key.value else {
        let fault = Diagnostic::error("a key must be one word").at(&origin(&key.span));
        return Some(fault.help("write 'key: value'"));
    };
    if let Some(first) = entries.iter().find(|e| e.key == text) {
        let fault = Diagnostic::error(format!("the key '{text}' is given twice"));
        return Some(
            fault
                .at(&origin(&key.span))
                .label("again here")
                .second(Some(&origin(&first.key_span)), "first here")
                .help("keep one of them"),
        );
    }
    if value.span.is_empty() {
        // Nothing was written, so there is nothing to underline but the key.
        value.span = key.span.clone();
    }
    entries.push(Entry {
        key: text,
        key_span: key.span,
        value,
    });
    None
}
