use std::fmt::Write as _;

use serde::Serialize;

use super::arguments::{Arguments, ComposeArguments};
use super::error::CliError;
use super::graph::results_folder;
use super::loaded::{Loaded, tell_warnings};
use crate::graph::{EdgeKind, TopologicalGraph};
use crate::planner::{Audit, Explanation, Plan, Planner};
use crate::view::write_automaton_svg;
use crate::wording::{counted, number_or_many};

/// What a plan looks like to a program.
#[derive(Serialize)]
pub(super) struct PlanReport {
    name: String,
    tasks: Vec<String>,
    /// How many orders of tasks the composition allows, of those that end with the task of the final state where that is
    /// said; none where they are too many to be counted.
    orders: Option<u64>,
    subgoals: Vec<String>,
    steps: u32,
    cost: f64,
    final_state: String,
    route: Vec<String>,
    audit: Audit,
    unconstrained: Option<UnconstrainedReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    explanation: Option<Explanation>,
}

/// What the paper would plan.
#[derive(Serialize)]
struct UnconstrainedReport {
    steps: u32,
    final_state: String,
    audit: Audit,
}

/// A plan with what there is to say of it.
pub(super) struct Planned {
    pub(super) planner: Planner,
    pub(super) plan: Plan,
    pub(super) report: PlanReport,
}

/// Plans a composition from its start.
pub(super) fn plan(loaded: &Loaded) -> Result<Planned, CliError> {
    let planner = loaded.own_planner()?;
    let plan = planner.plan_from_start().map_err(CliError::NoPath)?;
    let unconstrained = loaded
        .paper_plan()?
        .map(|(paper, plan)| UnconstrainedReport {
            steps: plan.steps,
            final_state: end_of(&loaded.graph, &plan),
            audit: paper.audit(&plan),
        });
    let automaton = &loaded.composition.automaton;
    let report = PlanReport {
        name: loaded.composition.name.clone(),
        tasks: automaton.tasks().to_vec(),
        orders: loaded
            .composition
            .orders
            .order_count(loaded.composition.final_task()),
        subgoals: automaton
            .subgoals()
            .iter()
            .map(|s| s.name.clone())
            .collect(),
        steps: plan.steps,
        cost: plan.cost,
        final_state: end_of(&loaded.graph, &plan),
        route: plan
            .route
            .iter()
            .map(|n| loaded.graph.node(*n).place())
            .collect(),
        audit: planner.audit(&plan),
        unconstrained,
        explanation: None,
    };
    Ok(Planned {
        planner,
        plan,
        report,
    })
}

fn end_of(graph: &TopologicalGraph, plan: &Plan) -> String {
    plan.route
        .last()
        .map(|n| graph.node(*n).place())
        .unwrap_or_default()
}

/// The plan in words: the way through each task, its subgoals with the step at which they are due, the
/// final state, and the audit.
pub(super) fn describe(loaded: &Loaded, planned: &Planned) -> String {
    let graph = &loaded.graph;
    let report = &planned.report;
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{}: {} states, {} edges, of which {} cross-task",
        report.name,
        graph.node_count(),
        graph.edge_count(),
        graph
            .edges()
            .filter(|(_, _, e)| e.kind == EdgeKind::CrossTask)
            .count(),
    );
    let _ = writeln!(
        text,
        "plan: {} to the final state {}",
        counted(report.steps as usize, "step"),
        report.final_state
    );
    text.push_str(&limit_note(report.steps, loaded.composition.limits.steps));
    text.push_str(empty_note(report.steps, &report.audit));
    if report.orders != Some(1) {
        let others = loaded.composition.other_tasks.iter();
        let not_done: Vec<&str> = others.map(|t| t.task.name.as_str()).collect();
        let has_optional = loaded.composition.orders.has_optional_parts();
        let order = described_order(&report.tasks, (report.orders, has_optional), &not_done);
        let _ = writeln!(text, "{order}");
    }
    let mut task = "";
    let route = &planned.plan.route;
    let arrivals = &planned.plan.arrival_steps;
    for (i, (id, step)) in route.iter().zip(arrivals).enumerate() {
        let node = graph.node(*id);
        // A task that is done again is entered by an edge between tasks too.
        let before = i
            .checked_sub(1)
            .and_then(|before| graph.edge(route[before], *id));
        let is_entered = before.is_some_and(|e| e.kind == EdgeKind::CrossTask);
        if node.task != task || is_entered {
            task = &node.task;
            let _ = writeln!(text, "  {task}: joins {}", node.place());
        }
        // What the robot reached before it starts is no part of the plan.
        let is_before = i == 0 && planned.plan.begins_before;
        for subgoal in node.reached.iter().filter(|_| !is_before) {
            let _ = writeln!(text, "    step {step:>3}  {}", subgoal.name);
        }
    }
    let _ = writeln!(text, "audit of the plan: {}", report.audit);
    match &report.unconstrained {
        Some(paper) if paper.audit.is_clean() => {
            let _ = writeln!(
                text,
                "the unconstrained plan of the paper: {}, skips nothing",
                counted(paper.steps as usize, "step")
            );
        }
        Some(paper) => {
            let _ = writeln!(
                text,
                "the unconstrained plan of the paper: {}, and it",
                counted(paper.steps as usize, "step")
            );
            for line in paper.audit.to_string().lines() {
                let _ = writeln!(text, "  {line}");
            }
        }
        None => {
            let _ = writeln!(text, "the unconstrained plan of the paper finds no route");
        }
    }
    for seam in &loaded.merge_report.seams {
        let _ = writeln!(
            text,
            "seam {} -> {}: {} of {} pairs connected{}",
            seam.from_task,
            seam.to_task,
            seam.accepted,
            seam.pair_count,
            if seam.below_rule > 0 {
                format!(", {} more kept as the best there is", seam.below_rule)
            } else {
                String::new()
            },
        );
    }
    text
}

/// What is to be said of a plan that no run gets through; nothing of others.
fn limit_note(steps: u32, limit: u32) -> String {
    if steps <= limit {
        return String::new();
    }
    format!(
        "  a run ends after {} ('limits: {{steps: ...}}'), before this plan does\n",
        counted(limit as usize, "step")
    )
}

/// What is to be said of a plan without a step; nothing of others.
fn empty_note(steps: u32, audit: &Audit) -> &'static str {
    if steps > 0 {
        return "";
    }
    if audit.is_clean() {
        return "  it starts at a final state: nothing is left to be done\n";
    }
    "  it starts at a final state; 'planner: {search: in_order}' plans what it never gets to\n"
}

/// An order of several, and by what it was chosen.
fn described_order(
    tasks: &[String],
    (orders, has_optional_parts): (Option<u64>, bool),
    not_done: &[&str],
) -> String {
    let all = number_or_many(orders);
    let chosen = if has_optional_parts {
        format!(": of {all}, the cheapest of those that leave the fewest optional parts out")
    } else {
        format!(", the cheapest of {all}")
    };
    let not_done = if not_done.is_empty() {
        String::new()
    } else {
        format!("; not done: {}", not_done.join(", "))
    };
    format!("order: {}{chosen}{not_done}", tasks.join(", "))
}

/// `catena compose`
pub(super) fn compose(
    compose_arguments: &ComposeArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let loaded = Loaded::load(&compose_arguments.file.to_string_lossy(), arguments)?;
    tell_warnings(&loaded.composition);
    let mut planned = plan(&loaded)?;
    let mut picture = None;
    if compose_arguments.explain {
        let explanation = explain(&loaded, &planned.planner)?;
        let name = &loaded.composition.name;
        let out = compose_arguments.out.clone();
        let path = out
            .unwrap_or_else(|| results_folder(name))
            .join("automaton.svg");
        let title = name.replace('_', " ");
        write_automaton_svg(&path, &loaded.composition.orders, &explanation, &title)?;
        planned.report.explanation = Some(explanation);
        picture = Some(path);
    }
    if compose_arguments.json {
        println!("{}", serde_json::to_string_pretty(&planned.report)?);
        return Ok(());
    }
    print!("{}", describe(&loaded, &planned));
    if let (Some(explanation), Some(path)) = (&planned.report.explanation, picture) {
        println!("to do:");
        for line in loaded.composition.order.to_string().lines() {
            println!("  {line}");
        }
        println!("{explanation}");
        println!("drawn in {}", path.display());
    }
    Ok(())
}

/// Why the plan of a composition is what it is.
fn explain(loaded: &Loaded, planner: &Planner) -> Result<Explanation, CliError> {
    let composition = &loaded.composition;
    let tasks = composition.planned_tasks();
    let final_task = composition.final_task();
    Explanation::new(planner, &composition.orders, &tasks, final_task).map_err(CliError::NoPath)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Order, OrderAutomaton, Subgoal};

    #[test]
    fn a_plan_that_no_run_gets_through_is_told() {
        assert_eq!(limit_note(80, 80), "");
        let told = limit_note(80, 10);
        assert!(
            told.contains("ends after 10 steps ('limits: {steps: ...}')"),
            "{told}"
        );
    }

    #[test]
    fn a_plan_without_a_step_is_told() {
        let all_done = Audit::default();
        let missed = Subgoal {
            task: "sock".to_owned(),
            name: "drawer_open".to_owned(),
        };
        let some_left = Audit {
            missed: vec![missed],
            ..Audit::default()
        };
        for audit in [&all_done, &some_left] {
            assert_eq!(empty_note(1, audit), "");
        }
        assert!(empty_note(0, &all_done).ends_with("nothing is left to be done\n"));
        let told = empty_note(0, &some_left);
        assert!(
            told.contains("starts at a final state") && told.contains("{search: in_order}"),
            "{told}"
        );
    }

    #[test]
    fn an_order_is_the_cheapest_of_all_only_where_nothing_is_optional() {
        let task = |name: &str| Order::Task(name.to_owned());
        let told = |last: Order, not_done: &[&str]| {
            let order = Order::InOrder(vec![
                task("sock"),
                Order::AnyOrder(vec![task("trash"), last]),
            ]);
            let orders = OrderAutomaton::new(&order).expect("it is small");
            let done = ["sock", "trash", "wine"].map(str::to_owned);
            let open = (orders.order_count(None), orders.has_optional_parts());
            described_order(&done, open, not_done)
        };
        assert_eq!(
            told(task("wine"), &[]),
            "order: sock, trash, wine, the cheapest of 2"
        );
        let optional = Order::Optional(Box::new(task("wine")));
        assert_eq!(
            told(optional, &["dust"]),
            "order: sock, trash, wine: of 3, the cheapest of those that leave the fewest optional \
             parts out; not done: dust"
        );
        let many = described_order(&["sock".to_owned()], (None, false), &[]);
        assert_eq!(many, "order: sock, the cheapest of very many");
    }
}
