use super::motion::Motion;
use super::{FilterOptions, Layout, LiveDistances, PlaceId};
use crate::graph::NodeId;

/// What became of the stage in a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StageChange {
    /// The subgoals up to this stage are reached, each one seen.
    Advanced {
        /// The new stage.
        to: usize,
    },
    /// Fewer subgoals hold than before.
    Regressed {
        /// The new stage.
        to: usize,
    },
    /// The robot seems to be beyond subgoals that it never reached. The stage stays; set it with
    /// [`StageFilter::set_stage`] to accept that.
    Shortcut {
        /// The stage at which the robot seems to be.
        to: usize,
        /// The subgoals that were not seen, as stages at which they are due.
        skipped: Vec<usize>,
    },
}

/// Where in the composition the robot is believed to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Localisation {
    /// The most probable state of the current stage, or of any where that stage is out of question.
    pub node: NodeId,
    /// At which of the composition's tasks, from 0.
    pub occurrence: usize,
    /// How many subgoals are taken to be reached.
    pub stage: usize,
    /// Time of the most probable state in the composition, in the median time of the demonstrations.
    pub time_steps: f32,
    /// Probability of each stage, summing to 1.
    pub stage_probabilities: Vec<f64>,
    /// Entropy of the belief over places in nats: 0 for certainty.
    pub entropy_nats: f64,
    /// Mean probability (0..=1), by belief, that what the robot sees is connected to where it is
    /// believed to be.
    pub fit: f64,
    /// Whether the fit has been low for several steps.
    pub is_lost: bool,
    /// What became of the stage in this step.
    pub change: Option<StageChange>,
}

/// Follows a robot along a composition: a belief over places, moved on at each step and weighed by how
/// near each place seems.
///
/// A single look-alike frame moves little of it, since the robot cannot have been anywhere near that
/// state before. Stages advance and fall back by votes. The same input gives the same belief.
#[derive(Clone, Debug)]
pub struct StageFilter {
    layout: Layout,
    options: FilterOptions,
    motion: Motion,
    belief: Vec<f64>,
    stage: usize,
    votes: Votes,
    /// For each stage, the largest probability it had since the current stage began.
    peaks: Vec<f64>,
    unfit_steps: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Votes {
    ahead: u32,
    behind: u32,
}

/// How far into the first task the robot may be at the beginning: mean of an exponential.
const START_STEPS: f64 = 4.0;
/// Share of the largest belief below which a place does not count.
const RULED_OUT: f64 = 0.02;
/// Probability below which the current stage is out of question.
const POSSIBLE: f64 = 0.02;
/// Probability that a stage must have had once for its subgoal to count as seen.
const SEEN: f64 = 0.3;

impl StageFilter {
    /// A filter that believes the robot near the start of the first task.
    #[must_use]
    pub fn new(layout: Layout, options: FilterOptions) -> Self {
        let motion = Motion::new(&layout);
        let stages = layout.stage_count();
        let mut filter = Self {
            layout,
            options,
            motion,
            belief: Vec::new(),
            stage: 0,
            votes: Votes::default(),
            peaks: vec![0.0; stages],
            unfit_steps: 0,
        };
        filter.reset();
        filter
    }

    /// Back to the beginning of the composition, for a new episode.
    pub fn reset(&mut self) {
        let start = |time: f32| (-f64::from(time) / START_STEPS).exp();
        let first = |o: usize, s: usize| o == 0 && s == 0;
        self.belief = self
            .layout
            .places()
            .iter()
            .map(|p| {
                if first(p.occurrence, p.stage) {
                    start(p.time_steps)
                } else {
                    0.0
                }
            })
            .map(|b| b + self.options.restart)
            .collect();
        normalise(&mut self.belief);
        self.set_stage(0);
        self.unfit_steps = 0;
    }

    /// The graph along the composition.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The nodes whose distances the filter wants: all that have a place.
    #[must_use]
    pub fn candidates(&self) -> Vec<NodeId> {
        let mut nodes: Vec<NodeId> = self.layout.places().iter().map(|p| p.node).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// How many subgoals are taken to be reached.
    #[must_use]
    pub fn stage(&self) -> usize {
        self.stage
    }

    /// The belief, by place; sums to 1.
    #[must_use]
    pub fn belief(&self) -> &[f64] {
        &self.belief
    }

    /// The most probable places of the current stage with their shares of the belief in all of them, the
    /// most probable one first: at most `count`, and none that is `1 / RULED_OUT` times less probable than
    /// the first.
    #[must_use]
    pub fn most_probable_places(&self, count: usize) -> Vec<(PlaceId, f64)> {
        let of_stage = |i: &usize| self.layout.places()[*i].stage == self.stage;
        let mut places: Vec<usize> = (0..self.belief.len()).filter(of_stage).collect();
        let order =
            |a: &usize, b: &usize| self.belief[*b].total_cmp(&self.belief[*a]).then(a.cmp(b));
        if places.len() > count {
            places.select_nth_unstable_by(count, order);
            places.truncate(count);
        }
        places.sort_unstable_by(order);
        let least = places.first().map_or(0.0, |i| self.belief[*i] * RULED_OUT);
        places.retain(|i| self.belief[*i] >= least);
        let total: f64 = places.iter().map(|i| self.belief[*i]).sum();
        places
            .into_iter()
            .map(|i| (PlaceId(i as u32), self.belief[i] / total))
            .collect()
    }

    /// Takes the robot to be at a stage, whatever the votes say.
    ///
    /// # Panics
    /// If the composition has no such stage.
    pub fn set_stage(&mut self, stage: usize) {
        assert!(
            stage < self.layout.stage_count(),
            "stage {stage} of {}",
            self.layout.stage_count()
        );
        self.stage = stage;
        self.votes = Votes::default();
        self.peaks.fill(0.0);
    }

    /// One step on: the robot acted, and now sees something at these distances.
    pub fn update(&mut self, distances: &LiveDistances) -> Localisation {
        let mut belief = if self.is_lost() {
            self.anywhere_in_stage()
        } else {
            self.motion
                .predict(&self.layout, &self.options, &self.belief)
        };
        let lowest = self.lowest_stage();
        let unknown = self.likelihood_of(None, None);
        for (mass, place) in belief.iter_mut().zip(self.layout.places()) {
            *mass *= if place.stage < lowest {
                0.0
            } else {
                match (distances.to(place.node), distances.from(place.node)) {
                    (None, None) => unknown,
                    (to, from) => self.likelihood_of(to, from),
                }
            };
        }
        normalise(&mut belief);
        self.belief = belief;
        let stage_probabilities = self.stage_probabilities();
        let fit = self.fit(distances);
        // What is seen is like nothing that is believed: a belief that only drifts on decides nothing.
        let is_unfit = fit < self.options.lost_probability;
        let change = if is_unfit {
            None
        } else {
            self.vote(&stage_probabilities)
        };
        self.unfit_steps = if is_unfit { self.unfit_steps + 1 } else { 0 };
        self.localise(fit, stage_probabilities, change)
    }

    /// The earliest stage that the robot may have fallen back to.
    fn lowest_stage(&self) -> usize {
        self.stage.saturating_sub(self.options.regress_stages)
    }

    fn is_lost(&self) -> bool {
        self.unfit_steps > 0 && self.unfit_steps >= self.options.lost_patience
    }

    /// What a lost robot starts from: any state of the current stage is as likely as any other. A
    /// belief that moved on without evidence would lead it through the task with closed eyes.
    fn anywhere_in_stage(&self) -> Vec<f64> {
        let places = self.layout.places().iter();
        places
            .map(|place| f64::from(u8::from(place.stage == self.stage)) + self.options.restart)
            .collect()
    }

    /// The most probable place of the current stage; of all stages where that one is out of question.
    fn best_place(&self, stage_probabilities: &[f64]) -> PlaceId {
        let is_possible = stage_probabilities[self.stage] >= POSSIBLE;
        let mut best: Option<usize> = None;
        for (i, place) in self.layout.places().iter().enumerate() {
            let counts = place.stage == self.stage || !is_possible;
            if counts && best.is_none_or(|b| self.belief[i] > self.belief[b]) {
                best = Some(i);
            }
        }
        PlaceId(best.unwrap_or(0) as u32)
    }

    /// How well the distances from and to a state fit with the robot being at it: both are one step
    /// for the state itself, and more or less so for its neighbours.
    fn likelihood_of(&self, to: Option<&[f32]>, from: Option<&[f32]>) -> f64 {
        let near = |row: Option<&[f32]>| {
            let Some(row) = row else { return 0.0 };
            let mut weight = 1.0;
            let mut sum = 0.0;
            for p in &row[..row.len() - 1] {
                sum += weight * f64::from(*p);
                weight *= 0.4;
            }
            sum
        };
        let floor = self.options.floor;
        let both = (floor + near(to)) * (floor + near(from));
        both.powf(self.options.evidence_weight)
    }

    fn stage_probabilities(&self) -> Vec<f64> {
        let mut probabilities = vec![0.0; self.layout.stage_count()];
        for (mass, place) in self.belief.iter().zip(self.layout.places()) {
            probabilities[place.stage] += mass;
        }
        probabilities
    }

    /// Counts this step's votes and changes the stage when they suffice.
    fn vote(&mut self, probabilities: &[f64]) -> Option<StageChange> {
        for (peak, p) in self.peaks.iter_mut().zip(probabilities) {
            *peak = peak.max(*p);
        }
        let behind: f64 = probabilities[..self.stage].iter().sum();
        let ahead: f64 = probabilities[self.stage + 1..].iter().sum();
        let count = |votes: u32, mass: f64, least: f64| if mass >= least { votes + 1 } else { 0 };
        self.votes.ahead = count(self.votes.ahead, ahead, self.options.advance_mass);
        self.votes.behind = count(self.votes.behind, behind, self.options.regress_mass);
        if self.votes.ahead > 0 && self.votes.ahead >= self.options.advance_votes {
            let to = self.stage + 1 + most_probable(&probabilities[self.stage + 1..]);
            return self.advance(to);
        }
        let enough = self.options.regress_votes.map(|v| v.max(1));
        if enough.is_some_and(|votes| self.votes.behind >= votes) {
            let to = most_probable(&probabilities[..self.stage]);
            self.set_stage(to);
            return Some(StageChange::Regressed { to });
        }
        None
    }

    fn advance(&mut self, to: usize) -> Option<StageChange> {
        let skipped: Vec<usize> = (self.stage..to)
            .filter(|due| self.peaks[due + 1] < SEEN && due + 1 != to)
            .collect();
        if skipped.is_empty() {
            self.set_stage(to);
            return Some(StageChange::Advanced { to });
        }
        // A stage that is only passed through may still gather its votes: report a shortcut once, and
        // when it has lasted longer than that takes.
        let patience = self.options.advance_votes.max(1) * 2;
        (self.votes.ahead == patience).then_some(StageChange::Shortcut { to, skipped })
    }

    /// Mean probability, by belief, that what is seen is connected to where the robot is believed to be.
    fn fit(&self, distances: &LiveDistances) -> f64 {
        let connected = |node| f64::from(distances.connected_probability(node).unwrap_or(0.0));
        let masses = self.belief.iter().zip(self.layout.places());
        masses
            .map(|(mass, place)| mass * connected(place.node))
            .sum()
    }

    fn localise(
        &self,
        fit: f64,
        stage_probabilities: Vec<f64>,
        change: Option<StageChange>,
    ) -> Localisation {
        let best = self.layout.place(self.best_place(&stage_probabilities));
        Localisation {
            node: best.node,
            occurrence: best.occurrence,
            stage: self.stage,
            time_steps: best.time_steps,
            stage_probabilities,
            entropy_nats: entropy(&self.belief),
            fit,
            is_lost: self.is_lost(),
            change,
        }
    }
}

/// Index of the largest value; the first wins a tie, an empty slice gives 0.
fn most_probable(values: &[f64]) -> usize {
    let mut best = 0;
    for (i, v) in values.iter().enumerate() {
        if *v > values[best] {
            best = i;
        }
    }
    best
}

fn entropy(belief: &[f64]) -> f64 {
    belief
        .iter()
        .filter(|b| **b > 0.0)
        .map(|b| -b * b.ln())
        .sum()
}

fn normalise(belief: &mut [f64]) {
    let sum: f64 = belief.iter().sum();
    for b in belief {
        *b /= sum;
    }
}
