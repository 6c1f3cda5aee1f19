use super::FilterOptions;

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
    /// [`StageFilter::set_stage`](super::StageFilter::set_stage) to accept that.
    Shortcut {
        /// The stage at which the robot seems to be.
        to: usize,
        /// The subgoals that were not seen, as stages at which they are due.
        skipped: Vec<usize>,
    },
}

/// Probability that a stage must have had once for its subgoal to count as seen.
const SEEN: f64 = 0.3;

/// The stage, which advances and falls back by votes.
#[derive(Clone, Debug)]
pub(super) struct Stages {
    pub(super) now: usize,
    votes: Votes,
    /// For each stage, the largest probability it had since the current stage began.
    peaks: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Votes {
    ahead: u32,
    behind: u32,
}

impl Stages {
    pub(super) fn new(count: usize) -> Self {
        Self {
            now: 0,
            votes: Votes::default(),
            peaks: vec![0.0; count],
        }
    }

    pub(super) fn set(&mut self, stage: usize) {
        self.now = stage;
        self.votes = Votes::default();
        self.peaks.fill(0.0);
    }

    /// Counts this step's votes and changes the stage when they suffice.
    pub(super) fn vote(
        &mut self,
        options: &FilterOptions,
        probabilities: &[f64],
    ) -> Option<StageChange> {
        for (peak, p) in self.peaks.iter_mut().zip(probabilities) {
            *peak = peak.max(*p);
        }
        let behind: f64 = probabilities[..self.now].iter().sum();
        let ahead: f64 = probabilities[self.now + 1..].iter().sum();
        let count = |votes: u32, mass: f64, least: f64| if mass >= least { votes + 1 } else { 0 };
        self.votes.ahead = count(self.votes.ahead, ahead, options.advance_mass);
        self.votes.behind = count(self.votes.behind, behind, options.regress_mass);
        if self.votes.ahead > 0 && self.votes.ahead >= options.advance_votes {
            let to = self.now + 1 + most_probable(&probabilities[self.now + 1..]);
            return self.advance(options, to);
        }
        let enough = options.regress_votes.map(|v| v.max(1));
        if enough.is_some_and(|votes| self.votes.behind >= votes) {
            let to = most_probable(&probabilities[..self.now]);
            self.set(to);
            return Some(StageChange::Regressed { to });
        }
        None
    }

    fn advance(&mut self, options: &FilterOptions, to: usize) -> Option<StageChange> {
        let skipped: Vec<usize> = (self.now..to)
            .filter(|due| self.peaks[due + 1] < SEEN && due + 1 != to)
            .collect();
        if skipped.is_empty() {
            self.set(to);
            return Some(StageChange::Advanced { to });
        }
        // A stage that is only passed through may still gather its votes: report a shortcut once, and
        // when it has lasted longer than that takes.
        let patience = options.advance_votes.max(1) * 2;
        (self.votes.ahead == patience).then_some(StageChange::Shortcut { to, skipped })
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
