use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::{Edge, EdgeKind, GraphPhase, GraphProgress, LearnedEdges, NodeId, ProgressFn};
use crate::model::{BLOCK_PAIRS, ModelError, Projections, Traversability};

/// A pair of states and how probable it is that the second lies fewer than `d_max` steps ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredPair {
    /// The state that is left.
    pub from: NodeId,
    /// The state that is to be reached.
    pub to: NodeId,
    /// Probability that they are connected, 0..=1.
    pub connected_probability: f32,
}

/// The edges found among many pairs, and the best of the pairs that became none.
pub(super) struct Scored {
    pub(super) edges: Vec<(NodeId, NodeId, Edge)>,
    /// Most probable first.
    pub(super) near_misses: Vec<(ScoredPair, Edge)>,
    /// Probability of the least of the near misses when there were enough of them: those below it need
    /// not be looked at.
    near_floor: f32,
    pub(super) pair_count: u64,
}

impl Scored {
    fn new() -> Self {
        Self {
            edges: Vec::new(),
            near_misses: Vec::new(),
            near_floor: 0.0,
            pair_count: 0,
        }
    }
}

/// Scores pairs in parallel blocks and keeps what a rule accepts.
///
/// Beside the edges that it keeps, it holds one block of pairs for each thread: no more memory
/// however many pairs there are.
pub(super) struct Scorer<'a> {
    pub(super) traversability: &'a (dyn Traversability + Sync),
    pub(super) projections: &'a Projections,
    pub(super) rule: &'a LearnedEdges,
    pub(super) kind: EdgeKind,
    /// How many rejected pairs to remember.
    pub(super) near_misses: usize,
    pub(super) progress: ProgressFn<'a>,
    /// Pairs scored before, and about so many in all, for the progress.
    pub(super) done_before: u64,
    pub(super) total: u64,
}

impl Scorer<'_> {
    /// Scores every node of `from` against `targets(node)`; `count` says how many those are.
    /// The result does not depend on the number of threads.
    pub(super) fn score(
        &self,
        from: &[u32],
        count: &(dyn Fn(u32) -> usize + Sync),
        targets: &(dyn Fn(u32, &mut Vec<u32>) + Sync),
    ) -> Result<Scored, ModelError> {
        let done = AtomicU64::new(self.done_before);
        let groups = group_rows(from, count);
        let parts: Vec<Scored> = groups
            .into_par_iter()
            .map(|rows| {
                let part = self.score_rows(&from[rows], targets)?;
                let done = done.fetch_add(part.pair_count, Ordering::Relaxed) + part.pair_count;
                (self.progress)(GraphProgress {
                    phase: GraphPhase::Score,
                    done,
                    total: self.total.max(done),
                });
                Ok(part)
            })
            .collect::<Result<_, ModelError>>()?;
        Ok(self.join(parts))
    }

    fn join(&self, parts: Vec<Scored>) -> Scored {
        let mut all = Scored::new();
        for part in parts {
            all.edges.extend(part.edges);
            all.near_misses.extend(part.near_misses);
            all.pair_count += part.pair_count;
            if all.near_misses.len() > 4 * self.near_misses + 1024 {
                keep_most_probable(&mut all.near_misses, self.near_misses);
            }
        }
        keep_most_probable(&mut all.near_misses, self.near_misses);
        all
    }

    fn score_rows(
        &self,
        rows: &[u32],
        targets: &(dyn Fn(u32, &mut Vec<u32>) + Sync),
    ) -> Result<Scored, ModelError> {
        let mut part = Scored::new();
        let mut row_targets = Vec::new();
        let mut pairs = Vec::new();
        for &row in rows {
            row_targets.clear();
            targets(row, &mut row_targets);
            pairs.extend(row_targets.iter().map(|&to| (row, to)));
        }
        let mut row_edges = Vec::new();
        for block in pairs.chunks(BLOCK_PAIRS) {
            let predicted =
                self.traversability
                    .predict(self.projections, self.projections, block)?;
            predicted.ensure_of(block.len(), self.traversability.d_max())?;
            for (&(from, to), probabilities) in block.iter().zip(predicted.rows()) {
                self.sort_in(
                    (NodeId(from), NodeId(to)),
                    probabilities,
                    &mut row_edges,
                    &mut part,
                );
            }
        }
        self.flush(&mut row_edges, &mut part);
        keep_most_probable(&mut part.near_misses, self.near_misses);
        part.pair_count = pairs.len() as u64;
        Ok(part)
    }

    fn sort_in(
        &self,
        (from, to): (NodeId, NodeId),
        probabilities: &[f32],
        row_edges: &mut Vec<(NodeId, NodeId, Edge)>,
        part: &mut Scored,
    ) {
        if self.rule.accepts(probabilities) {
            if row_edges.last().is_some_and(|(row, _, _)| *row != from) {
                self.flush(row_edges, part);
            }
            row_edges.push((from, to, Edge::predicted(self.kind, probabilities)));
            return;
        }
        let connected_probability = 1.0 - probabilities[probabilities.len() - 1];
        if self.near_misses == 0 || connected_probability < part.near_floor {
            return;
        }
        let pair = ScoredPair {
            from,
            to,
            connected_probability,
        };
        part.near_misses
            .push((pair, Edge::predicted(self.kind, probabilities)));
        if part.near_misses.len() > 4 * self.near_misses + 256 {
            keep_most_probable(&mut part.near_misses, self.near_misses);
            let last = part.near_misses.last();
            part.near_floor = last.map_or(0.0, |(pair, _)| pair.connected_probability);
        }
    }

    /// Ends a row: applies the cap on the edges that leave a node.
    fn flush(&self, row_edges: &mut Vec<(NodeId, NodeId, Edge)>, part: &mut Scored) {
        if let Some(cap) = self.rule.max_out_edges {
            keep_most_probable_edges(row_edges, cap);
        }
        part.edges.append(row_edges);
    }
}

/// Consecutive rows whose pairs fill about one block; a row is never cut.
fn group_rows(from: &[u32], count: &(dyn Fn(u32) -> usize + Sync)) -> Vec<Range<usize>> {
    let mut groups = Vec::new();
    let (mut start, mut pairs) = (0, 0);
    for (i, &row) in from.iter().enumerate() {
        let more = count(row);
        if i > start && pairs + more > BLOCK_PAIRS {
            groups.push(start..i);
            (start, pairs) = (i, 0);
        }
        pairs += more;
    }
    if start < from.len() {
        groups.push(start..from.len());
    }
    groups
}

fn keep_most_probable(pairs: &mut Vec<(ScoredPair, Edge)>, count: usize) {
    pairs.sort_by(|(a, _), (b, _)| {
        b.connected_probability
            .total_cmp(&a.connected_probability)
            .then((a.from, a.to).cmp(&(b.from, b.to)))
    });
    pairs.truncate(count);
}

/// The `cap` most probable edges of one node, in the order of their targets.
pub(super) fn keep_most_probable_edges(edges: &mut Vec<(NodeId, NodeId, Edge)>, cap: usize) {
    if edges.len() <= cap {
        return;
    }
    edges.sort_by(|(_, a, x), (_, b, y)| {
        y.connected_probability()
            .total_cmp(&x.connected_probability())
            .then(x.steps.cmp(&y.steps))
            .then(a.cmp(b))
    });
    edges.truncate(cap);
    edges.sort_by_key(|(_, to, _)| *to);
}
