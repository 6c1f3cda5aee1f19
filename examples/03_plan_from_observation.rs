//! One step of the loop by hand: an observation becomes a state, joins the graph, is localised, and
//! the planner says which state to go to next.
//!
//! `cargo run --release --example 03_plan_from_observation`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use catena::composer::compose_named;
use catena::environment::Environment;
use catena::inference::EngineChoice;
use catena::loading::LoadedComposition;
use catena::model::{Encoder, LocalPolicy, Traversability};
use catena::planner::{FilterOptions, LiveDistances};
use catena::simulator::{Bedroom, BedroomConfig, BedroomTask};
use catena::trajectory::State;

/// States that are less probably near are not asked how far the robot is from them.
const NEAR_PROBABILITY: f32 = 0.02;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let composition = compose_named("trash", root)?;
    let loaded = LoadedComposition::load(composition, EngineChoice::Auto)?;
    let (model, planner) = (&loaded.model, loaded.own_planner()?);

    // Your robot's cameras go here.
    let observation = Bedroom::new(BedroomConfig::paper(BedroomTask::Trash)).reset(4)?;
    let spec = model.spec();
    let state = State::from_history(&[Arc::new(observation)], spec.stack);

    // The filter remembers: it is made once an episode, and what the states are projected to once a graph.
    let mut filter = planner.stage_filter(FilterOptions::default());
    let projections = model.project(planner.graph().latents())?;

    let latent = model.encode(&[state])?;
    let distances = LiveDistances::query(
        model,
        &projections,
        &model.project(&latent)?,
        &filter.candidates(),
        NEAR_PROBABILITY,
    )?;
    let localisation = filter.update(&distances);
    let goal = planner.next_goal(&localisation, &distances)?;
    let policy = model.act(
        latent.row(0),
        planner.graph().latents().row(goal.node.index()),
    )?;
    let action = spec.action_space.action(&policy.most_probable())?;

    let place = |node| planner.graph().node(node).place();
    println!("the robot sees something like {}", place(localisation.node));
    println!(
        "it is sent to {}, {} steps ahead",
        place(goal.node),
        goal.steps
    );
    println!(
        "and does {} (entropy {:.2} nats)",
        spec.action_space.name(&action),
        policy.entropy()
    );
    Ok(())
}
