use std::fmt;

use serde::Serialize;

use super::evaluation::quantile;
use crate::planner::Layout;
use crate::rollout::{Monitor, RolloutError};
use crate::task::Subgoal;
use crate::trajectory::Trajectory;
use crate::wording::counted;

/// How far off a robot is taken to be, in steps of a typical demonstration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LocalisationError {
    /// Error at the median of all states.
    pub median_steps: f64,
    /// Error that one state in ten exceeds.
    pub p90_steps: f64,
    /// Share (0..=1) of the steps at which the place moves on by `d_max` steps or more too many, either
    /// way.
    pub jump_share: f64,
}

/// How well recordings that are not in a graph are followed along it.
///
/// The truth of a state is its share of the stretch between two subgoals, which is where a typical
/// demonstration would be; demonstrations differ, so that no follower has an error of 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LocalisationScore {
    /// Recordings that were followed.
    pub demonstrations: usize,
    /// Their states.
    pub states: usize,
    /// Share (0..=1) of the states at which the filter took the robot for lost.
    pub lost_share: f64,
    /// Share (0..=1) of the states at which it believed in the right stage.
    pub stage_share: f64,
    /// Errors of the filter.
    pub filter: LocalisationError,
    /// Errors of taking the state that seems nearest, whatever was seen before.
    pub nearest: LocalisationError,
}

/// What is collected on the way.
#[derive(Default)]
struct Track {
    errors: Vec<f64>,
    jumps: usize,
    moves: usize,
    last: Option<f64>,
}

impl Track {
    fn note(&mut self, place: f64, truth: f64, d_max: usize) {
        self.errors.push((place - truth).abs());
        if let Some(last) = self.last.replace(place) {
            self.moves += 1;
            self.jumps += usize::from((place - last - 1.0).abs() >= d_max as f64);
        }
    }

    fn error(mut self) -> LocalisationError {
        self.errors.sort_by(f64::total_cmp);
        LocalisationError {
            median_steps: quantile(&self.errors, 0.5),
            p90_steps: quantile(&self.errors, 0.9),
            jump_share: self.jumps as f64 / self.moves.max(1) as f64,
        }
    }
}

impl LocalisationScore {
    /// Shows recordings of the composition to a monitor, one after another. Each comes with its subgoals
    /// and the steps at which they are reached, as [`locate_subgoals`](crate::task::locate_subgoals) gives them. One
    /// that is reached before an earlier one counts once that one is reached.
    ///
    /// # Errors
    /// [`RolloutError`] when a network gives no answer.
    pub fn new(
        monitor: &mut Monitor<'_>,
        recordings: &[(Trajectory, Vec<(Subgoal, usize)>)],
        d_max: usize,
    ) -> Result<Self, RolloutError> {
        let stretches = stretches(monitor.filter().layout());
        let (mut filter, mut nearest) = (Track::default(), Track::default());
        let (mut lost, mut right_stage) = (0, 0);
        for (trajectory, subgoals) in recordings {
            monitor.reset();
            (filter.last, nearest.last) = (None, None);
            for (step, seen) in trajectory.steps.iter().enumerate() {
                let sight = monitor.look(seen.observation.clone())?;
                let (stage, truth) = place_of(step, trajectory.steps.len(), subgoals, &stretches);
                filter.note(f64::from(sight.localisation.time_steps), truth, d_max);
                let layout = monitor.filter().layout();
                let near = sight.distances.nearest();
                if let Some(place) = near.and_then(|(node, _)| layout.places_of(node).next()) {
                    nearest.note(f64::from(layout.place(place).time_steps), truth, d_max);
                }
                lost += usize::from(sight.localisation.is_lost);
                right_stage += usize::from(sight.localisation.stage == stage);
            }
        }
        let states = filter.errors.len();
        let share = |count: usize| count as f64 / states.max(1) as f64;
        Ok(Self {
            demonstrations: recordings.len(),
            states,
            lost_share: share(lost),
            stage_share: share(right_stage),
            filter: filter.error(),
            nearest: nearest.error(),
        })
    }
}

/// Start and length of each stage of a composition, in steps of a typical demonstration.
fn stretches(layout: &Layout) -> Vec<(f64, f64)> {
    let mut ends = vec![(f64::INFINITY, 0.0_f64); layout.stage_count()];
    for place in layout.places() {
        let (start, end) = &mut ends[place.stage];
        *start = start.min(f64::from(place.time_steps));
        *end = end.max(f64::from(place.time_steps) + 1.0);
    }
    let next = |stage: usize| {
        ends.get(stage + 1)
            .map_or(f64::INFINITY, |(start, _)| *start)
    };
    (0..ends.len())
        .map(|stage| {
            (
                ends[stage].0,
                next(stage).min(ends[stage].1) - ends[stage].0,
            )
        })
        .collect()
}

/// The stage of a step (so many subgoals are reached, none left out), and where a typical demonstration would be at its
/// share of the stretch.
fn place_of(
    step: usize,
    steps: usize,
    subgoals: &[(Subgoal, usize)],
    stretches: &[(f64, f64)],
) -> (usize, f64) {
    let stage = subgoals.iter().take_while(|(_, at)| *at <= step).count();
    let reached = subgoals[..stage].iter().map(|(_, at)| *at);
    let from = reached.max().unwrap_or(0);
    let to = subgoals.get(stage).map_or(steps, |(_, at)| *at);
    let share = (step - from) as f64 / (to - from).max(1) as f64;
    let (start, length) = stretches[stage.min(stretches.len() - 1)];
    (stage, start + share * length)
}

impl fmt::Display for LocalisationScore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, {} states: the stage is right at {:.1} % of them, lost at {:.1} %",
            counted(self.demonstrations, "demonstration"),
            self.states,
            100.0 * self.stage_share,
            100.0 * self.lost_share
        )?;
        for (name, error) in [("filter", &self.filter), ("nearest state", &self.nearest)] {
            writeln!(
                f,
                "  {name:<13}  error {:.1} steps at the median, {:.1} at the 90th percentile; jumps at {:.1} % of \
                 the steps",
                error.median_steps,
                error.p90_steps,
                100.0 * error.jump_share
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn subgoals(at: &[usize]) -> Vec<(Subgoal, usize)> {
        let subgoal = |nth: usize| Subgoal {
            task: "walk".to_owned(),
            name: nth.to_string(),
        };
        at.iter()
            .enumerate()
            .map(|(nth, at)| (subgoal(nth), *at))
            .collect()
    }

    #[test]
    fn a_slow_demonstration_is_where_a_typical_one_would_be() {
        let stretches = [(0.0, 10.0), (10.0, 4.0)];
        // Twenty steps to the subgoal where a typical demonstration takes ten, then eight more.
        let at = |step| place_of(step, 28, &subgoals(&[20]), &stretches);
        assert_eq!(at(0), (0, 0.0));
        assert_eq!(at(10), (0, 5.0));
        assert_eq!(at(20), (1, 10.0));
        assert_eq!(at(24), (1, 12.0));
    }

    #[test]
    fn a_subgoal_that_is_reached_before_an_earlier_one_counts_once_that_is_reached() {
        let stretches = [(0.0, 10.0), (10.0, 4.0), (14.0, 4.0)];
        let at = |step| place_of(step, 28, &subgoals(&[20, 10]), &stretches);
        assert_eq!(at(5), (0, 2.5));
        assert_eq!(at(15), (0, 7.5));
        assert_eq!(at(20), (2, 14.0));
        assert_eq!(at(24), (2, 16.0));
    }

    #[test]
    fn jumps_are_moves_that_are_d_max_too_long_either_way() {
        let mut track = Track::default();
        for (place, truth) in [(0.0, 0.0), (1.0, 1.0), (7.0, 2.0), (8.0, 3.0), (4.0, 4.0)] {
            track.note(place, truth, 5);
        }
        let error = track.error();
        assert!((error.jump_share - 0.5).abs() < 1e-12);
        assert_eq!(error.median_steps, 0.0);
        assert_eq!(error.p90_steps, 5.0);
    }
}
