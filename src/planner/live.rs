use crate::graph::NodeId;
use crate::model::{ModelError, Projections, Traversability, predict_in_blocks};

/// The current state joined to the graph: predicted steps from it to states of the graph, and from
/// them to it (Fu & Finn, section III-D).
#[derive(Clone, Debug, PartialEq)]
pub struct LiveDistances {
    d_max: usize,
    node_count: usize,
    /// A row a node; a row of NaN for a node that was not asked for.
    to: Vec<f32>,
    from: Vec<f32>,
}

impl LiveDistances {
    /// Distances for a graph of `node_count` nodes, none known yet.
    #[must_use]
    pub fn unknown(node_count: usize, d_max: usize) -> Self {
        Self {
            d_max,
            node_count,
            to: vec![f32::NAN; node_count * d_max],
            from: vec![f32::NAN; node_count * d_max],
        }
    }

    /// Asks the traversability function, from the current state to all `nodes`, and back from those
    /// that are connected with at least `min_probability` (0..=1): others are nowhere near, and asking
    /// in one direction halves the work.
    ///
    /// `graph` has a row a node, `current` one row.
    ///
    /// # Errors
    /// [`ModelError`] when the network gives no answer.
    ///
    /// # Panics
    /// If a node has no row.
    pub fn query(
        traversability: &(dyn Traversability + Sync),
        graph: &Projections,
        current: &Projections,
        nodes: &[NodeId],
        min_probability: f32,
    ) -> Result<Self, ModelError> {
        let d_max = traversability.d_max();
        let mut distances = Self::unknown(graph.from.len(), d_max);
        let pairs: Vec<(u32, u32)> = nodes.iter().map(|n| (0, n.0)).collect();
        let ahead = predict_in_blocks(traversability, current, graph, &pairs)?;
        for (node, row) in nodes.iter().zip(ahead.rows()) {
            distances.set_to(*node, row);
        }
        let near = |n: &&NodeId| {
            distances
                .connected_probability(**n)
                .is_some_and(|p| p >= min_probability)
        };
        let near: Vec<NodeId> = nodes.iter().filter(near).copied().collect();
        let pairs: Vec<(u32, u32)> = near.iter().map(|n| (n.0, 0)).collect();
        let back = predict_in_blocks(traversability, graph, current, &pairs)?;
        for (node, row) in near.iter().zip(back.rows()) {
            distances.set_from(*node, row);
        }
        Ok(distances)
    }

    /// Sets the class probabilities from the current state to a node.
    ///
    /// # Panics
    /// If the row has not `d_max` values or the node is not in the graph.
    pub fn set_to(&mut self, node: NodeId, probabilities: &[f32]) {
        self.to[node.index() * self.d_max..(node.index() + 1) * self.d_max]
            .copy_from_slice(probabilities);
    }

    /// Sets the class probabilities from a node to the current state.
    ///
    /// # Panics
    /// As [`set_to`](Self::set_to).
    pub fn set_from(&mut self, node: NodeId, probabilities: &[f32]) {
        self.from[node.index() * self.d_max..(node.index() + 1) * self.d_max]
            .copy_from_slice(probabilities);
    }

    /// Number of nodes of the graph.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.node_count
    }

    /// Class probabilities from the current state to a node, if known.
    #[must_use]
    pub fn to(&self, node: NodeId) -> Option<&[f32]> {
        known(&self.to[node.index() * self.d_max..(node.index() + 1) * self.d_max])
    }

    /// Class probabilities from a node to the current state, if known.
    #[must_use]
    pub fn from(&self, node: NodeId) -> Option<&[f32]> {
        known(&self.from[node.index() * self.d_max..(node.index() + 1) * self.d_max])
    }

    /// Probability that a node lies fewer than `d_max` steps ahead, if known.
    #[must_use]
    pub fn connected_probability(&self, node: NodeId) -> Option<f32> {
        self.to(node).map(|row| 1.0 - row[self.d_max - 1])
    }

    /// The node to which the current state is most probably connected, and that probability.
    #[must_use]
    pub fn nearest(&self) -> Option<(NodeId, f32)> {
        let mut best: Option<(NodeId, f32)> = None;
        for node in (0..self.node_count as u32).map(NodeId) {
            if let Some(p) = self.connected_probability(node)
                && best.is_none_or(|(_, b)| p > b)
            {
                best = Some((node, p));
            }
        }
        best
    }
}

/// A row that holds NaN, whether unknown or a broken answer, counts as not known.
fn known(row: &[f32]) -> Option<&[f32]> {
    (!row.iter().any(|p| p.is_nan())).then_some(row)
}
