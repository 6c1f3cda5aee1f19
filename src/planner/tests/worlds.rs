//! Small random graphs of compositions, and what the robot sees in them.

use std::sync::Arc;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::graph::fakes::{add_demonstration, task};
use crate::graph::{Edge, EdgeKind, NodeId, PruneOptions, TopologicalGraph};
use crate::planner::{
    EdgeChoice, EdgeCost, Join, LiveDistances, Localisation, PlannerOptions, Search,
};
use crate::task::{Automaton, Task};

pub(super) const D_MAX: usize = 5;

/// A graph of up to three tasks, a composition of them, and distances from a current state.
pub(super) struct World {
    pub(super) graph: Arc<TopologicalGraph>,
    pub(super) automaton: Automaton,
    pub(super) distances: LiveDistances,
    pub(super) stage: usize,
    pub(super) rng: ChaCha8Rng,
}

/// With `repeat_task` the composition does one of its tasks a second time, it may be at once, and edges
/// across tasks also join a task with itself, as those from its ends to its starts do.
pub(super) fn random_world(seed: u64, repeat_task: bool) -> World {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let names = ["a", "b", "c"];
    let tasks: Vec<Task> = names[..rng.random_range(1..=3)]
        .iter()
        .map(|n| task(n, &["first", "second"][..rng.random_range(1..=2)]))
        .collect();
    let mut graph = TopologicalGraph::new(1, D_MAX);
    for task in &tasks {
        for trajectory in 0..rng.random_range(1..=2) {
            add_random_demonstration(&mut graph, task, trajectory, &mut rng);
        }
    }
    add_random_edges(&mut graph, repeat_task, &mut rng);
    let mut order = tasks.clone();
    if repeat_task {
        order.push(tasks[rng.random_range(0..tasks.len())].clone());
    }
    let automaton = Automaton::in_order(&order);
    let mut distances = LiveDistances::unknown(graph.node_count(), D_MAX);
    for node in (0..graph.node_count() as u32).map(NodeId) {
        if rng.random_bool(0.6) {
            distances.set_to(node, &distribution(&mut rng));
            distances.set_from(node, &distribution(&mut rng));
        }
    }
    World {
        stage: rng.random_range(0..automaton.stage_count()),
        graph: Arc::new(graph),
        automaton,
        distances,
        rng,
    }
}

fn add_random_demonstration(
    graph: &mut TopologicalGraph,
    task: &Task,
    trajectory: usize,
    rng: &mut ChaCha8Rng,
) {
    let steps = rng.random_range(2..=4);
    let mut at: Vec<usize> = task
        .subgoals
        .iter()
        .map(|_| rng.random_range(0..steps))
        .collect();
    at.sort_unstable();
    if rng.random_bool(0.1) {
        at.pop();
    }
    let latents: Vec<Vec<f32>> = (0..steps).map(|_| vec![rng.random()]).collect();
    let id = format!("{}_{trajectory}", task.name);
    add_demonstration(graph, task, &id, &latents, &at);
}

fn add_random_edges(graph: &mut TopologicalGraph, with_rounds: bool, rng: &mut ChaCha8Rng) {
    let nodes = graph.node_count() as u32;
    for _ in 0..rng.random_range(0..4 * nodes) {
        let (a, b) = (
            NodeId(rng.random_range(0..nodes)),
            NodeId(rng.random_range(0..nodes)),
        );
        let is_round = with_rounds && rng.random_bool(0.3);
        let kind = if graph.node(a).task == graph.node(b).task && !is_round {
            EdgeKind::Learned
        } else {
            EdgeKind::CrossTask
        };
        if a != b {
            graph.add_edge(a, b, Edge::predicted(kind, &distribution(rng)));
        }
    }
}

pub(super) fn distribution(rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut p: Vec<f32> = (0..D_MAX).map(|_| rng.random::<f32>().powi(3)).collect();
    let sum: f32 = p.iter().sum();
    for p in &mut p {
        *p /= sum;
    }
    p
}

/// Options that bound nothing, so that a textbook search is the reference.
pub(super) fn free_options(rng: &mut ChaCha8Rng, search: Search) -> PlannerOptions {
    let costs = [
        EdgeCost::Argmax,
        EdgeCost::Expected {
            disconnected_steps: 20.0,
        },
        EdgeCost::RiskAverse { lambda: 2.0 },
    ];
    PlannerOptions {
        search,
        cost: costs[rng.random_range(0..3)],
        edges: [EdgeChoice::All, EdgeChoice::TemporalOnly][rng.random_range(0..2)],
        predicted_edges: PruneOptions::default(),
        forward_leap_steps: None,
        min_live_probability: 0.0,
        join: Join::Cheapest,
        lookahead_steps: rng.random_range(0..4),
    }
}

/// The robot taken to be at a stage, and at a state that leaves everything open.
pub(super) fn somewhere(stage: usize, stages: usize) -> Localisation {
    Localisation {
        node: NodeId(0),
        occurrence: usize::MAX,
        stage,
        time_steps: 0.0,
        stage_probabilities: vec![1.0 / stages as f64; stages],
        entropy_nats: 0.0,
        fit: 1.0,
        is_lost: false,
        change: None,
    }
}
