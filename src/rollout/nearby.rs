use crate::graph::{ConnectionEmbedding, ConnectionIndex, NodeId};
use crate::model::{ModelError, Projections, Traversability};
use crate::planner::{PlaceId, StageFilter};

/// Places of the belief whose states are asked for, however far they seem.
const BELIEVED_PLACES: usize = 64;

/// Proposes the states of a graph that may be near the robot, so that the network need not be asked
/// about all of them: those that a [`ConnectionEmbedding`] holds for connected, in either direction, and
/// those where the robot is believed to be, with their successors.
#[derive(Debug)]
pub(super) struct Nearby {
    embedding: ConnectionEmbedding,
    from: ConnectionIndex,
    to: ConnectionIndex,
    count: usize,
    /// Whether a node has a place in the composition.
    has_place: Vec<bool>,
}

impl Nearby {
    pub(super) fn new(
        traversability: &(dyn Traversability + Sync),
        projections: &Projections,
        candidates: &[NodeId],
        count: usize,
    ) -> Result<Self, ModelError> {
        let embedding = ConnectionEmbedding::fit(
            traversability,
            projections,
            ConnectionEmbedding::SAMPLE_SHARE,
            0,
        )?;
        let mut has_place = vec![false; projections.from.len()];
        for node in candidates {
            has_place[node.index()] = true;
        }
        Ok(Self {
            from: ConnectionIndex::new(embedding.embed_from(&projections.from)),
            to: ConnectionIndex::new(embedding.embed_to(&projections.to)),
            embedding,
            count,
            has_place,
        })
    }

    /// The states to ask for, in ascending order.
    pub(super) fn propose(&self, current: &Projections, filter: &StageFilter) -> Vec<NodeId> {
        let has_place = |node: u32| self.has_place[node as usize];
        let leaving = self.embedding.embed_from(&current.from);
        let arriving = self.embedding.embed_to(&current.to);
        let mut nodes = self
            .to
            .most_connected(leaving.row(0), self.count, has_place);
        nodes.extend(
            self.from
                .most_connected(arriving.row(0), self.count, has_place),
        );
        let layout = filter.layout();
        for (place, _) in filter.most_probable_places(BELIEVED_PLACES) {
            let next = |place: PlaceId| layout.successor(place);
            let here = [Some(place), next(place), next(place).and_then(next)];
            nodes.extend(here.into_iter().flatten().map(|p| layout.place(p).node.0));
        }
        nodes.sort_unstable();
        nodes.dedup();
        nodes.into_iter().map(NodeId).collect()
    }
}
