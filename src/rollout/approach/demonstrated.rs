use std::collections::BTreeMap;

use super::keys::Keys;
use crate::model::{LandmarkBook, median};
use crate::trajectory::Posture;

/// What demonstrations do with the arm, by their actions.
#[derive(Clone, Debug, Default)]
pub(super) struct Demonstrated {
    /// For each demonstration the posture in each state, and whether the arm rests there.
    arms: BTreeMap<String, Vec<(Posture, bool)>>,
    /// For each landmark what follows its event in most demonstrations, up to where they differ.
    departures: Vec<Vec<usize>>,
    /// For each landmark the median height of the gripper at its event.
    heights_m: Vec<Option<f32>>,
}

/// Steps after an event that are looked at.
const DEPARTURE_STEPS: usize = 6;
/// Steps before and after a state in which an arm that rests is not moved.
const REST_STEPS: usize = 2;

impl Demonstrated {
    pub(super) fn of(book: &LandmarkBook, keys: &Keys) -> Self {
        let arms = (book.actions.iter())
            .map(|(trajectory, actions)| (trajectory.clone(), arms(book, keys, actions)))
            .collect();
        let mut shown = Self {
            arms,
            ..Self::default()
        };
        for number in 0..book.landmarks.len() {
            let events: Vec<(&str, usize)> = (book.events.iter())
                .flat_map(|(trajectory, events)| events.iter().map(move |e| (trajectory, e)))
                .filter(|(_, (_, landmark))| *landmark == number)
                .map(|(trajectory, (step, _))| (trajectory.as_str(), *step as usize))
                .collect();
            shown.departures.push(departure(book, keys, &events));
            let heights = events.iter().filter_map(|(trajectory, step)| {
                shown
                    .arms
                    .get(*trajectory)?
                    .get(*step)
                    .map(|(p, _)| p.gripper_m()[2])
            });
            shown.heights_m.push(median(heights.collect()));
        }
        shown
    }

    /// The posture in a state of a demonstration in which the arm rests.
    pub(super) fn resting(&self, trajectory: &str, step: u32) -> Option<&Posture> {
        let (posture, rests) = self.arms.get(trajectory)?.get(step as usize)?;
        rests.then_some(posture)
    }

    pub(super) fn departure(&self, landmark: usize) -> &[usize] {
        self.departures.get(landmark).map_or(&[], Vec::as_slice)
    }

    pub(super) fn height_m(&self, landmark: usize) -> Option<f32> {
        self.heights_m.get(landmark).copied().flatten()
    }
}

fn arms(book: &LandmarkBook, keys: &Keys, actions: &[usize]) -> Vec<(Posture, bool)> {
    let moves: Vec<bool> = actions.iter().map(|class| keys.is_of_arm(*class)).collect();
    let rests = (0..actions.len()).map(|step| {
        let near = step.saturating_sub(REST_STEPS)..(step + REST_STEPS + 1).min(actions.len());
        !moves[near].contains(&true)
    });
    // A class without a name moves nothing.
    let names = actions
        .iter()
        .map(|class| keys.names.get(*class).map_or("", |name| name));
    book.robot
        .before_each(names)
        .into_iter()
        .zip(rests)
        .collect()
}

fn departure(book: &LandmarkBook, keys: &Keys, events: &[(&str, usize)]) -> Vec<usize> {
    let mut departure = Vec::new();
    for after in 1..=DEPARTURE_STEPS {
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for (trajectory, step) in events {
            let actions = book.actions.get(*trajectory);
            if let Some(class) = actions.and_then(|actions| actions.get(step + after)) {
                *counts.entry(*class).or_default() += 1;
            }
        }
        let Some((class, count)) = counts.into_iter().max_by_key(|(_, count)| *count) else {
            break;
        };
        let moves = keys
            .names
            .get(class)
            .is_some_and(|name| book.robot.primitives.contains_key(name));
        if 2 * count <= events.len() || !moves || [keys.close, keys.open].contains(&Some(class)) {
            break;
        }
        departure.push(class);
    }
    departure
}
