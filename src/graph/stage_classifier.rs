use std::fmt;

use rayon::prelude::*;

use super::{Logistic, NodeId, ROWS_A_CLASS, TopologicalGraph, evenly};

/// Weight of the squared weights against the summed loss; what 30 demonstrations of the bedroom need for
/// those left out to be told best.
const RIDGE: f64 = 50.0;
/// Spread below which a value of the latent says nothing.
const LEAST_SPREAD: f64 = 1e-6;

/// Tells from a latent alone at which stage of which task a state is: a multinomial logistic regression
/// on the states of a graph, whose stages are known.
///
/// It knows nothing of time, so it is not led on by what was believed before; what it says of single frames
/// flickers. [`StageFilter`](crate::planner::StageFilter) weighs both.
///
/// A regression is as sure of what no demonstration showed as of what all did. So each class also says how
/// familiar a latent is: how many of its own states are as far from the other demonstrations' (a conformal
/// p-value).
#[derive(Clone)]
pub struct StageClassifier {
    /// Task and subgoals of it that hold, of each class.
    classes: Vec<(String, u32)>,
    class_of_node: Vec<u32>,
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// On standardised latents; nothing to tell where there is one class.
    regression: Logistic,
    known: Vec<KnownStates>,
}

/// States of one class, standardised, one after another, and how near each is to the nearest of another
/// demonstration, squared and sorted.
#[derive(Clone, Default)]
struct KnownStates {
    values: Vec<f32>,
    distances: Vec<f32>,
}

/// What a classifier makes of one latent.
#[derive(Clone, Debug, PartialEq)]
pub struct StageEvidence {
    probabilities: Vec<f64>,
    familiarity: Vec<f64>,
}

/// From here on a latent is as familiar as need be.
const FAMILIAR: f64 = 0.1;
/// The same where something else speaks for a class, too.
const BARELY_FAMILIAR: f64 = 0.01;

impl StageClassifier {
    /// Learns from all states of a graph, or an even choice of them where there are many. The same graph
    /// gives the same classifier.
    ///
    /// # Errors
    /// Why the search for the weights failed, as where latents are not finite.
    pub fn fit(graph: &TopologicalGraph) -> Result<Self, String> {
        let mut classes: Vec<(String, u32)> = graph
            .nodes()
            .map(|(_, node)| (node.task.clone(), node.progress))
            .collect();
        classes.sort_unstable();
        classes.dedup();
        let class_of_node: Vec<u32> = graph
            .nodes()
            .map(|(_, node)| {
                classes.partition_point(|(task, progress)| {
                    (task.as_str(), *progress) < (node.task.as_str(), node.progress)
                }) as u32
            })
            .collect();
        let dim = graph.latents().dim();
        let mut classifier = Self {
            regression: Logistic::of_nothing(dim, classes.len()),
            mean: vec![0.0; dim],
            scale: vec![1.0; dim],
            classes,
            class_of_node,
            known: Vec::new(),
        };
        let mut members = vec![Vec::new(); classifier.classes.len()];
        for (node, class) in classifier.class_of_node.iter().enumerate() {
            members[*class as usize].push(node);
        }
        if members.len() > 1 {
            classifier.learn(graph, &members)?;
        }
        classifier.known = members
            .par_iter()
            .map(|of_class| classifier.known_states(graph, of_class))
            .collect();
        Ok(classifier)
    }

    /// Learns from as many states of each class.
    fn learn(&mut self, graph: &TopologicalGraph, members: &[Vec<usize>]) -> Result<(), String> {
        let chosen = members.iter().flat_map(|m| evenly(m, ROWS_A_CLASS));
        let rows: Vec<usize> = chosen.collect();
        let latents = graph.latents();
        let dim = latents.dim();
        let values = |row: usize| latents.row(row).iter().map(|value| f64::from(*value));
        let count = rows.len() as f64;
        for row in &rows {
            for (sum, value) in self.mean.iter_mut().zip(values(*row)) {
                *sum += value / count;
            }
        }
        let mut spread = vec![0.0_f64; dim];
        for row in &rows {
            for ((sum, mean), value) in spread.iter_mut().zip(&self.mean).zip(values(*row)) {
                *sum += (value - mean).powi(2) / count;
            }
        }
        let scales = spread.iter().map(|variance| {
            let spread = variance.sqrt();
            if spread < LEAST_SPREAD {
                0.0
            } else {
                spread.recip()
            }
        });
        self.scale = scales.collect();
        let value = |row: usize, k: usize| self.standardised(k, latents.row(rows[row])[k]);
        let targets = rows.iter().map(|row| self.class_of_node[*row] as usize);
        self.regression = Logistic::fit(dim, value, targets.collect(), RIDGE)?;
        Ok(())
    }

    /// A choice of the states of a class, with no one of them twice.
    fn known_states(&self, graph: &TopologicalGraph, members: &[usize]) -> KnownStates {
        let count = members.len().min(ROWS_A_CLASS);
        let chosen: Vec<usize> = evenly(members, count).collect();
        let mut known = KnownStates::default();
        for node in &chosen {
            let latent = graph.latents().row(*node);
            known.values.extend(self.all_standardised(latent));
        }
        let demonstration = |i: usize| &graph.node(NodeId(chosen[i] as u32)).trajectory;
        let dim = self.mean.len();
        for (i, row) in known.values.chunks_exact(dim).enumerate() {
            let others = known.values.chunks_exact(dim).enumerate();
            let others = others.filter(|(j, _)| demonstration(*j) != demonstration(i));
            known
                .distances
                .extend(nearest(row, others.map(|(_, other)| other)));
        }
        known.distances.sort_unstable_by(f32::total_cmp);
        known
    }

    fn all_standardised<'a>(&'a self, latent: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let values = latent.iter().enumerate();
        values.map(|(k, value)| self.standardised(k, *value) as f32)
    }

    fn standardised(&self, k: usize, value: f32) -> f64 {
        (f64::from(value) - self.mean[k]) * self.scale[k]
    }

    /// What a latent of the graph's length says.
    ///
    /// # Panics
    /// If the latent has another length.
    #[must_use]
    pub fn look(&self, latent: &[f32]) -> StageEvidence {
        assert_eq!(latent.len(), self.mean.len(), "a latent of another length");
        let standardised = latent
            .iter()
            .enumerate()
            .map(|(k, v)| self.standardised(k, *v));
        let probabilities = self.regression.probabilities(standardised);
        let values: Vec<f32> = self.all_standardised(latent).collect();
        StageEvidence {
            probabilities,
            familiarity: self.known.iter().map(|k| k.familiarity(&values)).collect(),
        }
    }

    /// The classes: a task, and how many of its subgoals hold.
    #[must_use]
    pub fn classes(&self) -> &[(String, u32)] {
        &self.classes
    }

    /// The class of a state of the graph, as an index into [`classes`](Self::classes).
    ///
    /// # Panics
    /// If the graph has no such node.
    #[must_use]
    pub fn class_of(&self, node: NodeId) -> usize {
        self.class_of_node[node.index()] as usize
    }
}

impl StageEvidence {
    /// Probability of each class, 0..=1, summing to 1; each is as probable as any other beforehand.
    #[must_use]
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// Share (0..=1) of the known states of a class that are at least as far from those of other
    /// demonstrations as the latent is from any; 1 where there is one demonstration, which says nothing.
    ///
    /// # Panics
    /// If there is no such class.
    #[must_use]
    pub fn familiarity(&self, class: usize) -> f64 {
        self.familiarity[class]
    }

    /// What speaks for a class, 0..=1: its probability, less where the latent is unlike all that is known of
    /// the class.
    ///
    /// # Panics
    /// If there is no such class.
    #[must_use]
    pub fn support(&self, class: usize) -> f64 {
        self.support_from(class, FAMILIAR)
    }

    /// The same where a latent may be less like what is known of the class, for use where something else
    /// speaks for it, too.
    ///
    /// # Panics
    /// If there is no such class.
    #[must_use]
    pub fn lenient_support(&self, class: usize) -> f64 {
        self.support_from(class, BARELY_FAMILIAR)
    }

    fn support_from(&self, class: usize, familiar: f64) -> f64 {
        self.probabilities[class] * (self.familiarity[class] / familiar).min(1.0)
    }
}

impl KnownStates {
    fn familiarity(&self, values: &[f32]) -> f64 {
        let states = self.values.chunks_exact(values.len().max(1));
        let Some(distance) = nearest(values, states) else {
            return 1.0;
        };
        let count = self.distances.len();
        if count == 0 {
            return 1.0;
        }
        let nearer = self.distances.partition_point(|known| *known < distance);
        (count - nearer) as f64 / count as f64
    }
}

/// Squared distance to the nearest of some rows.
fn nearest<'a>(row: &[f32], others: impl Iterator<Item = &'a [f32]>) -> Option<f32> {
    let squared = |other: &[f32]| -> f32 {
        let differences = row.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
        differences.sum()
    };
    others.map(squared).min_by(f32::total_cmp)
}

impl fmt::Debug for StageClassifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StageClassifier")
            .field("classes", &self.classes)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::fakes::{add_demonstration, task};

    /// Two tasks along one line: `near` reaches its subgoal at 4, `far` lies beyond 20.
    fn graph() -> TopologicalGraph {
        let mut graph = TopologicalGraph::new(2, 5);
        for (name, from) in [("near", 0), ("far", 20)] {
            let walk = task(name, &["half"]);
            for id in 0..3 {
                let place = |x: usize| vec![(from + x) as f32, 0.01 * id as f32];
                let places: Vec<Vec<f32>> = (0..8).map(place).collect();
                let id = format!("{name}_{id}");
                add_demonstration(&mut graph, &walk, &id, &places, &[4]);
            }
        }
        graph
    }

    fn most_probable(evidence: &StageEvidence) -> usize {
        let probabilities = evidence.probabilities();
        let by = |a: &usize, b: &usize| probabilities[*a].total_cmp(&probabilities[*b]);
        (0..probabilities.len())
            .max_by(by)
            .expect("there are classes")
    }

    #[test]
    fn tells_stages_of_states_that_it_has_not_seen() {
        let classifier = StageClassifier::fit(&graph()).expect("the graph is sound");
        assert_eq!(classifier.classes().len(), 4);
        for (x, class) in [(1.5, ("near", 0)), (25.5, ("far", 1)), (28.0, ("far", 1))] {
            let evidence = classifier.look(&[x, 0.005]);
            let sum: f64 = evidence.probabilities().iter().sum();
            assert!((sum - 1.0).abs() < 1e-9);
            let (task, progress) = &classifier.classes()[most_probable(&evidence)];
            assert_eq!((task.as_str(), *progress), class, "at {x}: {evidence:?}");
        }
    }

    #[test]
    fn is_the_same_each_time_and_says_nothing_of_one_class() {
        let [a, b] = [0, 1].map(|_| StageClassifier::fit(&graph()).expect("sound"));
        assert_eq!(a.look(&[5.0, 0.0]), b.look(&[5.0, 0.0]));
        let mut one = TopologicalGraph::new(2, 5);
        let places = vec![vec![0.0, 0.0], vec![1.0, 0.0]];
        add_demonstration(&mut one, &task("idle", &[]), "0", &places, &[]);
        let classifier = StageClassifier::fit(&one).expect("one class needs no search");
        assert_eq!(classifier.look(&[9.0, 9.0]).probabilities(), [1.0]);
    }

    #[test]
    fn what_no_demonstration_showed_is_unfamiliar_however_sure_the_class() {
        let classifier = StageClassifier::fit(&graph()).expect("sound");
        let far_half = 1;
        assert_eq!(classifier.classes()[far_half], ("far".to_owned(), 1));
        let [within, beyond] = [[26.0, 0.01], [60.0, 0.0]].map(|at| classifier.look(&at));
        assert!(within.support(far_half) > 0.5, "{within:?}");
        assert!(beyond.probabilities()[far_half] > 0.9, "{beyond:?}");
        assert_eq!(beyond.support(far_half), 0.0);
        assert!(within.lenient_support(far_half) >= within.support(far_half));
    }

    #[test]
    fn a_value_that_never_changes_is_left_out() {
        let mut graph = TopologicalGraph::new(2, 5);
        let places: Vec<Vec<f32>> = (0..8).map(|x| vec![x as f32, 7.0]).collect();
        add_demonstration(&mut graph, &task("walk", &["half"]), "0", &places, &[4]);
        let classifier = StageClassifier::fit(&graph).expect("sound");
        assert_eq!(classifier.look(&[1.0, 7.0]), classifier.look(&[1.0, -7.0]));
    }
}
