use std::path::PathBuf;

use super::environment_config::EnvironmentConfig;
use super::order_spec::read_order;
use super::planner_spec::read_planner;
use super::reader::{Reader, suggestion};
use super::region_spec::{RegionSpec, read_regions};
use super::source::Located;
use super::yaml::{Node, Value};
use crate::planner::{FinalChoice, PlannerOptions};
use crate::task::Order;

/// Keys of a composition's file, in the order in which they are best written.
pub(super) const COMPOSITION_KEYS: &[&str] = &[
    "name",
    "description",
    "model",
    "environment",
    "start",
    "do",
    "via",
    "avoid",
    "final_state",
    "on_shortcut",
    "planner",
    "calibration",
    "limits",
];

/// What to do when a run reaches a subgoal without an earlier one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnShortcut {
    /// Go back and do what was skipped.
    #[default]
    Replan,
    /// End the run.
    Stop,
    /// Note it and go on.
    Report,
}

/// How the probabilities of the traversability function are calibrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Calibration {
    /// By the model's temperature, which its training found on held-out demonstrations.
    #[default]
    Temperature,
    /// Not at all: the network's own probabilities, temperature 1.
    None,
}

/// Where the robot is at the start, as written.
#[derive(Clone, Debug, Default)]
pub enum StartSpec {
    /// Where demonstrations of the first task begin.
    #[default]
    Beginning,
    /// Anywhere in the first task.
    Anywhere,
    /// At the end of this task, which need not be one of those to do.
    From(Located<String>),
}

/// Bounds of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Time steps after which a run ends, `1..=100_000`.
    pub steps: u32,
}

impl Limits {
    /// Most steps that a run may have.
    pub const MAX_STEPS: u32 = 100_000;
}

impl Default for Limits {
    /// 400 steps: about three times what a chain of two tasks takes.
    fn default() -> Self {
        Self { steps: 400 }
    }
}

/// A composition as written: nothing of it is checked against tasks or graphs yet.
#[derive(Clone, Debug)]
pub struct CompositionSpec {
    /// Its name; by default that of its file.
    pub name: Option<Located<String>>,
    /// One sentence for people.
    pub description: Option<String>,
    /// Folder of the model.
    pub model: Option<Located<PathBuf>>,
    /// The simulated world to start in.
    pub environment: Option<EnvironmentConfig>,
    /// Where the robot is at the start.
    pub start: StartSpec,
    /// Names of the tasks as they are mentioned.
    pub tasks: Vec<Located<String>>,
    /// In which orders they may be done; `None`: in the one in which they are mentioned.
    pub order: Option<Order>,
    /// Regions that are to be passed, each a subgoal of its task.
    pub via: Vec<RegionSpec>,
    /// Regions that must not be passed.
    pub avoid: Vec<RegionSpec>,
    /// The task whose end is the end of all.
    pub final_task: Option<Located<String>>,
    /// Which end state of it is chosen.
    pub final_choice: Located<FinalChoice>,
    /// What to do on a shortcut.
    pub on_shortcut: OnShortcut,
    /// How to plan.
    pub planner: PlannerOptions,
    /// How the traversability is calibrated.
    pub calibration: Calibration,
    /// Bounds of a run.
    pub limits: Located<Limits>,
    /// Whether what is to be done was written and could not be read, so that its orders are not known.
    pub(super) is_order_misread: bool,
}

impl Default for CompositionSpec {
    fn default() -> Self {
        Self {
            name: None,
            description: None,
            model: None,
            environment: None,
            start: StartSpec::default(),
            tasks: Vec::new(),
            order: None,
            via: Vec::new(),
            avoid: Vec::new(),
            final_task: None,
            final_choice: FinalChoice::default().into(),
            on_shortcut: OnShortcut::default(),
            planner: PlannerOptions::default(),
            calibration: Calibration::default(),
            limits: Limits::default().into(),
            is_order_misread: false,
        }
    }
}

impl CompositionSpec {
    /// Reads a composition; what is missing is reported, and left out of the spec.
    pub(super) fn read(node: &Node, reader: &mut Reader<'_>) -> Option<Self> {
        let fields = reader.fields(node, "a composition", COMPOSITION_KEYS)?;
        let mut spec = Self {
            name: fields
                .value("name")
                .and_then(|n| reader.name(n, "the name of a composition")),
            description: fields
                .value("description")
                .and_then(|n| reader.text(n, "description"))
                .map(|d| d.value),
            model: fields.value("model").and_then(|n| reader.path(n, "model")),
            environment: fields
                .value("environment")
                .and_then(|n| EnvironmentConfig::read(n, reader)),
            ..Self::default()
        };
        spec.order = read_order(&fields, &mut spec.tasks, reader);
        spec.is_order_misread = spec.order.is_none();
        if let Some(node) = fields.value("start") {
            spec.start = read_start(node, reader).unwrap_or_default();
        }
        if let Some(node) = fields.value("via") {
            spec.via = read_regions(node, "via", true, reader);
        }
        if let Some(node) = fields.value("avoid") {
            spec.avoid = read_regions(node, "avoid", false, reader);
        }
        if let Some(node) = fields.value("final_state") {
            spec.read_final_state(node, reader);
        }
        if let Some(node) = fields.value("on_shortcut") {
            let choices = [
                ("replan", OnShortcut::Replan),
                ("stop", OnShortcut::Stop),
                ("report", OnShortcut::Report),
            ];
            spec.on_shortcut = reader
                .choice(node, "on_shortcut", &choices)
                .unwrap_or_default();
        }
        if let Some(node) = fields.value("planner") {
            spec.planner = read_planner(node, reader);
        }
        if let Some(node) = fields.value("calibration") {
            let choices = [
                ("temperature", Calibration::Temperature),
                ("none", Calibration::None),
            ];
            spec.calibration = reader
                .choice(node, "calibration", &choices)
                .unwrap_or_default();
        }
        if let Some(node) = fields.value("limits") {
            spec.read_limits(node, reader);
        }
        Some(spec)
    }

    fn read_final_state(&mut self, node: &Node, reader: &mut Reader<'_>) {
        let Some(fields) = reader.fields(node, "final_state", &["of", "choose"]) else {
            return;
        };
        self.final_task = fields
            .value("of")
            .and_then(|n| reader.name(n, "the name of a task"));
        if let Some(node) = fields.value("choose") {
            let choice = read_choice(node, reader).unwrap_or_default();
            self.final_choice = reader.located(node, choice);
        }
    }

    fn read_limits(&mut self, node: &Node, reader: &mut Reader<'_>) {
        let Some(fields) = reader.fields(node, "limits", &["steps"]) else {
            return;
        };
        let Some(node) = fields.value("steps") else {
            return;
        };
        if let Some(steps) = reader.integer(node, "steps", &(1..=Limits::MAX_STEPS)) {
            self.limits = reader.located(node, Limits { steps });
        }
    }
}

/// `beginning`, `anywhere` or `{from: task}`.
fn read_start(node: &Node, reader: &mut Reader<'_>) -> Option<StartSpec> {
    if !matches!(node.value, Value::Map(_)) {
        let words = ["beginning", "anywhere"];
        return match node.as_text() {
            Some("beginning") => Some(StartSpec::Beginning),
            Some("anywhere") => Some(StartSpec::Anywhere),
            Some(text) => {
                let help = suggestion(text, words, "choose one of");
                let help = format!("{help}, or {{from: sock}}, at the end of a task");
                reader.ambiguous(node, &format!("start cannot be '{text}'"), &help);
                None
            }
            None => {
                let wanted = "beginning, anywhere or {from: sock}";
                reader.misfit(node, "start", wanted, format!("write {wanted}"));
                None
            }
        };
    }
    let fields = reader.fields(node, "start", &["from"])?;
    let help = "write 'beginning', 'anywhere' or {from: sock}: at the end of that task";
    let task = reader.required(&fields, "from", help)?;
    let task = reader.name(task, "the name of a task")?;
    Some(StartSpec::From(task))
}

/// `cheapest`, `nearest`, `all` or `{demonstration: id}`.
fn read_choice(node: &Node, reader: &mut Reader<'_>) -> Option<FinalChoice> {
    if !matches!(node.value, Value::Map(_)) {
        if node.as_text() == Some("demonstration") {
            let help = "write 'choose: {demonstration: demo_007}'";
            reader.ambiguous(node, "choose does not say which demonstration", help);
            return None;
        }
        let choices = [("cheapest", 0), ("nearest", 1), ("all", 2)];
        let maps = ["{demonstration: demo_007}"];
        return Some(match reader.choice_or(node, "choose", &choices, &maps)? {
            0 => FinalChoice::Cheapest,
            1 => FinalChoice::Nearest,
            _ => FinalChoice::All,
        });
    }
    let fields = reader.fields(node, "choose", &["demonstration"])?;
    let help = "write 'cheapest', 'nearest', 'all' or {demonstration: demo_007}";
    let id = reader.required(&fields, "demonstration", help)?;
    let id = reader.text(id, "the id of a demonstration")?;
    Some(FinalChoice::Demonstration(id.value))
}
