//! Two tasks along one corridor: position is all that a state shows, and a step moves by one.

use std::sync::Arc;

use crate::graph::fakes::{Oracle, add_demonstration, forward, task};
use crate::graph::{
    CrossTaskCandidates, Edge, EdgeKind, MergeOptions, NodeId, TopologicalGraph, merge,
};
use crate::model::{Latents, Traversability};
use crate::planner::{Layout, LiveDistances, Search};
use crate::task::{Automaton, Task};

pub(super) const D_MAX: usize = 5;
/// Task `a` reaches its subgoals at 8 and 19, `b` at 28 and 39; `a` ends where `b` begins.
pub(super) const SUBGOALS_AT: [f32; 4] = [8.0, 19.0, 28.0, 39.0];

pub(super) fn tasks() -> [Task; 2] {
    [
        task("a", &["first", "second"]),
        task("b", &["first", "second"]),
    ]
}

pub(super) fn automaton() -> Automaton {
    Automaton::in_order(&tasks())
}

pub(super) fn oracle() -> Oracle {
    Oracle::new(D_MAX, forward)
}

/// Demonstrations of a task from `start` to `start + 19`, each a little aside of the others.
fn demonstrations(task: &Task, start: f32, count: usize) -> TopologicalGraph {
    let mut graph = TopologicalGraph::new(1, D_MAX);
    for aside in 0..count {
        let positions: Vec<Vec<f32>> = (0..20)
            .map(|i| vec![start + i as f32 + 0.3 * aside as f32 / count as f32])
            .collect();
        let id = format!("{}{aside}", task.name);
        add_demonstration(&mut graph, task, &id, &positions, &[8, 19]);
    }
    graph
}

/// Both tasks with many demonstrations and the edges across the seam only.
pub(super) fn crowded(demonstrations_a_task: usize) -> TopologicalGraph {
    let [a, b] = tasks();
    let graphs = [(a, 0.0), (b, 20.0)]
        .map(|(task, start)| demonstrations(&task, start, demonstrations_a_task));
    let options = MergeOptions {
        candidates: CrossTaskCandidates::Seam { window_steps: 2 },
        ..MergeOptions::default()
    };
    in_one(&graphs, &options)
}

/// Both tasks, with learned edges between demonstrations and across the seam.
pub(super) fn merged() -> TopologicalGraph {
    let [a, b] = tasks();
    let mut graphs = [demonstrations(&a, 0.0, 3), demonstrations(&b, 20.0, 3)];
    for graph in &mut graphs {
        add_near_edges(graph);
    }
    let options = MergeOptions {
        seam_floor: 0,
        ..MergeOptions::default()
    };
    in_one(&graphs, &options)
}

/// The graphs of both tasks in one.
fn in_one(graphs: &[TopologicalGraph; 2], options: &MergeOptions) -> TopologicalGraph {
    let [a, b] = graphs;
    let merged = merge(&[a, b], None, &oracle(), options, &|_| ());
    merged.expect("the graphs fit").graph
}

fn add_near_edges(graph: &mut TopologicalGraph) {
    let nodes: Vec<NodeId> = graph.nodes().map(|(id, _)| id).collect();
    for &a in &nodes {
        for &b in &nodes {
            let latents = graph.latents();
            let steps = forward(latents.row(a.index()), latents.row(b.index()));
            let other = graph.node(a).trajectory != graph.node(b).trajectory;
            if let (Some(steps @ 1..5), true) = (steps, other) {
                graph.add_edge(a, b, learned(EdgeKind::Learned, steps, 0.9));
            }
        }
    }
}

/// An edge that is connected with a probability.
pub(super) fn learned(kind: EdgeKind, steps: u32, probability: f32) -> Edge {
    let mut probabilities = vec![0.0; D_MAX];
    probabilities[steps as usize - 1] = probability;
    probabilities[D_MAX - 1] = 1.0 - probability;
    Edge::predicted(kind, &probabilities)
}

/// What the robot predicts at a position.
pub(super) fn seen_from(graph: &Arc<TopologicalGraph>, position: f32) -> LiveDistances {
    seen_by(graph, position, |_| true)
}

/// The same of the states at positions that are asked for.
pub(super) fn seen_by(
    graph: &Arc<TopologicalGraph>,
    position: f32,
    is_asked: impl Fn(f32) -> bool,
) -> LiveDistances {
    let oracle = oracle();
    let states = oracle
        .project(graph.latents())
        .expect("the oracle knows all");
    let current = oracle
        .project(&Latents::from_values(1, vec![position]))
        .expect("the oracle knows all");
    let position_of = |id: &NodeId| graph.latents().row(id.index())[0];
    let nodes: Vec<NodeId> = graph
        .nodes()
        .map(|(id, _)| id)
        .filter(|id| is_asked(position_of(id)))
        .collect();
    LiveDistances::query(&oracle, &states, &current, &nodes, 0.0).expect("the oracle knows all")
}

/// The node of a demonstration at a step.
pub(super) fn node_at(graph: &TopologicalGraph, trajectory: &str, step: u32) -> NodeId {
    graph
        .nodes()
        .find(|(_, n)| n.trajectory == trajectory && n.step == step)
        .map(|(id, _)| id)
        .expect("the demonstration has the step")
}

/// How many subgoals hold for a robot that walked to a position.
pub(super) fn true_stage(position: f32) -> usize {
    SUBGOALS_AT.iter().filter(|at| position >= **at).count()
}

/// A small layout: 120 places.
pub(in crate::planner) fn layout() -> Layout {
    Layout::new(&merged(), &automaton(), Search::InOrder).expect("the corridor has both tasks")
}
