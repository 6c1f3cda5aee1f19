use std::collections::VecDeque;

use crate::rollout::place::Sighting;

/// Least sureness of all sightings together.
const LEAST_SURENESS: f32 = 0.5;
/// Weight of the sightings since the base moved from which older ones do not count: a base that furniture stopped did
/// not get as far as it was sent, and what was seen before is not where it seems.
const FRESH_WEIGHT: f32 = 2.0;

/// What was lately seen of a landmark, picture by picture.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    pictures: VecDeque<Vec<Sighting>>,
    /// How many of them were seen since the base moved.
    fresh: usize,
}

impl Seen {
    pub(super) fn clear(&mut self) {
        self.pictures.clear();
        self.fresh = 0;
    }

    /// The next picture, upon which no more than so many are remembered.
    pub(super) fn add(&mut self, picture: Vec<Sighting>, remembered: usize) {
        self.pictures.push_back(picture);
        if self.pictures.len() > remembered {
            self.pictures.pop_front();
        }
        self.fresh = (self.fresh + 1).min(self.pictures.len());
    }

    /// The base moved, as far as it could.
    pub(super) fn base_moved(&mut self) {
        self.fresh = 0;
    }

    /// The sightings that tell where the landmark is: those since the base moved, where they say enough. None where all
    /// together say too little.
    pub(super) fn sightings(&self) -> Option<Vec<Sighting>> {
        let since = |first: usize| -> Vec<Sighting> {
            self.pictures.range(first..).flatten().copied().collect()
        };
        let fresh = since(self.pictures.len() - self.fresh);
        if fresh.iter().map(|s| s.weight).sum::<f32>() >= FRESH_WEIGHT {
            return Some(fresh);
        }
        let all = since(0);
        let sureness: f32 = all.iter().map(|s| s.sureness).sum();
        (sureness >= LEAST_SURENESS).then_some(all)
    }
}
