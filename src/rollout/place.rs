use nalgebra::{Matrix3, Point3, Vector3};

use crate::trajectory::Lens;

/// A landmark in one picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    /// Where the camera was.
    pub(super) lens: Lens,
    /// The pixel, x to the right and y down.
    pub(super) pixel: [f32; 2],
    /// How much it counts for where the landmark is, from 0 to 1.
    pub(super) weight: f32,
    /// How much it counts for whether the landmark is seen at all, from 0 to 1.
    pub(super) sureness: f32,
}

/// Standard deviation of a sighting of weight 1, in pixels.
const SIGHT_PIXELS: f32 = 3.0;
/// Distance in pixels beyond which a sighting counts less and less.
const OUTLIER_PIXELS: f32 = 6.0;
/// Rounds of the least squares.
const ROUNDS: usize = 8;
/// Farthest that one round moves the place, in metres.
const STEP_M: f32 = 0.2;
/// Least standard deviation of a height, in metres.
pub(super) const LEAST_SPREAD_M: f32 = 0.005;

/// The place that several pictures show, by weighted least squares over pixels, with what is known of its height.
/// None where no ray meets that height.
pub(super) fn place_of(
    sightings: &[Sighting],
    height_m: f32,
    height_spread_m: f32,
) -> Option<Point3<f32>> {
    let mut first = sightings.iter().rev();
    let mut place = first.find_map(|s| s.lens.at_height(s.pixel, height_m))?;
    let height_weight = height_spread_m.max(LEAST_SPREAD_M).powi(-2);
    for _ in 0..ROUNDS {
        let mut normal = Matrix3::zeros();
        let mut wanted = Vector3::zeros();
        normal[(2, 2)] = height_weight;
        wanted[2] = height_weight * (height_m - place.z);
        for sighting in sightings {
            let Some(seen) = sighting.lens.seen(&place) else {
                continue;
            };
            let there = sighting.lens.project(&seen);
            let off =
                nalgebra::Vector2::new(sighting.pixel[0] - there[0], sighting.pixel[1] - there[1]);
            let slope = sighting.lens.slope(&seen);
            let trust = sighting.weight / (off.norm() / OUTLIER_PIXELS).max(1.0);
            let weight = trust * SIGHT_PIXELS.powi(-2);
            normal += slope.transpose() * slope * weight;
            wanted += slope.transpose() * off * weight;
        }
        let moved = normal.cholesky()?.solve(&wanted);
        place += moved.map(|m| m.clamp(-STEP_M, STEP_M));
    }
    place.coords.iter().all(|c| c.is_finite()).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{CameraSpec, RobotGeometry};

    #[test]
    fn a_place_is_found_from_two_cameras_and_one_wrong_sight_does_little() {
        let robot = RobotGeometry::locobot();
        let place = Point3::new(0.55, 0.06, 0.33);
        let mut posture = robot.at_start();
        let mut sightings = Vec::new();
        for primitive in ["end_effector_up", "end_effector_left", "base_backward"] {
            posture = robot.after(&posture, primitive);
            for name in ["head", "wrist"] {
                let camera = CameraSpec {
                    name: name.to_owned(),
                    height: 90,
                    width: 160,
                };
                let pixel = robot.pixel(&posture, &camera, &place).unwrap();
                sightings.push(Sighting {
                    lens: robot.lens(&posture, &camera).unwrap(),
                    pixel,
                    weight: 1.0,
                    sureness: 1.0,
                });
            }
        }
        // Both cameras look down at it at nearly the same angle, so how far away it is rests on its height.
        let off =
            |sightings: &[Sighting]| (place_of(sightings, 0.33, 0.03).unwrap() - place).norm();
        assert!(off(&sightings) < 0.005, "{}", off(&sightings));
        sightings[2].pixel[0] += 40.0;
        assert!(off(&sightings) < 0.05, "{}", off(&sightings));
        assert!(place_of(&[], 0.3, 0.0).is_none());
    }
}
