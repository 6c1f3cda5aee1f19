//! Topological graphs: states of demonstrations as nodes, predicted time steps as edges
//! (Fu & Finn, section III-D).
//!
//! [`build`] makes the graph of one task, [`merge`] puts tasks together and looks for the edges that
//! lead from one to the next, [`prune`] thins out, [`GraphStatistics`] says what came of it.

mod build;
mod candidates;
mod edge;
mod error;
#[cfg(test)]
pub(crate) mod fakes;
mod fit;
mod index;
mod learned;
mod logistic;
mod merge;
mod node;
mod progress;
mod proposals;
mod prune;
mod region;
mod resample;
mod score_pairs;
mod scoring;
mod stage_classifier;
mod statistics;
#[cfg(test)]
mod tests;
mod topological;

pub use build::{BuildOptions, Built, PairCandidates, build, build_states};
pub use candidates::CrossTaskCandidates;
pub use edge::{Edge, EdgeKind};
pub use error::GraphError;
pub use index::ConnectionIndex;
pub use learned::LearnedEdges;
pub(crate) use logistic::{Logistic, ROWS_A_CLASS, evenly};
pub use merge::{MergeOptions, MergeReport, Merged, SeamReport, merge};
pub use node::{Node, NodeId};
pub use progress::{GraphPhase, GraphProgress, ProgressFn};
pub use proposals::ConnectionEmbedding;
pub use prune::{PruneOptions, left_out, prune};
pub use region::{RegionError, mark_subgoal, states_in};
pub use resample::resampled;
pub use score_pairs::{EdgeSink, JoinedEdges, ScoreError, ScoringReport, score_pairs};
pub use scoring::ScoredPair;
pub use stage_classifier::{StageClassifier, StageEvidence};
pub use statistics::{CrossTaskEdge, CrossTaskStatistics, GraphStatistics, TaskStatistics};
pub use topological::TopologicalGraph;
