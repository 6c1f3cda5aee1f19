//! What `via` and `avoid` come to: checked against tasks, then found on a graph.

use std::collections::BTreeMap;

use super::composition::Composition;
use super::composition_spec::CompositionSpec;
use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::reader::{name_fault, suggestion};
use super::region_spec::RegionSpec;
use super::resolved_task::ResolvedTask;
use super::source::Located;
use crate::graph::{NodeId, RegionError, TopologicalGraph, mark_subgoal, states_in};
use crate::planner::AvoidedRegion;
use crate::task::{Subgoal, Task};

impl CompositionSpec {
    /// Whether regions are of tasks that are done, and name their subgoals; whether what is passed has a
    /// name of its own.
    pub(super) fn check_regions(&self, tasks: &[ResolvedTask], faults: &mut Faults) {
        for region in self.via.iter().chain(&self.avoid) {
            self.check_region(region, tasks, faults);
        }
        for (i, region) in self.via.iter().enumerate() {
            self.check_name(i, region, tasks, faults);
        }
    }

    fn check_region(&self, region: &RegionSpec, tasks: &[ResolvedTask], faults: &mut Faults) {
        let task = &region.task;
        let is_done = self.tasks.iter().any(|t| t.value == task.value);
        let Some(resolved) = tasks
            .iter()
            .find(|t| t.task.name == task.value)
            .filter(|_| is_done)
        else {
            let message = format!("the composition does not do a task '{}'", task.value);
            let names = self.tasks.iter().map(|t| t.value.as_str());
            let help = suggestion(&task.value, names, "it does");
            faults.add(
                Diagnostic::error(message)
                    .at_any(task.origin.as_ref())
                    .help(help),
            );
            return;
        };
        let mut place = |name: &Option<Located<String>>| {
            let name = name.as_ref()?;
            let subgoals = &resolved.task.subgoals;
            let place = subgoals.iter().position(|s| s.name == name.value);
            if place.is_none() {
                let message = format!("task '{}' has no subgoal '{}'", task.value, name.value);
                let known = subgoals.iter().map(|s| s.name.as_str());
                let help = suggestion(&name.value, known, "its subgoals are");
                faults.add(
                    Diagnostic::error(message)
                        .at_any(name.origin.as_ref())
                        .help(help),
                );
            }
            place
        };
        let (after, before) = (place(&region.after), place(&region.before));
        if let (Some(after), Some(before), Some(name)) = (after, before, &region.before)
            && before <= after
        {
            let message = format!(
                "no state is before '{}' and after '{}'",
                name.value, resolved.task.subgoals[after].name
            );
            let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
            faults.add(fault.help("'after' names a subgoal that holds, 'before' a later one"));
        }
    }

    /// The name of what is passed must differ from all other subgoals of the task.
    fn check_name(
        &self,
        index: usize,
        region: &RegionSpec,
        tasks: &[ResolvedTask],
        faults: &mut Faults,
    ) {
        let Some(name) = &region.name else {
            let message = format!("a region to pass has no name: {}", region.region());
            let fault = Diagnostic::error(message).at_any(region.origin.as_ref());
            faults.add(fault.help("passing it is a subgoal, which needs a name"));
            return;
        };
        if let Some(fault) = name_fault(&name.value, "the name of a region") {
            faults.add(fault.at_any(name.origin.as_ref()));
        }
        let task = tasks.iter().find(|t| t.task.name == region.task.value);
        let is_subgoal = |t: &ResolvedTask| t.task.subgoals.iter().any(|s| s.name == name.value);
        let same = |other: &&RegionSpec| {
            let its = other.name.as_ref().map(|n| &n.value);
            its == Some(&name.value) && other.task.value == region.task.value
        };
        let first = self.via[..index].iter().find(same);
        if first.is_none() && !task.is_some_and(is_subgoal) {
            return;
        }
        let message = format!(
            "task '{}' has a subgoal '{}' already",
            region.task.value, name.value
        );
        let first = first.and_then(|f| f.name.as_ref()?.origin.as_ref());
        let fault = Diagnostic::error(message).at_any(name.origin.as_ref());
        let fault = fault.second(first, "first here");
        faults.add(fault.help("give what is passed a name of its own"));
    }
}

impl Composition {
    /// Finds the regions of `via` and `avoid` on a graph, usually the merged one. Where `via` names some, the
    /// graph that is returned has them as subgoals, and so has the [`automaton`](Self::automaton); plan on
    /// that one. Without, it is the graph that was given.
    ///
    /// A region that is passed belongs between two subgoals of its task: all its states must lie between
    /// the same two.
    ///
    /// # Errors
    /// A diagnostic for each region that has no state, names a demonstration or steps that the graph does
    /// not have, lies on both sides of a subgoal although it is to be passed, is to be passed and avoided, or
    /// is passed by no demonstration after those that are to be passed before it.
    pub fn place_regions(
        &mut self,
        mut graph: TopologicalGraph,
    ) -> Result<TopologicalGraph, Diagnostics> {
        let mut faults = Faults::default();
        self.via.clear();
        self.unplaced.clear();
        let avoid = self.avoided(&graph, &mut faults);
        let found: Vec<Option<(Subgoal, usize, Vec<NodeId>)>> = self
            .spec
            .via
            .iter()
            .map(|region| self.passed(&graph, region, &avoid, &mut faults))
            .collect();
        if faults.error_count() > 0 {
            return Err(Diagnostics::new(faults));
        }
        for (spec, found) in self.spec.via.iter().zip(found) {
            let Some((subgoal, stretch, states)) = found else {
                continue;
            };
            // Those of the same stretch are passed in the order in which they are written.
            let earlier = self.via.iter();
            let earlier = earlier.filter(|(at, s)| s.task == subgoal.task && *at <= stretch);
            let at = stretch + earlier.count();
            let beside = mark_subgoal(&mut graph, &subgoal, at, &states);
            if !graph.nodes().any(|(_, n)| n.reached.contains(&subgoal)) {
                faults.add(never_passed(spec, stretch, &self.via));
            }
            self.unplaced.extend(beside);
            self.via.push((stretch, subgoal));
        }
        if faults.error_count() > 0 {
            self.via.clear();
            self.unplaced.clear();
            return Err(Diagnostics::new(faults));
        }
        self.avoid = avoid;
        self.renew_automaton();
        Ok(graph)
    }

    fn avoided(&self, graph: &TopologicalGraph, faults: &mut Faults) -> Vec<AvoidedRegion> {
        let mut avoided = Vec::new();
        for spec in &self.spec.avoid {
            if let Some(states) = self.states(graph, spec, faults) {
                avoided.push(AvoidedRegion {
                    name: spec.region().to_string(),
                    states,
                });
            }
        }
        avoided
    }

    fn states(
        &self,
        graph: &TopologicalGraph,
        spec: &RegionSpec,
        faults: &mut Faults,
    ) -> Option<Vec<NodeId>> {
        let task: &Task = &self
            .all_tasks()
            .find(|t| t.task.name == spec.task.value)?
            .task;
        match states_in(graph, &spec.region(), &task.subgoals) {
            Ok(states) => Some(states),
            Err(error) => {
                faults.add(fault_of(&error, spec, graph));
                None
            }
        }
    }

    /// The subgoal of a region that is to be passed, after how many of its task's own subgoals it is due,
    /// and its states.
    fn passed(
        &self,
        graph: &TopologicalGraph,
        spec: &RegionSpec,
        avoid: &[AvoidedRegion],
        faults: &mut Faults,
    ) -> Option<(Subgoal, usize, Vec<NodeId>)> {
        let mut states = self.states(graph, spec, faults)?;
        let subgoal = Subgoal {
            task: spec.task.value.clone(),
            name: spec.name.as_ref()?.value.clone(),
        };
        let is_avoided = |id: &NodeId| avoid.iter().any(|region| region.states.contains(id));
        let inside = avoid
            .iter()
            .find(|r| states.iter().any(|id| r.states.contains(id)));
        states.retain(|id| !is_avoided(id));
        let progress = |id: &NodeId| graph.node(*id).progress as usize;
        let first = states.iter().map(progress).min();
        let last = states.iter().map(progress).max();
        match (first, last) {
            (Some(first), Some(last)) if first == last => Some((subgoal, first, states)),
            (Some(first), Some(last)) => {
                let task = self.all_tasks().find(|t| t.task.name == subgoal.task)?;
                faults.add(straddling(spec, &task.task, first, last));
                None
            }
            _ => {
                let name = inside.map_or("", |r| r.name.as_str());
                let message = format!("all of '{}' is to be avoided too, by {name}", spec.region());
                let fault = Diagnostic::error(message).at_any(spec.origin.as_ref());
                faults.add(fault.help("a plan cannot pass what it must not touch"));
                None
            }
        }
    }
}

/// A region to pass whose states lie on both sides of a subgoal.
fn straddling(spec: &RegionSpec, task: &Task, first: usize, last: usize) -> Diagnostic {
    let name = |at: usize| task.subgoals.get(at).map_or("", |s| s.name.as_str());
    let message = format!(
        "'{}' lies on both sides of the subgoal '{}'{}",
        spec.region(),
        name(first),
        if last > first + 1 {
            " and of others"
        } else {
            ""
        }
    );
    let help = format!(
        "what is passed belongs between two subgoals: add 'before: {}' or 'after: {}', or other steps",
        name(first),
        name(last - 1)
    );
    Diagnostic::error(message)
        .at_any(spec.origin.as_ref())
        .help(help)
}

/// A region to pass that no demonstration passes after those before it of the same stretch.
fn never_passed(spec: &RegionSpec, stretch: usize, earlier: &[(usize, Subgoal)]) -> Diagnostic {
    let beside = earlier
        .iter()
        .filter(|(at, s)| *at == stretch && s.task == spec.task.value);
    let names: Vec<&str> = beside.map(|(_, s)| s.name.as_str()).collect();
    let message = format!(
        "no demonstration passes '{}' after '{}'",
        spec.region(),
        names.join("', '")
    );
    let help = "what lies between the same two subgoals is passed in the order in which it is written: put them in \
                that of a demonstration, choose regions of the same one, or grow them by 'within_steps'";
    Diagnostic::error(message)
        .at_any(spec.origin.as_ref())
        .help(help)
}

/// What is wrong with a region, at the part of it that is.
fn fault_of(error: &RegionError, spec: &RegionSpec, graph: &TopologicalGraph) -> Diagnostic {
    let origin = |part: &Option<Located<String>>| part.as_ref().and_then(|p| p.origin.clone());
    match error {
        RegionError::UnknownDemonstration {
            demonstration,
            task,
            ..
        } => {
            let mut known: Vec<&str> = graph
                .nodes()
                .filter(|(_, n)| n.task == *task)
                .map(|(_, n)| n.trajectory.as_str())
                .collect();
            known.dedup();
            let message =
                format!("no demonstration '{demonstration}' of task '{task}' is in the graph");
            let fault = Diagnostic::error(message).at_any(origin(&spec.demonstration).as_ref());
            fault.help(suggestion(demonstration, known, "there are"))
        }
        RegionError::StepsBeyondEnd { last, .. } => {
            let at = spec.steps.as_ref().and_then(|s| s.origin.as_ref());
            let fault = Diagnostic::error(error.to_string()).at_any(at);
            fault.help(format!("choose steps within 0..{last}"))
        }
        RegionError::UnknownSubgoal { .. } => {
            let at = spec.after.as_ref().or(spec.before.as_ref());
            Diagnostic::error(error.to_string()).at_any(at.and_then(|a| a.origin.as_ref()))
        }
        RegionError::Empty { .. } => {
            let fault = Diagnostic::error(error.to_string()).at_any(spec.origin.as_ref());
            fault.help(format!(
                "all that is said of a region must hold{}",
                reached_in(spec, graph)
            ))
        }
    }
}

/// At which steps the demonstrations that a region may be of reach the subgoals of its task, to follow other words.
fn reached_in(spec: &RegionSpec, graph: &TopologicalGraph) -> String {
    let id = spec.demonstration.as_ref().map(|d| d.value.as_str());
    let nodes = graph.nodes().map(|(_, n)| n);
    let nodes =
        nodes.filter(|n| n.task == spec.task.value && id.is_none_or(|id| n.trajectory == id));
    let mut steps: BTreeMap<&str, (u32, u32)> = BTreeMap::new();
    for node in nodes {
        for subgoal in &node.reached {
            let (first, last) = steps.entry(&subgoal.name).or_insert((node.step, node.step));
            *first = node.step.min(*first);
            *last = node.step.max(*last);
        }
    }
    let mut reached: Vec<(&str, (u32, u32))> = steps.into_iter().collect();
    reached.sort_by_key(|(_, steps)| *steps);
    let told = reached.iter().map(|(name, (first, last))| {
        if first == last {
            format!("{name} at step {first}")
        } else {
            format!("{name} at steps {first} to {last}")
        }
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() {
        return String::new();
    }
    format!("; its demonstrations reach {}", told.join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::composer::{FoundBy, TaskSpec};
    use crate::graph::fakes::{add_demonstration, task};
    use crate::task::Region;

    #[test]
    fn regions_that_no_demonstration_passes_one_after_the_other_are_told() {
        let walk = task("walk", &["first", "second"]);
        let mut graph = TopologicalGraph::new(1, 5);
        for id in ["w0", "w1"] {
            let places: Vec<Vec<f32>> = (0..10).map(|x| vec![x as f32]).collect();
            add_demonstration(&mut graph, &walk, id, &places, &[2, 9]);
        }
        let placed = |order: [(&str, u32); 2]| {
            let spec = TaskSpec::new("walk", "graphs/walk")
                .model("graphs/model")
                .subgoal("first", FoundBy::Marker(None))
                .subgoal("second", FoundBy::End);
            let mut builder =
                Composition::builder("round").task(spec.resolve(Path::new("")).expect("sound"));
            for (id, step) in order {
                let region = Region::of("walk").demonstration(id).steps(step..=step);
                builder = builder.via(region.named(format!("at_{step}")));
            }
            let mut composition = builder.build().expect("sound");
            let placed = composition.place_regions(graph.clone()).map(|_| ());
            (placed, composition.automaton.stage_count())
        };
        let (sound, stages) = placed([("w0", 4), ("w0", 6)]);
        assert!(sound.is_ok() && stages == 5);
        for order in [[("w0", 6), ("w0", 4)], [("w0", 4), ("w1", 6)]] {
            let (faults, _) = placed(order);
            let told = faults.expect_err("it cannot be passed").to_string();
            let [first, second] = order.map(|(_, step)| step);
            let wanted = format!("no demonstration passes 'at_{second}' after 'at_{first}'");
            assert_eq!(told, wanted);
        }
    }
}
