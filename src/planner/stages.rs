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
    /// A later subgoal is seen to be reached without earlier ones. The stage stays; set it with
    /// [`StageFilter::set_stage`](super::StageFilter::set_stage) to accept that.
    Shortcut {
        /// The stage at which the robot seems to be.
        to: usize,
        /// The subgoals that were not seen, as stages at which they are due.
        skipped: Vec<usize>,
    },
    /// The robot goes about a later task although an earlier one is not done. Nothing is skipped yet.
    Ahead {
        /// The stage at which that task begins.
        to: usize,
        /// The subgoals before it that were not seen, as stages at which they are due.
        skipped: Vec<usize>,
    },
}

/// Probability that a stage must have had once, behind its subgoal, for that to count as seen.
const SEEN: f64 = 0.3;
/// Probability of a stage that is all but certain.
const CERTAIN: f64 = 0.9;
/// What speaks for a shortcut counts beyond this ...
const DOUBT: f64 = 0.5;
/// ... and together must come to so much: two steps that are plain, or more that are less so.
const CONVINCED: f64 = 0.5;

/// What a step says of the stages, one value each.
pub(super) struct StageView<'a> {
    /// Probabilities, which sum to 1.
    pub(super) probabilities: &'a [f64],
    /// What of them lies behind the stage's last subgoal in the same task, not at the start of a later one.
    pub(super) reached: &'a [f64],
    /// What speaks for being there, behind its subgoal, whatever was believed before; 0..=1.
    pub(super) support: &'a [f64],
}

/// The stage, which advances and falls back by votes.
#[derive(Clone, Debug)]
pub(super) struct Stages {
    pub(super) now: usize,
    votes: Votes,
    /// For each stage, the largest probability it had behind its subgoal since the current stage began.
    peaks: Vec<f64>,
    /// What speaks for a shortcut, added up.
    suspicion: f64,
    /// Stages that were reported since the current one began: as a shortcut, as what is headed for.
    reported: [Option<usize>; 2],
}

#[derive(Clone, Copy, Debug, Default)]
struct Votes {
    ahead: u32,
    behind: u32,
    /// Ahead while what is seen fits badly.
    unfit: u32,
}

impl Stages {
    pub(super) fn new(count: usize) -> Self {
        Self {
            now: 0,
            votes: Votes::default(),
            peaks: vec![0.0; count],
            suspicion: 0.0,
            reported: [None; 2],
        }
    }

    pub(super) fn set(&mut self, stage: usize) {
        self.now = stage;
        self.votes = Votes::default();
        self.peaks.fill(0.0);
        self.suspicion = 0.0;
        self.reported = [None; 2];
    }

    /// Counts this step's votes and changes the stage when they suffice.
    pub(super) fn vote(
        &mut self,
        options: &FilterOptions,
        view: &StageView<'_>,
    ) -> Option<StageChange> {
        self.votes.unfit = 0;
        for (peak, p) in self.peaks.iter_mut().zip(view.reached) {
            *peak = peak.max(*p);
        }
        let probabilities = view.probabilities;
        let behind: f64 = probabilities[..self.now].iter().sum();
        let ahead: f64 = probabilities[self.now + 1..].iter().sum();
        let count = |votes: u32, mass: f64, least: f64| if mass >= least { votes + 1 } else { 0 };
        self.votes.ahead = count(self.votes.ahead, ahead, options.advance_mass);
        self.votes.behind = count(self.votes.behind, behind, options.regress_mass);
        if self.votes.ahead > 0 && self.votes.ahead >= options.advance_votes {
            let to = self.now + 1 + most_probable(&probabilities[self.now + 1..]);
            let is_reached = view.reached[to] >= 0.5 * probabilities[to];
            let skipped = self.unseen_before(to, is_reached);
            if skipped.is_empty() {
                self.set(to);
                return Some(StageChange::Advanced { to });
            }
            // A stage that is only passed through may still gather its votes.
            let patience = options.advance_votes.max(1) * 2;
            if !is_reached && self.votes.ahead >= patience {
                let is_new = self.reported[1].replace(to) != Some(to);
                return is_new.then_some(StageChange::Ahead { to, skipped });
            }
            return self.shortcut(view);
        }
        let enough = options.regress_votes.map(|v| v.max(1));
        if enough.is_some_and(|votes| self.votes.behind >= votes) {
            let to = most_probable(&probabilities[..self.now]);
            self.set(to);
            return Some(StageChange::Regressed { to });
        }
        self.shortcut(view)
    }

    /// The same while what is seen fits badly: only on to the next stage, and only if that is all but certain.
    pub(super) fn vote_unfit(
        &mut self,
        options: &FilterOptions,
        view: &StageView<'_>,
    ) -> Option<StageChange> {
        let to = self.now + 1;
        let reached = view.reached.get(to).copied().unwrap_or(0.0);
        self.votes.unfit = if reached >= CERTAIN {
            self.votes.unfit + 1
        } else {
            0
        };
        let enough = options
            .advance_votes_unfit
            .is_some_and(|votes| self.votes.unfit >= votes.max(1));
        if !enough {
            return None;
        }
        self.set(to);
        Some(StageChange::Advanced { to })
    }

    /// A later subgoal that is seen to be reached, when enough speaks for it over some steps.
    fn shortcut(&mut self, view: &StageView<'_>) -> Option<StageChange> {
        let later = &view.support[self.now + 1..];
        if later.is_empty() {
            return None;
        }
        let to = self.now + 1 + most_probable(later);
        let skipped = self.unseen_before(to, true);
        let gained = if skipped.is_empty() {
            0.0
        } else {
            view.support[to]
        };
        self.suspicion = (self.suspicion + gained - DOUBT).max(0.0);
        if self.suspicion < CONVINCED {
            return None;
        }
        self.suspicion = 0.0;
        let is_new = self.reported[0].replace(to) != Some(to);
        is_new.then_some(StageChange::Shortcut { to, skipped })
    }

    /// The subgoals up to a stage that were never seen to be reached.
    fn unseen_before(&self, to: usize, is_reached: bool) -> Vec<usize> {
        let is_seen = |due: usize| self.peaks[due + 1] >= SEEN || (due + 1 == to && is_reached);
        (self.now..to).filter(|due| !is_seen(*due)).collect()
    }
}

/// Index of the largest value; the first wins a tie, an empty slice gives 0.
pub(super) fn most_probable(values: &[f64]) -> usize {
    let mut best = 0;
    for (i, v) in values.iter().enumerate() {
        if *v > values[best] {
            best = i;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of a robot that is believed at stage 0 while so much speaks for stage 3.
    fn step(stages: &mut Stages, support: f64) -> Option<StageChange> {
        let believed = [1.0, 0.0, 0.0, 0.0];
        let view = StageView {
            probabilities: &believed,
            reached: &believed,
            support: &[0.0, 0.0, 0.0, support],
        };
        stages.vote(&FilterOptions::default(), &view)
    }

    #[test]
    fn a_shortcut_takes_as_long_as_it_is_doubtful_and_is_said_once() {
        let steps = |support: f64| {
            let mut stages = Stages::new(4);
            (1..=50).find(|_| step(&mut stages, support).is_some())
        };
        assert_eq!(steps(0.9), Some(2));
        assert_eq!(steps(0.625), Some(4));
        assert_eq!(steps(0.5), None);
        let mut stages = Stages::new(4);
        let said: Vec<StageChange> = (0..20).filter_map(|_| step(&mut stages, 0.9)).collect();
        let skipped = vec![0, 1];
        assert_eq!(said, [StageChange::Shortcut { to: 3, skipped }]);
        assert_eq!(stages.now, 0);
    }

    #[test]
    fn a_stage_that_is_all_but_certain_is_reached_though_little_fits() {
        let steps = |reached: f64, options: &FilterOptions| {
            let mut stages = Stages::new(3);
            let view = [1.0 - reached, reached, 0.0];
            let view = StageView {
                probabilities: &view,
                reached: &view,
                support: &view,
            };
            (1..=20).find(|_| stages.vote_unfit(options, &view).is_some())
        };
        let options = FilterOptions::default();
        assert_eq!(steps(0.95, &options), Some(3));
        assert_eq!(steps(0.8, &options), None);
        let never = FilterOptions {
            advance_votes_unfit: None,
            ..options
        };
        assert_eq!(steps(0.95, &never), None);
    }

    #[test]
    fn what_flickers_is_no_shortcut() {
        let mut stages = Stages::new(4);
        for i in 0..50 {
            let support = if i % 2 == 0 { 0.9 } else { 0.0 };
            assert_eq!(step(&mut stages, support), None);
        }
    }
}
