//! Which steps of a demonstration led to a grasp that closed on nothing.

use std::ops::Range;

use super::ImitationConfig;
use crate::task::GripperEvent;

/// The steps of each missed grasp: those that led to a closing which was taken back soon, before any
/// subgoal was reached, up to the one that opened the gripper again, which is left out. Events and markers
/// are in order of time.
pub fn missed_grasps(
    events: &[(usize, GripperEvent)],
    markers: &[usize],
    config: &ImitationConfig,
) -> impl Iterator<Item = Range<usize>> {
    let (longest, lead) = (config.missed_grasp_steps, config.lead_steps);
    events
        .windows(2)
        .enumerate()
        .filter_map(move |(place, pair)| {
            let [(closed, GripperEvent::Close), (opened, GripperEvent::Open)] = *pair else {
                return None;
            };
            let reached = |step: &usize| (closed + 1..=opened).contains(step);
            if opened - closed > longest || markers.iter().any(reached) {
                return None;
            }
            let after_event = place.checked_sub(1).map_or(0, |p| events[p].0 + 1);
            let marked = markers.iter().rfind(|step| **step <= closed);
            let first = closed.saturating_sub(lead).max(after_event);
            Some(first.max(marked.copied().unwrap_or(0))..opened)
        })
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
