use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::arguments::{Arguments, GraphTrustArguments};
use super::demonstrations::{read_demonstrations, warn_of_own};
use super::error::CliError;
use super::progress::{self, show_progress};
use super::record::BEDROOM_NOTE;
use super::worlds::composed;
use crate::composer::{Calibration, ResolvedTask};
use crate::experiment::{EdgeOptions, EdgeTrust, EdgeTrustInput, ExperimentError, Replay};
use crate::graph::{BuildOptions, TopologicalGraph, build};
use crate::inference::Model;
use crate::loading::{merge_options, merge_tasks};
use crate::storage::{ReadOptions, Recordings};
use crate::task::locate_subgoals;

/// `catena graph trust`: builds graphs of recordings that the model has not seen, replays the recordings in the
/// simulator, and compares what the edges claim with what is the case.
pub(super) fn trust(
    trust_arguments: &GraphTrustArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let file = trust_arguments.file.to_string_lossy();
    let composition = composed(&file, &arguments.root)?;
    // A task that is done several times has one graph.
    let is_done = |task: &&ResolvedTask| {
        let mut done = composition.tasks.iter();
        done.any(|of_order| of_order.task.name == task.task.name)
    };
    let tasks: Vec<&ResolvedTask> = composition.all_tasks().filter(is_done).collect();
    let folders = &trust_arguments.demos;
    if tasks.len() != folders.len() {
        return Err(CliError::FoldersOfTasks {
            tasks: tasks
                .iter()
                .map(|t| t.task.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            expected: tasks.len(),
            found: folders.len(),
        });
    }
    let model = Model::load(&composition.model, arguments.engine.into())?;
    let mut graphs = Vec::new();
    let mut replays = Vec::new();
    for (task, folder) in tasks.into_iter().zip(folders) {
        let (graph, more) = replayed_graph(task, folder, &model)?;
        graphs.push(graph);
        replays.extend(more);
    }
    let bar = progress::bar("merging", 0);
    let merged = merge_tasks(&graphs, &composition, &model, &merge_options(), &|p| {
        show_progress(&bar, p);
    })?;
    bar.finish_and_clear();
    let graph = merged.graph;
    composition.check_against(&graph)?;
    let is_calibrated = composition.calibration == Calibration::Temperature;
    let trust = EdgeTrust::new(&EdgeTrustInput {
        graph: Arc::new(graph),
        replays: &replays,
        traversability: &model,
        temperature: model.temperature(),
        automaton: &composition.automaton,
        final_choice: &composition.final_choice,
        options: EdgeOptions::compared(&composition.planner, is_calibrated),
        walks: trust_arguments.walks,
        seed: trust_arguments.seed,
    })?;
    if trust_arguments.json {
        println!("{}", serde_json::to_string_pretty(&trust)?);
    } else {
        print!("{trust}");
    }
    Ok(())
}

/// The graph of the recordings in a folder, and their replays.
fn replayed_graph(
    task: &ResolvedTask,
    folder: &Path,
    model: &Model,
) -> Result<(TopologicalGraph, Vec<Replay>), CliError> {
    let recordings = Recordings::open(&[folder.to_owned()], &ReadOptions::default())?;
    warn_of_own(&recordings, &task.graph);
    let (set, reports) = read_demonstrations(&recordings, &task.task.name)?;
    let kept: Vec<_> = reports.iter().filter(|r| r.left_out.is_none()).collect();
    let bar = progress::bar("replaying", kept.len() as u64);
    let replays: Vec<Replay> = set
        .trajectories()
        .par_iter()
        .zip(&kept)
        .map(|(trajectory, report)| {
            let seed = report.metadata.get("seed").and_then(|s| s.parse().ok());
            let seed = seed.ok_or_else(|| ExperimentError::SeedMissing {
                recording: trajectory.id.clone(),
            })?;
            let noted = report.metadata.get(BEDROOM_NOTE);
            let noted = noted.map(|note| serde_json::from_str(note)).transpose()?;
            let replay = Replay::new(trajectory, seed, noted)?;
            bar.inc(1);
            Ok(replay)
        })
        .collect::<Result<_, CliError>>()?;
    bar.finish_and_clear();
    let subgoals = set
        .trajectories()
        .iter()
        .map(|t| locate_subgoals(&task.rules, t))
        .collect::<Result<Vec<_>, _>>()?;
    let bar = progress::bar("building", 0);
    let options = BuildOptions::default();
    let built = build(&set, &subgoals, model, model, &options, &|p| {
        show_progress(&bar, p);
    })?;
    bar.finish_and_clear();
    Ok((built.graph, replays))
}
