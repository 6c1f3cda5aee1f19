use std::sync::Arc;

use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::calibration_score::JudgedPair;
use super::edge_options::Judged;
use super::graph_truth::{EdgeTruth, GraphTruth, is_false};
use super::labelled_pairs::{Labelled, class_of, labelled_pairs};
use super::walk::walk;
use super::{
    CalibrationScore, EdgeOptions, EdgeTally, ExperimentError, OptionEffect, Population, Replay,
    WalkScore,
};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::model::{Projections, Traversability, predict_in_blocks};
use crate::planner::FinalChoice;
use crate::task::Automaton;

/// Edges that truly take more are not walked.
const LONGEST_WALK: u32 = 15;

/// How far the edges of a graph can be trusted.
///
/// The graph is of demonstrations that the model has not seen, recorded in the simulator and replayed there, so that the
/// truth of every state is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeTrust {
    /// Demonstrations of the graph.
    pub demonstrations: usize,
    /// Their states.
    pub states: usize,
    /// Number of traversability classes.
    pub d_max: usize,
    /// The model's temperature.
    pub temperature: f32,
    /// How well calibrated the traversability is, on several kinds of pairs.
    pub calibration: Vec<CalibrationScore>,
    /// False edges, by kind and tasks.
    pub edges: Vec<EdgeTally>,
    /// A sample of the learned edges that are counted as true, walked in the simulator.
    pub true_walks: WalkScore,
    /// A sample of those that are counted as false, but lead somewhere within 15 steps.
    pub false_walks: WalkScore,
    /// What each option of the edges does.
    pub options: Vec<OptionEffect>,
}

/// What is to be judged.
pub struct EdgeTrustInput<'a> {
    /// The graph of all tasks, merged, with calibrated probabilities.
    pub graph: Arc<TopologicalGraph>,
    /// Replays of all its demonstrations.
    pub replays: &'a [Replay],
    /// The traversability function that the graph was built with, calibrated.
    pub traversability: &'a (dyn Traversability + Sync),
    /// The temperature that calibrates it.
    pub temperature: f32,
    /// The composition's tasks and subgoals.
    pub automaton: &'a Automaton,
    /// Which end state plans lead to.
    pub final_choice: &'a FinalChoice,
    /// What to compare.
    pub options: Vec<EdgeOptions>,
    /// Edges that are walked, of those counted as true and of those counted as false each.
    pub walks: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl EdgeTrust {
    /// Judges a graph.
    ///
    /// # Errors
    /// [`ExperimentError::NotReplayed`] for a graph with other demonstrations than the replays',
    /// [`ExperimentError::Model`] when the model gives no answer, [`ExperimentError::Planner`] when the composition does
    /// not fit the graph.
    pub fn new(input: &EdgeTrustInput<'_>) -> Result<Self, ExperimentError> {
        let graph = &input.graph;
        let truth = GraphTruth::new(graph, input.replays)?;
        let mut rng = ChaCha8Rng::seed_from_u64(input.seed);
        let uncalibrated = Arc::new(graph.tempered(input.temperature));
        let judged = Judged {
            calibrated: graph,
            uncalibrated: &uncalibrated,
            truth: &truth,
            automaton: input.automaton,
            final_choice: input.final_choice,
        };
        let options = input.options.iter().cloned();
        let d_max = graph.d_max() as u32;
        let is_true = |e: &EdgeTruth| !is_false(e.wide, d_max);
        let is_walkable =
            |e: &EdgeTruth| e.wide.is_some_and(|s| (d_max..=LONGEST_WALK).contains(&s));
        Ok(Self {
            demonstrations: input.replays.len(),
            states: graph.node_count(),
            d_max: graph.d_max(),
            temperature: input.temperature,
            calibration: calibration(input, &truth, &mut rng)?,
            edges: truth.tallies(),
            true_walks: walks(&truth, is_true, input.walks, d_max, &mut rng),
            false_walks: walks(&truth, is_walkable, input.walks, d_max, &mut rng),
            options: options
                .map(|o| judged.effect(o))
                .collect::<Result<_, _>>()?,
        })
    }
}

/// Walks a sample of the learned edges that satisfy a condition. Cross-task edges are not walked: a recording of
/// another task may have found the things of the next one elsewhere.
fn walks(
    truth: &GraphTruth<'_>,
    condition: impl Fn(&EdgeTruth) -> bool,
    count: usize,
    d_max: u32,
    rng: &mut ChaCha8Rng,
) -> WalkScore {
    let is_asked = |e: &EdgeTruth| e.kind == EdgeKind::Learned && condition(e);
    let edges = truth.edges.iter().filter(|(_, edge)| is_asked(edge));
    let mut ends: Vec<(NodeId, NodeId)> = edges.map(|(ends, _)| *ends).collect();
    ends.sort_unstable();
    let sample: Vec<(NodeId, NodeId)> = ends.choose_multiple(rng, count).copied().collect();
    let walked: Vec<_> = sample
        .par_iter()
        .filter_map(|(from, to)| walk(&truth.wide, truth.state(*from), truth.state(*to)))
        .collect();
    WalkScore::new(&walked, d_max)
}

fn calibration(
    input: &EdgeTrustInput<'_>,
    truth: &GraphTruth<'_>,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<CalibrationScore>, ExperimentError> {
    let graph = &input.graph;
    let (same, other) = labelled_pairs(graph, truth, rng);
    let projections = input.traversability.project(graph.latents())?;
    let mut scores = Vec::new();
    for (population, pairs) in [
        (Population::SameDemonstration, same),
        (Population::OtherDemonstration, other),
    ] {
        let judged = ask(input.traversability, &projections, &pairs)?;
        scores.push(CalibrationScore::new(
            population,
            &judged,
            input.temperature,
        ));
    }
    for (population, kind) in [
        (Population::LearnedEdges, EdgeKind::Learned),
        (Population::CrossTaskEdges, EdgeKind::CrossTask),
    ] {
        let edges = graph.edges().filter(|(_, _, edge)| edge.kind == kind);
        let judged: Vec<JudgedPair> = edges
            .map(|(from, to, edge)| JudgedPair {
                probabilities: edge.probabilities.clone(),
                class: class_of(truth.edges[&(from, to)].wide, graph.d_max()),
                weight: 1.0,
            })
            .collect();
        if !judged.is_empty() {
            scores.push(CalibrationScore::new(
                population,
                &judged,
                input.temperature,
            ));
        }
    }
    Ok(scores)
}

fn ask(
    traversability: &(dyn Traversability + Sync),
    projections: &Projections,
    pairs: &[Labelled],
) -> Result<Vec<JudgedPair>, ExperimentError> {
    let ends: Vec<(u32, u32)> = pairs.iter().map(|p| p.0).collect();
    let rows = predict_in_blocks(traversability, projections, projections, &ends)?;
    let judged = rows.rows().zip(pairs).map(|(row, pair)| JudgedPair {
        probabilities: row.to_vec(),
        class: pair.1,
        weight: pair.2,
    });
    Ok(judged.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::fakes::{Oracle, add_demonstration, task};
    use crate::graph::{Edge, PruneOptions};
    use crate::planner::{EdgeChoice, PlannerOptions};
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, demonstrate};
    use crate::task::Task;
    use crate::trajectory::Trajectory;

    /// Three demonstrations that succeed, with their replays.
    fn shown() -> (Vec<Trajectory>, Vec<Replay>) {
        let bedroom = BedroomTask::Wine;
        let config = BedroomConfig::paper(bedroom);
        let shown = (0..).filter_map(|seed| {
            let shown = demonstrate(&mut Bedroom::new(config), bedroom, seed);
            let shown = shown.expect("the room does not fail");
            let replay = Replay::new(&shown.trajectory, seed, Some(config));
            let replay = replay.expect("it was just recorded");
            shown.succeeded.then_some((shown.trajectory, replay))
        });
        shown.take(3).unzip()
    }

    fn options(min_support: u32) -> EdgeOptions {
        EdgeOptions {
            name: format!("support {min_support}"),
            planner: PlannerOptions {
                edges: EdgeChoice::All,
                forward_leap_steps: None,
                predicted_edges: PruneOptions {
                    min_support,
                    ..PruneOptions::default()
                },
                ..PlannerOptions::default()
            },
            is_calibrated: true,
        }
    }

    /// A graph of demonstrations without any learned edge, and the states of each.
    fn graph_of(trajectories: &[Trajectory], task: &Task) -> (TopologicalGraph, Vec<Vec<NodeId>>) {
        let mut graph = TopologicalGraph::new(1, 5);
        let mut ids = Vec::new();
        for (k, trajectory) in trajectories.iter().enumerate() {
            let latents = (0..trajectory.steps.len()).map(|s| vec![1000.0 * k as f32 + s as f32]);
            let latents: Vec<Vec<f32>> = latents.collect();
            let reached: Vec<usize> = trajectory.markers.iter().map(|m| m.step).collect();
            ids.push(add_demonstration(
                &mut graph,
                task,
                &trajectory.id,
                &latents,
                &reached,
            ));
        }
        (graph, ids)
    }

    #[test]
    fn at_the_seam_of_a_task_with_itself_it_is_still_to_be_done() {
        let (trajectories, replays) = shown();
        let wine = task("wine", BedroomTask::Wine.subgoals());
        let (mut graph, ids) = graph_of(&trajectories, &wine);
        let end = *ids[0].last().expect("a state");
        let kinds = [
            (EdgeKind::CrossTask, ids[1][0]),
            (EdgeKind::Learned, ids[2][0]),
        ];
        for (kind, start) in kinds {
            let sure = Edge::predicted(kind, &[0.96, 0.01, 0.01, 0.01, 0.01]);
            graph.add_edge(end, start, sure);
        }
        let truth = GraphTruth::new(&graph, &replays).expect("all of it was replayed");
        let [again, back] = kinds.map(|(_, start)| truth.edges[&(end, start)].wide);
        assert!(again.is_some(), "the tissue lies there again");
        assert_eq!(back, None, "nobody takes it off the spill");
    }

    #[test]
    fn a_wormhole_is_found_and_support_keeps_plans_out_of_it() {
        let (trajectories, replays) = shown();
        let wine = task("wine", BedroomTask::Wine.subgoals());
        let (mut graph, ids) = graph_of(&trajectories, &wine);
        let grasp = trajectories[1].markers[0].step;
        let sure = Edge::predicted(EdgeKind::Learned, &[0.96, 0.01, 0.01, 0.01, 0.01]);
        // From the start of the first to just before the grasp of the second.
        graph.add_edge(ids[0][1], ids[1][grasp - 1], sure);
        let oracle = Oracle::new(5, |a, b| (b[0] >= a[0]).then(|| (b[0] - a[0]) as u32));
        let trust = EdgeTrust::new(&EdgeTrustInput {
            graph: Arc::new(graph),
            replays: &replays,
            traversability: &oracle,
            temperature: 1.0,
            automaton: &Automaton::in_order(&[wine]),
            final_choice: &FinalChoice::Demonstration(trajectories[1].id.clone()),
            options: vec![options(0), options(1)],
            walks: 4,
            seed: 0,
        })
        .expect("all of it was replayed");
        assert_eq!(trust.edges.len(), 1);
        let found = &trust.edges[0].within_one_primitive;
        assert_eq!((found.count, trust.edges[0].edges), (1, 1), "{found:?}");
        let [free, supported] = &trust.options[..] else {
            panic!("two were asked for");
        };
        assert_eq!((free.starts, free.plans), (3, 2), "the third leads nowhere");
        assert_eq!((free.plans_over_false_edges, supported.plans), (1, 1));
        assert_eq!(supported.plans_over_false_edges, 0);
        assert!(free.mean_true_steps > free.mean_claimed_steps);
        assert_eq!(supported.mean_true_steps, supported.mean_claimed_steps);
        // The oracle is 90 % sure of what is always so.
        let same = &trust.calibration[0];
        assert_eq!(same.population, Population::SameDemonstration);
        let error = same.class.after.expected_calibration_error;
        assert!((error - 0.1).abs() < 1e-3, "{error}");
        assert!(trust.to_string().contains("within wine"));
    }
}
