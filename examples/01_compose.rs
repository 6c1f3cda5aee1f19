//! Composes two tasks that were only ever demonstrated apart, and plans the way through both.
//!
//! `cargo run --release --example 01_compose`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use catena::composer::compose;
use catena::graph::{MergeOptions, merge};
use catena::inference::{EngineChoice, Model};
use catena::planner::{Planner, PlannerOptions};
use catena::storage::{ensure_same_model, load_graph};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let composition = compose(&root.join("tasks/sequences/sock_then_trash.yaml"), root)?;

    // One graph a task, joined by the edges that the traversability function finds between them.
    let model = Model::load(&composition.model, EngineChoice::Auto)?;
    let mut graphs = Vec::new();
    for task in composition.all_tasks() {
        let (graph, manifest) = load_graph(&task.graph)?;
        ensure_same_model(&task.graph, &manifest.model_digest, &model.digest())?;
        graphs.push(graph);
    }
    let follows: Vec<(&str, &str)> = composition.follows().into_iter().collect();
    let merged = merge(
        &graphs.iter().collect::<Vec<_>>(),
        Some(&follows),
        &model,
        &MergeOptions::default(),
        &|_| {},
    )?;
    composition.check_against(&merged.graph)?;
    let graph = Arc::new(merged.graph);

    // A plan with every subgoal in its order, and what the paper's unconstrained plan would do.
    for (name, options) in [
        ("in order", composition.planner.clone()),
        ("unconstrained", PlannerOptions::paper()),
    ] {
        let planner = Planner::new(
            Arc::clone(&graph),
            &composition.automaton,
            composition.terms(),
            options,
        )?;
        match planner.plan_from_start() {
            Ok(plan) => {
                let end = graph
                    .node(*plan.route.last().expect("a plan has an end"))
                    .place();
                println!("{name}: {} steps to {end}", plan.steps);
                println!(
                    "  {}",
                    planner.audit(&plan).to_string().replace('\n', "\n  ")
                );
            }
            Err(reason) => println!("{name}: {reason}"),
        }
    }
    Ok(())
}
