//! Looks at a merged graph: numbers, components by petgraph, and a picture.
//!
//! `cargo run --release --example 05_merged_graph`

use std::error::Error;
use std::path::Path;

use catena::composer::compose_named;
use catena::graph::{GraphStatistics, MergeOptions};
use catena::inference::EngineChoice;
use catena::loading::LoadedComposition;
use catena::view::write_merged_graph_svg;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // Edges between tasks at the seams alone, where one ends and the next begins.
    let options = MergeOptions::default();
    let composition = compose_named("tidy_room", root)?;
    let loaded = LoadedComposition::load_with(composition, EngineChoice::Auto, &options, &|_| {})?;
    let graph = &loaded.graph;
    println!("{}", GraphStatistics::new(graph, 5));

    // The graph is a petgraph: its algorithms work on it.
    let components = petgraph::algo::kosaraju_scc(graph.as_petgraph());
    println!("{} strongly connected components", components.len());

    let picture = std::env::temp_dir().join("catena_merged_graph.svg");
    write_merged_graph_svg(&picture, graph, None, "sock, trash and wine")?;
    println!("drawn in {}", picture.display());
    Ok(())
}
