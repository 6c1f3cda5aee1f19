//! How fast graphs are merged, saved and loaded, and the memory that it takes.
//!
//! `cargo bench --bench graphs` runs all of it, which takes minutes and 4 GB of temporary files;
//! `cargo bench --bench graphs -- load` only what has `load` in its name. The peak of memory of each stands
//! below the times; it counts what a benchmark holds beforehand too, such as the graph that is saved.

mod memory;

use std::fs;
use std::path::Path;
use std::sync::Mutex;

use catena::graph::{
    CrossTaskCandidates, Edge, EdgeKind, MergeOptions, Node, NodeId, TopologicalGraph, merge,
    resampled,
};
use catena::inference::{EngineChoice, Model};
use catena::model::{Latents, ModelError, Projections, StepDistributions, Traversability};
use catena::storage::{GraphManifest, load_graph, save_graph};
use divan::Bencher;
use divan::counter::ItemsCount;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const BEDROOM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/bedroom");

const NODES: u32 = 1_000_000;
const EDGES_OF_A_NODE: u32 = 20;
const STEPS_OF_A_DEMONSTRATION: u32 = 70;
const LATENT_DIM: usize = 192;
const D_MAX: usize = 5;

/// Each benchmark with the most memory that the process held meanwhile.
static PEAKS: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

fn main() {
    divan::main();
    for (name, peak) in PEAKS.lock().expect("no benchmark panicked").iter() {
        println!("{name}: peak of memory {peak}");
    }
}

/// Runs a benchmark and notes its peak of memory, on systems with `/proc`.
fn with_peak(name: &str, run: impl FnOnce()) {
    // Where the peak cannot be reset it is that of the whole process.
    _ = fs::write("/proc/self/clear_refs", "5");
    run();
    let mut peaks = PEAKS.lock().expect("no benchmark panicked");
    peaks.push((name.to_owned(), memory::peak()));
}

/// A shipped graph copied, with a little noise, until it has 100,000 states.
fn large(task: &str) -> TopologicalGraph {
    let (graph, _) = load_graph(&Path::new(BEDROOM).join(task)).expect("a shipped graph");
    resampled(&graph, 100_000, 1).expect("there is room for a demonstration")
}

fn merge_two(bencher: Bencher, name: &str, of: &(dyn Traversability + Sync), window_steps: u32) {
    let (first, second) = (large("sock"), large("trash"));
    let options = MergeOptions {
        candidates: CrossTaskCandidates::Seam { window_steps },
        ..MergeOptions::default()
    };
    let merged = |of: &(dyn Traversability + Sync)| {
        merge(&[&first, &second], None, of, &options, &|_| {}).expect("they belong together")
    };
    let pairs = merged(&Ready).report.pair_count;
    with_peak(
        &format!("{name}, window {window_steps}, {pairs} pairs"),
        || {
            bencher
                .counter(ItemsCount::new(pairs))
                .bench_local(|| merged(of));
        },
    );
}

/// Two graphs of 100,000 states with the shipped network; the argument is the window of the seam, in steps.
#[divan::bench(args = [1], sample_count = 2, sample_size = 1)]
fn merge_with_the_network(bencher: Bencher, window_steps: u32) {
    let folder = Path::new(BEDROOM).join("model");
    let model = Model::load(&folder, EngineChoice::Auto).expect("the shipped model");
    merge_two(bencher, "merge_with_the_network", &model, window_steps);
}

/// The same with an answer that costs next to nothing: what merging itself takes.
#[divan::bench(args = [1, 3], sample_count = 3, sample_size = 1)]
fn merge_without_a_network(bencher: Bencher, window_steps: u32) {
    merge_two(bencher, "merge_without_a_network", &Ready, window_steps);
}

/// Takes states for connected whose first values are nearly the same.
struct Ready;

impl Traversability for Ready {
    fn d_max(&self) -> usize {
        D_MAX
    }

    fn project(&self, latents: &Latents) -> Result<Projections, ModelError> {
        let mut firsts = Latents::new(1);
        for row in 0..latents.len() {
            firsts.push(&latents.row(row)[..1]);
        }
        Ok(Projections {
            from: firsts.clone(),
            to: firsts,
        })
    }

    fn predict(
        &self,
        from: &Projections,
        to: &Projections,
        pairs: &[(u32, u32)],
    ) -> Result<StepDistributions, ModelError> {
        const NEAR: [f32; D_MAX] = [0.1, 0.4, 0.2, 0.2, 0.1];
        const FAR: [f32; D_MAX] = [0.0, 0.0, 0.1, 0.1, 0.8];
        let mut probabilities = Vec::with_capacity(pairs.len() * D_MAX);
        for &(a, b) in pairs {
            let gap = from.from.row(a as usize)[0] - to.to.row(b as usize)[0];
            probabilities.extend(if gap.abs() < 1e-4 { NEAR } else { FAR });
        }
        Ok(StepDistributions::new(D_MAX, probabilities))
    }
}

/// A million states with twenty million edges; numbers are drawn by lot, so nothing compresses better than
/// what a network gives.
fn million() -> TopologicalGraph {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut graph = TopologicalGraph::new(LATENT_DIM, D_MAX);
    for id in 0..NODES {
        let step = id % STEPS_OF_A_DEMONSTRATION;
        let latent: Vec<f32> = (0..LATENT_DIM).map(|_| rng.random::<f32>() - 0.5).collect();
        let node = Node {
            task: "sock".to_owned(),
            trajectory: format!("sock_{:08}", id / STEPS_OF_A_DEMONSTRATION),
            step,
            reached: Vec::new(),
            progress: 0,
            is_end: step + 1 == STEPS_OF_A_DEMONSTRATION || id + 1 == NODES,
        };
        graph.add_node(node, &latent);
    }
    for id in 0..NODES {
        if !graph.node(NodeId(id)).is_end {
            graph.add_edge(NodeId(id), NodeId(id + 1), Edge::temporal(D_MAX));
        }
    }
    for id in 0..NODES {
        let temporal = u32::from(!graph.node(NodeId(id)).is_end);
        // One in each of equal parts of all states, so that no two lead to the same.
        let part = NODES / EDGES_OF_A_NODE;
        for k in temporal..EDGES_OF_A_NODE {
            let to = k * part + rng.random_range(0..part);
            let mut probabilities: Vec<f32> = (0..D_MAX).map(|_| rng.random()).collect();
            let sum: f32 = probabilities.iter().sum();
            for probability in &mut probabilities {
                *probability /= sum;
            }
            let edge = Edge::predicted(EdgeKind::Learned, &probabilities);
            graph.add_edge(NodeId(id), NodeId(to), edge);
        }
    }
    graph
}

fn save(folder: &Path, graph: &TopologicalGraph) {
    let manifest = GraphManifest::new(&[], "none", "none", serde_json::Value::Null);
    let saved = save_graph(folder, graph, &manifest).expect("there is room on the disk");
    let sizes: Vec<_> = saved.files.iter().map(|(n, f)| (n, f.bytes)).collect();
    assert_eq!(sizes.len(), 2);
}

/// Saves 1,000,000 states and 20,000,000 edges.
#[divan::bench(sample_count = 2, sample_size = 1)]
fn save_a_million_states(bencher: Bencher) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let graph = million();
    with_peak("save_a_million_states", || {
        bencher
            .counter(ItemsCount::new(graph.edge_count()))
            .bench_local(|| save(&folder.path().join("graph"), &graph));
    });
}

/// Loads 1,000,000 states and 20,000,000 edges.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn load_a_million_states(bencher: Bencher) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let graph = million();
    let edges = graph.edge_count();
    save(folder.path(), &graph);
    drop(graph);
    with_peak("load_a_million_states", || {
        bencher
            .counter(ItemsCount::new(edges))
            .bench_local(|| load_graph(folder.path()).expect("it was just saved"));
    });
}
