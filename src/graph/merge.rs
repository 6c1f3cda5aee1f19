use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::candidates::{Batch, Candidates, CrossTaskCandidates};
use super::scoring::{Scored, Scorer};
use super::{
    Edge, EdgeKind, GraphError, LearnedEdges, NodeId, ProgressFn, ScoredPair, TopologicalGraph,
};
use crate::model::{Projections, Traversability};

/// How graphs are merged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MergeOptions {
    /// Which pairs are scored.
    pub candidates: CrossTaskCandidates,
    /// Which of them become cross-task edges.
    pub learned: LearnedEdges,
    /// At each seam at least so many edges are kept, the most probable ones, even if `d_max` is the
    /// most probable class of some: training labels every pair of two tasks "far", so a seam may have
    /// no better edge. Their probabilities stay as they are, for the planner to price and a person to
    /// judge; a planner that costs by `argmax` does not use them.
    pub seam_floor: usize,
}

impl Default for MergeOptions {
    fn default() -> Self {
        Self {
            candidates: CrossTaskCandidates::Seam { window_steps: 10 },
            learned: LearnedEdges::default(),
            seam_floor: 30,
        }
    }
}

/// What was found between two tasks that follow each other.
#[derive(Clone, Debug, PartialEq)]
pub struct SeamReport {
    /// The task that ends.
    pub from_task: String,
    /// The task that begins.
    pub to_task: String,
    /// How many pairs were scored.
    pub pair_count: u64,
    /// How many became edges by rule.
    pub accepted: usize,
    /// How many became edges only because of the floor.
    pub below_rule: usize,
    /// The best pairs that the rule rejected, most probable first, the ones kept by the floor too.
    pub near_misses: Vec<ScoredPair>,
}

/// What merging found.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct MergeReport {
    /// A report for each two tasks of which the second may follow the first.
    pub seams: Vec<SeamReport>,
    /// How many pairs were scored in all.
    pub pair_count: u64,
}

/// A merged graph and what was found on the way.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The nodes of all tasks, task after task as the graphs were given, with the edges they had and
    /// cross-task edges.
    pub graph: TopologicalGraph,
    /// What was scored and what came close.
    pub report: MergeReport,
}

/// How many near misses a seam report holds at least.
const NEAR_MISSES: usize = 10;

/// One graph out of those of several tasks, with cross-task edges where the traversability function
/// predicts a way from a state of one task to a state of another (Fu & Finn, section IV,
/// "Experience Chaining").
///
/// `follows` says which task may come right after which, and so which seams there are: no pair, no seam.
/// `None` means the order of `graphs`. A task may follow itself: the edges from its ends to its starts are
/// cross-task edges too, since they lead from one time that it is done into the next.
///
/// # Errors
/// [`GraphError::NothingToMerge`], [`GraphError::NoStates`], [`GraphError::TaskTwice`] and [`GraphError::UnknownTask`] for
/// graphs and pairs of tasks that make no sense, [`GraphError::DMaxDiffers`] and
/// [`GraphError::LatentLengthDiffers`] for graphs of different models, [`GraphError::Model`] when the
/// model gives no answer.
pub fn merge(
    graphs: &[&TopologicalGraph],
    follows: Option<&[(&str, &str)]>,
    traversability: &(dyn Traversability + Sync),
    options: &MergeOptions,
    progress: ProgressFn<'_>,
) -> Result<Merged, GraphError> {
    check(graphs, follows, traversability)?;
    let mut graph = join(graphs);
    let tasks: Vec<String> = graph.tasks().into_iter().map(str::to_owned).collect();
    let seams: BTreeSet<(usize, usize)> = match follows {
        None => (1..tasks.len()).map(|next| (next - 1, next)).collect(),
        Some(pairs) => pairs
            .iter()
            .map(|(from, to)| (task_index(&tasks, from), task_index(&tasks, to)))
            .collect(),
    };
    let work = Work {
        candidates: Candidates::new(&graph, &tasks, seams),
        options,
        tasks: &tasks,
        graph_of: graph_of(graphs),
    };
    let projections = traversability.project(graph.latents())?;
    let report = work.run(&mut graph, traversability, &projections, progress)?;
    Ok(Merged { graph, report })
}

/// For each task, in the order of the joined graph, which of the graphs it is from.
fn graph_of(graphs: &[&TopologicalGraph]) -> Vec<usize> {
    let graphs = graphs.iter().enumerate();
    graphs
        .flat_map(|(number, graph)| vec![number; graph.tasks().len()])
        .collect()
}

fn task_index(tasks: &[String], name: &str) -> usize {
    tasks
        .iter()
        .position(|t| t == name)
        .expect("the names were checked")
}

fn check(
    graphs: &[&TopologicalGraph],
    follows: Option<&[(&str, &str)]>,
    traversability: &(dyn Traversability + Sync),
) -> Result<(), GraphError> {
    let first = graphs.first().ok_or(GraphError::NothingToMerge)?;
    let mut tasks: Vec<&str> = Vec::new();
    for (number, graph) in graphs.iter().enumerate() {
        graph.ensure_states(&format!("graph {} of those to merge", number + 1))?;
        let what = format!("the graph of '{}'", graph.tasks().join(", "));
        graph.ensure_fits(&what, traversability.d_max(), first.latents().dim())?;
        for task in graph.tasks() {
            if tasks.contains(&task) {
                return Err(GraphError::TaskTwice {
                    task: task.to_owned(),
                });
            }
            tasks.push(task);
        }
    }
    let pairs = follows.unwrap_or_default().iter();
    let named = pairs.flat_map(|(from, to)| [from, to]);
    match named.into_iter().find(|t| !tasks.contains(*t)) {
        Some(task) => Err(GraphError::UnknownTask {
            task: (*task).to_owned(),
            known: tasks.join(", "),
        }),
        None => Ok(()),
    }
}

/// All nodes and edges in one graph, renumbered.
fn join(graphs: &[&TopologicalGraph]) -> TopologicalGraph {
    let mut all = TopologicalGraph::new(graphs[0].latents().dim(), graphs[0].d_max());
    for graph in graphs {
        let offset = all.node_count() as u32;
        for (id, node) in graph.nodes() {
            all.add_node(node.clone(), graph.latents().row(id.index()));
        }
        for (from, to, edge) in graph.edges() {
            all.push_edge(NodeId(from.0 + offset), NodeId(to.0 + offset), edge.clone());
        }
    }
    all
}

/// Scores the candidates and adds what is found.
struct Work<'a> {
    candidates: Candidates,
    options: &'a MergeOptions,
    tasks: &'a [String],
    /// For each task, which of the graphs it is from.
    graph_of: Vec<usize>,
}

impl Work<'_> {
    fn run(
        &self,
        graph: &mut TopologicalGraph,
        traversability: &(dyn Traversability + Sync),
        projections: &Projections,
        progress: ProgressFn<'_>,
    ) -> Result<MergeReport, GraphError> {
        let batches = self.candidates.batches(self.options.candidates);
        let total = batches.iter().map(Batch::pair_count).sum();
        let mut report = MergeReport::default();
        for batch in &batches {
            let scored = Scorer {
                traversability,
                projections,
                rule: &self.options.learned,
                kind: EdgeKind::CrossTask,
                near_misses: if batch.is_seam {
                    NEAR_MISSES.max(self.options.seam_floor)
                } else {
                    0
                },
                progress,
                done_before: report.pair_count,
                total,
            }
            .score(&batch.from, &|f| batch.targets(f).len(), &|f, out| {
                out.extend_from_slice(batch.targets(f));
            })?;
            report.pair_count += scored.pair_count;
            let seam = self.add(graph, batch, scored);
            report.seams.extend(seam);
        }
        Ok(report)
    }

    fn add(
        &self,
        graph: &mut TopologicalGraph,
        batch: &Batch,
        scored: Scored,
    ) -> Option<SeamReport> {
        let accepted = scored.edges.len();
        let may_be_joined = self.graph_of[batch.from_task] == self.graph_of[batch.to_task];
        for (from, to, edge) in scored.edges {
            add_crossing(graph, may_be_joined, (from, to), edge);
        }
        if !batch.is_seam {
            return None;
        }
        let below_rule = self
            .options
            .seam_floor
            .saturating_sub(accepted)
            .min(scored.near_misses.len());
        let floor: Vec<(ScoredPair, Edge)> = scored.near_misses;
        for (pair, edge) in &floor[..below_rule] {
            add_crossing(graph, may_be_joined, (pair.from, pair.to), edge.clone());
        }
        Some(SeamReport {
            from_task: self.tasks[batch.from_task].clone(),
            to_task: self.tasks[batch.to_task].clone(),
            pair_count: scored.pair_count,
            accepted,
            below_rule,
            near_misses: floor.into_iter().map(|(pair, _)| pair).collect(),
        })
    }
}

/// Between states of two graphs there is no edge yet. Within one, which may have been merged before, there may be, and
/// a state need not be left for itself.
fn add_crossing(
    graph: &mut TopologicalGraph,
    may_be_joined: bool,
    (from, to): (NodeId, NodeId),
    edge: Edge,
) {
    if !may_be_joined {
        graph.push_edge(from, to, edge);
    } else if from != to {
        graph.add_edge(from, to, edge);
    }
}
