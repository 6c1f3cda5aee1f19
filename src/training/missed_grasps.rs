//! What came of each closing of the gripper, and which steps led to one that closed on nothing.

use std::ops::Range;

use super::ImitationConfig;
use crate::task::GripperEvent;

/// The gripper was told to close.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Closing {
    /// The step of that action.
    pub closed: usize,
    /// The step of the action that opened the gripper again.
    pub opened: Option<usize>,
    /// What came of it.
    pub outcome: Outcome,
    /// The first step after the gripper's last action before.
    after_event: usize,
}

/// What came of a closing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Taken back within a few steps, before any subgoal was reached.
    Missed,
    /// A subgoal was reached while the gripper was kept closed.
    Held,
    /// Neither.
    Unknown,
}

/// Every closing of a demonstration. Events and markers are in order of time.
pub fn closings(
    events: &[(usize, GripperEvent)],
    markers: &[usize],
    config: &ImitationConfig,
) -> impl Iterator<Item = Closing> {
    let longest = config.missed_grasp_steps;
    events.iter().enumerate().filter_map(move |(place, event)| {
        let (closed, GripperEvent::Close) = *event else {
            return None;
        };
        let opened = match events.get(place + 1) {
            Some((step, GripperEvent::Open)) => Some(*step),
            _ => None,
        };
        let end = opened.unwrap_or(usize::MAX);
        let reached = |step: &usize| *step > closed && *step <= end;
        let outcome = if markers.iter().any(reached) {
            Outcome::Held
        } else if end.saturating_sub(closed) <= longest {
            Outcome::Missed
        } else {
            Outcome::Unknown
        };
        Some(Closing {
            closed,
            opened,
            outcome,
            after_event: place.checked_sub(1).map_or(0, |p| events[p].0 + 1),
        })
    })
}

/// The steps of each missed grasp: those that led to a closing which was taken back soon, before any
/// subgoal was reached, up to the one that opened the gripper again, which is left out. Events and markers
/// are in order of time.
pub fn missed_grasps(
    events: &[(usize, GripperEvent)],
    markers: &[usize],
    config: &ImitationConfig,
) -> impl Iterator<Item = Range<usize>> {
    let lead = config.lead_steps;
    closings(events, markers, config)
        .filter(|closing| closing.outcome == Outcome::Missed)
        .filter_map(move |closing| {
            let first = closing.closed.saturating_sub(lead);
            let marked = markers.iter().rfind(|step| **step <= closing.closed);
            let first = first.max(closing.after_event);
            Some(first.max(marked.copied().unwrap_or(0))..closing.opened?)
        })
}

/// When a gripper closed and opened, without closings that missed and the openings that took them back.
pub fn lasting_events(
    events: &[(usize, GripperEvent)],
    markers: &[usize],
    config: &ImitationConfig,
) -> Vec<(usize, GripperEvent)> {
    let missed: Vec<usize> = closings(events, markers, config)
        .filter(|closing| closing.outcome == Outcome::Missed)
        .flat_map(|closing| [Some(closing.closed), closing.opened])
        .flatten()
        .collect();
    let lasting = events.iter().filter(|(step, _)| !missed.contains(step));
    lasting.copied().collect()
}

#[cfg(test)]
mod tests {
    use GripperEvent::{Close, Open};

    use super::*;

    const CONFIG: ImitationConfig = ImitationConfig {
        missed_grasp_steps: 4,
        lead_steps: 5,
    };

    fn steps(events: &[(usize, GripperEvent)], markers: &[usize]) -> Vec<(usize, usize)> {
        missed_grasps(events, markers, &CONFIG)
            .map(|steps| (steps.start, steps.end))
            .collect()
    }

    #[test]
    fn a_closing_that_is_taken_back_is_missed_with_what_led_to_it() {
        assert_eq!(
            steps(&[(20, Close), (22, Open), (30, Close)], &[]),
            [(15, 22)]
        );
    }

    #[test]
    fn a_closing_that_reached_a_subgoal_or_was_kept_is_none() {
        assert!(steps(&[(20, Close), (22, Open)], &[21]).is_empty());
        assert!(steps(&[(20, Close), (25, Open)], &[]).is_empty());
    }

    #[test]
    fn a_closing_holds_if_a_subgoal_is_reached_before_it_is_opened() {
        let events = [
            (20, Close),
            (22, Open),
            (30, Close),
            (40, Open),
            (50, Close),
        ];
        let outcomes: Vec<_> = closings(&events, &[31, 60], &CONFIG)
            .map(|c| (c.closed, c.opened, c.outcome))
            .collect();
        assert_eq!(
            outcomes,
            [
                (20, Some(22), Outcome::Missed),
                (30, Some(40), Outcome::Held),
                (50, None, Outcome::Held)
            ]
        );
        let kept = closings(&[(20, Close), (30, Open)], &[], &CONFIG).next();
        assert_eq!(kept.map(|c| c.outcome), Some(Outcome::Unknown));
    }

    #[test]
    fn what_led_to_it_begins_after_the_last_opening_and_the_last_subgoal() {
        assert_eq!(
            steps(&[(18, Open), (20, Close), (21, Open)], &[]),
            [(19, 21)]
        );
        assert_eq!(steps(&[(20, Close), (21, Open)], &[17]), [(17, 21)]);
    }

    #[test]
    fn by_default_everything_is_imitated() {
        let events = [(20, Close), (21, Open)];
        let config = ImitationConfig::default();
        assert_eq!(missed_grasps(&events, &[], &config).count(), 0);
    }
}
