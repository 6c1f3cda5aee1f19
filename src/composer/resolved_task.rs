use std::path::{Path, PathBuf};

use super::compose::Project;
use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::environment_config::EnvironmentConfig;
use super::reader::name_fault;
use super::source::{Located, Source, printable};
use super::task_spec::{FoundBy, SubgoalSpec, TaskSpec};
use super::yaml::{self, Node};
use crate::task::{Subgoal, SubgoalDetection, SubgoalRule, Task};

/// A task that is sound in itself, with the places of what belongs to it.
#[derive(Clone, Debug)]
pub struct ResolvedTask {
    /// The task as planner and graph know it.
    pub task: Task,
    /// One sentence for people.
    pub description: Option<String>,
    /// How each subgoal is found in a demonstration, in order.
    pub rules: Vec<SubgoalRule>,
    /// Folders of recordings.
    pub demonstrations: Vec<PathBuf>,
    /// Folder of its graph.
    pub graph: PathBuf,
    /// Folder of the model that its graph was built with.
    pub model: Option<PathBuf>,
    /// The world that shows it.
    pub environment: Option<EnvironmentConfig>,
    pub(super) spec: TaskSpec,
}

/// Reads the file of one task. Its paths are relative to `root`.
///
/// # Errors
/// All faults of the file.
pub fn load_task(path: &Path, root: &Path) -> Result<ResolvedTask, Diagnostics> {
    let mut faults = Faults::default();
    let project = Project::knowing_nothing(root);
    let task =
        Source::read(path, &mut faults).and_then(|source| read_task(&source, project, &mut faults));
    task.ok_or_else(|| Diagnostics::new(faults))
}

/// None exactly when the file has errors, which are in `faults` then.
pub(super) fn read_task(
    source: &Source,
    project: Project<'_>,
    faults: &mut Faults,
) -> Option<ResolvedTask> {
    let before = faults.error_count();
    let node = yaml::parse(source, faults)?;
    let task = read_task_node(&node, source, project, faults)?;
    (faults.error_count() == before).then_some(task)
}

/// A task that is worth something only when no error was added to `faults`.
pub(super) fn read_task_node(
    node: &Node,
    source: &Source,
    project: Project<'_>,
    faults: &mut Faults,
) -> Option<ResolvedTask> {
    let spec = TaskSpec::read(node, &mut project.reader(source, faults))?;
    check_file_name(&spec.name, source, faults);
    spec.check(faults);
    Some(spec.resolved(project.root))
}

/// A task is found by its name, so its file must bear it.
fn check_file_name(name: &Located<String>, source: &Source, faults: &mut Faults) {
    let stem = source
        .path()
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    if name.value.is_empty() || name.value == stem {
        return;
    }
    let message = format!(
        "the task calls itself '{}', but its file is '{stem}.yaml'",
        name.value
    );
    let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
    faults.add(fault.help(format!("write 'name: {stem}', or rename the file")));
}

impl TaskSpec {
    /// The task, checked. Paths are relative to `root`.
    ///
    /// # Errors
    /// All faults: no subgoals, one named twice, a name that cannot be part of a path.
    pub fn resolve(self, root: &Path) -> Result<ResolvedTask, Diagnostics> {
        let mut faults = Faults::default();
        let names = self
            .subgoals
            .iter()
            .map(|s| (&s.name, "the name of a subgoal"));
        for (name, what) in std::iter::once((&self.name, "the name of a task")).chain(names) {
            if let Some(fault) = name_fault(&name.value, what) {
                faults.add(fault.at_any(name.origin.as_ref()));
            }
        }
        if self.subgoals.is_empty() {
            let message = format!("task '{}' has no subgoals", self.name.value);
            faults.add(Diagnostic::error(message).help("its end is one: FoundBy::End"));
        }
        self.check(&mut faults);
        if faults.error_count() > 0 {
            return Err(Diagnostics::new(faults));
        }
        Ok(self.resolved(root))
    }

    /// What can be wrong with values that are right one by one.
    fn check(&self, faults: &mut Faults) {
        for (i, subgoal) in self.subgoals.iter().enumerate() {
            let name = &subgoal.name;
            let same = |s: &&SubgoalSpec| s.name.value == name.value;
            if let Some(first) = self.subgoals[..i].iter().find(same) {
                let message = format!("the subgoal '{}' is named twice", name.value);
                faults.add(
                    Diagnostic::error(message)
                        .at_any(name.origin.as_ref())
                        .label("again here")
                        .second(first.name.origin.as_ref(), "first here")
                        .help("give each subgoal of a task a name of its own"),
                );
            }
            let is_last = i + 1 == self.subgoals.len();
            if subgoal.found_by == FoundBy::End && !is_last {
                let message = format!(
                    "the subgoal '{}' is found at the end, but others are to come after it",
                    name.value
                );
                let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
                faults.add(fault.help("only the last subgoal can be the end of a demonstration"));
            }
        }
    }

    fn resolved(self, root: &Path) -> ResolvedTask {
        let place = |path: &Located<PathBuf>| printable(&root.join(&path.value));
        let rules: Vec<SubgoalRule> = self.subgoals.iter().map(|s| self.rule(s)).collect();
        ResolvedTask {
            task: Task {
                name: self.name.value.clone(),
                subgoals: rules.iter().map(|r| r.subgoal.clone()).collect(),
            },
            description: self.description.clone(),
            rules,
            demonstrations: self.demonstrations.iter().map(place).collect(),
            graph: place(&self.graph),
            model: self.model.as_ref().map(place),
            environment: self.environment.clone(),
            spec: self,
        }
    }

    fn rule(&self, spec: &SubgoalSpec) -> SubgoalRule {
        let name = spec.name.value.clone();
        let detection = match &spec.found_by {
            FoundBy::End => SubgoalDetection::End,
            FoundBy::Marker(None) => SubgoalDetection::Marker(name.clone()),
            FoundBy::Marker(Some(marker)) => SubgoalDetection::Marker(marker.clone()),
            FoundBy::Gripper(event, occurrence) => SubgoalDetection::Gripper {
                event: *event,
                occurrence: *occurrence,
                signal: self.gripper.clone(),
            },
        };
        SubgoalRule {
            subgoal: Subgoal {
                task: self.name.value.clone(),
                name,
            },
            detection,
        }
    }
}
