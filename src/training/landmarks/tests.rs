use super::*;
use crate::model::{Latents, ModelError};
use crate::training::trained_model::spec_of;
use crate::training::{NetworkVariant, Preset, synthetic};
use crate::trajectory::{DemonstrationSet, Marker, State, Trajectory};

const NAMES: [&str; 4] = ["left", "ahead", "gripper_close", "gripper_open"];

/// The gripper is 0.4 m ahead of a camera with a focal length of 8 pixels on the base, and 0.2 m ahead of
/// one on itself.
const ROBOT: &str = r#"{
    "gripper_m": [0.4, 0.0, 0.3],
    "primitives": {"left": {"gripper_m": [0.0, 0.05, 0.0]}, "ahead": {"drive_m": 0.1}},
    "cameras": {
        "head": {"on": "base", "position_m": [0.0, 0.0, 0.3], "tilt_rad": 0.0, "vertical_fov_rad": 1.5707964},
        "wrist": {"on": "gripper", "position_m": [-0.2, 0.0, 0.0], "tilt_rad": 0.0, "vertical_fov_rad": 1.5707964}
    }
}"#;

fn config() -> TrainingConfig {
    let mut config = Preset::Tiny.config();
    config.landmarks = Some(LandmarkConfig {
        weight: 1.0,
        count: 4,
        drop_m: 0.0,
        robot: serde_json::from_str(ROBOT).unwrap(),
    });
    config
}

fn dataset(tasks: &[[usize; 9]]) -> Dataset {
    let sets: Vec<DemonstrationSet> = (tasks.iter())
        .map(|actions| synthetic::acting(&NAMES, actions))
        .collect();
    Dataset::new(&sets).unwrap()
}

fn at(trajectory: u32, step: u32) -> StateRef {
    StateRef { trajectory, step }
}

fn learnt(data: &Dataset, config: &TrainingConfig) -> Landmarks {
    let all: Vec<u32> = (0..data.trajectory_count() as u32).collect();
    Landmarks::of_training(data, &all, config).unwrap()
}

fn grids(data: &Dataset, config: &TrainingConfig) -> Vec<PatchGrid> {
    PatchGrid::of_cameras(data.cameras(), config.stack, &config.network.encoder)
}

#[test]
fn the_place_of_a_closing_is_seen_before_it_and_not_after() {
    // Two to the left, one ahead, close, one ahead, open.
    let data = dataset(&[[0, 0, 1, 2, 1, 3, 0, 0, 0], [1, 1, 2, 1, 1, 1, 1, 1, 1]]);
    let found = learnt(&data, &config());
    let first = found.sightings(at(0, 0));
    assert_eq!(first.len(), 2);
    assert_eq!((first[0].landmark, first[1].landmark), (0, 1));
    // 0.1 m to the left at a distance of 0.5 m, and of 0.3 m.
    let near = |found: Option<[f32; 2]>, x: f32| {
        let [found, y] = found.unwrap();
        assert!(
            (found - x).abs() < 1e-3 && (y - 8.0).abs() < 1e-3,
            "{found} {y}"
        );
    };
    near(first[0].pixels[0], 12.0 - 8.0 * 0.1 / 0.5);
    near(first[0].pixels[1], 12.0 - 8.0 * 0.1 / 0.3);
    let closing = found.sightings(at(0, 3));
    near(closing[0].pixels[1], 12.0);
    let opening = |step| found.sightings(at(0, step)).iter().any(|s| s.landmark == 1);
    assert!(opening(2) && !opening(3), "what the gripper holds hides it");
    assert!(found.sightings(at(0, 4)).is_empty());
    assert_eq!(found.sightings(at(2, 0))[0].landmark, 2, "the other task's");
}

#[test]
fn the_place_of_an_opening_is_below_the_gripper() {
    let data = dataset(&[[0, 0, 1, 2, 1, 3, 0, 0, 0]]);
    let mut config = config();
    let pixel = |config: &TrainingConfig| {
        let found = learnt(&data, config);
        let seen = &found.sightings(at(0, 0))[1];
        assert_eq!(seen.landmark, 1);
        seen.pixels[0].unwrap()
    };
    let [x, y] = pixel(&config);
    config.landmarks.as_mut().unwrap().drop_m = 0.12;
    let [below_x, below_y] = pixel(&config);
    assert!((below_x - x).abs() < 1e-3, "{below_x} {x}");
    // 0.12 m lower at a distance of 0.6 m.
    assert!(
        (below_y - y - 8.0 * 0.12 / 0.6).abs() < 1e-3,
        "{below_y} {y}"
    );
    let grids = grids(&data, &config);
    let book = Landmarks::book(&data, &config, &grids, &[1.0, 2.0, 3.0, 4.0]).unwrap();
    let heights: Vec<f32> = book.landmarks.iter().map(|l| l.height_m).collect();
    assert!((heights[0] - heights[1] - 0.12).abs() < 1e-4, "{heights:?}");
}

#[test]
fn targets_move_with_the_pictures() {
    let data = dataset(&[[0, 0, 1, 2, 1, 1, 1, 1, 1]]);
    let config = config();
    let (found, grids) = (learnt(&data, &config), grids(&data, &config));
    let target = |variation: Variation| {
        let varied = vec![vec![variation; 2]];
        found.targets(&[at(0, 3)], &varied, &grids).swap_remove(0)
    };
    let cells = grids[0].positions();
    // At the closing the head sees it 0.1 m to the left at 0.4 m: pixel 10, between cells 2 and 3 of 4 pixels.
    let share = |target: &[f32], column: usize| -> f32 {
        let rows = target[..cells].chunks_exact(grids[0].columns());
        rows.map(|row| row[column]).sum()
    };
    let still = target(Variation::NONE);
    assert!((still[..cells].iter().sum::<f32>() - 1.0).abs() < 1e-5);
    assert!(
        still[cells..].iter().all(|v| *v == 0.0),
        "others are unknown"
    );
    assert!(share(&still, 2) > 0.5, "{still:?}");
    let mirrored = target(Variation {
        is_mirrored: true,
        ..Variation::NONE
    });
    assert!((share(&mirrored, 3) - share(&still, 2)).abs() < 1e-5);
    let moved = target(Variation {
        right_pixels: 4,
        ..Variation::NONE
    });
    assert!((share(&moved, 3) - share(&still, 2)).abs() < 1e-3);
    let gone = target(Variation {
        right_pixels: -11,
        ..Variation::NONE
    });
    let even = ABSENT_WEIGHT / cells as f32;
    assert!(gone[..cells].iter().all(|v| (v - even).abs() < 1e-7));
}

#[test]
fn errors_are_told_in_pixels() {
    let data = dataset(&[[0, 0, 1, 2, 1, 1, 1, 1, 1]]);
    let config = config();
    let (found, grids) = (learnt(&data, &config), grids(&data, &config));
    let state = at(0, 3);
    let told: Vec<Vec<f32>> = (found.sightings(state)[0].pixels.iter().zip(&grids))
        .map(|(pixel, grid)| {
            let (first, [x, y]) = (first_cell(grid), pixel.unwrap());
            let value = |pixel: f32, axis: usize, count: usize| {
                let cell = (pixel - first[axis]) / grid.stride as f32;
                ((2.0 * cell + 1.0) / count as f32 - 1.0) * PLACE_GAIN
            };
            let mut told = vec![0.0; 4 * LANDMARK_VALUES];
            told[0] = value(x + 3.0, 0, grid.columns());
            told[1] = value(y - 4.0, 1, grid.rows());
            told
        })
        .collect();
    let error = found.error_pixels(&[state], &told, &grids).unwrap();
    assert!((error - 5.0).abs() < 1e-3, "{error}");
    assert_eq!(found.error_pixels(&[at(0, 5)], &told, &grids), None);
}

#[test]
fn it_is_learnt_how_far_off_places_to_open_at_are_seen() {
    let config = config();
    let shown = synthetic::acting(&NAMES, &[0, 1, 1, 2, 1, 1, 3, 0, 0]).trajectories()[0].clone();
    let of = |demonstrations: usize| {
        let one = |number: usize| Trajectory {
            id: number.to_string(),
            ..shown.clone()
        };
        let all = (0..demonstrations).map(one).collect();
        Dataset::new(&[DemonstrationSet::new("a", all).unwrap()]).unwrap()
    };
    let offsets = |demonstrations: usize, peaks: [f32; 2]| {
        let data = of(demonstrations);
        let (found, grids) = (learnt(&data, &config), grids(&data, &config));
        let mut book = Landmarks::book(&data, &config, &grids, &[1.0; 4]).unwrap();
        let (views, dim) = (book.views.clone(), spec_of(&data, &config).latent_dim);
        // Each camera sees it 2 pixels to the left and 1 pixel too low, but in one of a demonstration's pictures.
        let encode = |states: &[State]| {
            let mut latents = Latents::new(dim);
            let steps = (0..states.len()).map(|row| row % (states.len() / demonstrations));
            for step in steps {
                let mut row = vec![0.0; dim];
                for (camera, view) in views.iter().enumerate() {
                    let mut shown = found.sightings(at(0, step as u32)).iter();
                    let opening = shown.find(|s| s.landmark == 1).unwrap();
                    let Some(pixel) = opening.pixels[camera] else {
                        continue;
                    };
                    let off = if step == 0 { [9.0, 9.0] } else { [-2.0, 1.0] };
                    for axis in [0, 1] {
                        row[view.first + LANDMARK_VALUES + axis] = (pixel[axis] + off[axis]
                            - view.middle_pixels[axis])
                            / view.unit_pixels[axis];
                    }
                    row[view.first + LANDMARK_VALUES + 2] = peaks[camera];
                }
                latents.push(&row);
            }
            Ok::<_, ModelError>(latents)
        };
        learn_offsets(&mut book, &data, &config, encode).unwrap();
        assert_eq!(
            book.landmarks[0].offsets_pixels,
            Vec::<[f32; 2]>::new(),
            "it closes there"
        );
        book.landmarks[1].offsets_pixels.clone()
    };
    let near = |found: &[[f32; 2]], told: &[[f32; 2]]| {
        assert_eq!(found.len(), told.len());
        for (found, told) in found.iter().flatten().zip(told.iter().flatten()) {
            assert!((found - told).abs() < 1e-3, "{found} {told}");
        }
    };
    near(&offsets(20, [0.5, 0.4]), &[[-2.0, 1.0]; 2]);
    near(&offsets(20, [0.5, 0.2]), &[[-2.0, 1.0], [0.0; 2]]);
    near(&offsets(20, [0.2, 0.2]), &[]);
    near(&offsets(2, [0.5, 0.4]), &[]);

    let closing_only = dataset(&[[0, 0, 1, 2, 1, 1, 1, 1, 1]]);
    let grids = grids(&closing_only, &config);
    let mut book = Landmarks::book(&closing_only, &config, &grids, &[1.0; 4]).unwrap();
    let before = book.clone();
    let encode = |_: &[State]| -> Result<Latents, ModelError> { panic!("nothing is to be seen") };
    learn_offsets(&mut book, &closing_only, &config, encode).unwrap();
    assert_eq!(book, before);
}

#[test]
fn offsets_are_learnt_alike_in_whatever_order_the_tasks_are_given() {
    let config = config();
    let set = |task: &str, actions: &[usize; 9]| {
        let shown = synthetic::acting(&NAMES, actions).trajectories()[0].clone();
        let one = |number: usize| Trajectory {
            id: number.to_string(),
            ..shown.clone()
        };
        DemonstrationSet::new(task, (0..20).map(one).collect()).unwrap()
    };
    let closing = set("closing", &[0, 0, 1, 2, 1, 1, 1, 1, 1]);
    let opening = set("opening", &[0, 1, 1, 2, 1, 1, 3, 0, 0]);
    let trained_on = Dataset::new(&[closing.clone(), opening.clone()]).unwrap();
    let grids = grids(&trained_on, &config);
    let book = Landmarks::book(&trained_on, &config, &grids, &[1.0; 4]).unwrap();
    let closes: Vec<bool> = book.landmarks.iter().map(|l| l.closes).collect();
    assert_eq!(closes, [true, true, false]);
    let dim = spec_of(&trained_on, &config).latent_dim;
    // Every camera surely sees the third landmark in the middle of its picture.
    let encode = |states: &[State]| {
        let mut row = vec![0.0; dim];
        for view in &book.views {
            row[view.first + 2 * LANDMARK_VALUES + 2] = 1.0;
        }
        let mut latents = Latents::new(dim);
        for _ in states {
            latents.push(&row);
        }
        Ok::<_, ModelError>(latents)
    };
    let learnt = |sets: &[DemonstrationSet]| {
        let data = Dataset::new(sets).unwrap();
        let mut learnt = book.clone();
        learn_offsets(&mut learnt, &data, &config, encode).unwrap();
        learnt
    };
    let as_trained = learnt(&[closing.clone(), opening.clone()]);
    assert!(!as_trained.landmarks[2].offsets_pixels.is_empty());
    assert_eq!(learnt(&[opening.clone(), closing]), as_trained);
    let other = set("other", &[0, 1, 2, 3, 2, 3, 2, 3, 2]);
    assert_eq!(
        learnt(&[other, opening]),
        as_trained,
        "it is not in the book"
    );
}

#[test]
fn a_book_says_how_demonstrations_come_to_a_place() {
    let data = dataset(&[[0, 1, 1, 2, 1, 3, 0, 0, 0]]);
    let config = config();
    let grids = grids(&data, &config);
    let book = Landmarks::book(&data, &config, &grids, &[2.0, 9.0, 0.0, 0.0]).unwrap();
    assert_eq!(book.landmarks.len(), 2, "two of four are used");
    let closing = &book.landmarks[0];
    assert!(closing.closes && !book.landmarks[1].closes);
    assert_eq!(closing.approach, [1.0, 0.0, 0.0]);
    assert!((closing.clearance_m - 0.2).abs() < 1e-5, "{closing:?}");
    assert_eq!(closing.reach_m, [[0.4; 2], [0.05; 2]]);
    assert_eq!((closing.height_m, closing.error_pixels), (0.3, 2.0));
    assert_eq!(
        book.events_of(&data.tasks()[0], data.id_of(1)),
        [(3, 0), (5, 1)]
    );
    // Two cameras of 8 values come first, and what the second sees of four landmarks comes last.
    let spec = spec_of(&data, &config);
    assert_eq!(spec.latent_dim, 16 + 2 * 4 * 3);
    assert_eq!(book.misfit(spec.latent_dim, &spec.cameras), None);
    let mut latent = vec![0.0; spec.latent_dim];
    latent[16 + 12 + 3] = PLACE_GAIN * 0.5;
    let [x, y] = book.views[1].of(&latent, 1).pixel;
    assert_eq!([x, y], pixel_of([PLACE_GAIN * 0.5, 0.0], &grids[1]));
}

/// Closes the gripper, and opens it again.
const TAKING: [usize; 9] = [0, 0, 2, 1, 1, 1, 3, 0, 0];
/// Closes the gripper, and keeps it so.
const CLOSING: [usize; 9] = [0, 2, 1, 1, 1, 1, 1, 1, 1];

/// Two recordings of a task, in which a subgoal is reached at some steps.
fn recorded(task: &str, actions: &[usize; 9], reached: &[usize]) -> DemonstrationSet {
    let mut trajectories = synthetic::acting(&NAMES, actions).trajectories().to_vec();
    let marker = |step: &usize| Marker {
        step: *step,
        name: "reached".to_owned(),
    };
    for trajectory in &mut trajectories {
        trajectory.markers = reached.iter().map(marker).collect();
    }
    DemonstrationSet::new(task, trajectories).unwrap()
}

#[test]
fn practice_needs_the_camera_on_the_gripper_alone() {
    let mut config = config();
    config.cameras = ["head", "wrist"].map(String::from).to_vec();
    let demonstrations = [recorded("carry", &TAKING, &[4])];
    let run = recorded("carry", &CLOSING, &[]);
    let check = |run: &DemonstrationSet| {
        let practice = GripperPractice {
            runs: std::slice::from_ref(run),
            demonstrations: &demonstrations,
        };
        practice.check(&config)
    };
    let by_both = check(&run).unwrap();
    assert_eq!(by_both, Practised { empty: 14, held: 0 });
    assert_eq!(check(&synthetic::seen_by(&run, "wrist")).unwrap(), by_both);
    let message = check(&synthetic::seen_by(&run, "head"))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("the demonstrations have a camera 'wrist' of 16x24, and it does not"),
        "{message}"
    );
}

#[test]
fn what_practice_holds_counts_in_tasks_whose_demonstrations_hold_something() {
    let mut config = config();
    config.imitation.missed_grasp_steps = 5;
    // It misses once, and then takes something.
    let carried = recorded("carry", &[2, 1, 1, 1, 1, 3, 2, 1, 1], &[7]);
    let pushed = recorded("push", &[0, 0, 1, 1, 1, 1, 1, 0, 0], &[7]);
    let demonstrations = [carried, pushed];
    let check = |runs: &[DemonstrationSet]| {
        let practice = GripperPractice {
            runs,
            demonstrations: &demonstrations,
        };
        practice.check(&config)
    };
    let [carried, pushed] = ["carry", "push"].map(|task| recorded(task, &TAKING, &[4]));
    let empty = recorded("carry", &CLOSING, &[]);
    assert_eq!(
        check(&[empty.clone(), carried]).unwrap(),
        Practised { empty: 14, held: 4 }
    );
    assert_eq!(
        check(&[empty, pushed.clone()]).unwrap(),
        Practised { empty: 14, held: 0 }
    );
    let message = check(&[pushed]).unwrap_err().to_string();
    assert!(
        message.contains("in tasks whose demonstrations never do"),
        "{message}"
    );
}

#[test]
fn what_shows_no_landmarks_is_refused_with_the_reason() {
    let data = dataset(&[[0, 0, 1, 2, 1, 3, 0, 0, 0]]);
    check_landmarks(&config(), &data).unwrap();
    let refused = |change: &dyn Fn(&mut LandmarkConfig), data: &Dataset, reason: &str| {
        let mut config = config();
        change(config.landmarks.as_mut().unwrap());
        let message = check_landmarks(&config, data).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
    };
    refused(
        &|l| l.count = 1,
        &data,
        "count is 1, and the demonstrations have 2",
    );
    refused(
        &|l| l.robot.cameras.retain(|name, _| name == "head"),
        &data,
        "has head, and the demonstrations show 'wrist'",
    );
    refused(&|l| l.robot.primitives.clear(), &data, "describes none of");
    let without = Dataset::new(&[synthetic::demonstrations("a", 2, 9, 1)]).unwrap();
    refused(&|_| (), &without, "neither `gripper_close` nor");
    let still = dataset(&[[0, 0, 1, 1, 1, 0, 0, 0, 0]]);
    refused(&|_| (), &still, "in no task do half of");
    let mut of_pairs = config();
    of_pairs.network.variant = NetworkVariant::PixelDifference;
    check_landmarks(&of_pairs, &still).unwrap();
}
