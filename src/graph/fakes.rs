//! A world that a test can check by hand: a state is a point, and an oracle knows the distances.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Edge, Node, NodeId, TopologicalGraph};
use crate::model::{
    Encoder, Latents, ModelError, ModelSpec, Projections, StepDistributions, Traversability,
};
use crate::task::{Subgoal, Task};
use crate::trajectory::{
    Action, ActionSpace, CameraSpec, DemonstrationSet, Image, Observation, State, Step, Trajectory,
};

/// Steps from the first point to the second, or `None` when there is no way.
pub(crate) type Distance = fn(&[f32], &[f32]) -> Option<u32>;

/// One step a unit of the first value forwards, no way back.
pub(crate) fn forward(a: &[f32], b: &[f32]) -> Option<u32> {
    let ahead = (b[0] - a[0]).round();
    (ahead >= 0.0).then_some(ahead as u32)
}

/// Knows the true distance; `certainty` is the probability that it gives to it.
pub(crate) struct Oracle {
    pub(crate) d_max: usize,
    pub(crate) certainty: f32,
    pub(crate) distance: Distance,
    pub(crate) pairs: AtomicU64,
}

impl Oracle {
    pub(crate) fn new(d_max: usize, distance: Distance) -> Self {
        Self {
            d_max,
            certainty: 0.9,
            distance,
            pairs: AtomicU64::new(0),
        }
    }
}

impl Traversability for Oracle {
    fn d_max(&self) -> usize {
        self.d_max
    }

    fn project(&self, latents: &Latents) -> Result<Projections, ModelError> {
        Ok(Projections {
            from: latents.clone(),
            to: latents.clone(),
        })
    }

    fn predict(
        &self,
        from: &Projections,
        to: &Projections,
        pairs: &[(u32, u32)],
    ) -> Result<StepDistributions, ModelError> {
        self.pairs.fetch_add(pairs.len() as u64, Ordering::Relaxed);
        let rest = (1.0 - self.certainty) / (self.d_max - 1) as f32;
        let mut probabilities = Vec::with_capacity(pairs.len() * self.d_max);
        for &(a, b) in pairs {
            let steps = (self.distance)(from.from.row(a as usize), to.to.row(b as usize))
                .map_or(self.d_max, |s| (s.max(1) as usize).min(self.d_max));
            probabilities
                .extend((1..=self.d_max).map(|c| if c == steps { self.certainty } else { rest }));
        }
        Ok(StepDistributions::new(self.d_max, probabilities))
    }
}

/// Reads the point out of a single pixel.
pub(crate) struct PixelEncoder(ModelSpec);

impl PixelEncoder {
    pub(crate) fn new(d_max: usize) -> Self {
        Self(ModelSpec {
            cameras: vec![CameraSpec {
                name: "eye".to_owned(),
                height: 1,
                width: 1,
            }],
            stack: 2,
            action_space: space(),
            d_max,
            latent_dim: 3,
        })
    }
}

impl Encoder for PixelEncoder {
    fn spec(&self) -> &ModelSpec {
        &self.0
    }

    fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
        let mut latents = Latents::new(3);
        for state in states {
            let image = state.newest().image("eye").expect("the fake has an eye");
            latents.push(&[0, 1, 2].map(|c| f32::from(image.rgb()[c])));
        }
        Ok(latents)
    }
}

/// A [`PixelEncoder`] that breaks at one point.
pub(crate) struct BrokenEncoder(PixelEncoder, [u8; 2]);

impl BrokenEncoder {
    /// Breaks where the first two coordinates are these.
    pub(crate) fn new(d_max: usize, broken_at: [u8; 2]) -> Self {
        Self(PixelEncoder::new(d_max), broken_at)
    }
}

impl Encoder for BrokenEncoder {
    fn spec(&self) -> &ModelSpec {
        self.0.spec()
    }

    fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
        let sound = self.0.encode(states)?;
        let broken_at = self.1.map(f32::from);
        let mut latents = Latents::new(sound.dim());
        for row in (0..sound.len()).map(|row| sound.row(row)) {
            if row[..2] == broken_at {
                latents.push(&[row[0], f32::NAN, row[2]]);
            } else {
                latents.push(row);
            }
        }
        Ok(latents)
    }
}

fn space() -> ActionSpace {
    ActionSpace::Primitives {
        names: vec!["move".to_owned()],
    }
}

/// Demonstrations through points.
pub(crate) fn demonstrations(task: &str, paths: &[Vec<[u8; 3]>]) -> DemonstrationSet {
    let trajectories = paths
        .iter()
        .enumerate()
        .map(|(i, path)| Trajectory {
            id: format!("{task}_{i}"),
            task: task.to_owned(),
            action_space: space(),
            steps: path.iter().enumerate().map(|(t, p)| step(t, *p)).collect(),
            markers: Vec::new(),
        })
        .collect();
    DemonstrationSet::new(task, trajectories).expect("the fake is consistent")
}

fn step(t: usize, point: [u8; 3]) -> Step {
    let image = Image::new(1, 1, point.to_vec()).expect("one pixel");
    Step {
        time_secs: t as f64,
        observation: Arc::new(Observation::new([("eye".to_owned(), image)])),
        action: Action::Primitive(0),
    }
}

/// A subgoal by task and name.
pub(crate) fn subgoal(task: &str, name: &str) -> Subgoal {
    Subgoal {
        task: task.to_owned(),
        name: name.to_owned(),
    }
}

/// A task by name and names of its subgoals.
pub(crate) fn task(name: &str, subgoals: &[&str]) -> Task {
    Task {
        name: name.to_owned(),
        subgoals: subgoals.iter().map(|s| subgoal(name, s)).collect(),
    }
}

/// Adds a demonstration of `latents.len()` states with temporal edges; subgoal `i` of the task is
/// reached at `subgoal_steps[i]`.
pub(crate) fn add_demonstration(
    graph: &mut TopologicalGraph,
    task: &Task,
    trajectory: &str,
    latents: &[Vec<f32>],
    subgoal_steps: &[usize],
) -> Vec<NodeId> {
    let mut ids: Vec<NodeId> = Vec::new();
    for (step, latent) in latents.iter().enumerate() {
        let node = Node {
            task: task.name.clone(),
            trajectory: trajectory.to_owned(),
            step: step as u32,
            reached: subgoal_steps
                .iter()
                .zip(&task.subgoals)
                .filter(|(s, _)| **s == step)
                .map(|(_, subgoal)| subgoal.clone())
                .collect(),
            progress: subgoal_steps.iter().filter(|s| **s <= step).count() as u32,
            is_end: step + 1 == latents.len(),
        };
        let id = graph.add_node(node, latent);
        if let Some(previous) = ids.last() {
            graph.add_edge(*previous, id, Edge::temporal(graph.d_max()));
        }
        ids.push(id);
    }
    ids
}
