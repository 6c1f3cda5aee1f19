//! What can be wrong with a composition whose parts are right one by one.

use std::path::{Path, PathBuf};

use super::composition_spec::{CompositionSpec, StartSpec};
use super::diagnostic::{Diagnostic, Faults};
use super::reader::name_fault;
use super::resolved_task::ResolvedTask;
use super::source::{Located, printable};
use crate::task::{Order, OrderAutomaton};

/// Most subgoals of a composition, what is repeated counted as often.
const MAX_SUBGOALS: usize = 512;

impl CompositionSpec {
    /// All tasks that it names: those to do, then the one where the robot starts.
    pub(super) fn mentioned(&self) -> impl Iterator<Item = &Located<String>> {
        let start = match &self.start {
            StartSpec::From(task) => Some(task),
            _ => None,
        };
        self.tasks.iter().chain(start)
    }

    pub(super) fn does(&self, task: &str) -> bool {
        self.tasks.iter().any(|t| t.value == task)
    }

    /// What is to be done; by default the tasks in the order in which they are mentioned.
    pub(super) fn order(&self) -> Order {
        let names = || self.tasks.iter().map(|t| Order::Task(t.value.clone()));
        let order = self.order.clone();
        order.unwrap_or_else(|| Order::InOrder(names().collect()))
    }

    /// All orders that are allowed; none where that is not known, of which a fault is told.
    pub(super) fn orders(&self, faults: &mut Faults) -> Option<OrderAutomaton> {
        if self.is_order_misread {
            return None;
        }
        OrderAutomaton::new(&self.order())
            .map_err(|e| {
                let first = self.tasks.first().and_then(|t| t.origin.as_ref());
                let fault = Diagnostic::error("'do' allows too many orders").at_any(first);
                faults.add(fault.help(e.to_string()));
            })
            .ok()
    }

    /// The first of the orders that end as they are to, but for that of no task.
    pub(super) fn first_order(&self, orders: &OrderAutomaton) -> Option<Vec<String>> {
        let last = self.final_task.as_ref().map(|task| task.value.as_str());
        // At most one of them is that of no task.
        let ending = orders.orders_ending_with(last, 2);
        ending.into_iter().find(|order| !order.is_empty())
    }

    pub(super) fn check_final_task(&self, orders: &OrderAutomaton, faults: &mut Faults) {
        let (Some(task), Some(mentioned)) = (&self.final_task, self.tasks.last()) else {
            return;
        };
        let last = orders.last_tasks();
        if !last.contains(task.value.as_str()) {
            let message = format!(
                "the final state is to be one of '{}', which is not the last task",
                task.value
            );
            let mut fault = Diagnostic::error(message).at_any(task.origin.as_ref());
            if last.len() == 1 {
                fault = fault.second(mentioned.origin.as_ref(), "the last task");
            }
            let last: Vec<&str> = last.into_iter().collect();
            let help = format!("write 'of: {}', or leave 'of' out", last.join("' or 'of: "));
            faults.add(fault.help(help));
        }
    }

    /// Its own name or that of its file. Results go to a folder of that name, so that the two ought to
    /// be the same.
    pub(super) fn checked_name(&self, file_name: &str, faults: &mut Faults) -> String {
        let Some(name) = &self.name else {
            if let Some(fault) = name_fault(file_name, "the name of a composition") {
                let fault = match self.tasks.first().and_then(|t| t.origin.as_ref()) {
                    Some(written) => fault.in_file(written.source.path()),
                    None => fault,
                };
                faults.add(fault.help("give it a name of its own: 'name: sock_then_trash'"));
            }
            return file_name.to_owned();
        };
        if name.value != file_name && !file_name.is_empty() {
            let message = format!(
                "the composition calls itself '{}', but its file is '{file_name}.yaml'",
                name.value
            );
            let fault = Diagnostic::warning(message).at_any(name.origin.as_ref());
            faults.add(fault.help(format!("its results are called '{}'", name.value)));
        }
        name.value.clone()
    }

    /// Each subgoal takes a step at least, and there are not too many to be planned.
    pub(super) fn check_stages(
        &self,
        orders: &OrderAutomaton,
        tasks: &[ResolvedTask],
        faults: &mut Faults,
    ) {
        let subgoals = |name: &str| {
            let task = tasks.iter().find(|t| t.task.name == name);
            let via = self.via.iter().filter(|v| v.task.value == name).count();
            task.map_or(0, |t| t.task.subgoals.len()) + via
        };
        let (fewest, most) = orders.least_and_most(subgoals);
        if most > MAX_SUBGOALS {
            let message = format!("'do' comes to {most} subgoals, more than {MAX_SUBGOALS}");
            let first = self.tasks.first().and_then(|t| t.origin.as_ref());
            let fault = Diagnostic::error(message).at_any(first);
            faults.add(fault.help("repeat less often, or run the composition again and again"));
        }
        let steps = self.limits.value.steps;
        if (steps as usize) < fewest {
            let message = format!("{steps} steps are too few for {fewest} subgoals");
            let written = self.limits.origin.as_ref();
            let usual = "a demonstration of one task takes 40 to 100 steps";
            // Without limits of its own it has the usual ones.
            let help = match written {
                Some(_) => usual.to_owned(),
                None => format!("give it more with 'limits: {{steps: ...}}'; {usual}"),
            };
            let first = self.tasks.first().and_then(|t| t.origin.as_ref());
            let fault = Diagnostic::error(message).at_any(written.or(first));
            faults.add(fault.help(help));
        }
    }

    /// The composition's model, else the one that all its tasks name.
    pub(super) fn model_of(
        &self,
        tasks: &[ResolvedTask],
        root: &Path,
        faults: &mut Faults,
    ) -> Option<PathBuf> {
        if let Some(model) = &self.model {
            return Some(printable(&root.join(&model.value)));
        }
        let at = self.tasks.first().and_then(|t| t.origin.as_ref());
        if tasks.is_empty() {
            // That nothing is to be done was reported; no task is left that could name a model.
            return None;
        }
        let help = "say which model is to be used: 'model: graphs/bedroom/model'";
        let named: Vec<_> = tasks
            .iter()
            .filter_map(|t| Some((t, t.model.as_ref()?)))
            .collect();
        let Some((first, model)) = named.first() else {
            let fault = Diagnostic::error("neither the composition nor its tasks name a model");
            faults.add(fault.at_any(at).help(help));
            return None;
        };
        if let Some((other, its)) = named.iter().find(|(_, m)| m != model) {
            let message = format!(
                "task '{}' goes with the model {}, but task '{}' with {}",
                first.task.name,
                model.display(),
                other.task.name,
                its.display()
            );
            let origin: Option<&Located<PathBuf>> = other.spec.model.as_ref();
            let fault = Diagnostic::error(message).at_any(origin.and_then(|m| m.origin.as_ref()));
            faults.add(fault.help("graphs can be merged only if one model built them"));
            return None;
        }
        Some((*model).clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composer::compose_source;
    use crate::composer::source::Source;

    fn told(file: &str, text: &str) -> Vec<String> {
        let source = Source::new(file, text);
        let faults = compose_source(&source, Path::new("")).expect_err("it is broken");
        faults.iter().map(Diagnostic::line).collect()
    }

    #[test]
    fn of_orders_that_cannot_be_read_nothing_more_is_said() {
        let misread = "do: {any_order: [trash, sock, {repeat: {times: 0, do: wine}}]}\n\
                       final_state: {of: trash}\nlimits: {steps: 6}\n";
        let told = told("misread.yaml", misread);
        assert_eq!(
            told,
            ["misread.yaml:1:48: times is the number 0, out of range"]
        );
    }

    #[test]
    fn a_fault_of_what_is_not_written_names_the_file_all_the_same() {
        let told = told(
            "a b.yaml",
            "do: {repeat: {times: 60, do: [sock, trash, wine]}}",
        );
        assert_eq!(
            told,
            [
                "a b.yaml: 'a b' cannot be the name of a composition",
                "a b.yaml:1:31: 400 steps are too few for 420 subgoals",
            ]
        );
    }
}
