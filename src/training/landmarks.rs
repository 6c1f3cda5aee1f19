//! Landmarks: the places where the gripper closes and opens, in every picture of a demonstration that shows them.
//!
//! The place of an event of the gripper stays where it is while the robot moves towards it. So from the actions
//! alone, and from what they move and where the cameras look ([`RobotGeometry`]), follows the pixel in which each
//! earlier picture shows that place: a thing is labelled in some hundred pictures of each demonstration, at no
//! cost to anybody. Finding it there teaches an encoder that a thing is a thing wherever it stands.

mod book;
mod grasps;
mod offsets;
mod practice;

use std::collections::HashMap;

pub use offsets::learn_offsets;
pub use practice::{GripperPractice, Practised};
use serde::{Deserialize, Serialize};

use super::augmentation::Variation;
use super::config::demand;
use super::network::PLACE_GAIN;
use super::patches::PatchGrid;
use super::{Dataset, EncoderConfig, ImitationConfig, StateRef, TrainingConfig, TrainingError};
use crate::model::{HIDDEN_M, LANDMARK_VALUES, LandmarkBook, median};
use crate::task::{GripperEvent, GripperSignal};
use crate::trajectory::{ActionSpace, Posture, RobotGeometry};

/// Standard deviation of the place that a landmark is told to have, in cells.
const SPREAD_CELLS: f32 = 0.7;
/// Steps before an event over which it is told how well its landmark is seen.
const BEFORE_EVENT_STEPS: usize = 10;
/// What all landmarks that are out of the picture weigh beside all that are in it.
const ABSENT_WEIGHT: f32 = 0.1;

/// Which landmarks are learnt, and how much they weigh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandmarkConfig {
    /// Weight of the auxiliary loss.
    pub weight: f32,
    /// How many there are: of each task as many as its demonstrations close and open the gripper, missed grasps not
    /// counted. A network may hold more than its tasks have.
    pub count: usize,
    /// How far below the gripper the place of an opening is, in metres: where a thing that is let go comes to lie.
    /// That place is seen; the one of the gripper above it is nowhere in a picture, and how far away it is cannot be
    /// told from a camera of about its height.
    #[serde(default)]
    pub drop_m: f32,
    /// What the robot's actions move and where its cameras look.
    pub robot: RobotGeometry,
}

impl LandmarkConfig {
    /// Those of the bedroom's three tasks: 4 of `sock`, 2 of `trash` and 2 of `wine`.
    #[must_use]
    pub fn bedroom() -> Self {
        Self {
            weight: 1.0,
            count: 8,
            drop_m: 0.12,
            robot: RobotGeometry::locobot(),
        }
    }

    /// How far below the gripper the place of an event is.
    fn drop_of(&self, closes: bool) -> f32 {
        if closes { 0.0 } else { self.drop_m }
    }

    pub(super) fn check(&self, encoder: &EncoderConfig) -> Result<(), TrainingError> {
        demand(
            self.weight > 0.0,
            "landmarks.weight",
            self.weight,
            "it must be above 0; without landmarks, set landmarks to null",
        )?;
        demand(
            self.count > 0,
            "landmarks.count",
            self.count,
            "it must be 1 or more; without landmarks, set landmarks to null",
        )?;
        demand(
            self.drop_m >= 0.0 && self.drop_m.is_finite(),
            "landmarks.drop_m",
            self.drop_m,
            "it must be 0 or more: metres from the gripper down to where a thing comes to lie",
        )?;
        if let Some((key, value, way_out)) = self.robot.fault() {
            demand(false, &format!("landmarks.robot.{key}"), value, way_out)?;
        }
        demand(
            !encoder.stage_channels.is_empty(),
            "network.encoder.stage_channels",
            "empty",
            "landmarks need at least one stage",
        )
    }
}

/// How many landmarks each camera of a network tells.
pub fn landmark_count(config: &TrainingConfig) -> usize {
    match &config.landmarks {
        Some(landmarks) if !config.network.variant.joins_pixels() => landmarks.count,
        _ => 0,
    }
}

/// Refuses a configuration whose landmarks these demonstrations do not show.
///
/// # Errors
/// [`TrainingError::NoLandmarks`].
pub fn check_landmarks(config: &TrainingConfig, data: &Dataset) -> Result<(), TrainingError> {
    let Some(landmarks) = &config.landmarks else {
        return Ok(());
    };
    let refuse = |reason: String| Err(TrainingError::NoLandmarks { reason });
    let space = data.action_space();
    let ActionSpace::Primitives { names } = space else {
        return refuse(format!("{space} are no primitives, whose motion is known"));
    };
    if GripperSignal::default().classes(space).is_empty() {
        return refuse(format!(
            "{space} hold neither `gripper_close` nor `gripper_open`"
        ));
    }
    let robot = &landmarks.robot;
    if !robot.primitives.keys().any(|name| names.contains(name)) {
        return refuse(format!(
            "landmarks.robot.primitives describes none of {space}"
        ));
    }
    let mut cameras = data.cameras().iter();
    if let Some(camera) = cameras.find(|c| !robot.cameras.contains_key(&c.name)) {
        let known: Vec<&str> = robot.cameras.keys().map(String::as_str).collect();
        return refuse(format!(
            "landmarks.robot.cameras has {}, and the demonstrations show '{}'",
            known.join(", "),
            camera.name
        ));
    }
    let needed: usize = numbers(data, &config.imitation).iter().map(|n| n.1).sum();
    if needed > landmarks.count {
        return refuse(format!(
            "landmarks.count is {}, and the demonstrations have {needed}: set it to {needed} or more",
            landmarks.count
        ));
    }
    if needed == 0 && landmark_count(config) > 0 {
        return refuse(
            "in no task do half of the demonstrations close or open the gripper, missed grasps not counted"
                .to_owned(),
        );
    }
    Ok(())
}

/// The landmarks of some demonstrations.
#[derive(Clone, Debug)]
pub struct Landmarks {
    count: usize,
    /// For each state of a trajectory what is known of its landmarks.
    of: HashMap<u32, Vec<Vec<Sighting>>>,
}

/// Where one landmark is in the pictures of one state.
#[derive(Clone, Debug, PartialEq)]
struct Sighting {
    landmark: usize,
    /// Steps until the event.
    steps_before: usize,
    /// For each camera the pixel, x to the right and y down; none where it is out of the picture.
    pixels: Vec<Option<[f32; 2]>>,
}

impl Landmarks {
    /// Those of some demonstrations of a training, if it learns any.
    #[must_use]
    pub fn of_training(
        data: &Dataset,
        trajectories: &[u32],
        config: &TrainingConfig,
    ) -> Option<Self> {
        let numbers = numbers(data, &config.imitation);
        let number = |trajectory| numbers[data.set_of(trajectory)];
        Self::numbered(data, trajectories, config, number)
    }

    /// Those of all demonstrations that a book knows, under the numbers that it has for them, in whatever order their sets
    /// are given.
    fn of_book(data: &Dataset, config: &TrainingConfig, book: &LandmarkBook) -> Option<Self> {
        let all: Vec<u32> = (0..data.trajectory_count() as u32).collect();
        Self::numbered(data, &all, config, |trajectory| {
            let task = &data.tasks()[data.set_of(trajectory)];
            let known = book.events_of(task, data.id_of(trajectory));
            (known.first()).map_or((0, 0), |(_, number)| (*number, known.len()))
        })
    }

    /// Those of some demonstrations; `number` tells the first landmark of each, and how many it has.
    fn numbered(
        data: &Dataset,
        trajectories: &[u32],
        config: &TrainingConfig,
        number: impl Fn(u32) -> (usize, usize),
    ) -> Option<Self> {
        let count = landmark_count(config);
        let landmarks = config.landmarks.as_ref().filter(|_| count > 0)?;
        let find = |trajectory: u32| {
            let (first, most) = number(trajectory);
            let mut events = data.lasting_events(trajectory, &config.imitation);
            events.truncate(most);
            sightings(data, trajectory, &events, first, landmarks)
        };
        let of = trajectories.iter().map(|t| (*t, find(*t))).collect();
        Some(Self { count, of })
    }

    /// What the logits of each camera's landmarks are to be after a softmax, `[states, count, cells]` row after row,
    /// weighted: rows that stand in a picture sum to 1 over all of them, rows that do not are the same everywhere,
    /// and rows of which nothing is known are 0. `variations` say how the pictures were changed.
    #[must_use]
    pub fn targets(
        &self,
        states: &[StateRef],
        variations: &[Vec<Variation>],
        grids: &[PatchGrid],
    ) -> Vec<Vec<f32>> {
        let of_camera = |(camera, grid): (usize, &PatchGrid)| {
            let cells = grid.positions();
            let mut values = vec![0.0; states.len() * self.count * cells];
            let (mut shown, mut absent) = (Vec::new(), Vec::new());
            for (row, (at, varied)) in states.iter().zip(variations).enumerate() {
                for sighting in self.sightings(*at) {
                    let start = (row * self.count + sighting.landmark) * cells;
                    let pixel = sighting.pixels[camera];
                    match pixel.and_then(|pixel| moved(pixel, &varied[camera], grid)) {
                        Some(pixel) => shown.push((start, pixel)),
                        None => absent.push(start),
                    }
                }
            }
            for (start, pixel) in &shown {
                let weight = 1.0 / shown.len() as f32;
                spread(*pixel, grid, weight, &mut values[*start..*start + cells]);
            }
            for start in &absent {
                let weight = ABSENT_WEIGHT / (absent.len() * cells) as f32;
                values[*start..*start + cells].fill(weight);
            }
            values
        };
        grids.iter().enumerate().map(of_camera).collect()
    }

    /// Median distance in pixels between where landmarks are and where they are told to be, over all that the
    /// pictures of some states show; `told` holds for each camera the landmarks' values, state after state.
    #[must_use]
    pub fn error_pixels(
        &self,
        states: &[StateRef],
        told: &[Vec<f32>],
        grids: &[PatchGrid],
    ) -> Option<f64> {
        let errors: Vec<f32> = (self.errors(states, told, grids, usize::MAX).into_iter())
            .flatten()
            .collect();
        median(errors).map(f64::from)
    }

    /// The median of these distances for each landmark, of states at most ten steps before its event; the largest
    /// number for one that no picture shows.
    #[must_use]
    pub fn errors_before_events(
        &self,
        states: &[StateRef],
        told: &[Vec<f32>],
        grids: &[PatchGrid],
    ) -> Vec<f32> {
        let errors = self.errors(states, told, grids, BEFORE_EVENT_STEPS);
        let of_landmark = |errors| median(errors).unwrap_or(f32::MAX);
        errors.into_iter().map(of_landmark).collect()
    }

    /// All these distances, by landmark.
    fn errors(
        &self,
        states: &[StateRef],
        told: &[Vec<f32>],
        grids: &[PatchGrid],
        most_steps: usize,
    ) -> Vec<Vec<f32>> {
        let mut errors = vec![Vec::new(); self.count];
        for (row, at) in states.iter().enumerate() {
            let near = self.sightings(*at).iter();
            for sighting in near.filter(|s| s.steps_before <= most_steps) {
                let place = (row * self.count + sighting.landmark) * LANDMARK_VALUES;
                for ((pixel, told), grid) in sighting.pixels.iter().zip(told).zip(grids) {
                    let Some([x, y]) = pixel else {
                        continue;
                    };
                    let [found_x, found_y] = pixel_of([told[place], told[place + 1]], grid);
                    errors[sighting.landmark].push((found_x - x).hypot(found_y - y));
                }
            }
        }
        errors
    }

    /// The states at most ten steps before one of the events.
    #[must_use]
    pub fn states_before_events(&self) -> Vec<StateRef> {
        let mut trajectories: Vec<u32> = self.of.keys().copied().collect();
        trajectories.sort_unstable();
        let states = trajectories.into_iter().flat_map(|trajectory| {
            (0..self.of[&trajectory].len() as u32).map(move |step| StateRef { trajectory, step })
        });
        states
            .filter(|at| {
                let mut near = self.sightings(*at).iter();
                near.any(|s| s.steps_before <= BEFORE_EVENT_STEPS)
            })
            .collect()
    }

    fn sightings(&self, at: StateRef) -> &[Sighting] {
        let states = self.of.get(&at.trajectory);
        states.map_or(&[], |states| &states[at.step as usize])
    }
}

/// For each set of demonstrations the number of its first landmark, and how many it has: as many as at least half of
/// its demonstrations have events.
fn numbers(data: &Dataset, imitation: &ImitationConfig) -> Vec<(usize, usize)> {
    let mut events: Vec<Vec<usize>> = Vec::new();
    for trajectory in 0..data.trajectory_count() as u32 {
        let set = data.set_of(trajectory);
        events.resize_with(events.len().max(set + 1), Vec::new);
        events[set].push(data.lasting_events(trajectory, imitation).len());
    }
    let mut first = 0;
    (events.into_iter())
        .map(|mut counts| {
            counts.sort_unstable();
            let most = counts.get(counts.len() / 2).copied().unwrap_or(0);
            first += most;
            (first - most, most)
        })
        .collect()
}

/// Where the robot is in each state of a demonstration, as its actions tell.
fn postures(data: &Dataset, trajectory: u32, robot: &RobotGeometry) -> Vec<Posture> {
    let names: &[String] = match data.action_space() {
        ActionSpace::Primitives { names } => names,
        _ => &[],
    };
    let steps = 0..data.steps(trajectory) as u32;
    robot.before_each(steps.map(|step| &*names[data.classes(StateRef { trajectory, step })[0]]))
}

/// What each state of a demonstration shows of the places of events that are still to come.
fn sightings(
    data: &Dataset,
    trajectory: u32,
    events: &[(usize, GripperEvent)],
    first: usize,
    config: &LandmarkConfig,
) -> Vec<Vec<Sighting>> {
    let robot = &config.robot;
    let postures = postures(data, trajectory, robot);
    let sightings_at = |(step, posture)| {
        let gripper = robot.gripper(posture);
        // Beside the gripper that place is hidden by what it holds, which would be learnt instead.
        let is_shown = |at: usize, event: &GripperEvent| {
            let from = robot.gripper(&postures[at]) - gripper;
            *event == GripperEvent::Close || from.xy().norm() >= HIDDEN_M
        };
        let to_come = (events.iter().enumerate())
            .filter(|(_, (at, event))| *at >= step && is_shown(*at, event));
        to_come
            .map(|(number, (at, event))| {
                let mut place = robot.gripper(&postures[*at]);
                place.z -= config.drop_of(*event == GripperEvent::Close);
                let cameras = data.cameras().iter();
                Sighting {
                    landmark: first + number,
                    steps_before: at - step,
                    pixels: cameras
                        .map(|camera| robot.pixel(posture, camera, &place))
                        .collect(),
                }
            })
            .collect()
    };
    postures.iter().enumerate().map(sightings_at).collect()
}

/// Where a pixel is in a picture that was changed; none where it was moved out of it.
fn moved([x, y]: [f32; 2], variation: &Variation, grid: &PatchGrid) -> Option<[f32; 2]> {
    let (width, height) = (grid.width as f32, grid.height as f32);
    let x = if variation.is_mirrored { width - x } else { x };
    let x = x + variation.right_pixels as f32;
    let y = y + variation.down_pixels as f32;
    ((0.0..width).contains(&x) && (0.0..height).contains(&y)).then_some([x, y])
}

/// Pixels from the picture's edge to the middle of the first cell, horizontally and vertically.
fn first_cell(grid: &PatchGrid) -> [f32; 2] {
    let [top, left, _, _] = grid.padding();
    let half = 0.5 * grid.kernel as f32;
    [half - left as f32, half - top as f32]
}

/// The pixel that values of a landmark tell.
fn pixel_of(values: [f32; 2], grid: &PatchGrid) -> [f32; 2] {
    let first = first_cell(grid);
    let sizes = [grid.columns(), grid.rows()];
    std::array::from_fn(|axis| {
        let cell = 0.5 * (values[axis] / PLACE_GAIN + 1.0) * sizes[axis] as f32 - 0.5;
        first[axis] + cell * grid.stride as f32
    })
}

/// Spreads a weight over the cells around a pixel.
fn spread(pixel: [f32; 2], grid: &PatchGrid, weight: f32, cells: &mut [f32]) {
    let first = first_cell(grid);
    let [across, down] =
        std::array::from_fn(|axis| (pixel[axis] - first[axis]) / grid.stride as f32);
    let share = |cell: usize, place: f32| {
        let off = (cell as f32 - place) / SPREAD_CELLS;
        (-0.5 * off * off).exp()
    };
    for (row, cells) in cells.chunks_exact_mut(grid.columns()).enumerate() {
        for (column, cell) in cells.iter_mut().enumerate() {
            *cell = share(row, down) * share(column, across);
        }
    }
    let sum: f32 = cells.iter().sum();
    for cell in cells {
        *cell *= weight / sum;
    }
}

#[cfg(test)]
mod tests;
