use std::path::PathBuf;

use super::environment_config::EnvironmentConfig;
use super::reader::{Fields, Reader};
use super::source::Located;
use super::yaml::{Node, Value};
use crate::task::{GripperEvent, GripperSignal, Occurrence};

/// Keys of a task's file, in the order in which they are best written.
pub(super) const TASK_KEYS: &[&str] = &[
    "name",
    "description",
    "demonstrations",
    "graph",
    "model",
    "environment",
    "gripper",
    "subgoals",
];

/// How a subgoal is found, as written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FoundBy {
    /// By a marker; one of the subgoal's own name unless another is given.
    Marker(Option<String>),
    /// By what the gripper is told.
    Gripper(GripperEvent, Occurrence),
    /// As the end of the demonstration.
    End,
}

/// A subgoal as written.
#[derive(Clone, Debug)]
pub struct SubgoalSpec {
    /// Its name, unique within the task.
    pub name: Located<String>,
    /// How it is found.
    pub found_by: FoundBy,
}

/// A task as written: nothing of it is checked against anything else yet.
///
/// Paths are relative to the project's root. In Rust, without YAML:
///
/// ```
/// use catena::composer::{FoundBy, TaskSpec};
///
/// let task = TaskSpec::new("cup", "graphs/cup")
///     .demonstrations("demos/cup")
///     .subgoal("cup_grasped", FoundBy::Marker(None))
///     .subgoal("cup_in_sink", FoundBy::End)
///     .resolve(".".as_ref())?;
/// assert_eq!(task.task.subgoals.len(), 2);
/// # Ok::<(), catena::composer::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct TaskSpec {
    /// Its name.
    pub name: Located<String>,
    /// One sentence for people.
    pub description: Option<String>,
    /// Folders of recordings.
    pub demonstrations: Vec<Located<PathBuf>>,
    /// Folder of its graph.
    pub graph: Located<PathBuf>,
    /// Folder of the model that its graph was built with.
    pub model: Option<Located<PathBuf>>,
    /// The world that shows it.
    pub environment: Option<EnvironmentConfig>,
    /// Which actions move the gripper.
    pub gripper: GripperSignal,
    /// In order.
    pub subgoals: Vec<SubgoalSpec>,
}

impl TaskSpec {
    /// A task without subgoals.
    #[must_use]
    pub fn new(name: impl Into<String>, graph: impl Into<PathBuf>) -> Self {
        Self {
            name: name.into().into(),
            description: None,
            demonstrations: Vec::new(),
            graph: graph.into().into(),
            model: None,
            environment: None,
            gripper: GripperSignal::default(),
            subgoals: Vec::new(),
        }
    }

    /// The same with one more folder of recordings.
    #[must_use]
    pub fn demonstrations(mut self, folder: impl Into<PathBuf>) -> Self {
        self.demonstrations.push(folder.into().into());
        self
    }

    /// The same with a model.
    #[must_use]
    pub fn model(mut self, folder: impl Into<PathBuf>) -> Self {
        self.model = Some(folder.into().into());
        self
    }

    /// The same with a simulated world.
    #[must_use]
    pub fn environment(mut self, environment: EnvironmentConfig) -> Self {
        self.environment = Some(environment);
        self
    }

    /// The same with other actions that move the gripper.
    #[must_use]
    pub fn gripper(mut self, signal: GripperSignal) -> Self {
        self.gripper = signal;
        self
    }

    /// The same with one more subgoal, to be reached after those before it.
    #[must_use]
    pub fn subgoal(mut self, name: impl Into<String>, found_by: FoundBy) -> Self {
        self.subgoals.push(SubgoalSpec {
            name: name.into().into(),
            found_by,
        });
        self
    }

    /// Reads a task; what is missing is reported, and left out or empty in the spec.
    pub(super) fn read(node: &Node, reader: &mut Reader<'_>) -> Option<Self> {
        let fields = reader.fields(node, "a task", TASK_KEYS)?;
        let name = reader
            .required(
                &fields,
                "name",
                "name it after its file: 'name: sock' in sock.yaml",
            )
            .and_then(|n| reader.name(n, "the name of a task"));
        let graph = reader
            .required(
                &fields,
                "graph",
                "say where its graph lives: 'graph: graphs/bedroom/sock'",
            )
            .and_then(|n| reader.path(n, "graph"));
        let demonstrations = read_demonstrations(&fields, reader);
        let subgoals = read_subgoals(&fields, reader);
        let description = fields
            .value("description")
            .and_then(|n| reader.text(n, "description"));
        let model = fields.value("model").and_then(|n| reader.path(n, "model"));
        let environment = fields
            .value("environment")
            .and_then(|n| EnvironmentConfig::read(n, reader));
        let gripper = fields.value("gripper").and_then(|n| read_signal(n, reader));
        Some(Self {
            name: name.unwrap_or_else(|| reader.located(node, String::new())),
            description: description.map(|d| d.value),
            demonstrations,
            graph: graph.unwrap_or_else(|| reader.located(node, PathBuf::new())),
            model,
            environment,
            gripper: gripper.unwrap_or_default(),
            subgoals,
        })
    }
}

/// One folder or a list of them.
fn read_demonstrations(fields: &Fields<'_>, reader: &mut Reader<'_>) -> Vec<Located<PathBuf>> {
    let help = "say where its recordings are: 'demonstrations: demos/sock'";
    let Some(node) = reader.required(fields, "demonstrations", help) else {
        return Vec::new();
    };
    let what = "a folder of demonstrations";
    if !matches!(node.value, Value::List(_)) {
        return reader.path(node, what).into_iter().collect();
    }
    let items = reader.list(node, "demonstrations").unwrap_or_default();
    items.iter().filter_map(|n| reader.path(n, what)).collect()
}

fn read_subgoals(fields: &Fields<'_>, reader: &mut Reader<'_>) -> Vec<SubgoalSpec> {
    let help = "list what must be reached, in order; the last subgoal is the end of the task";
    let items = reader
        .required(fields, "subgoals", help)
        .and_then(|n| reader.list(n, "subgoals"))
        .unwrap_or_default();
    items
        .iter()
        .filter_map(|n| read_subgoal(n, reader))
        .collect()
}

fn read_subgoal(node: &Node, reader: &mut Reader<'_>) -> Option<SubgoalSpec> {
    let fields = reader.fields(node, "a subgoal", &["name", "found_by"])?;
    let name = reader
        .required(&fields, "name", "name what is reached: 'name: drawer_open'")
        .and_then(|n| reader.name(n, "the name of a subgoal"));
    let help = "say how it is found in a demonstration: marker, {gripper_event: close} or end";
    let found_by = reader
        .required(&fields, "found_by", help)
        .and_then(|n| read_found_by(n, reader));
    Some(SubgoalSpec {
        name: name?,
        // Reported already; the name still counts for what is named twice.
        found_by: found_by.unwrap_or(FoundBy::Marker(None)),
    })
}

/// `marker`, `end`, `{marker: name}` or `{gripper_event: close, nth: 2}`.
fn read_found_by(node: &Node, reader: &mut Reader<'_>) -> Option<FoundBy> {
    if !matches!(node.value, Value::Map(_)) {
        if node.as_text() == Some("gripper_event") {
            let help = "write 'found_by: {gripper_event: close}', or open";
            reader.ambiguous(
                node,
                "found_by does not say which event of the gripper",
                help,
            );
            return None;
        }
        let choices = [("marker", true), ("end", false)];
        let maps = ["{marker: name}", "{gripper_event: close}"];
        let is_marker = reader.choice_or(node, "found_by", &choices, &maps)?;
        return Some(if is_marker {
            FoundBy::Marker(None)
        } else {
            FoundBy::End
        });
    }
    let fields = reader.fields(node, "found_by", &["marker", "gripper_event", "nth"])?;
    match (
        fields.value("marker"),
        fields.value("gripper_event"),
        fields.value("nth"),
    ) {
        (Some(marker), None, None) => {
            let name = reader.text(marker, "the name of a marker")?;
            Some(FoundBy::Marker(Some(name.value)))
        }
        (None, Some(event), nth) => {
            let events = [("close", GripperEvent::Close), ("open", GripperEvent::Open)];
            let event = reader.choice(event, "gripper_event", &events);
            let occurrence = nth.map_or(Some(Occurrence::Nth(1)), |n| read_nth(n, reader));
            Some(FoundBy::Gripper(event?, occurrence?))
        }
        _ => {
            reader.ambiguous(
                node,
                "found_by must name one way of finding the subgoal",
                "write {marker: name}, or {gripper_event: close, nth: 1}",
            );
            None
        }
    }
}

fn read_nth(node: &Node, reader: &mut Reader<'_>) -> Option<Occurrence> {
    if node.as_text() == Some("last") {
        return Some(Occurrence::Last);
    }
    let nth = reader.integer_or(node, "nth", &(1..=1000), Some("last"))?;
    Some(Occurrence::Nth(nth as usize))
}

/// `{close: gripper_close, open: gripper_open}` or `{dimension: gripper, closed_below: 0.5}`.
fn read_signal(node: &Node, reader: &mut Reader<'_>) -> Option<GripperSignal> {
    let keys = ["close", "open", "dimension", "closed_below", "closed_above"];
    let fields = reader.fields(node, "gripper", &keys)?;
    let is_given = keys.map(|k| fields.value(k).is_some());
    let bound = fields
        .value("closed_below")
        .or(fields.value("closed_above"));
    match (
        is_given,
        fields.value("close"),
        fields.value("open"),
        fields.value("dimension"),
        bound,
    ) {
        ([_, _, false, false, false], Some(close), Some(open), ..) => {
            let close = reader.text(close, "the primitive that closes");
            let open = reader.text(open, "the primitive that opens");
            Some(GripperSignal::Primitives {
                close: close?.value,
                open: open?.value,
            })
        }
        ([false, false, _, below, above], _, _, Some(name), Some(bound)) if below != above => {
            let name = reader.text(name, "the dimension of the gripper");
            let limit = f64::from(f32::MAX);
            let threshold = reader.number(bound, "the threshold of the gripper", &(-limit..=limit));
            Some(GripperSignal::Dimension {
                name: name?.value,
                threshold: threshold? as f32,
                closed_below: below,
            })
        }
        _ => {
            reader.ambiguous(
                node,
                "gripper must say which actions close and open it",
                "write {close: gripper_close, open: gripper_open} for primitives, or \
                 {dimension: gripper, closed_below: 0.5} for continuous actions",
            );
            None
        }
    }
}
