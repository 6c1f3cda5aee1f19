//! From MCAP recordings of a real robot to a merged graph: trains a tiny network on a few episodes of
//! two kitchen tasks (`BridgeData` V2, CC-BY-4.0, see `tests/data/bridge/README.md`), builds a graph of
//! each task and merges them.
//!
//! `cargo run --release --example 02_build_and_merge`

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use catena::graph::{
    BuildOptions, CrossTaskCandidates, GraphStatistics, MergeOptions, TopologicalGraph, build,
    merge,
};
use catena::inference::{EngineChoice, Model};
use catena::storage::load_demonstrations;
use catena::task::Subgoal;
use catena::training::{Preset, RunFolder, SilentObserver, export, train};
use catena::trajectory::DemonstrationSet;

const TASKS: [&str; 2] = [
    "put_cup_from_counter_or_drying_rack_into_sink",
    "put_carrot_on_plate",
];

fn main() -> Result<(), Box<dyn Error>> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/bridge");
    let work = tempfile::tempdir()?;

    // Continuous actions are cut into bins over the range of all recordings.
    let mut sets = Vec::new();
    for task in TASKS {
        sets.push(load_demonstrations(&[data.join(task)], task)?.0);
    }
    let steps = sets
        .iter()
        .flat_map(DemonstrationSet::trajectories)
        .flat_map(|t| &t.steps);
    let space = sets[0].action_space().binned(steps.map(|s| &s.action), 11);
    let sets: Vec<_> = sets
        .into_iter()
        .map(|set| set.with_action_space(&space))
        .collect();

    let report = train(
        &sets,
        &Preset::Tiny.config(),
        &RunFolder::open(&work.path().join("run"))?,
        &mut SilentObserver,
    )?;
    export(&report.model, BTreeMap::new(), &work.path().join("model"))?;
    let model = Model::load(&work.path().join("model"), EngineChoice::Auto)?;

    // Each task has one subgoal: its end.
    let mut graphs: Vec<TopologicalGraph> = Vec::new();
    for set in &sets {
        let end = Subgoal {
            task: set.task().to_owned(),
            name: "done".to_owned(),
        };
        let subgoals: Vec<_> = set
            .trajectories()
            .iter()
            .map(|t| vec![(end.clone(), t.steps.len() - 1)])
            .collect();
        let options = BuildOptions::default();
        let built = build(set, &subgoals, &model, &model, &options, &|_| {})?;
        graphs.push(built.graph);
    }
    let options = MergeOptions {
        candidates: CrossTaskCandidates::All,
        ..MergeOptions::default()
    };
    let merged = merge(
        &graphs.iter().collect::<Vec<_>>(),
        Some(&[(TASKS[0], TASKS[1])]),
        &model,
        &options,
        &|_| {},
    )?;
    println!("{}", GraphStatistics::new(&merged.graph, 3));
    assert_eq!(merged.graph.node_count(), 60);
    Ok(())
}
