//! The task language without YAML: containers, regions to pass and to avoid, and why the plan is what it is.
//!
//! `cargo run --release --example 07_task_language`

use std::error::Error;
use std::path::Path;

use catena::composer::{Composition, load_task};
use catena::inference::EngineChoice;
use catena::loading::LoadedComposition;
use catena::planner::{Explanation, FinalChoice};
use catena::task::{Order, Region};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let load = |name: &str| load_task(&root.join(format!("tasks/{name}.yaml")), root);
    let task = |name: &str| Order::Task(name.to_owned());

    // The sock and the can in whichever order is cheaper, then the spill if a way leads there.
    let composition = Composition::builder("tidy_carefully")
        .task(load("sock")?)
        .task(load("trash")?)
        .task(load("wine")?)
        .order(Order::InOrder(vec![
            Order::AnyOrder(vec![task("trash"), task("sock")]),
            Order::Optional(Box::new(task("wine"))),
        ]))
        // Up to the shelf as in this demonstration, or where others saw the same.
        .via(
            Region::of("trash")
                .demonstration("trash_01000022")
                .steps(10..=14)
                .within_steps(2)
                .named("at_the_shelf"),
        )
        // Not at all as in this one.
        .avoid(Region::of("sock").demonstration("sock_01000011"))
        .final_choice(FinalChoice::All)
        .step_limit(600)
        .build()?;
    println!("to do:\n{}", composition.order);

    // Regions are found on the merged graph; what is to be passed becomes a subgoal of graph and automaton.
    let loaded = LoadedComposition::load(composition, EngineChoice::Auto)?;
    let (composition, planner) = (&loaded.composition, loaded.own_planner()?);
    let explanation = Explanation::new(
        &planner,
        &composition.orders,
        &composition.planned_tasks(),
        composition.final_task(),
    )?;
    println!("{explanation}");

    let stages = composition.automaton.subgoals();
    assert!(stages.iter().any(|s| s.name == "at_the_shelf"));
    let plan = planner.plan_from_start()?;
    let passed = |id: &str| {
        let mut route = plan.route.iter();
        route.any(|n| planner.graph().node(*n).trajectory == id)
    };
    assert!(!passed("sock_01000011"));
    Ok(())
}
