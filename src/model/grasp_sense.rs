use serde::{Deserialize, Serialize};

use super::{most_probable, softmax};
use crate::trajectory::{CameraSpec, Image, Observation};

/// Rows and columns that the part of the picture around the gripper is averaged to.
const GRASP_CELLS: [u32; 2] = [15, 18];

/// Tells from one camera's picture of the gripper whether it is open, closed on nothing, or holds something: a
/// multinomial logistic regression on the pixels around it.
///
/// The latent does not tell that where no demonstration shows it: a gripper that closed on nothing is opened again at
/// once there, and never seen on the way to a box. Nothing around the gripper is looked at here.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspSense {
    /// The camera that is carried by the gripper.
    pub camera: String,
    /// What part of its picture shows the gripper: left, top, right and bottom edge, as shares of its size.
    pub region: [f32; 4],
    /// Mean of each value, 0..=1: cells row by row, three colours each.
    pub mean: Vec<f32>,
    /// Weight of each value for an open gripper, for one closed on nothing, and for each kind of thing held.
    pub weights: Vec<Vec<f32>>,
    /// What each of these begins with.
    pub intercepts: Vec<f32>,
    /// Tasks whose things are told from each other, in the order of the weights; none where that is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<String>,
}

/// What the gripper is seen to do, as probabilities that sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspSight {
    /// It is open.
    pub open: f64,
    /// It is closed on nothing.
    pub empty: f64,
    /// It holds something.
    pub held: f64,
    /// What it most probably holds if it does: a number among the kinds of things that are told from each other.
    pub thing: usize,
}

impl GraspSense {
    /// What a camera shows of the gripper; none where the camera is not there.
    ///
    /// # Panics
    /// If there are fewer than two classes of weights ([`misfit`](Self::misfit) tells before), or the camera's
    /// picture has no pixel.
    #[must_use]
    pub fn look(&self, observation: &Observation) -> Option<GraspSight> {
        let image = observation.image(&self.camera).ok()?;
        let values = grasp_values(image, self.region);
        let logits: Vec<f64> = (self.weights.iter().zip(&self.intercepts))
            .map(|(weights, intercept)| {
                let terms = weights.iter().zip(values.iter().zip(&self.mean));
                let sum: f32 = terms
                    .map(|(weight, (value, mean))| weight * (value - mean))
                    .sum();
                f64::from(sum + intercept)
            })
            .collect();
        let probabilities = softmax(&logits);
        Some(GraspSight {
            open: probabilities[0],
            empty: probabilities[1],
            held: probabilities[2..].iter().sum(),
            thing: most_probable(&probabilities[2..]),
        })
    }

    /// The number of the thing of a task, if things are told from each other.
    #[must_use]
    pub fn thing_of(&self, task: &str) -> Option<usize> {
        self.things.iter().position(|thing| thing == task)
    }

    /// Why this cannot be used with some cameras, if it cannot.
    #[must_use]
    pub fn misfit(&self, cameras: &[CameraSpec]) -> Option<String> {
        let [rows, columns] = GRASP_CELLS;
        let values = (3 * rows * columns) as usize;
        let [left, top, right, bottom] = self.region;
        let is_whole = self.weights.len() >= 3
            && self.intercepts.len() == self.weights.len()
            && self.mean.len() == values
            && (self.things.is_empty() || self.things.len() + 2 == self.weights.len())
            && self.weights.iter().all(|w| w.len() == values);
        if !is_whole {
            return Some(format!(
                "a sense of grasps without {values} values for three classes or more"
            ));
        }
        let is_part = |from: f32, to: f32| 0.0 <= from && from < to && to <= 1.0;
        if !is_part(left, right) || !is_part(top, bottom) {
            return Some(format!(
                "a sense of grasps in the part {:?} of a picture",
                self.region
            ));
        }
        let is_known = cameras.iter().any(|camera| camera.name == self.camera);
        (!is_known).then(|| format!("a sense of grasps of the camera `{}`", self.camera))
    }
}

/// The values, 0..=1, of a part of a picture.
pub(crate) fn grasp_values(image: &Image, [left, top, right, bottom]: [f32; 4]) -> Vec<f32> {
    let (height, width) = (image.height(), image.width());
    let edge = |share: f32, size: u32| ((share * size as f32).round() as u32).min(size);
    let (x, y) = (
        edge(left, width).min(width - 1),
        edge(top, height).min(height - 1),
    );
    let (end_x, end_y) = (
        edge(right, width).max(x + 1),
        edge(bottom, height).max(y + 1),
    );
    let mut part = Vec::with_capacity(3 * ((end_x - x) * (end_y - y)) as usize);
    for row in y..end_y {
        let first = 3 * (row * width + x) as usize;
        part.extend_from_slice(&image.rgb()[first..first + 3 * (end_x - x) as usize]);
    }
    let [rows, columns] = GRASP_CELLS;
    let part = Image::new(end_y - y, end_x - x, part).expect("as many bytes as its size needs");
    let cells = part.resized(rows, columns);
    cells
        .rgb()
        .iter()
        .map(|byte| f32::from(*byte) / 255.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sense() -> GraspSense {
        let [rows, columns] = GRASP_CELLS;
        let values = (3 * rows * columns) as usize;
        // A dark gripper is open, a grey one empty, a bright one holds something.
        GraspSense {
            camera: "wrist".to_owned(),
            region: [0.25, 0.5, 0.75, 1.0],
            mean: vec![0.5; values],
            weights: [-1.0, 0.0, 1.0].map(|w| vec![w; values]).to_vec(),
            intercepts: vec![0.0, 100.0, 0.0],
            things: Vec::new(),
        }
    }

    fn seen(around: u8, gripper: u8) -> Observation {
        let pixel = |x: u32, y: u32| {
            let is_gripper = (20..60).contains(&x) && y >= 20;
            [if is_gripper { gripper } else { around }; 3]
        };
        let rgb: Vec<u8> = (0..40)
            .flat_map(|y| (0..80).flat_map(move |x| pixel(x, y)))
            .collect();
        let image = Image::new(40, 80, rgb).expect("40 rows of 80");
        Observation::new([("wrist".to_owned(), image)])
    }

    #[test]
    fn the_gripper_is_told_whatever_is_around_it() {
        for around in [0, 128, 255] {
            let told = |gripper| {
                sense()
                    .look(&seen(around, gripper))
                    .expect("the camera is there")
            };
            assert!(told(10).open > 0.99 && told(128).empty > 0.99 && told(250).held > 0.99);
        }
        assert_eq!(sense().look(&Observation::default()), None);
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let camera = |name: &str| CameraSpec {
            name: name.to_owned(),
            height: 40,
            width: 80,
        };
        let (head, wrist) = ([camera("head")], [camera("wrist")]);
        let both = [camera("head"), camera("wrist")];
        assert_eq!(sense().misfit(&both), None);
        let no_camera = sense().misfit(&head).expect("it looks through the wrist");
        assert!(no_camera.contains("wrist"), "{no_camera}");
        let mut other = sense();
        other.region[2] = 0.1;
        assert!(other.misfit(&wrist).is_some());
        let mut other = sense();
        other.weights[1].pop();
        assert!(other.misfit(&wrist).is_some());
    }
}
