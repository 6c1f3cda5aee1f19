use serde::{Deserialize, Serialize};

use super::score_pairs::{ScoreError, ScoringReport, score_pairs};
use super::{
    Edge, GraphError, GraphPhase, GraphProgress, LearnedEdges, Node, NodeId, ProgressFn,
    TopologicalGraph,
};
use crate::model::{Encoder, Traversability};
use crate::task::Subgoal;
use crate::trajectory::{DemonstrationSet, Trajectory};

/// Pairs of a part: some seconds of work.
const PART_PAIRS: u64 = 1 << 21;

/// Which pairs of states of different demonstrations the network is asked about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PairCandidates {
    /// All of them, as in the paper.
    #[default]
    All,
    /// For each state those that a [`ConnectionEmbedding`](super::ConnectionEmbedding) holds for most probably connected.
    Nearest {
        /// How many, as a share (0..=1) of all states.
        share: f64,
        /// Share (0..=1) of the states on either side of the sample that the embedding is learnt from; its
        /// square is the share of the pairs that it takes.
        sample: f64,
    },
}

impl PairCandidates {
    fn is_all(&self) -> bool {
        *self == Self::All
    }
}

/// A graph and what it took.
#[derive(Clone, Debug)]
pub struct Built {
    /// The states of all demonstrations with temporal and learned edges.
    pub graph: TopologicalGraph,
    /// How many pairs were scored, and what that missed.
    pub report: ScoringReport,
}

/// How a graph is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BuildOptions {
    /// Which predicted pairs become edges.
    pub learned: LearnedEdges,
    /// Which pairs are scored.
    #[serde(skip_serializing_if = "PairCandidates::is_all")]
    pub candidates: PairCandidates,
    /// How many states are encoded at once.
    pub encode_batch: usize,
    /// Pairs that are scored before their edges are handed on, at least: what an interrupted build
    /// loses, and what it holds in memory.
    #[serde(skip)]
    pub part_pairs: u64,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            learned: LearnedEdges::default(),
            candidates: PairCandidates::All,
            encode_batch: 64,
            part_pairs: PART_PAIRS,
        }
    }
}

/// The topological graph of one task's demonstrations (Fu & Finn, section III-D): each state is a
/// node, successive states are joined by temporal edges, and pairs that the traversability function
/// takes for fewer than `d_max` steps apart by learned edges.
///
/// `subgoal_steps` has an entry for each demonstration: the task's subgoals with the step at which
/// each is first reached. Pairs are scored in blocks and in parallel; the same input gives the same
/// graph on any number of threads. It is [`build_states`] and [`score_pairs`] with all edges in memory.
///
/// # Errors
/// Those of [`build_states`], and [`GraphError::Model`] when the traversability function gives no answer, or not a
/// row for each pair.
///
/// # Panics
/// As [`build_states`].
pub fn build(
    demonstrations: &DemonstrationSet,
    subgoal_steps: &[Vec<(Subgoal, usize)>],
    encoder: &dyn Encoder,
    traversability: &(dyn Traversability + Sync),
    options: &BuildOptions,
    progress: ProgressFn<'_>,
) -> Result<Built, GraphError> {
    let mut graph = build_states(
        demonstrations,
        subgoal_steps,
        encoder,
        traversability.d_max(),
        options.encode_batch,
        progress,
    )?;
    let mut all = Vec::new();
    let scored = score_pairs(&graph, traversability, options, &mut all, progress);
    let report = scored.map_err(|e| match e {
        ScoreError::Graph(e) => e,
    })?;
    for (from, to, edge) in all {
        graph.push_edge(from, to, edge);
    }
    Ok(Built { graph, report })
}

/// The states of one task's demonstrations as nodes, and temporal edges between them.
///
/// # Errors
/// [`GraphError::Model`] when the encoder gives no answer, or not a latent of its own length for each state,
/// [`GraphError::DMaxDiffers`] when it is of another model than a traversability function with `d_max` classes,
/// [`GraphError::SubgoalLists`] and [`GraphError::SubgoalOutOfRange`] when `subgoal_steps` does not fit the
/// demonstrations, [`GraphError::LatentNotFinite`] when a latent holds NaN or infinity.
///
/// # Panics
/// If `d_max` is below 2 (there is no class for "connected"), or the encoder's states have no frame
/// ([`ModelSpec::stack`](crate::model::ModelSpec::stack) is 0).
pub fn build_states(
    demonstrations: &DemonstrationSet,
    subgoal_steps: &[Vec<(Subgoal, usize)>],
    encoder: &dyn Encoder,
    d_max: usize,
    encode_batch: usize,
    progress: ProgressFn<'_>,
) -> Result<TopologicalGraph, GraphError> {
    check(demonstrations, subgoal_steps, encoder, d_max)?;
    let mut graph = TopologicalGraph::new(encoder.spec().latent_dim, d_max);
    let mut done = 0;
    for (trajectory, subgoals) in demonstrations.trajectories().iter().zip(subgoal_steps) {
        let task = demonstrations.task();
        add_trajectory(
            &mut graph,
            task,
            trajectory,
            subgoals,
            encoder,
            encode_batch,
        )?;
        done += trajectory.steps.len() as u64;
        progress(GraphProgress {
            phase: GraphPhase::Encode,
            done,
            total: demonstrations.step_count() as u64,
        });
    }
    Ok(graph)
}

fn check(
    demonstrations: &DemonstrationSet,
    subgoal_steps: &[Vec<(Subgoal, usize)>],
    encoder: &dyn Encoder,
    d_max: usize,
) -> Result<(), GraphError> {
    if encoder.spec().d_max != d_max {
        return Err(GraphError::DMaxDiffers {
            what: "the traversability function".to_owned(),
            expected: encoder.spec().d_max,
            found: d_max,
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
    encode_batch: usize,
) -> Result<(), GraphError> {
    let stack = encoder.spec().stack;
    let steps: Vec<usize> = (0..trajectory.steps.len()).collect();
    let mut previous = None;
    for batch in steps.chunks(encode_batch.max(1)) {
        let states: Vec<_> = batch.iter().map(|s| trajectory.state(*s, stack)).collect();
        let latents = encoder.encode(&states)?;
        latents.ensure_of(states.len(), graph.latents().dim())?;
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
