//! How far off an encoder sees the places at which the gripper opens.

use super::Landmarks;
use crate::model::{LandmarkBook, Latents, median};
use crate::training::{Dataset, StateRef, TrainingConfig};
use crate::trajectory::State;

/// Sureness from which a sight tells it.
const SURE_PEAK: f32 = 0.3;
/// Fewest sights that tell it.
const SURE_SIGHTS: usize = 30;

/// Learns from demonstrations how far off a model sees the places at which the gripper opens ([`offsets_pixels`]);
/// `encode` gives the latents of states, a row each. What is an encoder's own fault is mostly the same in all pictures,
/// since a place is sought on a map of few cells. Places at which the gripper closes are seen until it is there, and the
/// nearer the less they are off, so theirs are not learnt.
///
/// [`offsets_pixels`]: crate::model::Landmark::offsets_pixels
pub fn learn_offsets<E>(
    book: &mut LandmarkBook,
    data: &Dataset,
    config: &TrainingConfig,
    encode: impl FnOnce(&[State]) -> Result<Latents, E>,
) -> Result<(), E> {
    let Some(landmarks) = Landmarks::of_book(data, config, book) else {
        return Ok(());
    };
    let all: Vec<u32> = (0..data.trajectory_count() as u32).collect();
    let shown: Vec<StateRef> = (data.states_of(&all))
        .filter(|at| landmarks.openings(book, *at).next().is_some())
        .collect();
    if shown.is_empty() {
        return Ok(());
    }
    let state = |at: &StateRef| data.state(*at, config.stack);
    let latents = encode(&shown.iter().map(state).collect::<Vec<_>>())?;
    let nothing = vec![[Vec::new(), Vec::new()]; book.views.len()];
    let mut off: Vec<Vec<[Vec<f32>; 2]>> = vec![nothing; book.landmarks.len()];
    for (row, at) in shown.iter().enumerate() {
        for (landmark, pixels) in landmarks.openings(book, *at) {
            for (camera, pixel) in pixels.iter().enumerate() {
                let sight = book.views[camera].of(latents.row(row), landmark);
                let Some([x, y]) = pixel.filter(|_| sight.peak >= SURE_PEAK) else {
                    continue;
                };
                let [right, below] = &mut off[landmark][camera];
                right.push(sight.pixel[0] - x);
                below.push(sight.pixel[1] - y);
            }
        }
    }
    for (landmark, off) in book.landmarks.iter_mut().zip(off) {
        let is_known = off.iter().any(|[right, _]| right.len() >= SURE_SIGHTS);
        let of_axis = |off: Vec<f32>| {
            let enough = Some(off).filter(|off| off.len() >= SURE_SIGHTS);
            enough.and_then(median).unwrap_or(0.0)
        };
        let of_cameras = off.into_iter().map(|axes| axes.map(of_axis));
        landmark.offsets_pixels = of_cameras.filter(|_| is_known).collect();
    }
    Ok(())
}

impl Landmarks {
    /// The landmarks at which the gripper opens that a state shows, with their pixels in each camera.
    fn openings<'a>(
        &'a self,
        book: &'a LandmarkBook,
        at: StateRef,
    ) -> impl Iterator<Item = (usize, &'a [Option<[f32; 2]>])> {
        let seen = self.sightings(at).iter();
        seen.filter(|sighting| !book.landmarks[sighting.landmark].closes)
            .map(|sighting| (sighting.landmark, &*sighting.pixels))
    }
}
