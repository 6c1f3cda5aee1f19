use serde::{Deserialize, Serialize};

use super::scoring::Scorer;
use super::{
    Edge, EdgeKind, GraphError, GraphPhase, GraphProgress, LearnedEdges, Node, NodeId, ProgressFn,
    TopologicalGraph,
};
use crate::model::{Encoder, Traversability};
use crate::task::Subgoal;
use crate::trajectory::{DemonstrationSet, Trajectory};

/// How a graph is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BuildOptions {
    /// Which predicted pairs become edges.
    pub learned: LearnedEdges,
    /// How many states are encoded at once.
    pub encode_batch: usize,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            learned: LearnedEdges::default(),
            encode_batch: 64,
        }
    }
}

/// The topological graph of one task's demonstrations (Fu & Finn, section III-D): each state is a
/// node, successive states are joined by temporal edges, and pairs that the traversability function
/// takes for fewer than `d_max` steps apart by learned edges.
///
/// `subgoal_steps` has an entry for each demonstration: the task's subgoals with the step at which
/// each is first reached. All pairs are scored, in blocks and in parallel; the same input gives the
/// same graph on any number of threads.
///
/// # Errors
/// [`GraphError::Model`] when the model gives no answer, [`GraphError::DMaxDiffers`] when encoder and
/// traversability are of different models, [`GraphError::SubgoalLists`] and
/// [`GraphError::SubgoalOutOfRange`] when `subgoal_steps` does not fit the demonstrations,
/// [`GraphError::LatentNotFinite`] when a latent holds NaN or infinity.
pub fn build(
    demonstrations: &DemonstrationSet,
    subgoal_steps: &[Vec<(Subgoal, usize)>],
    encoder: &dyn Encoder,
    traversability: &(dyn Traversability + Sync),
    options: &BuildOptions,
    progress: ProgressFn<'_>,
) -> Result<TopologicalGraph, GraphError> {
    check(demonstrations, subgoal_steps, encoder, traversability)?;
    let mut graph = TopologicalGraph::new(encoder.spec().latent_dim, traversability.d_max());
    let mut done = 0;
    for (trajectory, subgoals) in demonstrations.trajectories().iter().zip(subgoal_steps) {
        add_trajectory(
            &mut graph,
            demonstrations.task(),
            trajectory,
            subgoals,
            encoder,
            options,
        )?;
        done += trajectory.steps.len() as u64;
        progress(GraphProgress {
            phase: GraphPhase::Encode,
            done,
            total: demonstrations.step_count() as u64,
        });
    }
    add_learned_edges(&mut graph, traversability, &options.learned, progress)?;
    Ok(graph)
}

fn check(
    demonstrations: &DemonstrationSet,
    subgoal_steps: &[Vec<(Subgoal, usize)>],
    encoder: &dyn Encoder,
    traversability: &(dyn Traversability + Sync),
) -> Result<(), GraphError> {
    if encoder.spec().d_max != traversability.d_max() {
        return Err(GraphError::DMaxDiffers {
            what: "the traversability function".to_owned(),
            expected: encoder.spec().d_max,
            found: traversability.d_max(),
        });
    }
    let trajectories = demonstrations.trajectories();
    if subgoal_steps.len() != trajectories.len() {
        return Err(GraphError::SubgoalLists {
            task: demonstrations.task().to_owned(),
            expected: trajectories.len(),
            found: subgoal_steps.len(),
        });
    }
    for (trajectory, subgoals) in trajectories.iter().zip(subgoal_steps) {
        if let Some((subgoal, step)) = subgoals.iter().find(|(_, s)| *s >= trajectory.steps.len()) {
            return Err(GraphError::SubgoalOutOfRange {
                trajectory: trajectory.id.clone(),
                subgoal: subgoal.name.clone(),
                step: *step,
                steps: trajectory.steps.len(),
            });
        }
    }
    Ok(())
}

/// Adds the states of one demonstration and the temporal edges between them.
fn add_trajectory(
    graph: &mut TopologicalGraph,
    task: &str,
    trajectory: &Trajectory,
    subgoals: &[(Subgoal, usize)],
    encoder: &dyn Encoder,
    options: &BuildOptions,
) -> Result<(), GraphError> {
    let stack = encoder.spec().stack;
    let steps: Vec<usize> = (0..trajectory.steps.len()).collect();
    let mut previous = None;
    for batch in steps.chunks(options.encode_batch.max(1)) {
        let states: Vec<_> = batch.iter().map(|s| trajectory.state(*s, stack)).collect();
        let latents = encoder.encode(&states)?;
        for (row, &step) in batch.iter().enumerate() {
            let node = node_at(task, trajectory, subgoals, step);
            let latent = latents.row(row);
            if let Some(value) = latent.iter().find(|v| !v.is_finite()) {
                return Err(GraphError::LatentNotFinite {
                    task: node.task,
                    trajectory: node.trajectory,
                    step: node.step,
                    value: value.to_string(),
                });
            }
            let id = graph.add_node(node, latent);
            if let Some(previous) = previous.replace(id) {
                graph.add_edge(previous, id, Edge::temporal(graph.d_max()));
            }
        }
    }
    Ok(())
}

fn node_at(
    task: &str,
    trajectory: &Trajectory,
    subgoals: &[(Subgoal, usize)],
    step: usize,
) -> Node {
    Node {
        task: task.to_owned(),
        trajectory: trajectory.id.clone(),
        step: step as u32,
        reached: subgoals
            .iter()
            .filter(|(_, s)| *s == step)
            .map(|(subgoal, _)| subgoal.clone())
            .collect(),
        progress: subgoals.iter().filter(|(_, s)| *s <= step).count() as u32,
        is_end: step + 1 == trajectory.steps.len(),
    }
}

/// Scores all pairs of the graph's nodes and adds those that the rule accepts.
fn add_learned_edges(
    graph: &mut TopologicalGraph,
    traversability: &(dyn Traversability + Sync),
    rule: &LearnedEdges,
    progress: ProgressFn<'_>,
) -> Result<(), GraphError> {
    let projections = traversability.project(graph.latents())?;
    let spans = trajectory_spans(graph);
    let count = graph.node_count();
    let nodes: Vec<u32> = (0..count as u32).collect();
    let partners = |node: u32| {
        let (start, end) = spans[node as usize];
        if rule.same_trajectory {
            count
        } else {
            count - (end - start) as usize
        }
    };
    let targets = |node: u32, out: &mut Vec<u32>| {
        let (start, end) = spans[node as usize];
        out.extend((0..count as u32).filter(|&to| {
            let inside = (start..end).contains(&to);
            // A temporal edge is there already, and a state is not its own successor.
            !inside || (rule.same_trajectory && to != node && to != node + 1)
        }));
    };
    let total = nodes.iter().map(|n| partners(*n) as u64).sum();
    let scored = Scorer {
        traversability,
        projections: &projections,
        rule,
        kind: EdgeKind::Learned,
        near_misses: 0,
        progress,
        done_before: 0,
        total,
    }
    .score(&nodes, &partners, &targets)?;
    for (from, to, edge) in scored.edges {
        graph.push_edge(from, to, edge);
    }
    Ok(())
}

/// For each node, the range of nodes that belong to its demonstration.
pub(super) fn trajectory_spans(graph: &TopologicalGraph) -> Vec<(u32, u32)> {
    let mut spans = vec![(0, 0); graph.node_count()];
    let same = |a: u32, b: u32| {
        let (a, b) = (graph.node(NodeId(a)), graph.node(NodeId(b)));
        a.trajectory == b.trajectory && a.task == b.task
    };
    let mut start = 0;
    for i in 0..graph.node_count() as u32 {
        if i + 1 == graph.node_count() as u32 || !same(i, i + 1) {
            spans[start as usize..=i as usize].fill((start, i + 1));
            start = i + 1;
        }
    }
    spans
}
