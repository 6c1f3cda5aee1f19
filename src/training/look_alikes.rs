use std::collections::BTreeMap;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{Dataset, StateRef};
use crate::trajectory::Image;

/// Rows and columns of a thumbnail.
const THUMBNAIL: (usize, usize) = (9, 16);
/// Look-alikes kept for each state.
const KEPT: usize = 4;

/// For each state the moments of its own trajectory that look most similar although they are `d_max`
/// or more steps away, such as the start and the end of a demonstration.
#[derive(Clone, Debug, Default)]
pub struct LookAlikes {
    of: BTreeMap<StateRef, Vec<StateRef>>,
}

impl LookAlikes {
    /// Compares thumbnails of all cameras; `trajectories` are indices with their numbers of steps.
    pub fn find(data: &Dataset, trajectories: &[(u32, usize)], d_max: usize) -> Self {
        let of = trajectories
            .par_iter()
            .flat_map_iter(|(trajectory, steps)| in_trajectory(data, *trajectory, *steps, d_max))
            .collect();
        Self { of }
    }

    /// Whether no state has a look-alike.
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// Every state with each of its look-alikes.
    pub fn pairs(&self) -> impl Iterator<Item = (StateRef, StateRef)> {
        self.of
            .iter()
            .flat_map(|(state, twins)| twins.iter().map(|twin| (*state, *twin)))
    }

    /// One of a state's look-alikes.
    pub fn one_of(&self, state: StateRef, rng: &mut ChaCha8Rng) -> Option<StateRef> {
        let twins = self.of.get(&state)?;
        Some(twins[rng.random_range(0..twins.len())])
    }
}

fn in_trajectory(
    data: &Dataset,
    trajectory: u32,
    steps: usize,
    d_max: usize,
) -> Vec<(StateRef, Vec<StateRef>)> {
    let at = |step: usize| StateRef {
        trajectory,
        step: step as u32,
    };
    let thumbnails: Vec<Vec<f32>> = (0..steps)
        .map(|step| {
            let observation = data.observation(at(step));
            let images = data.cameras().iter();
            images
                .filter_map(|camera| observation.image(&camera.name).ok())
                .flat_map(thumbnail)
                .collect()
        })
        .collect();
    (0..steps)
        .filter_map(|step| {
            let mut others: Vec<(f32, usize)> = (0..steps)
                .filter(|other| step.abs_diff(*other) >= d_max)
                .map(|other| (distance(&thumbnails[step], &thumbnails[other]), other))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            others.truncate(KEPT);
            let twins: Vec<_> = others.into_iter().map(|(_, other)| at(other)).collect();
            (!twins.is_empty()).then(|| (at(step), twins))
        })
        .collect()
}

fn thumbnail(image: &Image) -> Vec<f32> {
    let (height, width) = (image.height() as usize, image.width() as usize);
    let mut sums = vec![0.0; THUMBNAIL.0 * THUMBNAIL.1 * 3];
    let mut counts = vec![0.0_f32; THUMBNAIL.0 * THUMBNAIL.1];
    for (pixel, rgb) in image.rgb().chunks_exact(3).enumerate() {
        let (y, x) = (pixel / width, pixel % width);
        let cell = y * THUMBNAIL.0 / height * THUMBNAIL.1 + x * THUMBNAIL.1 / width;
        counts[cell] += 1.0;
        for (channel, value) in rgb.iter().enumerate() {
            sums[cell * 3 + channel] += f32::from(*value);
        }
    }
    for (index, sum) in sums.iter_mut().enumerate() {
        *sum /= counts[index / 3].max(1.0);
    }
    sums
}

fn distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::training::synthetic;

    #[test]
    fn look_alikes_are_the_nearest_pictures_that_are_far_in_time() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 24, 4)]).unwrap();
        let twins = LookAlikes::find(&data, &[(0, 24), (1, 24)], 5);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let seen = |at: StateRef| {
            let images = data.observation(at).iter();
            images.flat_map(|(_, image)| thumbnail(image)).collect()
        };
        for state in data.states_of(&[0, 1]) {
            let here: Vec<f32> = seen(state);
            let own = [state.trajectory];
            let far = data
                .states_of(&own)
                .filter(|other| other.step.abs_diff(state.step) >= 5);
            let mut distances: Vec<f32> = far.map(|at| distance(&here, &seen(at))).collect();
            distances.sort_by(f32::total_cmp);
            for _ in 0..2 * KEPT {
                let twin = twins.one_of(state, &mut rng).unwrap();
                assert_eq!(twin.trajectory, state.trajectory);
                assert!(twin.step.abs_diff(state.step) >= 5);
                let away = distance(&here, &seen(twin));
                assert!(away <= distances[KEPT - 1], "{state:?} {twin:?}");
            }
        }
    }

    #[test]
    fn a_short_trajectory_has_none() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 4, 4)]).unwrap();
        assert!(LookAlikes::find(&data, &[(0, 4), (1, 4)], 5).is_empty());
    }
}
