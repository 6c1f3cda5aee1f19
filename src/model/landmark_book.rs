use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::GraspSense;
use crate::trajectory::{CameraSpec, RobotGeometry};

/// What is known of the landmarks of a model: `landmarks.json` in its folder.
///
/// A landmark is the place of one event of the gripper, such as where a sock is taken. The encoder tells in which
/// pixel each camera sees it; this says what that is good for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandmarkBook {
    /// What the robot's actions move and where its cameras look.
    pub robot: RobotGeometry,
    /// Where the latent holds what each camera sees of landmarks, in the order of the model's cameras.
    pub views: Vec<LandmarkView>,
    /// The landmarks by their numbers.
    pub landmarks: Vec<Landmark>,
    /// For each demonstration, under its [`key`](Self::key), the steps of its events, with the numbers of their landmarks,
    /// in order of time.
    pub events: BTreeMap<String, Vec<(u32, usize)>>,
    /// For each demonstration, under the same keys, the class of the action of each step. Empty in models of before, whose robots are not
    /// told what demonstrations do with the arm.
    #[serde(default)]
    pub actions: BTreeMap<String, Vec<usize>>,
    /// What a camera that the gripper carries tells of what is between its fingers. None where demonstrations never
    /// closed on nothing, and in models of before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grasp: Option<GraspSense>,
}

/// Where the latent holds what one camera sees of landmarks: x, y and sureness of each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandmarkView {
    /// The first value of the first landmark.
    pub first: usize,
    /// The pixel, x to the right and y down, that values of 0 tell.
    pub middle_pixels: [f32; 2],
    /// Pixels for each unit of a value.
    pub unit_pixels: [f32; 2],
}

/// The place of one event of the gripper, over all demonstrations of its task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Landmark {
    /// Whether the gripper closes there; otherwise it opens.
    pub closes: bool,
    /// Median height above the floor.
    pub height_m: f32,
    /// Standard deviation of the height.
    pub height_spread_m: f32,
    /// Median tilt of the gripper at the event, downwards.
    pub tilt_rad: f32,
    /// The direction in which the gripper comes: one axis of the base's frame.
    pub approach: [f32; 3],
    /// How far away the gripper is, against that direction, when it comes into line with the place.
    pub clearance_m: f32,
    /// Least and largest x and y of the place in the base's frame, at the event.
    pub reach_m: [[f32; 2]; 2],
    /// Median distance in pixels between where demonstrations show it, within ten steps before the event, and where
    /// the encoder sees it.
    pub error_pixels: f32,
    /// For each camera how far right of and below that place the encoder sees it, in pixels: the median over the pictures of
    /// demonstrations in which it sees it surely. Empty where that is not known, and in models of before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets_pixels: Vec<[f32; 2]>,
}

/// What one camera sees of a landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkSight {
    /// The pixel, x to the right and y down.
    pub pixel: [f32; 2],
    /// From about 0, anywhere, to 4, in one cell of the map.
    pub peak: f32,
}

/// Values that each landmark brings to a latent: x, y, and how sure its place is.
pub const LANDMARK_VALUES: usize = 3;

/// How near to the place of an opening, to any side, the gripper hides it, in metres: what cameras see of it there is
/// neither learnt nor believed.
pub const HIDDEN_M: f32 = 0.15;

/// The middle one of some values, the upper one of two.
pub(crate) fn median(mut values: Vec<f32>) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

impl LandmarkView {
    /// What a latent holds of a landmark.
    ///
    /// # Panics
    /// If the latent does not hold it.
    #[must_use]
    pub fn of(&self, latent: &[f32], landmark: usize) -> LandmarkSight {
        let start = self.first + LANDMARK_VALUES * landmark;
        LandmarkSight {
            pixel: std::array::from_fn(|axis| {
                self.middle_pixels[axis] + self.unit_pixels[axis] * latent[start + axis]
            }),
            peak: latent[start + 2],
        }
    }
}

impl LandmarkBook {
    /// What a latent tells of a camera's sight of a landmark, less how far off the encoder mostly sees it.
    ///
    /// # Panics
    /// If there is no such camera or landmark, or the latent does not hold it.
    #[must_use]
    pub fn sight(&self, latent: &[f32], camera: usize, landmark: usize) -> LandmarkSight {
        let LandmarkSight { mut pixel, peak } = self.views[camera].of(latent, landmark);
        if let Some(offset) = self.landmarks[landmark].offsets_pixels.get(camera) {
            pixel = std::array::from_fn(|axis| pixel[axis] - offset[axis]);
        }
        LandmarkSight { pixel, peak }
    }

    /// What a demonstration of a task is called in [`events`](Self::events) and [`actions`](Self::actions): its task, a
    /// slash and its id, or its id alone in models of before. A task that goes by another name here than where it was
    /// learnt is found by the id, if only one has it.
    #[must_use]
    pub fn key<'a>(&'a self, task: &str, trajectory: &'a str) -> Cow<'a, str> {
        let of_task = Self::key_of(task, trajectory);
        if self.events.contains_key(&of_task) {
            return Cow::Owned(of_task);
        }
        let bare = Cow::Borrowed(trajectory);
        if self.events.contains_key(trajectory) {
            return bare;
        }
        let parts = || self.events.keys().filter_map(|key| key.split_once('/'));
        if parts().any(|(known, _)| known == task) {
            return bare;
        }
        let mut others = parts().filter(|(_, id)| *id == trajectory);
        match (others.next(), others.next()) {
            (Some((other, _)), None) => Cow::Owned(Self::key_of(other, trajectory)),
            _ => bare,
        }
    }

    /// The key of a demonstration that is learnt from.
    pub(crate) fn key_of(task: &str, trajectory: &str) -> String {
        format!("{task}/{trajectory}")
    }

    /// The steps of a demonstration's events, with the numbers of their landmarks, in order of time; none where it was
    /// not learnt from.
    #[must_use]
    pub fn events_of(&self, task: &str, trajectory: &str) -> &[(u32, usize)] {
        let events = self.events.get(&*self.key(task, trajectory));
        events.map_or(&[], Vec::as_slice)
    }

    /// Whether the gripper is closed at a state of a demonstration, missed grasps left out.
    ///
    /// # Panics
    /// If an event is of a landmark that is not there; [`misfit`](Self::misfit) tells before.
    #[must_use]
    pub fn is_closed(&self, task: &str, trajectory: &str, step: u32) -> bool {
        let events = self.events_of(task, trajectory).iter();
        let before = events.take_while(|(at, _)| *at < step).last();
        before.is_some_and(|(_, number)| self.landmarks[*number].closes)
    }

    /// Why this does not belong to a latent of so many values and to these cameras, if it does not.
    #[must_use]
    pub fn misfit(&self, latent_dim: usize, cameras: &[CameraSpec]) -> Option<String> {
        let count = self.landmarks.len();
        if self.views.len() != cameras.len() {
            return Some(format!(
                "{} views of {} cameras",
                self.views.len(),
                cameras.len()
            ));
        }
        if let Some(view) =
            (self.views.iter()).find(|v| v.first + LANDMARK_VALUES * count > latent_dim)
        {
            return Some(format!(
                "{count} landmarks from value {} on, in a latent of {latent_dim} values",
                view.first
            ));
        }
        self.misfit_of_grasps(cameras)
    }

    /// What makes the part of it that tells of the gripper impossible: its events, and its sense of grasps.
    #[must_use]
    pub(crate) fn misfit_of_grasps(&self, cameras: &[CameraSpec]) -> Option<String> {
        let count = self.landmarks.len();
        let numbers = self
            .events
            .values()
            .flatten()
            .map(|(_, landmark)| *landmark);
        let unknown = numbers.into_iter().find(|landmark| *landmark >= count);
        let unknown = unknown.map(|landmark| format!("an event of landmark {landmark} of {count}"));
        unknown.or_else(|| self.grasp.as_ref()?.misfit(cameras))
    }
}

#[cfg(test)]
impl Landmark {
    /// One that is seen well, 0.3 m above the floor.
    pub(crate) fn example(closes: bool, approach: [f32; 3]) -> Self {
        Self {
            closes,
            height_m: 0.3,
            height_spread_m: 0.0,
            tilt_rad: 0.0,
            approach,
            clearance_m: 0.07,
            reach_m: [[0.35, 0.6], [-0.1, 0.1]],
            error_pixels: 2.0,
            offsets_pixels: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn book() -> LandmarkBook {
        let landmark = Landmark::example(true, [1.0, 0.0, 0.0]);
        LandmarkBook {
            robot: RobotGeometry::locobot(),
            views: vec![LandmarkView {
                first: 2,
                middle_pixels: [80.0, 45.0],
                unit_pixels: [20.0, 10.0],
            }],
            landmarks: vec![landmark.clone(), landmark],
            events: [("a".to_owned(), vec![(4, 0), (9, 1)])].into(),
            actions: BTreeMap::new(),
            grasp: None,
        }
    }

    #[test]
    fn a_gripper_is_closed_from_the_state_after_it_closes() {
        let mut book = book();
        book.landmarks[1].closes = false;
        let closed: Vec<u32> = (0..12)
            .filter(|step| book.is_closed("t", "a", *step))
            .collect();
        assert_eq!(closed, [5, 6, 7, 8, 9]);
        assert!(!book.is_closed("t", "b", 5));
    }

    #[test]
    fn demonstrations_of_two_tasks_may_have_the_same_id() {
        let mut book = book();
        assert_eq!(
            book.events_of("t", "a"),
            [(4, 0), (9, 1)],
            "as in models of before"
        );
        let events = [
            ("t", "a", (4, 0)),
            ("other", "a", (1, 1)),
            ("t", "b", (2, 0)),
        ];
        let events = events.map(|(task, id, event)| (LandmarkBook::key_of(task, id), vec![event]));
        book.events = events.into();
        assert_eq!(book.events_of("t", "a"), [(4, 0)]);
        assert_eq!(book.events_of("other", "a"), [(1, 1)]);
        assert!(
            book.events_of("other", "b").is_empty(),
            "that of another task"
        );
        assert_eq!(book.events_of("t_by_another_name", "b"), [(2, 0)]);
        assert!(
            book.events_of("t_by_another_name", "a").is_empty(),
            "of which"
        );
    }

    #[test]
    fn values_become_pixels() {
        let latent = [9.0, 9.0, 0.0, 0.0, 0.0, 0.5, -1.0, 0.25];
        let seen = book().views[0].of(&latent, 1);
        assert_eq!((seen.pixel, seen.peak), ([90.0, 35.0], 0.25));
    }

    #[test]
    fn a_sight_is_corrected_by_how_far_off_that_camera_sees_that_landmark() {
        let latent = [9.0, 9.0, 0.0, 0.0, 0.0, 0.5, -1.0, 0.25];
        let mut book = book();
        assert_eq!(book.sight(&latent, 0, 1), book.views[0].of(&latent, 1));
        book.landmarks[1].offsets_pixels = vec![[1.0, -2.0]];
        let seen = book.sight(&latent, 0, 1);
        assert_eq!((seen.pixel, seen.peak), ([89.0, 37.0], 0.25));
        assert_eq!(book.sight(&latent, 0, 0), book.views[0].of(&latent, 0));
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let camera = |name: &str| CameraSpec {
            name: name.to_owned(),
            height: 90,
            width: 160,
        };
        let (one, two) = ([camera("head")], [camera("head"), camera("wrist")]);
        assert_eq!(book().misfit(8, &one), None);
        assert!(book().misfit(7, &one).unwrap().contains("7 values"));
        assert!(book().misfit(8, &two).unwrap().contains("2 cameras"));
        let mut other = book();
        other.landmarks.pop();
        assert!(other.misfit(8, &one).unwrap().contains("landmark 1 of 1"));
    }
}
