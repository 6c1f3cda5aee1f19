use std::path::{Path, PathBuf};

use super::composition::Composition;
use super::composition_spec::CompositionSpec;
use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::reader::{Reader, suggestion};
use super::resolved_task::{ResolvedTask, load_task, read_task, read_task_node};
use super::source::{Located, Source, files_in};
use super::world::KnownWorld;
use super::yaml::{self, Node, Value};
use crate::wording::counted;

/// Where tasks are, below a project's root.
const TASKS: &str = "tasks";
/// Where compositions are.
const SEQUENCES: &str = "tasks/sequences";

/// Where what files name is looked up.
#[derive(Clone, Copy)]
pub(super) struct Project<'a> {
    /// The folder that paths are relative to.
    pub root: &'a Path,
    /// Worlds whose settings are checked.
    worlds: &'a [KnownWorld],
}

impl<'a> Project<'a> {
    /// Settings of worlds are taken as they are.
    pub(super) fn knowing_nothing(root: &'a Path) -> Self {
        Self { root, worlds: &[] }
    }

    pub(super) fn reader(self, source: &'a Source, faults: &'a mut Faults) -> Reader<'a> {
        Reader {
            source,
            faults,
            worlds: self.worlds,
        }
    }
}

/// Reads a composition and the tasks that it names, each from `tasks/NAME.yaml` below `root`. The file
/// of a task is a composition of that task alone.
///
/// All paths in the files are relative to `root`; `path` itself is used as it is.
///
/// # Errors
/// All faults of the composition and of its tasks.
pub fn compose(path: &Path, root: &Path) -> Result<Composition, Diagnostics> {
    compose_file(path, Project::knowing_nothing(root))
}

fn compose_file(path: &Path, project: Project<'_>) -> Result<Composition, Diagnostics> {
    let mut faults = Faults::default();
    let composition =
        Source::read(path, &mut faults).and_then(|s| compose_in(&s, project, &mut faults));
    Composition::finish(composition, faults)
}

/// The same of a text that is in memory already.
///
/// # Errors
/// All faults of the composition and of its tasks.
pub fn compose_source(source: &Source, root: &Path) -> Result<Composition, Diagnostics> {
    let mut faults = Faults::default();
    faults.begin_file(source.path().to_owned());
    let composition = compose_in(source, Project::knowing_nothing(root), &mut faults);
    Composition::finish(composition, faults)
}

/// The composition that a person means on the command line: a path to its file, or the bare name of a
/// task or of a composition in `tasks/sequences`.
///
/// # Errors
/// All faults of the files; a diagnostic with the nearest name when there is no such task.
pub fn compose_named(name_or_path: &str, root: &Path) -> Result<Composition, Diagnostics> {
    compose_named_knowing(&[], name_or_path, root)
}

/// The same where some worlds are known: what does not fit of their settings, in the composition or in its
/// tasks, is told with all other faults.
///
/// # Errors
/// As [`compose_named`].
pub fn compose_named_knowing(
    worlds: &[KnownWorld],
    name_or_path: &str,
    root: &Path,
) -> Result<Composition, Diagnostics> {
    let project = Project { root, worlds };
    if is_path(name_or_path) {
        return compose_file(Path::new(name_or_path), project);
    }
    let found = [TASKS, SEQUENCES]
        .map(|folder| file_named(root, folder, name_or_path))
        .into_iter()
        .find(|path| path.is_file());
    if let Some(path) = found {
        return compose_file(&path, project);
    }
    let mut names = names_in(root, TASKS);
    names.extend(names_in(root, SEQUENCES));
    let message = format!("there is no task and no composition '{name_or_path}'");
    Err(unknown(message, known_names(name_or_path, &names, root)))
}

/// The task that a person means on the command line: a path to its file, or its bare name.
///
/// # Errors
/// All faults of the file; a diagnostic with the nearest name when there is no such task.
pub fn load_task_named(name_or_path: &str, root: &Path) -> Result<ResolvedTask, Diagnostics> {
    if is_path(name_or_path) {
        return load_task(Path::new(name_or_path), root);
    }
    let path = file_named(root, TASKS, name_or_path);
    if path.is_file() {
        return load_task(&path, root);
    }
    let message = format!("there is no task '{name_or_path}'");
    let names = names_in(root, TASKS);
    Err(unknown(message, known_names(name_or_path, &names, root)))
}

/// Whether a person means a file and not the name of a task or of a composition.
fn is_path(name_or_path: &str) -> bool {
    name_or_path.contains(['/', '\\', '.']) || Path::new(name_or_path).is_file()
}

fn unknown(message: String, help: String) -> Diagnostics {
    let mut faults = Faults::default();
    faults.add(Diagnostic::error(message).help(help));
    Diagnostics::new(faults)
}

/// Names of all tasks of a project, sorted.
#[must_use]
pub fn task_names(root: &Path) -> Vec<String> {
    names_in(root, TASKS)
}

fn compose_in(source: &Source, project: Project<'_>, faults: &mut Faults) -> Option<Composition> {
    let node = yaml::parse(source, faults)?;
    if is_task(&node) {
        let task = read_task_node(&node, source, project, faults)?;
        return (faults.error_count() == 0)
            .then(|| Composition::of_one(task, faults))
            .flatten();
    }
    let spec = CompositionSpec::read(&node, &mut project.reader(source, faults))?;
    let tasks = load_tasks(spec.mentioned(), project, faults);
    let file_name = source
        .path()
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    Composition::resolve(spec, tasks, &file_name, project.root, faults)
}

/// Tasks have subgoals, compositions have tasks to do.
fn is_task(node: &Node) -> bool {
    let Value::Map(entries) = &node.value else {
        return false;
    };
    let has = |key: &str| entries.iter().any(|e| e.key == key);
    has("subgoals") && !has("do")
}

/// Each task that is named, once.
fn load_tasks<'a>(
    names: impl Iterator<Item = &'a Located<String>>,
    project: Project<'_>,
    faults: &mut Faults,
) -> Vec<Option<ResolvedTask>> {
    let known = names_in(project.root, TASKS);
    let mut tasks = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        if seen.contains(&name.value.as_str()) {
            continue;
        }
        seen.push(&name.value);
        tasks.push(if known.contains(&name.value) {
            load_named(name, project, faults)
        } else {
            let message = format!("there is no task '{}'", name.value);
            let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
            let help = known_names(&name.value, &known, project.root);
            faults.add(fault.label("unknown task").help(help));
            None
        });
    }
    tasks
}

fn load_named(
    name: &Located<String>,
    project: Project<'_>,
    faults: &mut Faults,
) -> Option<ResolvedTask> {
    let path = file_named(project.root, TASKS, &name.value);
    let before = faults.error_count();
    let task = Source::read(&path, faults).and_then(|s| read_task(&s, project, faults));
    let own = faults.error_count() - before;
    if own > 0 {
        let message = format!(
            "the task '{}' has {} of its own",
            name.value,
            counted(own, "fault")
        );
        let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
        faults.add(
            fault
                .label("used here")
                .help(format!("mend {}", path.display())),
        );
    }
    task
}

fn file_named(root: &Path, folder: &str, name: &str) -> PathBuf {
    super::source::printable(&root.join(folder).join(format!("{name}.yaml")))
}

/// Names of the YAML files of a folder, sorted; none when it cannot be read.
fn names_in(root: &Path, folder: &str) -> Vec<String> {
    let files = files_in(&root.join(folder), &["yaml"]).into_iter();
    let mut names: Vec<String> = files
        .filter_map(|p| Some(p.file_stem()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    names
}

fn known_names(word: &str, names: &[String], root: &Path) -> String {
    if names.is_empty() {
        let folder = root.join(TASKS);
        return format!(
            "{} holds no tasks; is '{}' the project's root?",
            folder.display(),
            root.display()
        );
    }
    suggestion(word, names.iter().map(String::as_str), "there are")
}
