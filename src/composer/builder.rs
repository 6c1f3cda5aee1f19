use std::path::{Path, PathBuf};

use super::composition::Composition;
use super::composition_spec::{Calibration, CompositionSpec, Limits, OnShortcut, StartSpec};
use super::diagnostic::Diagnostic;
use super::diagnostic::Faults;
use super::diagnostics::Diagnostics;
use super::environment_config::EnvironmentConfig;
use super::reader::name_fault;
use super::resolved_task::ResolvedTask;
use crate::planner::{FinalChoice, PlannerOptions};
use crate::task::{Order, Region};

/// Makes a [`Composition`] in Rust, with the same checks as of a file.
///
/// ```
/// use catena::composer::{Composition, FoundBy, OnShortcut, TaskSpec};
///
/// let task = |name: &str| {
///     TaskSpec::new(name, format!("graphs/{name}"))
///         .subgoal("reached", FoundBy::End)
///         .resolve("project".as_ref())
/// };
/// let composition = Composition::builder("two")
///     .task(task("first")?)
///     .task(task("second")?)
///     .model("project/graphs/model")
///     .on_shortcut(OnShortcut::Stop)
///     .step_limit(200)
///     .build()?;
/// assert_eq!(composition.automaton.tasks(), ["first", "second"]);
/// # Ok::<(), catena::composer::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct CompositionBuilder {
    spec: CompositionSpec,
    tasks: Vec<ResolvedTask>,
}

impl Composition {
    /// A builder without tasks.
    #[must_use]
    pub fn builder(name: impl Into<String>) -> CompositionBuilder {
        CompositionBuilder {
            spec: CompositionSpec {
                name: Some(name.into().into()),
                ..CompositionSpec::default()
            },
            tasks: Vec::new(),
        }
    }
}

impl CompositionBuilder {
    /// A task to be done after those before it; one that is added again is done again.
    #[must_use]
    pub fn task(mut self, task: ResolvedTask) -> Self {
        self.spec.tasks.push(task.spec.name.clone());
        self.add(task);
        self
    }

    /// The first task of a name is taken.
    fn add(&mut self, task: ResolvedTask) {
        if self.tasks.iter().all(|t| t.task.name != task.task.name) {
            self.tasks.push(task);
        }
    }

    /// The robot may be anywhere in the first task at the start.
    #[must_use]
    pub fn start_anywhere(mut self) -> Self {
        self.spec.start = StartSpec::Anywhere;
        self
    }

    /// The robot is at the end of this task at the start.
    #[must_use]
    pub fn start_from(mut self, task: ResolvedTask) -> Self {
        self.spec.start = StartSpec::From(task.spec.name.clone());
        self.add(task);
        self
    }

    /// A region that is to be passed, and has a name: a subgoal of its task.
    #[must_use]
    pub fn via(mut self, region: Region) -> Self {
        self.spec.via.push(region.into());
        self
    }

    /// A region that must not be passed.
    #[must_use]
    pub fn avoid(mut self, region: Region) -> Self {
        self.spec.avoid.push(region.into());
        self
    }

    /// In which orders the tasks may be done; by default in that in which they were added.
    #[must_use]
    pub fn order(mut self, order: Order) -> Self {
        self.spec.order = Some(order);
        self
    }

    /// Folder of the model; by default the one that all tasks name.
    #[must_use]
    pub fn model(mut self, folder: impl Into<PathBuf>) -> Self {
        self.spec.model = Some(folder.into().into());
        self
    }

    /// The task with which the run ends, where the orders leave that open.
    #[must_use]
    pub fn final_task(mut self, task: impl Into<String>) -> Self {
        self.spec.final_task = Some(task.into().into());
        self
    }

    /// Which end state of the last task the run leads to.
    #[must_use]
    pub fn final_choice(mut self, choice: FinalChoice) -> Self {
        self.spec.final_choice = choice.into();
        self
    }

    /// What to do on a shortcut.
    #[must_use]
    pub fn on_shortcut(mut self, on_shortcut: OnShortcut) -> Self {
        self.spec.on_shortcut = on_shortcut;
        self
    }

    /// How to plan.
    #[must_use]
    pub fn planner(mut self, options: PlannerOptions) -> Self {
        self.spec.planner = options;
        self
    }

    /// How the traversability is calibrated.
    #[must_use]
    pub fn calibration(mut self, calibration: Calibration) -> Self {
        self.spec.calibration = calibration;
        self
    }

    /// Time steps after which a run ends.
    #[must_use]
    pub fn step_limit(mut self, steps: u32) -> Self {
        self.spec.limits = Limits { steps }.into();
        self
    }

    /// The simulated world to start in.
    #[must_use]
    pub fn environment(mut self, environment: EnvironmentConfig) -> Self {
        self.spec.environment = Some(environment);
        self
    }

    /// Checks everything.
    ///
    /// # Errors
    /// All faults: no tasks, no model, a limit out of range, a name that cannot be part of a path, a region
    /// of a task that is not done, a final task that no order ends with, an order in which nothing is done.
    pub fn build(self) -> Result<Composition, Diagnostics> {
        let mut faults = Faults::default();
        let name = self.spec.name.as_ref().map_or("", |n| &n.value).to_owned();
        if let Some(fault) = name_fault(&name, "the name of a composition") {
            faults.add(fault);
        }
        if self.spec.tasks.is_empty() {
            faults.add(Diagnostic::error(format!(
                "composition '{name}' has no tasks"
            )));
        }
        let named = self.spec.order.iter().flat_map(Order::tasks);
        // One at whose end the robot starts is known, but that alone does not make it one to be done.
        for name in named.filter(|name| !self.spec.does(name)) {
            let message = format!("the order names task '{name}', which was not added");
            let fault = Diagnostic::error(message);
            faults.add(fault.help("add each task that is to be done with `task`"));
        }
        let steps = self.spec.limits.value.steps;
        if !(1..=Limits::MAX_STEPS).contains(&steps) {
            let message = format!("{steps} steps are out of range");
            let help = format!("choose a number within 1..={}", Limits::MAX_STEPS);
            faults.add(Diagnostic::error(message).help(help));
        }
        let tasks = self.tasks.into_iter().map(Some).collect();
        let composition = Composition::resolve(self.spec, tasks, &name, Path::new(""), &mut faults);
        Composition::finish(composition, faults)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composer::{FoundBy, TaskSpec};

    fn task(name: &str) -> Result<ResolvedTask, Diagnostics> {
        TaskSpec::new(name, "graphs/x")
            .subgoal("reached", FoundBy::End)
            .resolve(Path::new("root"))
    }

    #[test]
    fn all_faults_are_told() {
        let built = Composition::builder("no good")
            .task(task("a").unwrap())
            .task(task("a").unwrap())
            .via(Region::of("b"))
            .avoid(Region::of("a").after("reached").before("reachd"))
            .step_limit(0)
            .build();
        let faults = built.unwrap_err().to_string();
        assert_eq!(
            faults,
            "'no good' cannot be the name of a composition\n\
             0 steps are out of range\n\
             the composition does not do a task 'b'\n\
             task 'a' has no subgoal 'reachd'\n\
             a region to pass has no name: b\n\
             0 steps are too few for 2 subgoals\n\
             neither the composition nor its tasks name a model"
        );
        let empty = Composition::builder("empty")
            .model("m")
            .build()
            .unwrap_err();
        assert_eq!(empty.to_string(), "composition 'empty' has no tasks");
    }

    #[test]
    fn a_task_of_the_order_that_is_only_where_the_robot_starts_is_not_dropped() {
        let both = ["a", "b"].map(|name| Order::Task(name.to_owned()));
        let builder = Composition::builder("both")
            .model("m")
            .task(task("a").unwrap())
            .start_from(task("b").unwrap())
            .order(Order::InOrder(both.to_vec()));
        let faults = builder.clone().build().unwrap_err().to_string();
        assert_eq!(faults, "the order names task 'b', which was not added");
        let built = builder.task(task("b").unwrap()).build();
        let built = built.expect("both are to be done");
        assert_eq!(built.automaton.tasks(), ["a", "b"]);
    }

    #[test]
    fn an_order_in_which_nothing_is_done_is_told() {
        let part = || Box::new(Order::Task("a".to_owned()));
        let never = Order::Repeat(0, part());
        for order in [
            Order::InOrder(Vec::new()),
            Order::Choice(Vec::new()),
            never.clone(),
            Order::Optional(Box::new(never)),
        ] {
            let builder = Composition::builder("idle").model("m");
            let built = builder.task(task("a").unwrap()).order(order).build();
            let faults = built.unwrap_err().to_string();
            assert_eq!(faults, "the order has no way on which a task is done");
        }
        let builder = Composition::builder("idle").model("m");
        let perhaps = builder.task(task("a").unwrap());
        let built = perhaps.order(Order::Optional(part())).build();
        assert_eq!(built.expect("it may be done").automaton.tasks(), ["a"]);
    }

    #[test]
    fn tasks_are_checked_too() {
        let bare = TaskSpec::new("a/b", "graphs/x").resolve(Path::new(""));
        let faults = bare.unwrap_err().to_string();
        assert_eq!(
            faults,
            "'a/b' cannot be the name of a task\ntask 'a/b' has no subgoals"
        );
        assert_eq!(task("a").unwrap().graph, Path::new("root/graphs/x"));
    }

    #[test]
    fn the_order_until_it_is_settled_ends_with_the_final_task() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let parts = names.map(|name| Order::Task(name.to_owned()));
        let mut builder = Composition::builder("eight")
            .model("m")
            .order(Order::AnyOrder(parts.to_vec()));
        for name in names {
            builder = builder.task(task(name).unwrap());
        }
        let composition = builder
            .clone()
            .final_task("a")
            .build()
            .expect("a sound composition");
        assert_eq!(composition.automaton.tasks().join(" "), "b c d e f g h a");
        let faults = builder.final_task("i").build().unwrap_err().to_string();
        assert!(
            faults.contains("one of 'i', which is not the last task"),
            "{faults}"
        );
    }
}
