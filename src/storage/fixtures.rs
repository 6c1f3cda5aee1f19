//! Small trajectories and graphs for the tests of this room.

use std::sync::Arc;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::graph::{Edge, EdgeKind, Node, NodeId, TopologicalGraph};
use crate::task::Subgoal;
use crate::trajectory::{Action, ActionSpace, Image, Marker, Observation, Step, Trajectory};

/// A gradient that moves with `step`, under a little noise, as a camera gives it.
pub(super) fn picture(height: u32, width: u32, step: usize) -> Image {
    let mut rng = ChaCha8Rng::seed_from_u64(step as u64);
    let mut rgb = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let noise = rng.random_range(0..24);
            rgb.extend([
                (x * 2) as u8 / 2 + noise,
                (y * 3) as u8 / 2 + noise,
                (step * 5) as u8 / 2 + noise,
            ]);
        }
    }
    Image::new(height, width, rgb).unwrap()
}

/// A picture of depths as depth cameras give it: the bytes of a PNG with grey values of 16 bits, millimetres.
pub(super) fn depth_picture(height: u32, width: u32) -> Vec<u8> {
    let millimetres = (0..height * width).map(|i| 1500 + i as u16);
    let values: Vec<u8> = millimetres.flat_map(u16::to_ne_bytes).collect();
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(&values, width, height, ExtendedColorType::L16)
        .unwrap();
    bytes
}

/// Primitives, the cameras `head` 90x160 and `wrist` 45x80, 5 Hz, markers at a third and at the end.
pub(super) fn trajectory(steps: usize) -> Trajectory {
    let names = ["ahead", "left", "right"].map(str::to_owned).to_vec();
    let marker = |step, name: &str| Marker {
        step,
        name: name.to_owned(),
    };
    Trajectory {
        id: "demo".to_owned(),
        task: "sock".to_owned(),
        action_space: ActionSpace::Primitives { names },
        steps: (0..steps)
            .map(|i| Step {
                time_secs: i as f64 * 0.2,
                observation: Arc::new(Observation::new([
                    ("head".to_owned(), picture(90, 160, i)),
                    ("wrist".to_owned(), picture(45, 80, i + 1000)),
                ])),
                action: Action::Primitive(i % 3),
            })
            .collect(),
        markers: vec![marker(steps / 3, "grasped"), marker(steps - 1, "stowed")],
    }
}

/// Two demonstrations of ten states each with temporal, learned and cross-task edges.
pub(super) fn graph() -> TopologicalGraph {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut graph = TopologicalGraph::new(6, 5);
    for task in ["sock", "put it / away"] {
        for step in 0..10 {
            let name = if step == 9 { "stowed" } else { "grasped" };
            let subgoal = Subgoal {
                task: task.to_owned(),
                name: name.to_owned(),
            };
            let node = Node {
                task: task.to_owned(),
                trajectory: format!("{task}_003"),
                step,
                reached: if step % 9 == 4 || step == 9 {
                    vec![subgoal]
                } else {
                    Vec::new()
                },
                progress: u32::from(step >= 4) + u32::from(step == 9),
                is_end: step == 9,
            };
            let latent: Vec<f32> = (0..6).map(|_| rng.random::<f32>() - 0.5).collect();
            graph.add_node(node, &latent);
        }
    }
    let mut edge = |from: u32, to: u32, kind, steps| {
        let probabilities = (0..5).map(|_| rng.random::<f32>()).collect();
        let edge = Edge {
            kind,
            steps,
            probabilities,
        };
        graph.add_edge(NodeId(from), NodeId(to), edge);
    };
    for i in (0..19).filter(|i| *i != 9) {
        edge(i, i + 1, EdgeKind::Temporal, 1);
    }
    edge(3, 7, EdgeKind::Learned, 4);
    edge(9, 10, EdgeKind::CrossTask, 2);
    graph
}
