use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::composition_spec::{Calibration, CompositionSpec, Limits, OnShortcut, StartSpec};
use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::environment_config::EnvironmentConfig;
use super::region_spec::RegionSpec;
use super::resolved_task::ResolvedTask;
use crate::graph::{NodeId, TopologicalGraph};
use crate::planner::{
    AvoidedRegion, FinalChoice, PlannerError, PlannerOptions, SettledOrder, Start, Terms,
    settle_order,
};
use crate::task::{Automaton, Order, OrderAutomaton, Region, Subgoal, Task};

/// Steps of a run of one task: twice those of a long demonstration.
const SINGLE_TASK_STEPS: u32 = 200;

/// Tasks in an order, with everything that planning and running them needs to know except their
/// graphs, which whoever runs it loads from the places named here.
#[derive(Clone, Debug)]
pub struct Composition {
    /// Its name, fit to be part of a path.
    pub name: String,
    /// One sentence for people.
    pub description: Option<String>,
    /// The tasks in the order in which they are to be done, one that is done several times so often; never
    /// empty. Where several orders are allowed it is the first of them until [`settle`](Self::settle)
    /// finds the cheapest.
    pub tasks: Vec<ResolvedTask>,
    /// All subgoals of these tasks in order; those of `via` too once
    /// [`place_regions`](Self::place_regions) has found where they belong.
    pub automaton: Automaton,
    /// What is to be done, as it was written.
    pub order: Order,
    /// All orders that are allowed.
    pub orders: OrderAutomaton,
    /// Tasks that are only done in other orders.
    pub other_tasks: Vec<ResolvedTask>,
    /// The task at whose end the robot starts, if it is at one's.
    pub start_task: Option<ResolvedTask>,
    /// Where the robot is at the start.
    pub start: Start,
    /// What a plan must not pass; empty until [`place_regions`](Self::place_regions) has found the states.
    pub avoid: Vec<AvoidedRegion>,
    /// Folder of the model.
    pub model: PathBuf,
    /// Which end state of the last task the run leads to.
    pub final_choice: FinalChoice,
    /// What to do when a run reaches a subgoal without an earlier one.
    pub on_shortcut: OnShortcut,
    /// How to plan.
    pub planner: PlannerOptions,
    /// How the traversability is calibrated, on the edges of the graphs and while running.
    pub calibration: Calibration,
    /// Bounds of a run.
    pub limits: Limits,
    /// The simulated world to start in: its own, else that of the task at whose end the robot starts, else that of the
    /// first task.
    pub environment: Option<EnvironmentConfig>,
    /// What may not be meant as written, though it works.
    pub warnings: Vec<Diagnostic>,
    /// States of demonstrations that do not pass what is to be passed, where that matters.
    pub(super) unplaced: Vec<NodeId>,
    /// Subgoals of `via`, each with how many of its task's own subgoals come before it.
    pub(super) via: Vec<(usize, Subgoal)>,
    pub(super) spec: CompositionSpec,
}

impl Composition {
    /// One task as a composition of its own, with all options at their defaults and at most 200 steps.
    ///
    /// # Errors
    /// A diagnostic when the task names no model.
    pub fn single(task: ResolvedTask) -> Result<Self, Diagnostics> {
        let mut faults = Faults::default();
        let composition = Self::of_one(task, &mut faults);
        Self::finish(composition, faults)
    }

    pub(super) fn of_one(task: ResolvedTask, faults: &mut Faults) -> Option<Self> {
        let spec = CompositionSpec {
            name: Some(task.spec.name.clone()),
            description: task.description.clone(),
            tasks: vec![task.spec.name.clone()],
            limits: Limits {
                steps: SINGLE_TASK_STEPS,
            }
            .into(),
            ..CompositionSpec::default()
        };
        // The root plays no part: only a composition's own paths are joined with it.
        Self::resolve(spec, vec![Some(task)], "", Path::new(""), faults)
    }

    /// Checks what a composition says against its tasks, of which those with faults are missing.
    /// Each task is there once, also the one where the robot starts. `file_name` is its name when it gives
    /// itself none.
    pub(super) fn resolve(
        spec: CompositionSpec,
        tasks: Vec<Option<ResolvedTask>>,
        file_name: &str,
        root: &Path,
        faults: &mut Faults,
    ) -> Option<Self> {
        let orders = spec.orders(faults);
        if let Some(orders) = &orders {
            spec.check_final_task(orders, faults);
        }
        let name = spec.checked_name(file_name, faults);
        let tasks: Vec<ResolvedTask> = tasks.into_iter().collect::<Option<_>>()?;
        spec.check_regions(&tasks, faults);
        if let Some(orders) = &orders {
            spec.check_stages(orders, &tasks, faults);
        }
        let model = spec.model_of(&tasks, root, faults);
        if faults.error_count() > 0 {
            return None;
        }
        let orders = orders?;
        let Some(first) = spec.first_order(&orders) else {
            let fault = Diagnostic::error("the order has no way on which a task is done");
            faults.add(fault.help("name at least one task that is to be done"));
            return None;
        };
        let start = match &spec.start {
            StartSpec::Beginning => Start::Beginning,
            StartSpec::Anywhere => Start::Anywhere,
            StartSpec::From(task) => Start::After(task.value.clone()),
        };
        let (tasks, others): (Vec<ResolvedTask>, Vec<ResolvedTask>) =
            tasks.into_iter().partition(|t| spec.does(&t.task.name));
        let start_task = match &start {
            Start::After(name) => {
                let mut all = tasks.iter().chain(&others);
                all.find(|t| t.task.name == *name).cloned()
            }
            _ => None,
        };
        let mut composition = Self {
            name,
            description: spec.description.clone(),
            automaton: Automaton::in_order(&[]),
            order: spec.order(),
            start_task,
            start,
            avoid: Vec::new(),
            via: Vec::new(),
            unplaced: Vec::new(),
            model: model?,
            final_choice: spec.final_choice.value.clone(),
            on_shortcut: spec.on_shortcut,
            planner: spec.planner.clone(),
            calibration: spec.calibration,
            limits: spec.limits.value,
            environment: None,
            warnings: Vec::new(),
            tasks,
            orders,
            other_tasks: Vec::new(),
            spec,
        };
        composition.take_order(&first);
        Some(composition)
    }

    /// Makes an order, given as names of its tasks, the present one.
    fn take_order(&mut self, order: &[String]) {
        let own: Vec<ResolvedTask> = once(self.tasks.iter().chain(&self.other_tasks));
        let named = |name: &String| own.iter().find(|t| t.task.name == *name).cloned();
        self.tasks = order.iter().filter_map(named).collect();
        self.other_tasks = own
            .into_iter()
            .filter(|t| !order.contains(&t.task.name))
            .collect();
        self.renew_automaton();
        let first = self.start_task.as_ref().or(self.tasks.first());
        let first = first.and_then(|t| t.environment.clone());
        self.environment = self.spec.environment.clone().or(first);
    }

    /// Lays the subgoals out anew, after the order or the regions have changed.
    pub(super) fn renew_automaton(&mut self) {
        let planned: Vec<Task> = self.tasks.iter().map(|t| self.planned(t)).collect();
        self.automaton = Automaton::in_order(&planned);
    }

    /// A task with the subgoals of `via` among its own.
    pub(super) fn planned(&self, task: &ResolvedTask) -> Task {
        let mut planned = task.task.clone();
        let own = std::mem::take(&mut planned.subgoals);
        for (at, subgoal) in own.iter().map(Some).chain([None]).enumerate() {
            let due = |(before, s): &&(usize, Subgoal)| *before == at && s.task == planned.name;
            let passed: Vec<Subgoal> = self.via.iter().filter(due).map(|v| v.1.clone()).collect();
            planned.subgoals.extend(passed);
            planned.subgoals.extend(subgoal.cloned());
        }
        planned
    }

    /// Each task that it names once, as it is planned: with the subgoals of `via`.
    #[must_use]
    pub fn planned_tasks(&self) -> Vec<Task> {
        self.all_tasks().map(|t| self.planned(t)).collect()
    }

    /// The subgoals that demonstrations and the world know: without those of `via`.
    #[must_use]
    pub fn demonstrated_automaton(&self) -> Automaton {
        let plain: Vec<Task> = self.tasks.iter().map(|t| t.task.clone()).collect();
        Automaton::in_order(&plain)
    }

    /// How many of the subgoals that are reached at a stage demonstrations and the world know: the stage
    /// without those of `via`.
    ///
    /// # Panics
    /// If there is no such stage.
    #[must_use]
    pub fn demonstrated_stage(&self, stage: usize) -> usize {
        let reached = self.automaton.subgoals()[..stage].iter();
        let is_own = |s: &&Subgoal| self.via.iter().all(|(_, via)| via != *s);
        reached.filter(is_own).count()
    }

    /// Each task that it names once, those of the present order first, that where the robot starts last.
    pub fn all_tasks(&self) -> impl Iterator<Item = &ResolvedTask> {
        let all = self
            .tasks
            .iter()
            .chain(&self.other_tasks)
            .chain(&self.start_task);
        let mut seen: Vec<&str> = Vec::new();
        all.filter(move |t| {
            let is_new = !seen.contains(&t.task.name.as_str());
            seen.push(&t.task.name);
            is_new
        })
    }

    /// Pairs of tasks of which the second may come right after the first: where graphs are to be merged.
    #[must_use]
    pub fn follows(&self) -> BTreeSet<(&str, &str)> {
        let mut pairs = self.orders.follows();
        if let Some(start) = &self.start_task {
            let first = self.orders.first_tasks().into_iter();
            pairs.extend(first.map(|task| (start.task.name.as_str(), task)));
        }
        pairs
    }

    /// The task whose end is to be the end of all, where it says so.
    #[must_use]
    pub fn final_task(&self) -> Option<&str> {
        self.spec.final_task.as_ref().map(|t| t.value.as_str())
    }

    /// The regions that are to be passed, and those that must not be, as they were written.
    #[must_use]
    pub fn regions(&self) -> (Vec<Region>, Vec<Region>) {
        let plain = |specs: &[RegionSpec]| specs.iter().map(RegionSpec::region).collect();
        (plain(&self.spec.via), plain(&self.spec.avoid))
    }

    /// Where its plans start, where they may end, and what they do not pass.
    #[must_use]
    pub fn terms(&self) -> Terms {
        Terms {
            start: self.start.clone(),
            end: self.final_choice.clone(),
            avoid: self.avoid.clone(),
            unplaced: self.unplaced.clone(),
        }
    }

    /// Takes the cheapest of the allowed orders on a graph, usually the merged one, of those that leave the
    /// fewest optional parts out; see [`settle_order`]. `None` where no order connects, and nothing changes
    /// unless the final state is that of a demonstration: the first order that ends with its task is taken then.
    ///
    /// # Errors
    /// [`PlannerError::UnknownTask`] for a task that the graph lacks.
    pub fn settle(
        &mut self,
        graph: &TopologicalGraph,
    ) -> Result<Option<SettledOrder>, PlannerError> {
        let tasks = self.planned_tasks();
        let how = (&self.terms(), &self.planner);
        let settled = settle_order(graph, &self.orders, &tasks, self.final_task(), how)?;
        if let Some(settled) = &settled {
            self.take_order(&settled.tasks);
        } else if let Some(order) = self.first_order_to_its_end(graph) {
            self.take_order(&order);
        }
        Ok(settled)
    }

    /// Where the final state is that of a demonstration and the present order ends with another task, the first
    /// order that ends with one of which it is.
    fn first_order_to_its_end(&self, graph: &TopologicalGraph) -> Option<Vec<String>> {
        let FinalChoice::Demonstration(id) = &self.final_choice else {
            return None;
        };
        let is_end_of = |task: &str| {
            let mut nodes = graph.nodes().map(|(_, n)| n);
            nodes.any(|n| n.is_end && n.task == task && n.trajectory == *id)
        };
        let present = self.tasks.last().map(|t| t.task.name.as_str());
        if self.final_task().is_some() || present.is_some_and(is_end_of) {
            return None;
        }
        let mut last = self.orders.last_tasks().into_iter();
        let ending = last.find(|task| is_end_of(task))?;
        self.orders.orders_ending_with(Some(ending), 1).pop()
    }

    /// The composition with its warnings, unless there are errors.
    pub(super) fn finish(composition: Option<Self>, faults: Faults) -> Result<Self, Diagnostics> {
        match composition {
            Some(mut composition) if faults.error_count() == 0 => {
                composition.warnings = faults.into_sorted();
                Ok(composition)
            }
            _ => Err(Diagnostics::new(faults)),
        }
    }
}

/// Each task once, in the order in which they come.
fn once<'a>(tasks: impl Iterator<Item = &'a ResolvedTask>) -> Vec<ResolvedTask> {
    let mut own: Vec<ResolvedTask> = Vec::new();
    for task in tasks {
        if own.iter().all(|t| t.task.name != task.task.name) {
            own.push(task.clone());
        }
    }
    own
}
