//! What it costs to score pairs of states: `cargo bench --bench building`, or with `-- NAME` one of them.
//! The figures that the README of this folder quotes come from here.
//!
//! The states are those of the bedroom's graph of `sock`, or copies of them with a little noise on their
//! latents, cut into trajectories of 70 steps; the network is the bedroom's.

mod memory;

use std::path::Path;
use std::sync::OnceLock;

use catena::graph::{
    BuildOptions, ConnectionEmbedding, Edge, JoinedEdges, Node, NodeId, PairCandidates,
    ScoringReport, TopologicalGraph, score_pairs,
};
use catena::inference::{EngineChoice, Model};
use catena::model::{Latents, Projections, Traversability};
use catena::storage::{BuildFolder, GraphManifest, load_graph};
use divan::Bencher;
use divan::counter::ItemsCount;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps of a trajectory.
const STEPS: usize = 70;
/// Noise on latents, as a share of their root mean square.
const NOISE: f32 = 0.01;
/// Candidates of each state on the largest graph.
const NEAREST: usize = 32;

fn main() {
    divan::main();
}

fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let model = Model::load(Path::new("graphs/bedroom/model"), EngineChoice::Auto)
            .expect("the bedroom's model is in the repository");
        eprintln!("engine: {}", model.engine().kind());
        model
    })
}

/// So many states in trajectories of 70 steps, and the temporal edges between them.
fn states(count: usize) -> TopologicalGraph {
    let (bedroom, _) =
        load_graph(Path::new("graphs/bedroom/sock")).expect("the graph is in the repository");
    let latents = bedroom.latents();
    let squares: f32 = latents.values().iter().map(|v| v * v).sum();
    let noise = NOISE * (squares / latents.values().len() as f32).sqrt();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut graph = TopologicalGraph::new(latents.dim(), bedroom.d_max());
    let mut first = 0;
    for state in 0..count {
        let step = state % STEPS;
        if step == 0 {
            first = rng.random_range(0..bedroom.node_count() - STEPS);
        }
        let original = latents.row(first + step);
        let latent: Vec<f32> = original
            .iter()
            .map(|value| value + rng.random_range(-noise..=noise))
            .collect();
        let is_end = step + 1 == STEPS || state + 1 == count;
        let node = Node {
            task: "sock".to_owned(),
            trajectory: format!("{}", state / STEPS),
            step: step as u32,
            reached: Vec::new(),
            progress: 0,
            is_end,
        };
        let id = graph.add_node(node, &latent);
        if step > 0 {
            graph.add_edge(NodeId(id.0 - 1), id, Edge::temporal(bedroom.d_max()));
        }
    }
    graph
}

fn projections(graph: &TopologicalGraph) -> Projections {
    model().project(graph.latents()).expect("it projects")
}

/// Pairs of different trajectories.
fn some_pairs(count: usize, states: usize) -> Vec<(u32, u32)> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw = || rng.random_range(0..states as u32);
    (0..count).map(|_| (draw(), draw())).collect()
}

/// Both states projected and the head run for each pair alone, as it would be done at first.
#[divan::bench(sample_count = 10, sample_size = 1)]
fn pair_by_pair(bencher: Bencher) {
    let graph = states(2100);
    let pairs = some_pairs(2000, graph.node_count());
    let one = |row: u32| {
        let latents = graph.latents();
        Latents::from_values(latents.dim(), latents.row(row as usize).to_vec())
    };
    bencher.counter(ItemsCount::new(pairs.len())).bench(|| {
        for (from, to) in &pairs {
            let from = model().project(&one(*from)).expect("it projects");
            let to = model().project(&one(*to)).expect("it projects");
            divan::black_box(model().predict(&from, &to, &[(0, 0)]).expect("it answers"));
        }
    });
}

/// States projected once, the head run for each pair alone.
#[divan::bench(sample_count = 10, sample_size = 1)]
fn pair_by_pair_projected_once(bencher: Bencher) {
    let graph = states(2100);
    let projections = projections(&graph);
    let pairs = some_pairs(2000, graph.node_count());
    bencher.counter(ItemsCount::new(pairs.len())).bench(|| {
        for pair in &pairs {
            let answer = model().predict(&projections, &projections, &[*pair]);
            divan::black_box(answer.expect("it answers"));
        }
    });
}

/// All pairs of some states, as `catena graph build` scores them.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn all_pairs_of_2100_states(bencher: Bencher) {
    score(bencher, 2100, PairCandidates::All);
}

#[divan::bench(sample_count = 1, sample_size = 1)]
fn all_pairs_of_6300_states(bencher: Bencher) {
    score(bencher, 6300, PairCandidates::All);
}

#[divan::bench(sample_count = 3, sample_size = 1)]
fn candidates_of_6300_states(bencher: Bencher) {
    let sample = ConnectionEmbedding::SAMPLE_SHARE;
    let candidates = PairCandidates::Nearest {
        share: 0.05,
        sample,
    };
    score(bencher, 6300, candidates);
}

/// Takes minutes, and some gigabytes of memory and of temporary files: the states and the edges of each part
/// are kept in files, and the graph is put together from them, as `catena graph build` does.
#[divan::bench(sample_count = 1, sample_size = 1)]
fn candidates_of_1000000_states_by_way_of_files(bencher: Bencher) {
    let count = 1_000_000;
    let options = BuildOptions {
        candidates: PairCandidates::Nearest {
            share: NEAREST as f64 / count as f64,
            sample: ConnectionEmbedding::SAMPLE_SHARE,
        },
        ..BuildOptions::default()
    };
    let graph = states(count);
    model();
    let place = tempfile::tempdir().expect("a temporary folder");
    bencher.bench_local(|| {
        let manifest = GraphManifest::new(&[], "model", "states", serde_json::Value::Null);
        let target = place.path().join("graph");
        let mut folder =
            BuildFolder::open(&target, &manifest, options.part_pairs).expect("the folder is empty");
        folder.keep_states(&graph).expect("there is room");
        let report = score_pairs(&graph, model(), &options, &mut folder, &|_| ())
            .expect("there is room for the edges");
        let saved = folder
            .finish(&graph, &manifest, std::iter::empty())
            .expect("there is room for the graph");
        tell(count, &report, saved.edge_count);
    });
}

fn score(bencher: Bencher, count: usize, candidates: PairCandidates) {
    let graph = states(count);
    let options = BuildOptions {
        candidates,
        ..BuildOptions::default()
    };
    model();
    bencher.bench(|| {
        let mut edges = JoinedEdges::new();
        let report = score_pairs(&graph, model(), &options, &mut edges, &|_| ())
            .expect("memory holds everything");
        tell(count, &report, edges.len());
        edges
    });
}

fn tell(count: usize, report: &ScoringReport, edges: usize) {
    eprintln!(
        "{count} states: {} of {} pairs scored, {edges} edges, recall {:?}, at most {}",
        report.scored_pairs,
        report.all_pairs,
        report.recall,
        memory::peak()
    );
}
