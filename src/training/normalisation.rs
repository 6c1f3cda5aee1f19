use serde::{Deserialize, Serialize};

use super::{Dataset, StateRef};
use crate::trajectory::Image;

/// Images that the mean and the spread are measured on, spread evenly over all steps.
const MEASURED: usize = 256;

/// Mean and standard deviation of the red, green and blue values (0..=255) of one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelNormalisation {
    /// Means.
    pub mean: [f32; 3],
    /// Standard deviations, never 0.
    pub deviation: [f32; 3],
}

impl ChannelNormalisation {
    /// Measures every camera of a dataset on states of `trajectories`.
    #[must_use]
    pub fn measure(data: &Dataset, trajectories: &[u32]) -> Vec<Self> {
        let states: Vec<StateRef> = data.states_of(trajectories).collect();
        let stride = states.len().div_ceil(MEASURED).max(1);
        data.cameras()
            .iter()
            .map(|camera| {
                let images = states.iter().step_by(stride).filter_map(|state| {
                    let observation = data.observation(*state);
                    observation.image(&camera.name).ok().map(Image::rgb)
                });
                Self::of_pixels(images)
            })
            .collect()
    }

    fn of_pixels<'a>(images: impl Iterator<Item = &'a [u8]>) -> Self {
        let (mut sum, mut squares, mut count) = ([0.0_f64; 3], [0.0_f64; 3], 0.0_f64);
        for rgb in images {
            for pixel in rgb.chunks_exact(3) {
                for channel in 0..3 {
                    let value = f64::from(pixel[channel]);
                    sum[channel] += value;
                    squares[channel] += value * value;
                }
            }
            count += (rgb.len() / 3) as f64;
        }
        let count = count.max(1.0);
        let mean = sum.map(|s| s / count);
        let deviation = [0, 1, 2].map(|c: usize| {
            // A camera that shows one colour only would otherwise divide by 0.
            (squares[c] / count - mean[c] * mean[c]).max(1.0).sqrt() as f32
        });
        Self {
            mean: mean.map(|m| m as f32),
            deviation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_by_hand() {
        let image: &[u8] = &[10, 0, 7, 30, 0, 7];
        let measured = ChannelNormalisation::of_pixels([image].into_iter());
        assert_eq!(measured.mean, [20.0, 0.0, 7.0]);
        assert_eq!(measured.deviation, [10.0, 1.0, 1.0]);
    }
}
