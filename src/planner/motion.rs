use super::{FilterOptions, Layout, PlaceId};

/// Share of a jump that goes to the bucket of time before, the same, and the ones after.
const JUMP: [(isize, f64); 4] = [(-1, 0.15), (0, 0.35), (1, 0.35), (2, 0.15)];
/// Length of a bucket of time.
const BUCKET_STEPS: f32 = 2.0;
/// How far into the next task the robot may be when it has left a task's end.
const SEAM_STEPS: f32 = 4.0;
/// Share of the going on from a demonstration's end that leads into the next task.
const SEAM_SHARE: f64 = 0.5;

/// How the robot may have moved since the last step.
///
/// Mostly along the demonstration that it was in; at times to another state at about the same time of
/// the composition, which is also how it gets from one task into the next; seldom to anywhere.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    bucket_of: Vec<u32>,
    bucket_sizes: Vec<u32>,
    /// For each occurrence of a task, the places at which it begins.
    starts: Vec<Vec<PlaceId>>,
}

impl Motion {
    pub(super) fn new(layout: &Layout) -> Self {
        let bucket = |time: f32| (time / BUCKET_STEPS) as u32;
        let bucket_of: Vec<u32> = layout
            .places()
            .iter()
            .map(|p| bucket(p.time_steps))
            .collect();
        let count = bucket_of.iter().max().map_or(0, |b| *b as usize + 1);
        let mut bucket_sizes = vec![0; count];
        for b in &bucket_of {
            bucket_sizes[*b as usize] += 1;
        }
        Self {
            bucket_of,
            bucket_sizes,
            starts: starts(layout),
        }
    }

    /// The belief one step later; it still sums to 1.
    pub(super) fn predict(
        &self,
        layout: &Layout,
        options: &FilterOptions,
        belief: &[f64],
    ) -> Vec<f64> {
        let along = 1.0 - options.jump - options.restart;
        let sum = options.stay + options.advance + options.hurry;
        let mut entering = vec![0.0; self.starts.len()];
        let mut next = vec![options.restart / belief.len() as f64; belief.len()];
        for (i, mass) in belief.iter().enumerate() {
            let here = PlaceId(i as u32);
            let one = layout.successor(here).unwrap_or(here);
            let two = layout.successor(one).unwrap_or(one);
            let mut moves = [
                (here, options.stay),
                (one, options.advance),
                (two, options.hurry),
            ];
            let occurrence = layout.place(here).occurrence;
            if one == here && occurrence + 1 < self.starts.len() {
                let leaving = SEAM_SHARE * (options.advance + options.hurry);
                entering[occurrence + 1] += along * mass * leaving / sum;
                moves[1].1 -= SEAM_SHARE * options.advance;
                moves[2].1 -= SEAM_SHARE * options.hurry;
            }
            for (to, weight) in moves {
                next[to.index()] += along * mass * weight / sum;
            }
        }
        for (starts, mass) in self.starts.iter().zip(entering) {
            for start in starts {
                next[start.index()] += mass / starts.len() as f64;
            }
        }
        let jumped = self.jump(belief);
        for (next, bucket) in next.iter_mut().zip(&self.bucket_of) {
            let size = f64::from(self.bucket_sizes[*bucket as usize]);
            *next += options.jump * jumped[*bucket as usize] / size;
        }
        next
    }

    /// The belief by bucket of time after a jump.
    fn jump(&self, belief: &[f64]) -> Vec<f64> {
        let mut masses = vec![0.0; self.bucket_sizes.len()];
        for (mass, bucket) in belief.iter().zip(&self.bucket_of) {
            masses[*bucket as usize] += mass;
        }
        let mut jumped = vec![0.0; masses.len()];
        for (bucket, mass) in masses.iter().enumerate() {
            for (by, share) in JUMP {
                let to = bucket
                    .checked_add_signed(by)
                    .filter(|to| self.bucket_sizes.get(*to).is_some_and(|s| *s > 0))
                    .unwrap_or(bucket);
                jumped[to] += mass * share;
            }
        }
        jumped
    }
}

/// The places at which each occurrence of a task begins, within the first few steps.
fn starts(layout: &Layout) -> Vec<Vec<PlaceId>> {
    let count = layout.places().last().map_or(0, |p| p.occurrence + 1);
    let mut begins = vec![f32::INFINITY; count];
    for place in layout.places() {
        begins[place.occurrence] = begins[place.occurrence].min(place.time_steps);
    }
    let mut starts = vec![Vec::new(); count];
    for (i, place) in layout.places().iter().enumerate() {
        if place.time_steps <= begins[place.occurrence] + SEAM_STEPS {
            starts[place.occurrence].push(PlaceId(i as u32));
        }
    }
    starts
}
