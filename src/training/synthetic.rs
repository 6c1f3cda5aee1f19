//! Small made-up demonstrations for tests: a coloured square crosses the pictures of two cameras, and
//! the action is the way it moves.

use std::sync::Arc;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{TrainingEvent, TrainingObserver};
use crate::trajectory::{
    Action, ActionSpace, DemonstrationSet, Image, Observation, Step, Trajectory,
};

const MOVES: [(i32, i32); 4] = [(2, 0), (-2, 0), (0, 2), (0, -2)];

/// Demonstrations of 16x24 pixels from each of two cameras.
pub fn demonstrations(task: &str, count: usize, steps: usize, seed: u64) -> DemonstrationSet {
    demonstrations_sized(task, count, steps, seed, (16, 24))
}

/// Two demonstrations of nine steps that do the same, by primitives of these names.
pub fn acting(names: &[&str], actions: &[usize; 9]) -> DemonstrationSet {
    let mut trajectories = demonstrations("a", 2, actions.len(), 1)
        .trajectories()
        .to_vec();
    for trajectory in &mut trajectories {
        trajectory.action_space = ActionSpace::Primitives {
            names: names.iter().map(|name| (*name).to_owned()).collect(),
        };
        for (step, action) in trajectory.steps.iter_mut().zip(actions) {
            step.action = Action::Primitive(*action);
        }
    }
    DemonstrationSet::new("a", trajectories).expect("made alike")
}

/// The same demonstrations, whose camera `wrist` has another name.
pub fn with_wrist_called(set: &DemonstrationSet, name: &str) -> DemonstrationSet {
    let mut trajectories = set.trajectories().to_vec();
    for trajectory in &mut trajectories {
        for step in &mut trajectory.steps {
            let images = step.observation.iter().map(|(camera, image)| {
                let camera = if camera == "wrist" { name } else { camera };
                (camera.to_owned(), image.clone())
            });
            let renamed = Observation::new(images);
            step.observation = Arc::new(renamed);
        }
    }
    DemonstrationSet::new(set.task(), trajectories).expect("made alike")
}

/// The same demonstrations, seen by one camera alone.
pub fn seen_by(set: &DemonstrationSet, camera: &str) -> DemonstrationSet {
    let mut trajectories = set.trajectories().to_vec();
    for trajectory in &mut trajectories {
        for step in &mut trajectory.steps {
            let image = step.observation.image(camera).expect("it is there").clone();
            step.observation = Arc::new(Observation::new([(camera.to_owned(), image)]));
        }
    }
    DemonstrationSet::new(set.task(), trajectories).expect("made alike")
}

/// Demonstrations of any size.
pub fn demonstrations_sized(
    task: &str,
    count: usize,
    steps: usize,
    seed: u64,
    (height, width): (u32, u32),
) -> DemonstrationSet {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let trajectories = (0..count)
        .map(|index| {
            let ground = [rng.random(), rng.random(), rng.random()];
            let mut at = (
                rng.random_range(0..height as i32),
                rng.random_range(0..width as i32),
            );
            let mut direction = 0;
            let steps = (0..steps)
                .map(|step| {
                    if step % 4 == 0 {
                        direction = rng.random_range(0..MOVES.len());
                    }
                    let observation = Observation::new([
                        ("head".to_owned(), picture(height, width, ground, at)),
                        (
                            "wrist".to_owned(),
                            picture(height, width, ground, (at.1, at.0)),
                        ),
                    ]);
                    at.0 = (at.0 + MOVES[direction].0).rem_euclid(height as i32);
                    at.1 = (at.1 + MOVES[direction].1).rem_euclid(width as i32);
                    Step {
                        time_secs: step as f64,
                        observation: Arc::new(observation),
                        action: Action::Primitive(direction),
                    }
                })
                .collect();
            Trajectory {
                id: format!("{task}_{index}"),
                task: task.to_owned(),
                action_space: ActionSpace::Primitives {
                    names: ["down", "up", "right", "left"].map(String::from).to_vec(),
                },
                steps,
                markers: Vec::new(),
            }
        })
        .collect();
    DemonstrationSet::new(task, trajectories).expect("made alike")
}

fn picture(height: u32, width: u32, ground: [u8; 3], at: (i32, i32)) -> Image {
    let mut rgb = Vec::with_capacity((height * width * 3) as usize);
    for y in 0..height as i32 {
        for x in 0..width as i32 {
            let inside = (y - at.0).abs() <= 2 && (x - at.1).abs() <= 2;
            let pixel = if inside { [250, 40, 10] } else { ground };
            rgb.extend(pixel.map(|v| v.wrapping_add((x * 3) as u8 / 4)));
        }
    }
    Image::new(height, width, rgb).expect("as many pixels as said")
}

/// Stops after some steps and counts events.
#[derive(Default)]
pub struct Counting {
    pub steps: u64,
    pub stop_after: Option<u64>,
    pub first: f32,
    pub last: f32,
    pub validations: usize,
}

impl TrainingObserver for Counting {
    fn notice(&mut self, event: &TrainingEvent) {
        match event {
            TrainingEvent::Step { losses, .. } => {
                self.steps += 1;
                self.last = losses.total;
                if self.steps == 1 {
                    self.first = losses.total;
                }
            }
            TrainingEvent::Validated { .. } | TrainingEvent::BaselineValidated { .. } => {
                self.validations += 1;
            }
            _ => {}
        }
    }

    fn wants_stop(&mut self) -> bool {
        self.stop_after.is_some_and(|s| self.steps >= s)
    }
}

/// Two tasks.
pub fn sets() -> [DemonstrationSet; 2] {
    [demonstrations("a", 3, 12, 3), demonstrations("b", 3, 12, 4)]
}
