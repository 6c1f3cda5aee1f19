//! Walking from one recorded state to another in the simulator, to see whether counted steps are true ones.

use serde::{Deserialize, Serialize};

use super::posture::{Arrival, Posture};
use super::true_steps::Leg;
use super::{RecordedState, TrueSteps};
use crate::simulator::{Bedroom, Insight, Joints, Primitive};

/// Steps beyond three times the counted ones after which a walk is given up.
const SPARE_STEPS: u32 = 6;

/// What came of a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Walk {
    pub(super) counted: u32,
    pub(super) walked: u32,
    pub(super) has_arrived: bool,
}

/// Walks compared with what was counted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WalkScore {
    /// Edges that were walked, drawn at random.
    pub walks: usize,
    /// Walks that ended where the edge leads, with the same thing held and the same subgoals reached.
    pub arrived: usize,
    /// Those of them that took fewer than `d_max` steps.
    pub arrived_near: usize,
    /// Median of walked minus counted steps, of the walks that arrived, the lower one of an even number; 0 where none did.
    pub median_extra_steps: f64,
}

impl WalkScore {
    pub(super) fn new(walks: &[Walk], d_max: u32) -> Self {
        let arrived: Vec<&Walk> = walks.iter().filter(|w| w.has_arrived).collect();
        let mut extra: Vec<f64> = arrived
            .iter()
            .map(|w| f64::from(w.walked) - f64::from(w.counted))
            .collect();
        extra.sort_by(f64::total_cmp);
        Self {
            walks: walks.len(),
            arrived: arrived.len(),
            arrived_near: arrived.iter().filter(|w| w.walked < d_max).count(),
            median_extra_steps: super::evaluation::quantile(&extra, 0.5),
        }
    }
}

/// Brings the bedroom to a recorded state and walks from there to another one, which takes a number of steps by
/// `truth`; `None` where no number does.
///
/// At each step the primitive is done after which the fewest are left, leaving out what has just moved nothing.
pub(super) fn walk(truth: &TrueSteps<'_>, from: RecordedState, to: RecordedState) -> Option<Walk> {
    let replay = &truth.replays()[from.replay];
    let (counted, legs) = truth.way(&replay.insights[from.step], to)?;
    let mut walker = Walker {
        bedroom: replay.bedroom_at(from.step),
        truth,
        to,
        steps: 0,
        limit: 3 * counted + SPARE_STEPS,
    };
    let has_walked = legs.iter().all(|leg| walker.goes(*leg));
    let has_arrived = has_walked && truth.is_alike(&walker.bedroom.insight(), to);
    Some(Walk {
        counted: counted.max(1),
        walked: walker.steps,
        has_arrived,
    })
}

struct Walker<'a> {
    bedroom: Bedroom,
    truth: &'a TrueSteps<'a>,
    to: RecordedState,
    steps: u32,
    limit: u32,
}

impl Walker<'_> {
    /// Whether the leg could be walked.
    fn goes(&mut self, leg: Leg) -> bool {
        let mut blocked: Vec<Primitive> = Vec::new();
        loop {
            let insight = self.bedroom.insight();
            let Some(next) = self.next(&insight, leg, &blocked) else {
                return false;
            };
            let (primitive, is_last) = match next {
                Next::There => match leg.action {
                    Some(action) => (action, true),
                    None => return true,
                },
                Next::Do(primitive) => (primitive, false),
            };
            if self.steps >= self.limit {
                return false;
            }
            self.bedroom.act(primitive);
            self.steps += 1;
            if is_last {
                return true;
            }
            if self.bedroom.insight().stands_as(&insight) {
                blocked.push(primitive);
            } else {
                blocked.clear();
            }
        }
    }

    /// What to do now; `None` where nothing that is not blocked leads nearer.
    fn next(&self, insight: &Insight, leg: Leg, blocked: &[Primitive]) -> Option<Next> {
        let replay = &self.truth.replays()[self.to.replay];
        let (goal, arrival) = self.truth.goal(insight, replay, leg.step);
        let here = Posture::of(insight);
        let left = here.steps_to(&goal, arrival);
        if left == 0 {
            return Some(Next::There);
        }
        let moves = Primitive::ALL.into_iter().filter(|p| {
            *p != Primitive::Terminate
                && !blocked.contains(p)
                && Joints::reaching(here.after(*p).tool()).is_some()
        });
        moves
            .map(|p| (steps_after(&here, p, &goal, arrival), p))
            .min_by_key(|(steps, _)| *steps)
            .filter(|(steps, _)| *steps < left)
            .map(|(_, primitive)| Next::Do(primitive))
    }
}

enum Next {
    There,
    Do(Primitive),
}

fn steps_after(here: &Posture, primitive: Primitive, goal: &Posture, arrival: Arrival) -> u32 {
    here.after(primitive).steps_to(goal, arrival)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Replay;
    use crate::simulator::{BedroomConfig, BedroomTask, demonstrate};

    #[test]
    fn what_was_demonstrated_can_be_walked() {
        let task = BedroomTask::Trash;
        let config = BedroomConfig::paper(task);
        let mut shown = (0..).map(|seed| {
            let shown = demonstrate(&mut Bedroom::new(config), task, seed);
            (seed, shown.expect("the room does not fail"))
        });
        let (seed, shown) = shown.find(|(_, s)| s.succeeded).expect("one succeeds");
        let replay = Replay::new(&shown.trajectory, seed, Some(config)).expect("just recorded");
        let replays = [replay];
        let truth = TrueSteps::new(&replays, 0.5);
        let state = |step| RecordedState { replay: 0, step };
        let walks: Vec<Walk> = (0..replays[0].insights.len() - 4)
            .step_by(6)
            .map(|step| walk(&truth, state(step), state(step + 4)).expect("it was shown"))
            .collect();
        let arrived = walks.iter().filter(|w| w.has_arrived).count();
        assert!(arrived * 5 >= walks.len() * 4, "{walks:?}");
        let score = WalkScore::new(&walks, 5);
        assert_eq!((score.walks, score.arrived), (walks.len(), arrived));
        assert!(score.median_extra_steps.abs() <= 1.0, "{walks:?}");
        // The end of the task is no place to go back from: what lies in the bin stays there.
        let end = state(replays[0].insights.len() - 1);
        assert_eq!(walk(&truth, end, state(0)), None);
    }
}
