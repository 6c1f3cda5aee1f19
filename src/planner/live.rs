use crate::graph::NodeId;
use crate::model::{ModelError, Projections, Traversability, predict_in_blocks};

/// The current state joined to the graph: predicted steps from it to states of the graph, and from
/// them to it (Fu & Finn, section III-D).
///
/// It holds rows for the states that were asked for only, so that its size does not depend on the
/// graph's.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveDistances {
    d_max: usize,
    node_count: usize,
    /// The nodes of the rows, ascending.
    nodes: Vec<NodeId>,
    /// A row a node of `nodes`; NaN where only the other direction is known.
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
            nodes: Vec::new(),
            to: Vec::new(),
            from: Vec::new(),
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
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes.dedup();
        let pairs: Vec<(u32, u32)> = nodes.iter().map(|n| (0, n.0)).collect();
        let ahead = predict_in_blocks(traversability, current, graph, &pairs)?;
        let mut distances = Self {
            d_max,
            node_count: graph.from.len(),
            from: vec![f32::NAN; nodes.len() * d_max],
            to: ahead.into_values(),
            nodes,
        };
        let near: Vec<usize> = (0..distances.nodes.len())
            .filter(|row| {
                let to = known(distances.row(&distances.to, *row));
                to.is_some_and(|row| 1.0 - row[d_max - 1] >= min_probability)
            })
            .collect();
        let pairs: Vec<(u32, u32)> = near
            .iter()
            .map(|row| (distances.nodes[*row].0, 0))
            .collect();
        let back = predict_in_blocks(traversability, graph, current, &pairs)?;
        for (row, probabilities) in near.iter().zip(back.rows()) {
            distances.from[row * d_max..(row + 1) * d_max].copy_from_slice(probabilities);
        }
        Ok(distances)
    }

    /// Sets the class probabilities from the current state to a node.
    ///
    /// # Panics
    /// If the row has not `d_max` values or the node is not in the graph.
    pub fn set_to(&mut self, node: NodeId, probabilities: &[f32]) {
        let row = self.make_row(node);
        self.to[row * self.d_max..(row + 1) * self.d_max].copy_from_slice(probabilities);
    }

    /// Sets the class probabilities from a node to the current state.
    ///
    /// # Panics
    /// As [`set_to`](Self::set_to).
    pub fn set_from(&mut self, node: NodeId, probabilities: &[f32]) {
        let row = self.make_row(node);
        self.from[row * self.d_max..(row + 1) * self.d_max].copy_from_slice(probabilities);
    }

    /// Number of nodes of the graph.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.node_count
    }

    /// The nodes that were asked for, ascending.
    #[must_use]
    pub fn nodes(&self) -> &[NodeId] {
        &self.nodes
    }

    /// Class probabilities from the current state to a node, if known.
    #[must_use]
    pub fn to(&self, node: NodeId) -> Option<&[f32]> {
        let row = self.find(node).ok()?;
        known(self.row(&self.to, row))
    }

    /// Class probabilities from a node to the current state, if known.
    #[must_use]
    pub fn from(&self, node: NodeId) -> Option<&[f32]> {
        let row = self.find(node).ok()?;
        known(self.row(&self.from, row))
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
        for &node in &self.nodes {
            if let Some(p) = self.connected_probability(node)
                && best.is_none_or(|(_, b)| p > b)
            {
                best = Some((node, p));
            }
        }
        best
    }

    fn row<'a>(&self, rows: &'a [f32], row: usize) -> &'a [f32] {
        &rows[row * self.d_max..(row + 1) * self.d_max]
    }

    /// The row of a node, or where it would have to be.
    fn find(&self, node: NodeId) -> Result<usize, usize> {
        // Where all nodes were asked for, each is its own row.
        if self.nodes.get(node.index()) == Some(&node) {
            return Ok(node.index());
        }
        self.nodes.binary_search(&node)
    }

    fn make_row(&mut self, node: NodeId) -> usize {
        assert!(
            node.index() < self.node_count,
            "node {} of {}",
            node.0,
            self.node_count
        );
        self.find(node).unwrap_or_else(|row| {
            self.nodes.insert(row, node);
            for rows in [&mut self.to, &mut self.from] {
                let at = row * self.d_max;
                rows.splice(at..at, std::iter::repeat_n(f32::NAN, self.d_max));
            }
            row
        })
    }
}

/// A row that holds NaN, whether unknown or a broken answer, counts as not known.
fn known(row: &[f32]) -> Option<&[f32]> {
    (!row.iter().any(|p| p.is_nan())).then_some(row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_whatever_the_order_in_which_they_came() {
        let mut distances = LiveDistances::unknown(9, 2);
        for node in [7, 2, 5, 0] {
            distances.set_to(NodeId(node), &[0.1 * node as f32, 1.0 - 0.1 * node as f32]);
        }
        distances.set_from(NodeId(5), &[0.25, 0.75]);
        distances.set_from(NodeId(3), &[0.5, 0.5]);
        let known: Vec<u32> = distances.nodes().iter().map(|n| n.0).collect();
        assert_eq!(known, [0, 2, 3, 5, 7]);
        for node in [0, 2, 5, 7] {
            assert_eq!(
                distances.to(NodeId(node)),
                Some(&[0.1 * node as f32, 1.0 - 0.1 * node as f32][..])
            );
        }
        assert_eq!(distances.from(NodeId(5)), Some(&[0.25, 0.75][..]));
        for node in [1, 3, 4, 6, 8] {
            assert_eq!(distances.to(NodeId(node)), None);
        }
        assert_eq!(distances.from(NodeId(7)), None);
        assert_eq!(distances.nearest().map(|(node, _)| node), Some(NodeId(7)));
    }
}
