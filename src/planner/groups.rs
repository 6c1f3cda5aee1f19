use std::collections::BTreeMap;

use super::{Layout, PlaceId};

/// Length of a bucket of time.
const BUCKET_STEPS: f32 = 2.0;

/// The places of a layout by time and stage.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    of_place: Vec<u32>,
    /// How many places each group has.
    pub(super) sizes: Vec<u32>,
    /// For each group, its bucket of time.
    pub(super) buckets: Vec<u32>,
    /// For each group, its stage.
    pub(super) stages: Vec<usize>,
    /// How many places each bucket of time has, whatever their stage.
    pub(super) bucket_sizes: Vec<u32>,
}

impl Groups {
    pub(super) fn new(layout: &Layout) -> Self {
        let mut numbers = BTreeMap::new();
        let keys: Vec<(u32, usize)> = layout
            .places()
            .iter()
            .map(|place| ((place.time_steps / BUCKET_STEPS) as u32, place.stage))
            .collect();
        for key in &keys {
            *numbers.entry(*key).or_insert(0_u32) += 1;
        }
        let bucket_count = keys.iter().map(|(b, _)| *b as usize + 1).max();
        let mut bucket_sizes = vec![0; bucket_count.unwrap_or(0)];
        for ((bucket, _), size) in &numbers {
            bucket_sizes[*bucket as usize] += size;
        }
        let sizes = numbers.values().copied().collect();
        let (buckets, stages) = numbers.keys().copied().unzip();
        for (number, entry) in numbers.values_mut().enumerate() {
            *entry = number as u32;
        }
        Self {
            of_place: keys.iter().map(|key| numbers[key]).collect(),
            sizes,
            buckets,
            stages,
            bucket_sizes,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.sizes.len()
    }

    /// A share of the belief for each place of a group: all places of one stage alike, and little to those of others.
    pub(super) fn all_of(&self, stage: usize, others: f64) -> Vec<f64> {
        let of_stage = |of: &usize| f64::from(u8::from(*of == stage)) + others;
        self.stages.iter().map(of_stage).collect()
    }

    pub(super) fn of(&self, place: PlaceId) -> usize {
        self.of_place[place.index()] as usize
    }
}
