use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::arguments::{
    Arguments, GraphBuildArguments, GraphCommand, GraphMergeArguments, GraphShowArguments,
};
use super::demonstrations::{in_model_space, read_demonstrations, read_options};
use super::error::CliError;
use super::gaps::gaps;
use super::localise::localise;
use super::progress::{self, show_progress};
use super::trust::trust;
use crate::composer::load_task_named;
use crate::graph::{
    BuildOptions, ConnectionEmbedding, EdgeKind, GraphStatistics, Node, NodeId, PairCandidates,
    ScoringReport, TopologicalGraph, build_states, merge, score_pairs,
};
use crate::inference::Model;
use crate::loading::{GraphFolders, in_folder, merge_options};
use crate::planner::{SuspectEdge, suspects};
use crate::storage::{
    BuildFolder, GraphImage, GraphManifest, Recordings, check_graph_files, check_graph_place,
    check_same_tasks, load_graph, load_manifest, save_graph,
};
use crate::task::{Subgoal, Task, locate_subgoals};
use crate::trajectory::DemonstrationSet;
use crate::view::write_merged_graph_svg;

/// Cross-task edges that `graph show` lists.
const LISTED_EDGES: usize = 8;

/// Steps that a predicted edge may claim to save over the demonstrations before it is suspect: some people
/// are that much slower than others between the same two states.
const SUSPICIOUS_GAIN_STEPS: f32 = 12.0;

/// Suspect edges that `graph show` prints; JSON has all of them.
const LISTED_SUSPECTS: usize = 20;

/// A graph with more edges is not loaded again only to sum it up: `graph show` does that.
const SUMMARISED_EDGES: usize = 5_000_000;

/// What `graph show --json` prints.
#[derive(Serialize)]
struct GraphReport {
    #[serde(flatten)]
    statistics: GraphStatistics,
    #[serde(skip_serializing_if = "Option::is_none")]
    scoring: Option<ScoringReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    suspects: Option<Vec<SuspectEdge>>,
}

/// One picture stands for so many steps: with all of them the pictures would outweigh everything else.
pub(super) const PICTURE_EVERY_STEPS: u32 = 6;

/// `catena graph ...`
pub(super) fn graph(command: &GraphCommand, arguments: &Arguments) -> Result<(), CliError> {
    match command {
        GraphCommand::Build(a) => build_graph(a, arguments),
        GraphCommand::Merge(a) => merge_graphs(a, arguments),
        GraphCommand::Show(a) => show(a),
        GraphCommand::Gaps(a) => gaps(a, arguments),
        GraphCommand::Localise(a) => localise(a, arguments),
        GraphCommand::Trust(a) => trust(a, arguments),
    }
}

fn build_graph(
    build_arguments: &GraphBuildArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let task = load_task_named(&build_arguments.task.to_string_lossy(), &arguments.root)?;
    let model = Model::load(&build_arguments.model, arguments.engine.into())?;
    let paths = match &build_arguments.demos {
        Some(demos) => vec![demos.clone()],
        None => task.demonstrations.clone(),
    };
    let out = build_arguments
        .out
        .clone()
        .unwrap_or_else(|| task.graph.clone());
    let options = BuildOptions {
        candidates: candidates(build_arguments.nearest)?,
        ..BuildOptions::default()
    };
    let recordings = Recordings::open(&paths, &read_options(&build_arguments.read))?;
    let mut manifest = GraphManifest::new(
        std::slice::from_ref(&task.task),
        model.digest(),
        recordings.digest()?,
        serde_json::to_value(&options)?,
    );
    manifest.subgoal_rules = Some(task.rules.clone());
    if is_up_to_date(&out, &manifest) {
        println!("{} is up to date", out.display());
        return Ok(());
    }
    check_graph_place(&out)?;
    check_same_tasks(&out, std::slice::from_ref(&task.task))?;
    let mut folder = BuildFolder::open(&out, &manifest, options.part_pairs)?;
    let (set, _) = read_demonstrations(&recordings, &task.task.name)?;
    let set = in_model_space(&set, &model)?;
    let bar = progress::bar("building", 0);
    let show = |p| show_progress(&bar, p);
    let states = if let Some(states) = folder.states()? {
        eprintln!(
            "going on with an interrupted build: {} states, {} parts of their pairs",
            states.node_count(),
            folder.kept_parts()
        );
        states
    } else {
        let subgoals: Vec<Vec<(Subgoal, usize)>> = set
            .trajectories()
            .iter()
            .map(|t| locate_subgoals(&task.rules, t))
            .collect::<Result<_, _>>()?;
        let d_max = model.manifest().spec.d_max;
        let states = build_states(&set, &subgoals, &model, d_max, options.encode_batch, &show)?;
        folder.keep_states(&states)?;
        states
    };
    let scoring = score_pairs(&states, &model, &options, &mut folder, &show)?;
    bar.finish_and_clear();
    manifest.scoring = Some(scoring);
    let saved = folder.finish(&states, &manifest, pictures(&set, &states))?;
    drop((set, states));
    if saved.edge_count <= SUMMARISED_EDGES {
        let (graph, _) = load_graph(&out)?;
        println!("{}", GraphStatistics::new(&graph, LISTED_EDGES));
    } else {
        println!("{} nodes, {} edges", saved.node_count, saved.edge_count);
    }
    println!("{}\nin {}", in_words(&scoring), out.display());
    Ok(())
}

/// Which pairs to score for `--nearest`.
fn candidates(nearest: Option<f64>) -> Result<PairCandidates, CliError> {
    match nearest {
        None => Ok(PairCandidates::All),
        Some(share) if share > 0.0 && share <= 1.0 => Ok(PairCandidates::Nearest {
            share,
            sample: ConnectionEmbedding::SAMPLE_SHARE,
        }),
        Some(share) => Err(CliError::ShareOutOfRange { share }),
    }
}

/// How many pairs were scored, and what that missed.
fn in_words(scoring: &ScoringReport) -> String {
    let share = 100.0 * scoring.scored_pairs as f64 / scoring.all_pairs.max(1) as f64;
    let recall = scoring.recall.map_or_else(String::new, |recall| {
        format!(
            "; the candidates hold {:.1} % of the edges of {} states of which all pairs were scored",
            100.0 * recall,
            scoring.probe_states
        )
    });
    format!(
        "pairs scored: {} of {} ({share:.1} %){recall}",
        scoring.scored_pairs, scoring.all_pairs
    )
}

/// Whether the graph that is wanted is there, whole: a killed build goes on with the tasks that are missing. One
/// that does not say by which rules its subgoals were found was built before that was written down, and counts.
fn is_up_to_date(folder: &Path, wanted: &GraphManifest) -> bool {
    load_manifest(folder).is_ok_and(|found| {
        found.tasks == wanted.tasks
            && found.model_digest == wanted.model_digest
            && found.demonstrations_digest == wanted.demonstrations_digest
            && found.build_options == wanted.build_options
            && (found.subgoal_rules.is_none() || found.subgoal_rules == wanted.subgoal_rules)
            && check_graph_files(folder, &found).is_ok()
    })
}

/// The pictures of every few states, and of those that reach a subgoal or end a demonstration.
fn pictures<'a>(
    set: &'a DemonstrationSet,
    graph: &'a TopologicalGraph,
) -> impl Iterator<Item = GraphImage> + 'a {
    let steps = set.trajectories().iter().flat_map(|t| &t.steps);
    let is_kept = |(_, node): &(NodeId, &Node)| {
        node.step % PICTURE_EVERY_STEPS == 0 || node.is_end || !node.reached.is_empty()
    };
    let states = graph
        .nodes()
        .zip(steps)
        .filter(move |(node, _)| is_kept(node));
    states.flat_map(|((node, _), step)| {
        step.observation
            .iter()
            .map(move |(camera, image)| GraphImage {
                node,
                camera: camera.to_owned(),
                image: image.clone(),
            })
    })
}

fn merge_graphs(
    merge_arguments: &GraphMergeArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let out = &merge_arguments.out;
    check_graph_place(out)?;
    if let Some(svg) = merge_arguments
        .svg
        .as_ref()
        .filter(|svg| svg.parent() == Some(out.as_path()))
    {
        return Err(CliError::PictureInGraph { svg: svg.clone() });
    }
    let same = |graph: &&PathBuf| fs::canonicalize(graph).ok() == fs::canonicalize(out).ok();
    if let Some(graph) = merge_arguments
        .graphs
        .iter()
        .filter(|_| out.exists())
        .find(same)
    {
        return Err(CliError::MergedIntoItself {
            graph: graph.clone(),
        });
    }
    let model = Model::load(&merge_arguments.model, arguments.engine.into())?;
    let folders = GraphFolders::load(&merge_arguments.graphs, &model)?;
    let tasks: Vec<Task> = folders.manifests.iter().flat_map(tasks_of).collect();
    check_same_tasks(out, &tasks)?;
    let graphs: Vec<&TopologicalGraph> = folders.graphs.iter().collect();
    let options = merge_options();
    let bar = progress::bar("merging", 0);
    let merged = merge(&graphs, None, &model, &options, &|p| show_progress(&bar, p))?;
    bar.finish_and_clear();
    let digests: Vec<&str> = folders
        .manifests
        .iter()
        .map(|m| m.demonstrations_digest.as_str())
        .collect();
    let manifest = GraphManifest::new(
        &tasks,
        model.digest(),
        digests.join("+"),
        serde_json::to_value(&options)?,
    );
    save_graph(out, &merged.graph, &manifest)?;
    println!(
        "{}\nin {}",
        GraphStatistics::new(&merged.graph, LISTED_EDGES),
        out.display()
    );
    if let Some(svg) = &merge_arguments.svg {
        let names: Vec<&str> = tasks.iter().map(|t| t.name.as_str()).collect();
        write_merged_graph_svg(svg, &merged.graph, None, &names.join(" + "))?;
        println!("drawn in {}", svg.display());
    }
    Ok(())
}

fn tasks_of(manifest: &GraphManifest) -> impl Iterator<Item = Task> {
    let task = |t: &crate::storage::GraphTask| Task {
        name: t.name.clone(),
        subgoals: t
            .subgoals
            .iter()
            .map(|name| Subgoal {
                task: t.name.clone(),
                name: name.clone(),
            })
            .collect(),
    };
    manifest.tasks.iter().map(task)
}

fn show(arguments: &GraphShowArguments) -> Result<(), CliError> {
    let (graph, manifest) = load_graph(&arguments.graph)?;
    graph.ensure_states(&in_folder(&arguments.graph))?;
    let statistics = GraphStatistics::new(&graph, LISTED_EDGES);
    let found = arguments.suspects.then(|| {
        let tasks: Vec<Task> = tasks_of(&manifest).collect();
        suspects(&graph, &tasks, SUSPICIOUS_GAIN_STEPS)
    });
    if arguments.json {
        let report = GraphReport {
            statistics,
            scoring: manifest.scoring,
            suspects: found,
        };
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    println!("{statistics}");
    println!(
        "model {}",
        &manifest.model_digest[..12.min(manifest.model_digest.len())]
    );
    if let Some(scoring) = &manifest.scoring {
        println!("{}", in_words(scoring));
    }
    let ends: Vec<NodeId> = graph
        .nodes()
        .filter(|(_, n)| n.is_end)
        .map(|(id, _)| id)
        .collect();
    println!("end states: {}", ends.len());
    if let Some(found) = found {
        print_suspects(&graph, &found);
    }
    Ok(())
}

fn print_suspects(graph: &TopologicalGraph, found: &[SuspectEdge]) {
    let kinds = graph.edges().map(|(_, _, edge)| edge.kind);
    println!(
        "{} of {} predicted edges claim to save {SUSPICIOUS_GAIN_STEPS} steps or more",
        found.len(),
        kinds.filter(|k| *k != EdgeKind::Temporal).count()
    );
    for suspect in found.iter().take(LISTED_SUSPECTS) {
        println!("  {suspect}");
    }
}

/// Where a folder would go; kept here so that commands name it alike.
pub(super) fn results_folder(name: &str) -> PathBuf {
    PathBuf::from("out").join(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{SubgoalDetection, SubgoalRule};

    /// The manifest of a graph of the task `sock`, whose last subgoal ends it.
    fn wanted(subgoals: [&str; 2]) -> GraphManifest {
        let subgoals = subgoals.map(|name| Subgoal {
            task: "sock".to_owned(),
            name: name.to_owned(),
        });
        let [held, _] = &subgoals;
        let marker = SubgoalDetection::Marker(held.name.clone());
        let rules = subgoals.iter().zip([marker, SubgoalDetection::End]);
        let rules = rules.map(|(subgoal, detection)| SubgoalRule {
            subgoal: subgoal.clone(),
            detection,
        });
        let rules: Vec<SubgoalRule> = rules.collect();
        let task = Task {
            name: "sock".to_owned(),
            subgoals: subgoals.to_vec(),
        };
        let options = serde_json::json!({ "encode_batch": 64 });
        let mut manifest = GraphManifest::new(&[task], "model", "demonstrations", options);
        manifest.subgoal_rules = Some(rules);
        manifest
    }

    #[test]
    fn a_graph_of_other_subgoals_or_with_a_broken_table_is_built_again() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("sock");
        let manifest = wanted(["held", "stowed"]);
        assert!(!is_up_to_date(&folder, &manifest), "nothing is there");
        let graph = TopologicalGraph::new(3, 5);
        save_graph(&folder, &graph, &manifest).unwrap();
        assert!(is_up_to_date(&folder, &manifest));
        assert!(!is_up_to_date(&folder, &wanted(["stowed", "held"])));
        assert!(!is_up_to_date(&folder, &wanted(["held", "put_away"])));
        let mut other = manifest.clone();
        other.tasks[0].name = "trash".to_owned();
        assert!(!is_up_to_date(&folder, &other));
        let mut found_otherwise = manifest.clone();
        found_otherwise.subgoal_rules.as_mut().unwrap()[0].detection = SubgoalDetection::End;
        assert!(!is_up_to_date(&folder, &found_otherwise));
        let edges = folder.join("edges.parquet");
        let mut bytes = fs::read(&edges).unwrap();
        bytes[5] ^= 1;
        fs::write(&edges, &bytes).unwrap();
        assert!(!is_up_to_date(&folder, &manifest), "the table was changed");
        fs::remove_file(&edges).unwrap();
        assert!(!is_up_to_date(&folder, &manifest), "the table is gone");
        // Built before rules were written down.
        let mut older = manifest.clone();
        older.subgoal_rules = None;
        save_graph(&folder, &graph, &older).unwrap();
        assert!(is_up_to_date(&folder, &manifest));
    }

    #[test]
    fn a_shipped_graph_is_whole_and_says_no_rules() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bedroom/wine");
        let found = load_manifest(&folder).unwrap();
        assert_eq!(found.subgoal_rules, None);
        let mut wanted = found.clone();
        wanted.subgoal_rules = Some(Vec::new());
        assert!(is_up_to_date(&folder, &wanted));
    }
}
