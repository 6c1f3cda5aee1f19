use std::collections::BTreeSet;

use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::TopologicalGraph;
use super::build::trajectory_spans;

/// How many states at each end of a demonstration belong to the seam of a task that follows itself, where all
/// pairs of other tasks are scored. Within a task all pairs would take the place of its learned edges.
const OWN_SEAM_STEPS: u32 = 10;

/// Which pairs of states of different tasks are scored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CrossTaskCandidates {
    /// Every pair of every two tasks, in both directions, as in the paper: exact, and slow for
    /// large graphs. Of a task that follows itself only the seam: the last ten states of its demonstrations
    /// with the first ten.
    All,
    /// Only the seams of the order: the last states of the demonstrations of a task with the first
    /// ones of the task that comes next.
    Seam {
        /// How many states at each end of a demonstration belong to the seam.
        window_steps: u32,
    },
    /// The seams, and pairs drawn at random from all others: enough to see whether the
    /// network takes states of different tasks for each other where it should not.
    SeamAndSample {
        /// As for [`Seam`](Self::Seam).
        window_steps: u32,
        /// How many pairs to draw for each two tasks and direction.
        pairs: u32,
        /// What the draw starts from.
        seed: u64,
    },
}

/// A block of pairs between two tasks: for each first node, the nodes to score it against.
pub(super) struct Batch {
    pub(super) from_task: usize,
    pub(super) to_task: usize,
    /// Whether it holds the seam between two tasks that follow each other.
    pub(super) is_seam: bool,
    pub(super) from: Vec<u32>,
    /// One list for each first node, or one list for all.
    to: Vec<Vec<u32>>,
}

impl Batch {
    pub(super) fn targets(&self, from: u32) -> &[u32] {
        if self.to.len() == 1 {
            return &self.to[0];
        }
        let row = self
            .from
            .binary_search(&from)
            .expect("the node is in the batch");
        &self.to[row]
    }

    pub(super) fn pair_count(&self) -> u64 {
        self.from
            .iter()
            .map(|f| self.targets(*f).len() as u64)
            .sum()
    }
}

/// The nodes of each task, and how far each lies from the ends of its demonstration.
pub(super) struct Candidates {
    nodes: Vec<Vec<u32>>,
    /// Steps since the first state and until the last state of the node's demonstration.
    ends: Vec<(u32, u32)>,
    /// Pairs of tasks of which the second follows the first.
    seams: BTreeSet<(usize, usize)>,
}

impl Candidates {
    pub(super) fn new(
        graph: &TopologicalGraph,
        tasks: &[String],
        seams: BTreeSet<(usize, usize)>,
    ) -> Self {
        let mut nodes = vec![Vec::new(); tasks.len()];
        for (id, node) in graph.nodes() {
            let task = tasks.iter().position(|t| *t == node.task);
            nodes[task.expect("the tasks are the graph's own")].push(id.0);
        }
        let ends = trajectory_spans(graph)
            .into_iter()
            .enumerate()
            .map(|(i, (start, end))| (i as u32 - start, end - 1 - i as u32))
            .collect();
        Self { nodes, ends, seams }
    }

    fn last(&self, task: usize, window: u32) -> Vec<u32> {
        self.within(task, |(_, until_end)| until_end < window)
    }

    fn first(&self, task: usize, window: u32) -> Vec<u32> {
        self.within(task, |(since_start, _)| since_start < window)
    }

    fn within(&self, task: usize, keep: impl Fn((u32, u32)) -> bool) -> Vec<u32> {
        let near = |n: &&u32| keep(self.ends[**n as usize]);
        self.nodes[task].iter().filter(near).copied().collect()
    }

    /// What is to be scored; no pair comes twice.
    pub(super) fn batches(&self, which: CrossTaskCandidates) -> Vec<Batch> {
        let tasks = self.nodes.len();
        match which {
            CrossTaskCandidates::All => {
                let own = self.seams.iter().filter(|(a, b)| a == b);
                let own = own.map(|&(a, b)| self.batch(a, b, Some(OWN_SEAM_STEPS)));
                let others = ordered_pairs(tasks).map(|(a, b)| self.batch(a, b, None));
                others.chain(own).collect()
            }
            CrossTaskCandidates::Seam { window_steps } => self.seam_batches(window_steps),
            CrossTaskCandidates::SeamAndSample {
                window_steps,
                pairs,
                seed,
            } => {
                let mut batches = self.seam_batches(window_steps);
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                batches.extend(
                    ordered_pairs(tasks)
                        .map(|(a, b)| self.sample(a, b, window_steps, pairs, &mut rng)),
                );
                batches
            }
        }
    }

    fn seam_batches(&self, window: u32) -> Vec<Batch> {
        self.seams
            .iter()
            .map(|&(a, b)| self.batch(a, b, Some(window)))
            .collect()
    }

    fn batch(&self, from_task: usize, to_task: usize, window: Option<u32>) -> Batch {
        let window = window.unwrap_or(u32::MAX);
        Batch {
            from_task,
            to_task,
            is_seam: self.seams.contains(&(from_task, to_task)),
            from: self.last(from_task, window),
            to: vec![self.first(to_task, window)],
        }
    }

    fn sample(
        &self,
        from_task: usize,
        to_task: usize,
        window: u32,
        pairs: u32,
        rng: &mut ChaCha8Rng,
    ) -> Batch {
        let (a, b) = (&self.nodes[from_task], &self.nodes[to_task]);
        let is_seam = self.seams.contains(&(from_task, to_task));
        let mut drawn = BTreeSet::new();
        for _ in 0..pairs {
            if a.is_empty() || b.is_empty() {
                break;
            }
            let (f, t) = (
                a[rng.random_range(0..a.len())],
                b[rng.random_range(0..b.len())],
            );
            let scored_already =
                is_seam && self.ends[f as usize].1 < window && self.ends[t as usize].0 < window;
            if !scored_already {
                drawn.insert((f, t));
            }
        }
        let (mut from, mut to): (Vec<u32>, Vec<Vec<u32>>) = (Vec::new(), Vec::new());
        for (f, t) in drawn {
            if from.last() != Some(&f) {
                from.push(f);
                to.push(Vec::new());
            }
            to.last_mut().expect("a list was just added").push(t);
        }
        Batch {
            from_task,
            to_task,
            is_seam: false,
            from,
            to,
        }
    }
}

fn ordered_pairs(tasks: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..tasks).flat_map(move |a| (0..tasks).filter(move |b| *b != a).map(move |b| (a, b)))
}
