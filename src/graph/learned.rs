use serde::{Deserialize, Serialize};

use super::{Edge, EdgeKind};
use crate::model::most_probable;

/// Which predicted pairs become learned edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LearnedEdges {
    /// Least probability (0..=1) that the pair is fewer than `d_max` steps apart. The paper asks only
    /// that `d_max` is not the most probable class, which is always asked as well.
    pub min_probability: f32,
    /// At most this many learned edges leave a node: the most probable ones. `None` keeps all.
    pub max_out_edges: Option<usize>,
    /// Whether pairs of one demonstration are scored too, as the paper does. Their distance is known,
    /// so such an edge is either no shorter than the temporal ones or false.
    pub same_trajectory: bool,
}

impl Default for LearnedEdges {
    fn default() -> Self {
        Self {
            min_probability: 0.0,
            max_out_edges: Some(32),
            same_trajectory: false,
        }
    }
}

impl LearnedEdges {
    /// Whether a pair with these class probabilities becomes an edge.
    ///
    /// # Panics
    /// If there is no class.
    #[must_use]
    pub fn accepts(&self, probabilities: &[f32]) -> bool {
        let far = probabilities.len() - 1;
        most_probable(probabilities) < far && 1.0 - probabilities[far] >= self.min_probability
    }
}

impl Edge {
    /// The edge between two states that follow each other: one step, certain.
    ///
    /// # Panics
    /// If `d_max` is below 2: there is no class for "connected".
    #[must_use]
    pub fn temporal(d_max: usize) -> Self {
        assert!(d_max >= 2, "traversability needs at least 2 classes");
        let mut probabilities = vec![0.0; d_max];
        probabilities[0] = 1.0;
        Self {
            kind: EdgeKind::Temporal,
            steps: 1,
            probabilities,
        }
    }

    /// A predicted edge; its steps are the most probable of the classes below `d_max`.
    ///
    /// # Panics
    /// If there are fewer than 2 classes.
    #[must_use]
    pub fn predicted(kind: EdgeKind, probabilities: &[f32]) -> Self {
        assert!(
            probabilities.len() >= 2,
            "traversability needs at least 2 classes"
        );
        let connected = &probabilities[..probabilities.len() - 1];
        Self {
            kind,
            steps: most_probable(connected) as u32 + 1,
            probabilities: probabilities.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_by_most_probable_class_and_by_probability() {
        let rule = LearnedEdges::default();
        assert!(rule.accepts(&[0.1, 0.5, 0.4]));
        assert!(!rule.accepts(&[0.3, 0.3, 0.4]));
        let strict = LearnedEdges {
            min_probability: 0.7,
            ..rule
        };
        assert!(!strict.accepts(&[0.1, 0.5, 0.4]));
    }

    #[test]
    fn predicted_edge_never_has_d_max_steps() {
        let edge = Edge::predicted(EdgeKind::CrossTask, &[0.05, 0.15, 0.8]);
        assert_eq!(edge.steps, 2);
        assert!((edge.connected_probability() - 0.2).abs() < 1e-6);
    }
}
