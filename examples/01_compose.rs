//! Composes two tasks that were only ever demonstrated apart, and plans the way through both.
//!
//! `cargo run --release --example 01_compose`

use std::error::Error;
use std::path::Path;

use catena::composer::compose;
use catena::inference::EngineChoice;
use catena::loading::LoadedComposition;
use catena::planner::PlannerOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let composition = compose(&root.join("tasks/sequences/sock_then_trash.yaml"), root)?;

    // The model, and one graph a task, joined by the edges that the traversability function finds between them.
    let loaded = LoadedComposition::load(composition, EngineChoice::Auto)?;

    // A plan with every subgoal in its order, and what the paper's unconstrained plan would do.
    for (name, planner) in [
        ("in order", loaded.own_planner()?),
        ("unconstrained", loaded.planner(PlannerOptions::paper())?),
    ] {
        match planner.plan_from_start() {
            Ok(plan) => {
                let end = loaded
                    .graph
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
