//! What a model says of its landmarks to those who run it.

use std::collections::BTreeMap;

use super::grasps::grasp_sense;
use super::{LandmarkConfig, Landmarks, landmark_count, numbers, pixel_of, postures};
use crate::model::{LANDMARK_VALUES, Landmark, LandmarkBook, LandmarkView, median};
use crate::task::GripperEvent;
use crate::training::motion_to_go::motion_axes;
use crate::training::patches::PatchGrid;
use crate::training::{Dataset, StateRef, TrainingConfig};
use crate::trajectory::Posture;

/// Steps before an event over which the gripper's last way is told.
const LAST_STEPS: usize = 3;
/// Steps before an event in which the gripper comes into line.
const LINE_STEPS: usize = 12;
/// Farthest to one side that a gripper is in line.
const LINE_M: f32 = 0.03;
/// Bounds of [`Landmark::clearance_m`].
const CLEARANCE_M: (f32, f32) = (0.05, 0.25);

/// One event of a demonstration.
struct Event<'a> {
    postures: &'a [Posture],
    step: usize,
    closes: bool,
}

impl Landmarks {
    /// The book of a model that was trained so; `errors` holds for each landmark how far off the encoder sees it.
    /// None where none are learnt.
    #[must_use]
    pub fn book(
        data: &Dataset,
        config: &TrainingConfig,
        grids: &[PatchGrid],
        errors: &[f32],
    ) -> Option<LandmarkBook> {
        let learnt = config.landmarks.as_ref()?;
        let robot = &learnt.robot;
        let count = landmark_count(config);
        let numbers = numbers(data, &config.imitation);
        let all = 0..data.trajectory_count() as u32;
        let ways: Vec<Vec<Posture>> = all.clone().map(|t| postures(data, t, robot)).collect();
        let used: usize = numbers.iter().map(|(_, most)| most).sum();
        let mut shown: Vec<Vec<Event<'_>>> = (0..used).map(|_| Vec::new()).collect();
        let (mut events, mut actions) = (BTreeMap::new(), BTreeMap::new());
        for trajectory in all {
            let (first, most) = numbers[data.set_of(trajectory)];
            let postures = &ways[trajectory as usize];
            let mut of_demonstration = Vec::new();
            let lasting = data.lasting_events(trajectory, &config.imitation);
            for (number, (step, event)) in lasting.into_iter().take(most).enumerate() {
                let closes = event == GripperEvent::Close;
                of_demonstration.push((step as u32, first + number));
                shown[first + number].push(Event {
                    postures,
                    step,
                    closes,
                });
            }
            let steps = 0..data.steps(trajectory) as u32;
            let classes = steps.map(|step| data.classes(StateRef { trajectory, step })[0]);
            let task = &data.tasks()[data.set_of(trajectory)];
            let key = LandmarkBook::key_of(task, data.id_of(trajectory));
            actions.insert(key.clone(), classes.collect());
            events.insert(key, of_demonstration);
        }
        let found = (shown.iter().zip(errors))
            .map(|(events, error)| landmark(learnt, events, *error))
            .collect();
        let encoded = grids.len() * config.network.encoder.latent_dim;
        let before = encoded + motion_axes(data.action_space(), config);
        let view = |(camera, grid): (usize, &PatchGrid)| {
            let middle = pixel_of([0.0; 2], grid);
            let unit = pixel_of([1.0; 2], grid);
            LandmarkView {
                first: before + camera * LANDMARK_VALUES * count,
                middle_pixels: middle,
                unit_pixels: std::array::from_fn(|axis| unit[axis] - middle[axis]),
            }
        };
        Some(LandmarkBook {
            robot: robot.clone(),
            views: grids.iter().enumerate().map(view).collect(),
            landmarks: found,
            events,
            actions,
            grasp: grasp_sense(data, learnt, &config.imitation),
        })
    }
}

fn landmark(config: &LandmarkConfig, events: &[Event<'_>], error_pixels: f32) -> Landmark {
    let robot = &config.robot;
    let closes = events.first().is_some_and(|e| e.closes);
    let at = |event: &Event<'_>| event.postures[event.step].gripper_m();
    // From the place to the gripper, in the base's frame at that time.
    let from_place = |event: &Event<'_>, step: usize| -> [f32; 3] {
        let place = robot.gripper(&event.postures[event.step]);
        let posture = &event.postures[step];
        let (gripper, place) = (posture.gripper_m(), posture.in_base(&place));
        [0, 1, 2].map(|axis| gripper[axis] - place[axis])
    };
    let mut way = [0.0_f32; 3];
    for event in events {
        let before = from_place(event, event.step.saturating_sub(LAST_STEPS));
        way.iter_mut().zip(before).for_each(|(sum, b)| *sum -= b);
    }
    let main = (0..3)
        .max_by(|a, b| way[*a].abs().total_cmp(&way[*b].abs()))
        .unwrap_or(0);
    let mut approach = [0.0; 3];
    approach[main] = if way[main] < 0.0 { -1.0 } else { 1.0 };
    let clearance = |event: &Event<'_>| {
        let first = event.step.saturating_sub(LINE_STEPS);
        let line = (first..=event.step).rev().map(|s| from_place(event, s));
        let is_in_line = |from: &[f32; 3]| {
            let aside = (0..3).filter(|axis| *axis != main);
            aside.map(|axis| from[axis].abs()).fold(0.0, f32::max) <= LINE_M
        };
        let far = line.take_while(is_in_line);
        far.map(|from| -from[main] * approach[main])
            .fold(0.0, f32::max)
    };
    let drop_m = config.drop_of(closes);
    let heights: Vec<f32> = events.iter().map(|e| at(e)[2] - drop_m).collect();
    let reach = |axis: usize| {
        let all = events.iter().map(|e| at(e)[axis]);
        [
            all.clone().fold(f32::INFINITY, f32::min),
            all.fold(f32::NEG_INFINITY, f32::max),
        ]
    };
    let (least, most) = CLEARANCE_M;
    Landmark {
        closes,
        height_m: median(heights.clone()).unwrap_or(0.0),
        height_spread_m: spread(&heights),
        tilt_rad: median(
            (events.iter())
                .map(|e| e.postures[e.step].tilt_rad())
                .collect(),
        )
        .unwrap_or(0.0),
        approach,
        clearance_m: median(events.iter().map(clearance).collect())
            .unwrap_or(0.0)
            .clamp(least, most),
        reach_m: [reach(0), reach(1)],
        error_pixels,
        offsets_pixels: Vec::new(),
    }
}

fn spread(values: &[f32]) -> f32 {
    let count = values.len().max(1) as f32;
    let mean = values.iter().sum::<f32>() / count;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / count).sqrt()
}
