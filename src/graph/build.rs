use std::collections::HashSet;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::proposals::{ConnectionEmbedding, most_connected};
use super::scoring::Scorer;
use super::{
    Edge, EdgeKind, GraphError, GraphPhase, GraphProgress, LearnedEdges, Node, NodeId, ProgressFn,
    TopologicalGraph,
};
use crate::model::{Encoder, Traversability};
use crate::task::Subgoal;
use crate::trajectory::{DemonstrationSet, Trajectory};

/// States whose pairs are all scored to measure how many edges the candidates miss.
const PROBE_STATES: usize = 16;

/// Which pairs of states of different demonstrations the network is asked about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PairCandidates {
    /// All of them, as in the paper.
    #[default]
    All,
    /// For each state those that a [`ConnectionEmbedding`] holds for most probably connected.
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

/// What the learned edges of a graph took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoringReport {
    /// Pairs that all states make.
    pub all_pairs: u64,
    /// Pairs that the network was asked about, those of the sample and of the probe included.
    pub scored_pairs: u64,
    /// States of which all pairs were scored too, to measure the recall.
    pub probe_states: usize,
    /// Share of the edges of these states that the candidates found; `None` where all pairs were scored.
    pub recall: Option<f64>,
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
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            learned: LearnedEdges::default(),
            candidates: PairCandidates::All,
            encode_batch: 64,
        }
    }
}

/// The topological graph of one task's demonstrations (Fu & Finn, section III-D): each state is a
/// node, successive states are joined by temporal edges, and pairs that the traversability function
/// takes for fewer than `d_max` steps apart by learned edges.
///
/// `subgoal_steps` has an entry for each demonstration: the task's subgoals with the step at which
/// each is first reached. Pairs are scored in blocks and in parallel; the same input gives the same
/// graph on any number of threads.
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
) -> Result<Built, GraphError> {
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
    let report = add_learned_edges(&mut graph, traversability, options, progress)?;
    Ok(Built { graph, report })
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

/// Scores pairs of the graph's nodes and adds those that the rule accepts.
fn add_learned_edges(
    graph: &mut TopologicalGraph,
    traversability: &(dyn Traversability + Sync),
    options: &BuildOptions,
    progress: ProgressFn<'_>,
) -> Result<ScoringReport, GraphError> {
    let projections = traversability.project(graph.latents())?;
    let spans = trajectory_spans(graph);
    let count = graph.node_count();
    let nodes: Vec<u32> = (0..count as u32).collect();
    let rule = &options.learned;
    let may_join = |node: u32, to: u32| {
        let (start, end) = spans[node as usize];
        // A temporal edge is there already, and a state is not its own successor.
        !(start..end).contains(&to) || (rule.same_trajectory && to != node && to != node + 1)
    };
    let all_partners = |node: u32| {
        let (start, end) = spans[node as usize];
        if rule.same_trajectory {
            count
        } else {
            count - (end - start) as usize
        }
    };
    let all_targets = |node: u32, out: &mut Vec<u32>| {
        out.extend((0..count as u32).filter(|to| may_join(node, *to)));
    };
    let scorer = |total: u64| Scorer {
        traversability,
        projections: &projections,
        rule,
        kind: EdgeKind::Learned,
        near_misses: 0,
        progress,
        done_before: 0,
        total,
    };
    let mut report = ScoringReport {
        all_pairs: nodes.iter().map(|n| all_partners(*n) as u64).sum(),
        scored_pairs: 0,
        probe_states: 0,
        recall: None,
    };
    let scored = match options.candidates {
        PairCandidates::Nearest { share, sample } if count > 0 => {
            let embedding = ConnectionEmbedding::fit(traversability, &projections, sample, 0)?;
            let from = embedding.embed_from(&projections.from);
            let to = embedding.embed_to(&projections.to);
            let nearest = (share.clamp(0.0, 1.0) * count as f64).ceil() as usize;
            let proposed: Vec<Vec<u32>> = nodes
                .par_iter()
                .map(|node| {
                    most_connected(from.row(*node as usize), &to, nearest, |b| {
                        may_join(*node, b)
                    })
                })
                .collect();
            let total = proposed.iter().map(|targets| targets.len() as u64).sum();
            let scored =
                scorer(total).score(&nodes, &|n| proposed[n as usize].len(), &|n, out| {
                    out.extend(&proposed[n as usize]);
                })?;
            let probe: Vec<u32> = nodes
                .iter()
                .step_by(count.div_ceil(PROBE_STATES))
                .copied()
                .collect();
            let total = probe.iter().map(|n| all_partners(*n) as u64).sum();
            let whole = scorer(total).score(&probe, &all_partners, &all_targets)?;
            report.probe_states = probe.len();
            report.recall = Some(recall(&scored.edges, &whole.edges));
            report.scored_pairs = embedding.scored_pairs() + whole.pair_count;
            scored
        }
        _ => scorer(report.all_pairs).score(&nodes, &all_partners, &all_targets)?,
    };
    report.scored_pairs += scored.pair_count;
    for (from, to, edge) in scored.edges {
        graph.push_edge(from, to, edge);
    }
    Ok(report)
}

/// The share of `all` edges that are among those `found`; 1 where there are none.
fn recall(found: &[(NodeId, NodeId, Edge)], all: &[(NodeId, NodeId, Edge)]) -> f64 {
    let found: HashSet<(NodeId, NodeId)> = found.iter().map(|(a, b, _)| (*a, *b)).collect();
    let hits = all.iter().filter(|(a, b, _)| found.contains(&(*a, *b)));
    if all.is_empty() {
        return 1.0;
    }
    hits.count() as f64 / all.len() as f64
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
