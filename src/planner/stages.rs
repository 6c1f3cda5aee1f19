mod fingers;
mod grip;
mod suspicion;

use grip::Grip;
use suspicion::Suspicion;

use super::FilterOptions;
use super::grips::Load;
use crate::model::{GraspSight, most_probable};

/// What became of the stage in a step.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StageChange {
    /// The subgoals up to this stage are reached, each one seen.
    Advanced {
        /// The new stage.
        to: usize,
    },
    /// The next subgoal is reached, since the gripper is seen to hold what it should then hold, wherever the robot is
    /// believed to be.
    Taken {
        /// The new stage.
        to: usize,
    },
    /// Fewer subgoals hold than before.
    Regressed {
        /// The new stage.
        to: usize,
    },
    /// The gripper that should hold something is seen to be empty: what it held is to be grasped again.
    Dropped {
        /// The new stage.
        to: usize,
    },
    /// A later subgoal is seen to be reached without earlier ones. The stage stays, or falls back to the first of
    /// these where it was believed to be reached; set it with
    /// [`StageFilter::set_stage`](super::StageFilter::set_stage) to accept what was skipped.
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
/// Steps that a robot must be believed at the start of a later task to have gone about it.
const PASSED_STEPS: f64 = 8.0;
/// What a classifier must have given a stage once for that to be more than believed.
const SENSED: f64 = 0.5;

/// What a step says of the stages, one value each.
pub(super) struct StageView<'a> {
    /// Probabilities, which sum to 1.
    pub(super) probabilities: &'a [f64],
    /// What of them lies behind the stage's last subgoal in the same task, not at the start of a later one.
    pub(super) reached: &'a [f64],
    /// What speaks for being there, behind its subgoal; 0..=1.
    pub(super) support: &'a [f64],
    /// The same where what is seen may be less familiar.
    pub(super) lenient: &'a [f64],
    /// What a classifier gives the stage, whatever is believed, 0..=1; none without one.
    pub(super) sensed: Option<&'a [f64]>,
}

/// The stage, which advances and falls back by votes.
#[derive(Clone, Debug)]
pub(super) struct Stages {
    pub(super) now: usize,
    votes: Votes,
    /// For each stage, the largest probability it had behind its subgoal since the current stage began ...
    peaks: Vec<f64>,
    /// ... and for how many steps the robot was believed at it, be it at the start of a later task.
    passed_steps: Vec<f64>,
    /// For each stage, the most that the classifier gave it, or 1 where it is to be taken as reached.
    sensed: Vec<f64>,
    /// Stages at which a later task starts.
    is_start: Vec<bool>,
    grip: Grip,
    /// Stages whose subgoal was to let go of something when the gripper was empty, or had not shut to take it; those of
    /// the taking, too, then.
    is_hollow: Vec<bool>,
    /// The stage at which the robot was most probably a step ago.
    believed: usize,
    /// What speaks for a later subgoal without earlier ones.
    ahead: Suspicion,
    /// What speaks for the current stage although an earlier one was only believed.
    overlooked: Suspicion,
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
    /// At the first of so many stages; later tasks start at some of them.
    pub(super) fn new(count: usize, starts_of_tasks: &[usize]) -> Self {
        Self {
            now: 0,
            votes: Votes::default(),
            peaks: vec![0.0; count],
            passed_steps: vec![0.0; count],
            sensed: vec![0.0; count],
            is_start: (0..count).map(|s| starts_of_tasks.contains(&s)).collect(),
            grip: Grip::new(vec![Load::Nothing; count]),
            is_hollow: vec![false; count],
            believed: 0,
            ahead: Suspicion::new(DOUBT, CONVINCED),
            overlooked: Suspicion::new(DOUBT, CONVINCED),
            reported: [None; 2],
        }
    }

    /// Says what the gripper holds in each stage.
    pub(super) fn know_loads(&mut self, loads: Vec<Load>) {
        self.grip = Grip::new(loads);
    }

    /// Forgets all that was seen, for a new episode that begins at a stage.
    pub(super) fn begin(&mut self, stage: usize) {
        self.sensed.fill(0.0);
        self.accept(stage);
    }

    /// Takes a stage as reached, with all before it, whatever was seen.
    pub(super) fn accept(&mut self, stage: usize) {
        self.set(stage);
        self.grip.forget_what_was_carried();
        self.sensed[..=stage].fill(1.0);
        self.is_hollow.fill(false);
        self.believed = stage;
    }

    fn set(&mut self, stage: usize) {
        if stage < self.now {
            self.sensed[stage + 1..].fill(0.0);
            self.is_hollow[stage + 1..].fill(false);
        }
        if stage > self.now && self.grip.lets_go_of_nothing(stage) {
            self.is_hollow[self.now + 1..=stage].fill(true);
        }
        if let Some(first) = self.grip.never_took(self.now, stage) {
            self.is_hollow[first..=stage].fill(true);
        }
        self.grip.forget();
        self.now = stage;
        self.votes = Votes::default();
        self.peaks.fill(0.0);
        self.passed_steps.fill(0.0);
        self.ahead.forget();
        self.overlooked.forget();
        self.reported = [None; 2];
    }

    /// Notes where the robot is believed to be, and what is seen of each stage.
    fn note(&mut self, view: &StageView<'_>) {
        for (peak, p) in self.peaks.iter_mut().zip(view.reached) {
            *peak = peak.max(*p);
        }
        for (steps, p) in self.passed_steps.iter_mut().zip(view.probabilities) {
            *steps += p;
        }
        // Without a classifier what is believed is all that there is to know.
        for (stage, sensed) in self.sensed.iter_mut().enumerate() {
            *sensed = sensed.max(view.sensed.map_or(1.0, |seen| seen[stage]));
        }
    }

    /// Notes what is seen of the gripper.
    pub(super) fn note_grasp(&mut self, sight: GraspSight) {
        self.grip.note(self.now, self.believed, sight);
    }

    /// What a classifier gives each stage, less where the gripper should hold something and is empty.
    pub(super) fn weighed(&self, sensed: Vec<f64>, sight: GraspSight) -> Vec<f64> {
        self.grip.weighed(sensed, sight)
    }

    /// Counts this step's votes and changes the stage when they suffice.
    pub(super) fn vote(
        &mut self,
        options: &FilterOptions,
        view: &StageView<'_>,
    ) -> Option<StageChange> {
        self.votes.unfit = 0;
        self.believed = most_probable(view.probabilities);
        self.note(view);
        if let Some(change) = self.dropped(options).or_else(|| self.taken(options)) {
            return Some(change);
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
        self.shortcut(view).or_else(|| self.overlooked(view))
    }

    /// The same while what is seen fits badly: only on to the next stage, and only if that is all but certain.
    pub(super) fn vote_unfit(
        &mut self,
        options: &FilterOptions,
        view: &StageView<'_>,
    ) -> Option<StageChange> {
        self.believed = most_probable(view.probabilities);
        self.note_release(view);
        if let Some(change) = self.dropped(options).or_else(|| self.taken(options)) {
            return Some(change);
        }
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

    /// Notes that what was held is put away, where that is all but certain in the very step in which the gripper is
    /// seen to let go. A robot that goes straight on is at the start of the next task a step or two later, and until
    /// then it stands as no demonstration did.
    fn note_release(&mut self, view: &StageView<'_>) {
        let to = self.now + 1;
        let reached = view.reached.get(to).copied().unwrap_or(0.0);
        if reached >= CERTAIN && self.grip.lets_go(self.now) {
            self.peaks[to] = self.peaks[to].max(reached);
        }
    }

    /// Back to the stage in which what an empty gripper should hold is grasped, over all those in which it is held.
    fn dropped(&mut self, options: &FilterOptions) -> Option<StageChange> {
        let is_dropped = options.regress_when_empty && self.grip.should_hold_and_is_empty(self.now);
        let to = (0..self.now)
            .rfind(|stage| !self.grip.holds(*stage))
            .filter(|_| is_dropped)?;
        self.set(to);
        self.grip.stay_empty();
        Some(StageChange::Dropped { to })
    }

    /// On to the next stage, where what it should hold is seen to be held.
    fn taken(&mut self, options: &FilterOptions) -> Option<StageChange> {
        if !(options.advance_when_held && self.grip.is_taken()) {
            return None;
        }
        let to = self.now + 1;
        self.sensed[to] = 1.0;
        self.set(to);
        Some(StageChange::Taken { to })
    }

    /// Whether a stage is out of question, since the gripper should hold something there and was seen to be empty.
    pub(super) fn is_ruled_out(&self, stage: usize, sight: GraspSight) -> bool {
        self.grip.is_ruled_out(stage, sight)
    }

    /// A later subgoal that is seen to be reached, when enough speaks for it over some steps.
    fn shortcut(&mut self, view: &StageView<'_>) -> Option<StageChange> {
        // A robot that went about the later task is at its first subgoal more probably than one that never did.
        let support = |to: usize| {
            let came_by = self.is_start[to - 1] && self.passed_steps[to - 1] >= PASSED_STEPS;
            (if came_by { view.lenient } else { view.support })[to]
        };
        let later: Vec<f64> = (self.now + 1..self.peaks.len()).map(support).collect();
        if later.is_empty() {
            return None;
        }
        let to = self.now + 1 + most_probable(&later);
        let skipped = self.unseen_before(to, true);
        let gained = if skipped.is_empty() {
            0.0
        } else {
            later[to - self.now - 1]
        };
        if !self.ahead.add(gained) {
            return None;
        }
        let is_new = self.reported[0].replace(to) != Some(to);
        is_new.then_some(StageChange::Shortcut { to, skipped })
    }

    /// The current stage, when enough speaks for it over some steps and yet one of an earlier task was believed
    /// without ever being seen, or was to let go of what an empty gripper did not hold. The stage falls back to what
    /// is due. Stages at which a later task starts may pass too fast to be seen.
    fn overlooked(&mut self, view: &StageView<'_>) -> Option<StageChange> {
        let to = self.now;
        let task_starts = (0..=to).rfind(|stage| self.is_start[*stage])?;
        let is_unseen = |stage: &usize| {
            let is_unsensed = !self.is_start[*stage] && self.sensed[*stage] < SENSED;
            self.is_hollow[*stage] || (is_unsensed && *stage < task_starts)
        };
        let unseen = (1..to.min(task_starts + 1)).filter(is_unseen);
        let skipped: Vec<usize> = unseen.map(|stage| stage - 1).collect();
        let due = *skipped.first()?;
        if !self.overlooked.add(view.support[to]) {
            return None;
        }
        self.set(due);
        self.reported[0] = Some(to);
        Some(StageChange::Shortcut { to, skipped })
    }

    /// The subgoals up to a stage that were never seen to be reached.
    fn unseen_before(&self, to: usize, is_reached: bool) -> Vec<usize> {
        let is_seen = |due: usize| self.peaks[due + 1] >= SEEN || (due + 1 == to && is_reached);
        (self.now..to).filter(|due| !is_seen(*due)).collect()
    }
}

#[cfg(test)]
mod tests;
