use std::collections::BTreeSet;
use std::path::Path;

use super::composition::Composition;
use super::diagnostic::{Diagnostic, Faults};
use super::diagnostics::Diagnostics;
use super::reader::{listed, suggestion};
use super::resolved_task::ResolvedTask;
use super::source::Origin;
use crate::graph::{Node, TopologicalGraph};
use crate::hidden::{moved_from, way_back};
use crate::planner::FinalChoice;

impl Composition {
    /// Whether the folders of the graphs and of the model are there.
    ///
    /// # Errors
    /// A diagnostic for each that is missing, at the line that names it, with the command that makes it or
    /// brings it back.
    pub fn check_files(&self) -> Result<(), Diagnostics> {
        let mut faults = Faults::default();
        let mut check = |path: &Path, what: String, origin: Option<&Origin>, help: String| {
            if !path.is_dir() {
                let message = format!("{what} is not there: {} is no folder", path.display());
                let help = moved_from(path).map_or(help, |previous| way_back(path, &previous));
                faults.add(Diagnostic::error(message).at_any(origin).help(help));
            }
        };
        let model = self.model.display();
        for task in self.all_tasks() {
            let name = &task.task.name;
            let help = format!("build it: catena graph build tasks/{name}.yaml --model {model}");
            let origin = task.spec.graph.origin.as_ref();
            check(&task.graph, format!("the graph of '{name}'"), origin, help);
        }
        let written = self.spec.model.as_ref();
        let written = written.or_else(|| self.all_tasks().find_map(|t| t.spec.model.as_ref()));
        let folders: Vec<_> = self.all_tasks().flat_map(|t| &t.demonstrations).collect();
        let folders: Vec<_> = folders.iter().map(|d| d.display().to_string()).collect();
        let help = format!("train it: catena train {} --out {model}", folders.join(" "));
        let origin = written.and_then(|m| m.origin.as_ref());
        check(&self.model, "the model".to_owned(), origin, help);
        passed(faults)
    }

    /// Whether a graph, usually the merged one, knows the tasks, their subgoals and the final state.
    ///
    /// # Errors
    /// A diagnostic for each task without states, each subgoal that no state reaches, and a final
    /// state that no demonstration has, at the line that names it.
    pub fn check_against(&self, graph: &TopologicalGraph) -> Result<(), Diagnostics> {
        let mut faults = Faults::default();
        for task in self.all_tasks() {
            let nodes = graph.nodes().map(|(_, n)| n);
            let nodes: Vec<&Node> = nodes.filter(|n| n.task == task.task.name).collect();
            if nodes.is_empty() {
                let message = format!("the graph has no state of task '{}'", task.task.name);
                let tasks: BTreeSet<&str> = graph.nodes().map(|(_, n)| n.task.as_str()).collect();
                let help = format!("its states are of: {}", listed(tasks));
                let origin = task.spec.graph.origin.as_ref();
                faults.add(Diagnostic::error(message).at_any(origin).help(help));
            } else {
                check_subgoals(task, &nodes, &mut faults);
            }
        }
        self.check_final_state(graph, &mut faults);
        passed(faults)
    }

    fn check_final_state(&self, graph: &TopologicalGraph, faults: &mut Faults) {
        let last: Vec<&str> = match self.final_task() {
            Some(task) => vec![task],
            None => self.orders.last_tasks().into_iter().collect(),
        };
        let nodes = graph.nodes().map(|(_, n)| n);
        let ends: BTreeSet<&str> = nodes
            .filter(|n| n.is_end && last.contains(&n.task.as_str()))
            .map(|n| n.trajectory.as_str())
            .collect();
        let origin = self.spec.final_choice.origin.as_ref();
        match &self.final_choice {
            FinalChoice::Demonstration(id) if !ends.contains(id.as_str()) => {
                let message = format!(
                    "no demonstration '{id}' of task '{}' is in the graph",
                    last.join("' or '")
                );
                let fault = Diagnostic::error(message).at_any(origin);
                faults.add(fault.help(suggestion(id, ends, "there are")));
            }
            _ => {}
        }
    }
}

fn check_subgoals(task: &ResolvedTask, nodes: &[&Node], faults: &mut Faults) {
    let seen = nodes.iter().flat_map(|n| &n.reached);
    let seen: BTreeSet<&str> = seen.map(|s| s.name.as_str()).collect();
    for (subgoal, spec) in task.task.subgoals.iter().zip(&task.spec.subgoals) {
        if seen.contains(subgoal.name.as_str()) {
            continue;
        }
        let message = format!(
            "the graph of '{}' has never seen the subgoal '{}'",
            task.task.name, subgoal.name
        );
        let known = if seen.is_empty() {
            "it has seen none".to_owned()
        } else {
            suggestion(&subgoal.name, seen.iter().copied(), "it has seen")
        };
        let help = format!("{known}; if the task has changed, build its graph again");
        let fault = Diagnostic::error(message).at_any(spec.name.origin.as_ref());
        faults.add(fault.help(help));
    }
}

fn passed(faults: Faults) -> Result<(), Diagnostics> {
    if faults.error_count() > 0 {
        return Err(Diagnostics::new(faults));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::composer::{FoundBy, TaskSpec};
    use crate::task::{Order, OrderAutomaton, Subgoal};

    fn composition(choice: FinalChoice) -> Composition {
        composition_below(Path::new(""), choice)
    }

    fn composition_below(root: &Path, choice: FinalChoice) -> Composition {
        let task = |name: &str, subgoals: [&str; 2]| {
            TaskSpec::new(name, "graphs/nowhere")
                .model("graphs/nowhere")
                .subgoal(subgoals[0], FoundBy::Marker(None))
                .subgoal(subgoals[1], FoundBy::End)
                .resolve(root)
                .expect("a sound task")
        };
        Composition::builder("both")
            .task(task("a", ["a1", "a2"]))
            .task(task("b", ["b1", "b2"]))
            .final_choice(choice)
            .build()
            .expect("a sound composition")
    }

    /// Graph with one demonstration a task, a node a subgoal; the last is its end.
    fn graph(reached: &[(&str, &[&str])]) -> TopologicalGraph {
        let mut graph = TopologicalGraph::new(1, 5);
        for (task, subgoals) in reached {
            for (step, name) in subgoals.iter().enumerate() {
                let subgoal = Subgoal {
                    task: (*task).to_owned(),
                    name: (*name).to_owned(),
                };
                let node = Node {
                    task: (*task).to_owned(),
                    trajectory: format!("{task}_000"),
                    step: step as u32,
                    reached: vec![subgoal],
                    progress: step as u32 + 1,
                    is_end: step + 1 == subgoals.len(),
                };
                graph.add_node(node, &[0.0]);
            }
        }
        graph
    }

    fn told(result: Result<(), Diagnostics>) -> Vec<String> {
        let faults = result
            .err()
            .into_iter()
            .flat_map(|d| d.iter().cloned().collect::<Vec<_>>());
        faults
            .map(|d| format!("{} ({})", d.message, d.help.unwrap_or_default()))
            .collect()
    }

    #[test]
    fn a_graph_that_knows_all_passes() {
        let graph = graph(&[("a", &["a1", "a2"]), ("b", &["b1", "b2"])]);
        let last = FinalChoice::Demonstration("b_000".to_owned());
        assert!(
            composition(FinalChoice::Cheapest)
                .check_against(&graph)
                .is_ok()
        );
        assert!(composition(last).check_against(&graph).is_ok());
    }

    #[test]
    fn all_that_a_graph_lacks_is_told() {
        let graph = graph(&[("b", &["b1", "c2"]), ("c", &["c1"])]);
        let choice = FinalChoice::Demonstration("b_001".to_owned());
        let told = told(composition(choice).check_against(&graph));
        assert_eq!(
            told,
            [
                "the graph has no state of task 'a' (its states are of: b, c)",
                "the graph of 'b' has never seen the subgoal 'b2' (did you mean 'b1'? it has seen \
                 b1, c2; if the task has changed, build its graph again)",
                "no demonstration 'b_001' of task 'b' is in the graph (did you mean 'b_000'? there \
                 are b_000)",
            ]
        );
    }

    #[test]
    fn a_final_demonstration_may_be_of_any_task_that_may_be_last() {
        let graph = graph(&[("a", &["a1", "a2"]), ("b", &["b1", "b2"])]);
        let any_order = |id: &str| {
            let mut open = composition(FinalChoice::Demonstration(id.to_owned()));
            let parts = ["a", "b"].map(|name| Order::Task(name.to_owned()));
            open.orders = OrderAutomaton::new(&Order::AnyOrder(parts.to_vec())).expect("small");
            open
        };
        assert!(any_order("a_000").check_against(&graph).is_ok());
        assert_eq!(
            told(any_order("a_001").check_against(&graph)),
            [
                "no demonstration 'a_001' of task 'a' or 'b' is in the graph (did you mean 'a_000'? \
                 there are a_000, b_000)"
            ]
        );
        // Where no order connects, one is left that ends as it is to.
        let mut open = any_order("a_000");
        assert_eq!(open.automaton.tasks(), ["a", "b"]);
        assert_eq!(open.settle(&graph), Ok(None));
        assert_eq!(open.automaton.tasks(), ["b", "a"]);
    }

    #[test]
    fn missing_folders_are_told_with_the_command_that_makes_them() {
        let told = told(composition(FinalChoice::Nearest).check_files());
        assert_eq!(told.len(), 3, "{told:?}");
        assert!(told[0].contains("catena graph build tasks/a.yaml --model graphs/nowhere"));
        assert!(told[2].contains("catena train"), "{told:?}");
    }

    #[test]
    fn folders_that_were_moved_away_are_told_with_the_way_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("graphs/nowhere");
        let previous = root.path().join("graphs/.nowhere.previous");
        fs::create_dir_all(&previous).unwrap();
        let told = told(composition_below(root.path(), FinalChoice::Nearest).check_files());
        let way_back = format!("mv {} {}", previous.display(), folder.display());
        assert_eq!(told.len(), 3, "{told:?}");
        assert!(told.iter().all(|t| t.contains(&way_back)), "{told:?}");
    }
}
