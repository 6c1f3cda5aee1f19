use super::{OrderExplained, OrdersExplained};
use crate::planner::{Plan, Planner};
use crate::task::{Automaton, OrderAutomaton, Task};

/// Most orders that are planned to be compared, the chosen one included.
const PLANNED: usize = 64;
/// Most that are listed.
const LISTED: usize = 6;

/// What the orders cost that the composition allows.
pub(super) fn explain(
    planner: &Planner,
    plan: &Plan,
    orders: &OrderAutomaton,
    tasks: &[Task],
    final_task: Option<&str>,
) -> OrdersExplained {
    let chosen = planner.automaton().tasks();
    let mut explained: Vec<OrderExplained> = orders
        .orders_ending_with(final_task, PLANNED)
        .into_iter()
        .filter(|order| !order.is_empty() && order != chosen)
        .take(PLANNED - 1)
        .map(|order| {
            let plan = plan_in(planner, tasks, &order);
            OrderExplained {
                tasks: order,
                cost: plan.as_ref().map(|p| p.cost),
                steps: plan.map(|p| p.steps),
                left_out: 0,
                is_chosen: false,
            }
        })
        .collect();
    explained.push(OrderExplained {
        tasks: chosen.to_vec(),
        cost: Some(plan.cost),
        steps: Some(plan.steps),
        left_out: 0,
        is_chosen: true,
    });
    let cost = |order: &OrderExplained| order.cost.unwrap_or(f64::INFINITY);
    explained.sort_by(|a, b| {
        cost(a)
            .total_cmp(&cost(b))
            .then(b.is_chosen.cmp(&a.is_chosen))
    });
    let planned = explained.len();
    let connected = explained.iter().filter(|o| o.cost.is_some()).count();
    let chosen_at = explained.iter().position(|o| o.is_chosen);
    // A part that is optional is done although leaving it out is cheaper, so the chosen one may stand low.
    if let Some(at) = chosen_at.filter(|at| *at >= LISTED) {
        explained.swap(at, LISTED - 1);
    }
    explained.truncate(LISTED);
    for order in &mut explained {
        order.left_out = orders.left_out(&order.tasks).unwrap_or(0);
    }
    OrdersExplained {
        order_count: orders.order_count(final_task),
        planned,
        connected,
        listed: explained,
    }
}

/// The plan in another order of tasks.
fn plan_in(planner: &Planner, tasks: &[Task], order: &[String]) -> Option<Plan> {
    let named = |name: &String| tasks.iter().find(|t| t.name == *name).cloned();
    let tasks: Vec<Task> = order.iter().map(named).collect::<Option<_>>()?;
    let automaton = Automaton::in_order(&tasks);
    let other = Planner::new(
        planner.graph().clone(),
        &automaton,
        planner.terms(),
        planner.options().clone(),
    );
    other.ok()?.plan_from_start().ok()
}
