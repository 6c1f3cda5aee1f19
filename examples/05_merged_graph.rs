//! Looks at a merged graph: numbers, components by petgraph, and a picture.
//!
//! `cargo run --release --example 05_merged_graph`

use std::error::Error;
use std::path::Path;

use catena::graph::{GraphStatistics, MergeOptions, merge};
use catena::inference::{EngineChoice, Model};
use catena::storage::{ensure_same_model, load_graph};
use catena::view::write_merged_graph_svg;

fn main() -> Result<(), Box<dyn Error>> {
    let bedroom = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bedroom");
    let model = Model::load(&bedroom.join("model"), EngineChoice::Auto)?;
    let mut graphs = Vec::new();
    for task in ["sock", "trash", "wine"] {
        let folder = bedroom.join(task);
        let (graph, manifest) = load_graph(&folder)?;
        ensure_same_model(&folder, &manifest.model_digest, &model.digest())?;
        graphs.push(graph);
    }
    let merged = merge(
        &graphs.iter().collect::<Vec<_>>(),
        Some(&[("sock", "trash"), ("trash", "wine")]),
        &model,
        &MergeOptions::default(),
        &|_| {},
    )?;
    println!("{}", GraphStatistics::new(&merged.graph, 5));

    // The graph is a petgraph: its algorithms work on it.
    let components = petgraph::algo::kosaraju_scc(merged.graph.as_petgraph());
    println!("{} strongly connected components", components.len());

    let picture = std::env::temp_dir().join("catena_merged_graph.svg");
    write_merged_graph_svg(&picture, &merged.graph, None, "sock, trash and wine")?;
    println!("drawn in {}", picture.display());
    Ok(())
}
