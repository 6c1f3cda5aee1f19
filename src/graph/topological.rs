use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::EdgeRef;

use super::{Edge, EdgeKind, Node, NodeId};
use crate::model::{Latents, temper};

/// Nodes, the latents of their states, and directed edges between them.
///
/// Row `i` of [`latents`](Self::latents) belongs to node `i`.
#[derive(Clone, Debug)]
pub struct TopologicalGraph {
    graph: DiGraph<Node, Edge, u32>,
    latents: Latents,
    d_max: usize,
}

impl TopologicalGraph {
    /// A graph without nodes for latents of `latent_dim` values and `d_max` traversability classes.
    #[must_use]
    pub fn new(latent_dim: usize, d_max: usize) -> Self {
        Self {
            graph: DiGraph::default(),
            latents: Latents::new(latent_dim),
            d_max,
        }
    }

    /// Adds a state.
    ///
    /// # Panics
    /// If the latent has another length than the graph's.
    pub fn add_node(&mut self, node: Node, latent: &[f32]) -> NodeId {
        self.latents.push(latent);
        NodeId(self.graph.add_node(node).index() as u32)
    }

    /// Adds an edge; an edge between the same nodes is replaced unless it is temporal, which stays.
    ///
    /// # Panics
    /// If a node is not in the graph.
    pub fn add_edge(&mut self, from: NodeId, to: NodeId, edge: Edge) {
        let (from, to) = (NodeIndex::new(from.index()), NodeIndex::new(to.index()));
        match self.graph.find_edge(from, to) {
            Some(old) if self.graph[old].kind == EdgeKind::Temporal => {}
            Some(old) => self.graph[old] = edge,
            None => {
                self.graph.add_edge(from, to, edge);
            }
        }
    }

    /// Adds an edge without looking for one between the same nodes; the caller knows that there is none,
    /// or asks [`ends_joined_twice`](Self::ends_joined_twice) afterwards.
    pub(crate) fn push_edge(&mut self, from: NodeId, to: NodeId, edge: Edge) {
        self.graph.add_edge(
            NodeIndex::new(from.index()),
            NodeIndex::new(to.index()),
            edge,
        );
    }

    /// Two nodes between which more than one edge leads the same way; `None` if there are no such nodes.
    pub(crate) fn ends_joined_twice(&self) -> Option<(NodeId, NodeId)> {
        let mut last_source = vec![NodeIndex::end(); self.node_count()];
        for from in self.graph.node_indices() {
            for to in self.graph.neighbors(from) {
                if std::mem::replace(&mut last_source[to.index()], from) == from {
                    return Some((NodeId(from.index() as u32), NodeId(to.index() as u32)));
                }
            }
        }
        None
    }

    /// The same states with the probabilities of all predicted edges at another temperature; see
    /// [`temper`]. Which edges there are and their most probable steps stay.
    #[must_use]
    pub fn tempered(&self, exponent: f32) -> Self {
        let mut tempered = self.clone();
        for edge in tempered.graph.edge_weights_mut() {
            if edge.kind != EdgeKind::Temporal {
                temper(&mut edge.probabilities, exponent);
            }
        }
        tempered
    }

    /// Number of traversability classes.
    #[must_use]
    pub fn d_max(&self) -> usize {
        self.d_max
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.graph.node_count()
    }

    /// Number of edges of all kinds.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        self.graph.edge_count()
    }

    /// One node.
    ///
    /// # Panics
    /// If it is not in the graph.
    #[must_use]
    pub fn node(&self, id: NodeId) -> &Node {
        &self.graph[NodeIndex::new(id.index())]
    }

    /// All nodes in the order of their ids.
    #[must_use]
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = (NodeId, &Node)> {
        self.graph
            .raw_nodes()
            .iter()
            .enumerate()
            .map(|(i, n)| (NodeId(i as u32), &n.weight))
    }

    /// All nodes to be changed, in the order of their ids.
    pub(super) fn nodes_mut(&mut self) -> impl Iterator<Item = &mut Node> {
        self.graph.node_weights_mut()
    }

    /// The latents of all states, a row a node.
    #[must_use]
    pub fn latents(&self) -> &Latents {
        &self.latents
    }

    /// The tasks that its demonstrations show, in the order of their first nodes.
    #[must_use]
    pub fn tasks(&self) -> Vec<&str> {
        let mut tasks: Vec<&str> = Vec::new();
        for (_, node) in self.nodes() {
            if !tasks.contains(&node.task.as_str()) {
                tasks.push(&node.task);
            }
        }
        tasks
    }

    /// All edges in the order in which they were added.
    #[must_use]
    pub fn edges(&self) -> impl ExactSizeIterator<Item = (NodeId, NodeId, &Edge)> {
        self.graph.raw_edges().iter().map(|edge| {
            (
                NodeId(edge.source().index() as u32),
                NodeId(edge.target().index() as u32),
                &edge.weight,
            )
        })
    }

    /// The edges that leave a node.
    pub fn edges_from(&self, node: NodeId) -> impl Iterator<Item = (NodeId, &Edge)> {
        self.graph
            .edges(NodeIndex::new(node.index()))
            .map(|e| (NodeId(e.target().index() as u32), e.weight()))
    }

    /// The edge between two nodes, if there is one.
    #[must_use]
    pub fn edge(&self, from: NodeId, to: NodeId) -> Option<&Edge> {
        self.graph
            .find_edge(NodeIndex::new(from.index()), NodeIndex::new(to.index()))
            .map(|e| &self.graph[e])
    }

    /// The underlying petgraph, for algorithms of that library.
    #[must_use]
    pub fn as_petgraph(&self) -> &DiGraph<Node, Edge, u32> {
        &self.graph
    }
}
