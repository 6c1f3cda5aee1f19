//! The cheapest of several orders, against planning in each of them.

use proptest::prelude::*;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::corridor::{D_MAX, learned};
use super::worlds::{World, free_options, random_world};
use crate::graph::fakes::{add_demonstration, task};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::planner::{
    AvoidedRegion, EdgeCost, Planner, PlannerOptions, Search, Start, Terms, settle_order,
};
use crate::task::{Automaton, Order, OrderAutomaton, Task};

/// The tasks of a world, in some order of theirs that may leave things open.
fn random_order(tasks: &[Task], rng: &mut ChaCha8Rng) -> Order {
    let mut parts: Vec<Order> = tasks.iter().map(|t| Order::Task(t.name.clone())).collect();
    parts.shuffle(rng);
    for part in &mut parts {
        if rng.random_bool(0.3) {
            *part = Order::Optional(Box::new(part.clone()));
        }
    }
    let last = parts.pop().expect("a world has a task");
    match rng.random_range(0..4) {
        _ if parts.is_empty() => last,
        0 => Order::AnyOrder(vec![Order::InOrder(parts), last]),
        1 => Order::Choice(vec![Order::AnyOrder(parts), last]),
        2 => Order::InOrder(vec![Order::Choice(parts), last]),
        _ => {
            parts.push(last);
            Order::AnyOrder(parts)
        }
    }
}

/// All ways through an automaton: the tasks, and how many optional parts are left out.
fn ways(automaton: &OrderAutomaton, state: usize) -> Vec<(Vec<String>, usize)> {
    if state == automaton.last_state() {
        return vec![(Vec::new(), 0)];
    }
    let leaving = automaton.transitions().iter().filter(|t| t.from == state);
    leaving
        .flat_map(|transition| {
            let rest = ways(automaton, transition.to).into_iter();
            rest.map(move |(mut tasks, skips)| match &transition.task {
                Some(task) => {
                    tasks.insert(0, task.clone());
                    (tasks, skips)
                }
                None => (tasks, skips + 1),
            })
        })
        .collect()
}

/// A start of any kind, and some states to avoid.
fn random_terms(world: &mut World, tasks: &[Task]) -> Terms {
    let before = tasks[world.rng.random_range(0..tasks.len())].name.clone();
    let start = match world.rng.random_range(0..4) {
        0 => Start::Anywhere,
        1 => Start::After(before),
        _ => Start::Beginning,
    };
    let share = if world.rng.random_bool(0.5) { 0.1 } else { 0.0 };
    let nodes: Vec<NodeId> = world.graph.nodes().map(|(id, _)| id).collect();
    let states = nodes
        .into_iter()
        .filter(|_| world.rng.random_bool(share))
        .collect();
    let name = "some".to_owned();
    Terms {
        start,
        avoid: vec![AvoidedRegion { name, states }],
        ..Terms::default()
    }
}

/// What the cheapest plan costs that does these tasks in this order.
fn cost_in_order(
    world: &World,
    tasks: &[Task],
    order: &[String],
    (terms, options): (&Terms, &PlannerOptions),
) -> Option<f64> {
    let of = |name: &String| tasks.iter().find(|t| t.name == *name).cloned();
    let order: Vec<Task> = order.iter().filter_map(of).collect();
    let automaton = Automaton::in_order(&order);
    let planner = Planner::new(world.graph.clone(), &automaton, terms, options.clone());
    Some(planner.ok()?.plan_from_start().ok()?.cost)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    #[test]
    fn settled_order_is_the_cheapest_of_all(seed: u64) {
        let mut world = random_world(seed, false);
        let mut options = free_options(&mut world.rng, Search::InOrder);
        options.forward_leap_steps = world.rng.random_bool(0.5).then_some(3);
        let tasks: Vec<Task> = world
            .automaton
            .tasks()
            .iter()
            .map(|name| Task {
                name: name.clone(),
                subgoals: world.automaton.subgoals().iter().filter(|s| s.task == *name).cloned().collect(),
            })
            .collect();
        let order = random_order(&tasks, &mut world.rng);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let terms = random_terms(&mut world, &tasks);
        let how = (&terms, &options);
        let settled = settle_order(
            &world.graph, &automaton, &tasks, None, how,
        ).expect("the graph has all tasks");
        let best = ways(&automaton, 0)
            .into_iter()
            .filter(|(order, _)| !order.is_empty())
            .filter_map(|(order, skips)| {
                Some((skips, cost_in_order(&world, &tasks, &order, how)?))
            })
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        match (settled, best) {
            (None, None) => {}
            (Some(settled), Some((skips, cost))) => {
                prop_assert_eq!(settled.left_out, skips);
                prop_assert!((settled.cost - cost).abs() < 1e-6, "{:?} for {}", settled, cost);
                let own = cost_in_order(&world, &tasks, &settled.tasks, how);
                prop_assert!(own.is_some_and(|own| (own - cost).abs() < 1e-6));
            }
            (settled, best) => prop_assert!(false, "{settled:?} and {best:?} of {order:?}"),
        }
    }
}

#[test]
fn an_optional_part_is_done_however_dear_its_seams_are() {
    let tasks = ["a", "b", "c"].map(|name| task(name, &["done"]));
    let states = [vec![0.0], vec![1.0]];
    let settled = |seams: &[(usize, usize, f32)]| {
        let mut graph = TopologicalGraph::new(1, D_MAX);
        let ends = tasks
            .each_ref()
            .map(|task| add_demonstration(&mut graph, task, &task.name, &states, &[1]));
        for (from, to, probability) in seams {
            let seam = learned(EdgeKind::CrossTask, 1, *probability);
            graph.add_edge(ends[*from][1], ends[*to][0], seam);
        }
        let [a, b, c] = tasks.each_ref().map(|t| Order::Task(t.name.clone()));
        let order = Order::InOrder(vec![a, Order::Optional(Box::new(b)), c]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let options = PlannerOptions {
            cost: EdgeCost::Expected {
                disconnected_steps: 1e6,
            },
            ..PlannerOptions::default()
        };
        let how = (&Terms::default(), &options);
        settle_order(&graph, &automaton, &tasks, None, how)
            .expect("the graph has all tasks")
            .expect("a way")
    };
    // Each of two seams that hold with probability 0.3 costs 0.7 million steps.
    let dear = settled(&[(0, 1, 0.3), (1, 2, 0.3), (0, 2, 0.99)]);
    assert_eq!((dear.tasks.join(" ").as_str(), dear.left_out), ("a b c", 0));
    assert!((dear.cost - 1.4e6).abs() < 10.0, "{}", dear.cost);
    let without = settled(&[(0, 1, 0.3), (0, 2, 0.3)]);
    assert_eq!(
        (without.tasks.join(" ").as_str(), without.left_out),
        ("a c", 1)
    );
    assert!((without.cost - 0.7e6).abs() < 10.0, "{}", without.cost);
}
