use std::collections::HashSet;
use std::convert::Infallible;
use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::build::trajectory_spans;
use super::index::ConnectionIndex;
use super::proposals::ConnectionEmbedding;
use super::scoring::{Scored, Scorer, keep_most_probable_edges};
use super::{
    BuildOptions, Edge, EdgeKind, GraphError, NodeId, PairCandidates, ProgressFn, TopologicalGraph,
};
use crate::model::{Latents, ModelError, Projections, Traversability};

/// States whose pairs are all scored to measure how many edges the candidates miss.
const PROBE_STATES: usize = 12;
/// How often the candidates are widened by the neighbours in time of what was found.
const WIDENINGS: usize = 2;
/// Most parts of a build: more of them would be more files than a folder should hold.
const MOST_PARTS: u64 = 1024;

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

/// Learned edges with the states that they join.
pub type JoinedEdges = Vec<(NodeId, NodeId, Edge)>;

/// Takes the learned edges of a build, part after part: in memory (a `Vec`), or in files, so that an
/// interrupted build goes on where it was.
pub trait EdgeSink {
    /// Why a part could not be kept.
    type Error;

    /// How many pairs were scored for a part that was kept before, if it was.
    fn kept_pairs(&self, part: usize) -> Option<u64>;

    /// Keeps the edges of a part; parts come in order, each once.
    ///
    /// # Errors
    /// What the sink says.
    fn keep(&mut self, part: usize, edges: JoinedEdges, pairs: u64) -> Result<(), Self::Error>;
}

impl EdgeSink for JoinedEdges {
    type Error = Infallible;

    fn kept_pairs(&self, _: usize) -> Option<u64> {
        None
    }

    fn keep(&mut self, _: usize, edges: JoinedEdges, _: u64) -> Result<(), Infallible> {
        self.extend(edges);
        Ok(())
    }
}

/// Why pairs could not be scored, or their edges not be kept.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ScoreError<E> {
    /// The model gave no answer.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The sink failed.
    #[error(transparent)]
    Sink(E),
}

impl<E> From<ModelError> for ScoreError<E> {
    fn from(error: ModelError) -> Self {
        Self::Graph(GraphError::Model(error))
    }
}

/// Scores pairs of a graph's states and hands those that become learned edges to a sink, part after part,
/// in the order of the states that they leave. The graph stays as it is.
///
/// Beside the graph it holds a projection of each state in both roles (and, where candidates are asked for,
/// an embedding of 64 values in both), one block of pairs for each thread, and the edges of one part:
/// those of [`BuildOptions::part_pairs`] pairs, or of a 1024th of all where that is more. The same
/// input gives the same edges on any number of threads, interrupted or not.
///
/// # Errors
/// [`ScoreError::Graph`] when the model gives no answer, [`ScoreError::Sink`] when the sink fails.
pub fn score_pairs<S: EdgeSink>(
    graph: &TopologicalGraph,
    traversability: &(dyn Traversability + Sync),
    options: &BuildOptions,
    sink: &mut S,
    progress: ProgressFn<'_>,
) -> Result<ScoringReport, ScoreError<S::Error>> {
    let projections = traversability.project(graph.latents())?;
    let mut work = Work {
        traversability,
        projections: &projections,
        options,
        progress,
        spans: trajectory_spans(graph),
        proposals: None,
        done: 0,
        total: 0,
    };
    let mut report = ScoringReport {
        all_pairs: work.nodes().map(|n| work.partner_count(n) as u64).sum(),
        scored_pairs: 0,
        probe_states: 0,
        recall: None,
    };
    if let (PairCandidates::Nearest { share, sample }, true) =
        (options.candidates, graph.node_count() > 0)
    {
        let proposals = Proposals::new(traversability, &projections, share, sample)?;
        report.scored_pairs = proposals.embedding_pairs;
        work.proposals = Some(proposals);
    }
    work.total = work.nodes().map(|n| work.target_count(n) as u64).sum();
    for (part, rows) in work.parts().into_iter().enumerate() {
        let pairs = if let Some(pairs) = sink.kept_pairs(part) {
            pairs
        } else {
            let scored = work.score(rows, work.proposals.as_ref())?;
            let pairs = scored.pair_count;
            sink.keep(part, scored.edges, pairs)
                .map_err(ScoreError::Sink)?;
            pairs
        };
        work.done += pairs;
        report.scored_pairs += pairs;
    }
    if work.proposals.is_some() {
        work.probe(&mut report)?;
    }
    Ok(report)
}

/// What does not change while pairs are scored.
struct Work<'a> {
    traversability: &'a (dyn Traversability + Sync),
    projections: &'a Projections,
    options: &'a BuildOptions,
    progress: ProgressFn<'a>,
    spans: Vec<(u32, u32)>,
    proposals: Option<Proposals>,
    /// Pairs scored, and in all, for the progress.
    done: u64,
    total: u64,
}

/// What the candidates of a state are found with.
struct Proposals {
    from: Latents,
    to: ConnectionIndex,
    nearest: usize,
    embedding_pairs: u64,
}

impl Proposals {
    fn new(
        traversability: &(dyn Traversability + Sync),
        projections: &Projections,
        share: f64,
        sample: f64,
    ) -> Result<Self, ModelError> {
        let embedding = ConnectionEmbedding::fit(traversability, projections, sample, 0)?;
        let count = projections.from.len();
        Ok(Self {
            from: embedding.embed_from(&projections.from),
            to: ConnectionIndex::new(embedding.embed_to(&projections.to)),
            nearest: (share.clamp(0.0, 1.0) * count as f64).ceil() as usize,
            embedding_pairs: embedding.scored_pairs(),
        })
    }
}

impl Work<'_> {
    fn nodes(&self) -> Range<u32> {
        0..self.spans.len() as u32
    }

    /// Whether a learned edge may lead from one state to the other.
    fn may_join(&self, node: u32, to: u32) -> bool {
        let (start, end) = self.spans[node as usize];
        // A temporal edge is there already, and a state is not its own successor.
        !(start..end).contains(&to)
            || (self.options.learned.same_trajectory && to != node && to != node + 1)
    }

    /// How many states a learned edge may lead to.
    fn partner_count(&self, node: u32) -> usize {
        let (start, end) = self.spans[node as usize];
        if self.options.learned.same_trajectory {
            // All but itself and its successor.
            self.spans.len() - 1 - usize::from(node + 1 < end)
        } else {
            self.spans.len() - (end - start) as usize
        }
    }

    /// How many states one is scored against, at most.
    fn target_count(&self, node: u32) -> usize {
        let nearest = self.proposals.as_ref().map_or(usize::MAX, |p| p.nearest);
        self.partner_count(node).min(nearest)
    }

    /// Ranges of states whose pairs make a part each.
    fn parts(&self) -> Vec<Range<u32>> {
        let least = self
            .options
            .part_pairs
            .max(self.total.div_ceil(MOST_PARTS))
            .max(1);
        let mut parts = Vec::new();
        let (mut start, mut pairs) = (0, 0);
        for node in self.nodes() {
            pairs += self.target_count(node) as u64;
            if pairs >= least || node + 1 == self.nodes().end {
                parts.push(start..node + 1);
                (start, pairs) = (node + 1, 0);
            }
        }
        parts
    }

    /// Scores states against their candidates, or against all others.
    fn score(&self, rows: Range<u32>, proposals: Option<&Proposals>) -> Result<Scored, ModelError> {
        let scorer = Scorer {
            traversability: self.traversability,
            projections: self.projections,
            rule: &self.options.learned,
            kind: EdgeKind::Learned,
            near_misses: 0,
            progress: self.progress,
            done_before: self.done,
            total: self.total,
        };
        let first = rows.start;
        let rows: Vec<u32> = rows.collect();
        let Some(proposals) = proposals else {
            let all = |node: u32, out: &mut Vec<u32>| {
                out.extend(self.nodes().filter(|to| self.may_join(node, *to)));
            };
            return scorer.score(&rows, &|n| self.partner_count(n), &all);
        };
        let mut proposed: Vec<Vec<u32>> = rows
            .par_iter()
            .map(|node| {
                let from = proposals.from.row(*node as usize);
                let may_join = |to| self.may_join(*node, to);
                proposals
                    .to
                    .most_connected(from, proposals.nearest, may_join)
            })
            .collect();
        let ask = |lists: &[Vec<u32>]| {
            let of = |node: u32| &lists[(node - first) as usize];
            scorer.score(&rows, &|n| of(n).len(), &|n, out| out.extend(of(n)))
        };
        let mut scored = ask(&proposed)?;
        for _ in 0..WIDENINGS {
            let wider = self.widen(&rows, &scored.edges, &proposed);
            let found = ask(&wider)?;
            scored.pair_count += found.pair_count;
            scored.edges = self.join_edges(scored.edges, found.edges);
            for (all, more) in proposed.iter_mut().zip(wider) {
                all.extend(more);
                all.sort_unstable();
            }
        }
        Ok(scored)
    }

    /// For each state those just before and after the states that its edges lead to, unless they were
    /// asked for: what is connected with a state is connected with its neighbours in time, too.
    fn widen(&self, rows: &[u32], edges: &JoinedEdges, asked: &[Vec<u32>]) -> Vec<Vec<u32>> {
        let mut edges = edges.iter().peekable();
        let mut wider = Vec::with_capacity(rows.len());
        for (node, asked) in rows.iter().zip(asked) {
            let mut around = Vec::new();
            while let Some((_, to, _)) = edges.next_if(|(from, _, _)| from.0 == *node) {
                let (start, end) = self.spans[to.index()];
                let before = to.0.checked_sub(1).filter(|before| *before >= start);
                let after = Some(to.0 + 1).filter(|after| *after < end);
                around.extend(before.into_iter().chain(after));
            }
            around.sort_unstable();
            around.dedup();
            around.retain(|to| self.may_join(*node, *to) && asked.binary_search(to).is_err());
            wider.push(around);
        }
        wider
    }

    /// Two lists of edges that are sorted by the states they leave, as one, with the cap on the edges of
    /// each.
    fn join_edges(&self, first: JoinedEdges, second: JoinedEdges) -> JoinedEdges {
        let mut all = first;
        all.extend(second);
        all.sort_by_key(|(from, to, _)| (*from, *to));
        let Some(cap) = self.options.learned.max_out_edges else {
            return all;
        };
        let mut kept = Vec::with_capacity(all.len());
        let mut all = all.into_iter().peekable();
        while let Some(edge) = all.next() {
            let node = edge.0;
            let mut row = vec![edge];
            while let Some(next) = all.next_if(|(from, _, _)| *from == node) {
                row.push(next);
            }
            keep_most_probable_edges(&mut row, cap);
            kept.extend(row);
        }
        kept
    }

    /// Scores all pairs of a few states to measure how many of their edges the candidates hold.
    fn probe(&self, report: &mut ScoringReport) -> Result<(), ModelError> {
        let count = self.spans.len();
        let (mut hits, mut all) = (0, 0);
        for node in self.nodes().step_by(count.div_ceil(PROBE_STATES)) {
            let found = self.score(node..node + 1, self.proposals.as_ref())?;
            let whole = self.score(node..node + 1, None)?;
            let held: HashSet<NodeId> = found.edges.iter().map(|(_, to, _)| *to).collect();
            all += whole.edges.len();
            hits += whole
                .edges
                .iter()
                .filter(|(_, to, _)| held.contains(to))
                .count();
            report.probe_states += 1;
            report.scored_pairs += found.pair_count + whole.pair_count;
        }
        report.recall = Some(if all == 0 {
            1.0
        } else {
            hits as f64 / all as f64
        });
        Ok(())
    }
}
