use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::calibration_score::JudgedPair;
use super::edge_options::Judged;
use super::graph_truth::{EdgeTruth, GraphTruth};
use super::walk::walk;
use super::{
    CalibrationScore, EdgeOptions, EdgeTally, ExperimentError, OptionEffect, Population, Replay,
    WalkScore,
};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::model::{Traversability, predict_in_blocks};
use crate::planner::FinalChoice;
use crate::task::Automaton;

/// Pairs of different demonstrations that are judged, each task.
const SAMPLED_PAIRS: usize = 20_000;
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
    /// A sample of the edges that are counted as true, walked in the simulator.
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
        let is_true = |e: &EdgeTruth| e.wide.is_some_and(|s| s < d_max);
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

/// Walks a sample of the edges that satisfy a condition.
fn walks(
    truth: &GraphTruth<'_>,
    condition: impl Fn(&EdgeTruth) -> bool,
    count: usize,
    d_max: u32,
    rng: &mut ChaCha8Rng,
) -> WalkScore {
    let edges = truth.edges.iter().filter(|(_, edge)| condition(edge));
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
    let mut scores = Vec::new();
    for (population, pairs) in [
        (Population::SameDemonstration, same),
        (Population::OtherDemonstration, other),
    ] {
        let judged = ask(graph, input.traversability, &pairs)?;
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

/// The class of a number of steps.
fn class_of(steps: Option<u32>, d_max: usize) -> usize {
    steps.map_or(d_max, |s| (s as usize).min(d_max)).max(1) - 1
}

/// A pair of nodes, its true class, and its weight.
type Labelled = ((u32, u32), usize, f64);

/// Pairs of one demonstration by their distance in time, and a sample of pairs of two demonstrations of one task by the
/// simulator.
fn labelled_pairs(
    graph: &TopologicalGraph,
    truth: &GraphTruth<'_>,
    rng: &mut ChaCha8Rng,
) -> (Vec<Labelled>, Vec<Labelled>) {
    let d_max = graph.d_max();
    let mut by_task: BTreeMap<&str, Vec<NodeId>> = BTreeMap::new();
    for (id, node) in graph.nodes() {
        by_task.entry(&node.task).or_default().push(id);
    }
    let (mut same, mut sampled) = (Vec::new(), Vec::new());
    for nodes in by_task.values() {
        for from in nodes {
            let of_one = |to: &&NodeId| {
                let (a, b) = (graph.node(*from), graph.node(**to));
                *to != from && a.trajectory == b.trajectory
            };
            same.extend(nodes.iter().filter(of_one).map(|to| {
                let gap = i64::from(graph.node(*to).step) - i64::from(graph.node(*from).step);
                let steps = u32::try_from(gap).ok();
                ((from.0, to.0), class_of(steps, d_max), 1.0)
            }));
        }
        let demonstrations: Vec<&str> = nodes
            .iter()
            .map(|n| graph.node(*n).trajectory.as_str())
            .collect();
        if demonstrations.iter().all(|d| *d == demonstrations[0]) {
            continue;
        }
        for _ in 0..SAMPLED_PAIRS {
            let (a, b) = loop {
                let pair = [0; 2].map(|_| rng.random_range(0..nodes.len()));
                if demonstrations[pair[0]] != demonstrations[pair[1]] {
                    break (nodes[pair[0]], nodes[pair[1]]);
                }
            };
            sampled.push((a, b));
        }
    }
    weigh_halves(&mut same, d_max);
    let other = sampled.into_par_iter().map(|(a, b)| {
        let steps = truth.wide.between(truth.state(a), truth.state(b));
        ((a.0, b.0), class_of(steps, d_max), 1.0)
    });
    (same, other.collect())
}

/// Half of the weight to near pairs, half to far ones.
fn weigh_halves(pairs: &mut [Labelled], d_max: usize) {
    let near = pairs.iter().filter(|p| p.1 + 1 < d_max).count();
    let far = pairs.len() - near;
    for pair in pairs {
        let count = if pair.1 + 1 < d_max { near } else { far };
        pair.2 = 0.5 / count as f64;
    }
}

fn ask(
    graph: &TopologicalGraph,
    traversability: &(dyn Traversability + Sync),
    pairs: &[Labelled],
) -> Result<Vec<JudgedPair>, ExperimentError> {
    let projections = traversability.project(graph.latents())?;
    let ends: Vec<(u32, u32)> = pairs.iter().map(|p| p.0).collect();
    let rows = predict_in_blocks(traversability, &projections, &projections, &ends)?;
    let judged = rows.rows().zip(pairs).map(|(row, pair)| JudgedPair {
        probabilities: row.to_vec(),
        class: pair.1,
        weight: pair.2,
    });
    Ok(judged.collect())
}

impl fmt::Display for EdgeTrust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} demonstrations, {} states, d_max {}, temperature {:.2}\n",
            self.demonstrations, self.states, self.d_max, self.temperature
        )?;
        self.write_calibration(f)?;
        self.write_edges(f)?;
        self.write_walks(f)?;
        self.write_options(f)
    }
}

impl EdgeTrust {
    fn write_calibration(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<28} {:>8} {:>9}   {:<23} most probable class",
            "expected calibration error", "pairs", "connected", "connected or not"
        )?;
        for score in &self.calibration {
            let errors = [&score.connected, &score.class].map(|both| {
                let [before, after] =
                    [&both.before, &both.after].map(|r| r.expected_calibration_error);
                format!("{before:.3} -> {after:.3}")
            });
            writeln!(
                f,
                "  {:<26} {:>8} {:>7.1} %   {:<23} {}",
                score.population.name(),
                score.pairs,
                100.0 * score.connected_share,
                errors[0],
                errors[1]
            )?;
        }
        for score in &self.calibration {
            writeln!(
                f,
                "\n{}: P(connected) said, and how many are connected",
                score.population.name()
            )?;
            for (before, after) in score
                .connected
                .before
                .bins
                .iter()
                .zip(&score.connected.after.bins)
            {
                let told = [before, after].map(|bin| match bin.count {
                    0 => format!("{:>22}", "-"),
                    count => format!("{:>6.3} {:>6.3} ({count:>6})", bin.confidence, bin.accuracy),
                });
                writeln!(f, "  before {}   after {}", told[0], told[1])?;
            }
        }
        writeln!(f)
    }

    fn write_edges(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<30} {:>7}  {:>8} {:>11} {:>6} {:>12} {:>13}   to half a primitive",
            "false edges", "edges", "false", "impossible", "far", "understated", "median error"
        )?;
        for tally in &self.edges {
            let of = match tally.kind {
                EdgeKind::CrossTask => format!("{} -> {}", tally.from_task, tally.to_task),
                _ => format!("within {}", tally.from_task),
            };
            let (wide, narrow) = (&tally.within_one_primitive, &tally.within_half_a_primitive);
            let share = |count: usize| 100.0 * count as f64 / tally.edges.max(1) as f64;
            let median = wide
                .median_error_steps
                .map_or_else(|| "-".to_owned(), |m| format!("{m:+.0} steps"));
            writeln!(
                f,
                "  {of:<28} {:>7}  {:>6.1} % {:>9.1} % {:>4.1} % {:>10.1} % {median:>13}   {:>5.1} %",
                tally.edges,
                100.0 * wide.share,
                share(wide.impossible),
                share(wide.far),
                share(wide.understated),
                100.0 * narrow.share
            )?;
        }
        writeln!(f)
    }

    fn write_walks(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, score) in [("true", &self.true_walks), ("false", &self.false_walks)] {
            writeln!(
                f,
                "of {} {what} edges that were walked, {} lead there, {} in fewer than {} steps; {:+.0} steps at the median",
                score.walks,
                score.arrived,
                score.arrived_near,
                self.d_max,
                score.median_extra_steps
            )?;
        }
        writeln!(f)
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<26} {:>8} {:>7} {:>8} {:>7} {:>13} {:>7} {:>9} {:>11}",
            "options",
            "learned",
            "cross",
            "false",
            "plans",
            "over a false",
            "cost",
            "claimed",
            "true steps"
        )?;
        for effect in &self.options {
            writeln!(
                f,
                "  {:<24} {:>8} {:>7} {:>6.1} % {:>3}/{:<3} {:>13} {:>7.1} {:>9.1} {:>11.1}",
                effect.options.name,
                effect.learned_edges,
                effect.cross_task_edges,
                100.0 * effect.false_share,
                effect.plans,
                effect.starts,
                effect.plans_over_false_edges,
                effect.mean_cost,
                effect.mean_claimed_steps,
                effect.mean_true_steps
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_of_steps() {
        let classes = [Some(1), Some(4), Some(5), Some(30), None, Some(0)];
        let classes = classes.map(|steps| class_of(steps, 5));
        assert_eq!(classes, [0, 3, 4, 4, 4, 0]);
    }

    #[test]
    fn near_and_far_pairs_weigh_the_same() {
        let mut pairs = vec![((0, 1), 0, 1.0), ((0, 2), 4, 1.0), ((0, 3), 4, 1.0)];
        weigh_halves(&mut pairs, 5);
        let weights: Vec<f64> = pairs.iter().map(|p| p.2).collect();
        assert_eq!(weights, [0.5, 0.25, 0.25]);
    }
}
