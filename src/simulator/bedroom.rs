//! The simulated bedroom as a robot's environment: images in, primitives out.

use std::fmt;

use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::decor::{decoration, decoration_open_to_the_south};
use super::layout::Layout;
use super::primitive::Primitive;
use super::ranges::{VariationError, WrittenVariation};
use super::render::{Camera, Lighting, Renderer, Scene, Visual};
use super::robot::{HEAD_FOV_RAD, WRIST_FOV_RAD};
use super::truth::{Insight, Truth};
use super::variation::{Arrangement, BedroomTask, Leftovers, Level, Variation};
use super::world::World;
use crate::environment::{Environment, EnvironmentError};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Image, Observation};

/// Rows of the cameras' images.
pub const CAMERA_HEIGHT: u32 = 90;
/// Columns of the cameras' images.
pub const CAMERA_WIDTH: u32 = 160;
/// Name of the camera on the mast.
pub const HEAD_CAMERA: &str = "head";
/// Name of the camera above the gripper.
pub const WRIST_CAMERA: &str = "wrist";

/// Vertical field of view of [`Bedroom::render_overview`].
const OVERVIEW_FOV_RAD: f32 = 0.663;

/// What a bedroom's episodes look like.
///
/// Of a variation that is read, what is not written is as at the level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenConfig")]
pub struct BedroomConfig {
    /// The task whose start region the robot starts in.
    pub start: BedroomTask,
    /// How much episodes differ.
    pub level: Level,
    /// Other ranges than the level's, such as [`Variation::check`] passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variation: Option<Variation>,
    /// In which state the other tasks' objects are.
    pub leftovers: Leftovers,
}

/// A [`BedroomConfig`] as it is written.
#[derive(Deserialize)]
#[serde(rename = "BedroomConfig", deny_unknown_fields)]
struct WrittenConfig {
    start: BedroomTask,
    #[serde(default)]
    level: Level,
    variation: Option<WrittenVariation>,
    #[serde(default)]
    leftovers: Leftovers,
}

impl TryFrom<WrittenConfig> for BedroomConfig {
    type Error = VariationError;

    fn try_from(written: WrittenConfig) -> Result<Self, VariationError> {
        let level = written.level;
        let variation = written.variation.map(|v| v.at(level)).transpose()?;
        Ok(Self {
            start: written.start,
            level,
            variation,
            leftovers: written.leftovers,
        })
    }
}

impl BedroomConfig {
    /// Episodes of one task at level `paper`.
    #[must_use]
    pub const fn paper(start: BedroomTask) -> Self {
        Self {
            start,
            level: Level::Paper,
            variation: None,
            leftovers: Leftovers::AtStart,
        }
    }
}

/// A bedroom with a robot in it. [`Environment::reset`] makes it anew from a seed.
pub struct Bedroom {
    config: BedroomConfig,
    layout: Layout,
    world: World,
    arrangement: Arrangement,
    decoration: Vec<Visual>,
    renderer: Renderer,
    noise: ChaCha8Rng,
}

impl Bedroom {
    /// A bedroom in the first observation of the episode of seed 0.
    ///
    /// # Panics
    /// If the variation has a range that leaves no possible world: [`Variation::check`] tells before.
    #[must_use]
    pub fn new(config: BedroomConfig) -> Self {
        if let Some(Err(fault)) = config.variation.map(|v| v.check()) {
            panic!("{fault}");
        }
        let layout = Layout::bedroom();
        let (arrangement, world) = arranged(&config, &layout, 0);
        Self {
            config,
            layout,
            world,
            noise: ChaCha8Rng::seed_from_u64(arrangement.noise_seed),
            arrangement,
            decoration: decoration(),
            renderer: Renderer::new(),
        }
    }

    /// What the episodes look like.
    #[must_use]
    pub const fn config(&self) -> &BedroomConfig {
        &self.config
    }

    /// Starts an episode without taking a picture.
    pub fn arrange(&mut self, seed: u64) {
        (self.arrangement, self.world) = arranged(&self.config, &self.layout, seed);
        self.noise = ChaCha8Rng::seed_from_u64(self.arrangement.noise_seed);
    }

    /// Carries out a primitive without taking a picture.
    pub fn act(&mut self, primitive: Primitive) {
        self.world.act(primitive);
    }

    /// What the cameras see now. Noise goes on from picture to picture.
    pub fn observe(&mut self) -> Observation {
        let scene = self.scene();
        let stance = self.world.robot().stance;
        let camera = |world_from_camera, vertical_fov_rad| Camera {
            world_from_camera,
            vertical_fov_rad,
            height: CAMERA_HEIGHT,
            width: CAMERA_WIDTH,
        };
        let head = camera(stance.world_from_head_camera(), HEAD_FOV_RAD);
        let wrist = camera(stance.world_from_wrist_camera(), WRIST_FOV_RAD);
        let [head, wrist] = self.renderer.render_each(&scene, [&head, &wrist]);
        Observation::new(
            [(HEAD_CAMERA, head), (WRIST_CAMERA, wrist)].map(|(name, image)| {
                let image = noisy(&image, self.arrangement.noise_levels, &mut self.noise);
                (name.to_owned(), image)
            }),
        )
    }

    /// Which subgoals hold: for scores only, never for what plans or acts.
    #[must_use]
    pub fn truth(&self) -> Truth {
        Truth::of(&self.world)
    }

    /// What the operator knows: never for what plans or acts.
    #[must_use]
    pub fn insight(&self) -> Insight {
        Insight::of(&self.world)
    }

    /// Everything that can be seen, decoration included.
    #[must_use]
    pub fn visuals(&self) -> Vec<Visual> {
        let mut visuals = self.world.visuals();
        visuals.extend_from_slice(&self.decoration);
        visuals
    }

    /// A picture of the whole room from outside, its south wall taken away.
    pub fn render_overview(&mut self, height: u32, width: u32) -> Image {
        let mut visuals = self.world.visuals();
        visuals.extend(decoration_open_to_the_south());
        let scene = Scene {
            visuals,
            ..self.scene()
        };
        let [_, _, south, _] = self.layout.walls_m;
        let camera = Camera {
            world_from_camera: looking(
                Point3::new(0.25, south - 2.3, 2.9),
                Point3::new(0.35, 0.3, 0.55),
            ),
            vertical_fov_rad: OVERVIEW_FOV_RAD,
            height,
            width,
        };
        self.renderer.render(&scene, &camera)
    }

    fn scene(&self) -> Scene {
        let [sun, ambient, headlight] = self.arrangement.light;
        let nominal = Lighting::default();
        Scene {
            visuals: self.visuals(),
            lighting: Lighting {
                sun_direction: nominal.sun_direction,
                sun: nominal.sun * sun,
                ambient: nominal.ambient * ambient,
                headlight: nominal.headlight * headlight,
            },
        }
    }
}

impl fmt::Debug for Bedroom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bedroom")
            .field("config", &self.config)
            .finish_non_exhaustive()
    }
}

impl Environment for Bedroom {
    fn cameras(&self) -> Vec<CameraSpec> {
        [HEAD_CAMERA, WRIST_CAMERA]
            .map(|name| CameraSpec {
                name: name.to_owned(),
                height: CAMERA_HEIGHT,
                width: CAMERA_WIDTH,
            })
            .to_vec()
    }

    fn action_space(&self) -> ActionSpace {
        Primitive::action_space()
    }

    fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError> {
        self.arrange(seed);
        Ok(self.observe())
    }

    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        self.act(primitive(action)?);
        Ok(self.observe())
    }
}

fn primitive(action: &Action) -> Result<Primitive, EnvironmentError> {
    let refused = |reason: String| EnvironmentError::ActionRefused {
        action: action.to_string(),
        reason,
    };
    match action {
        Action::Primitive(index) => Primitive::from_index(*index).ok_or_else(|| {
            let count = Primitive::ALL.len();
            refused(format!("the robot has {count} primitives, counted from 0"))
        }),
        Action::Continuous(_) => Err(refused("the robot moves by primitives".to_owned())),
    }
}

fn arranged(config: &BedroomConfig, layout: &Layout, seed: u64) -> (Arrangement, World) {
    let variation = config.variation.unwrap_or(config.level.variation());
    let arrangement = variation.arrangement(layout, config.start, config.leftovers, seed);
    let world = World::new(layout, &arrangement);
    (arrangement, world)
}

/// A camera's pose at `eye`, turned towards `middle`, upright.
fn looking(eye: Point3<f32>, middle: Point3<f32>) -> Isometry3<f32> {
    let ahead = middle - eye;
    let yaw = ahead.y.atan2(ahead.x);
    let pitch = (-ahead.z).atan2(ahead.x.hypot(ahead.y));
    Isometry3::translation(eye.x, eye.y, eye.z)
        * Isometry3::rotation(Vector3::z() * yaw)
        * Isometry3::rotation(Vector3::y() * pitch)
}

/// The image with triangular noise of at most `levels` on each channel of each pixel.
fn noisy(image: &Image, levels: f32, rng: &mut ChaCha8Rng) -> Image {
    let mut lots = vec![0_u8; image.rgb().len() * 2];
    rng.fill_bytes(&mut lots);
    let scale = levels / 255.0;
    let rgb: Vec<u8> = image
        .rgb()
        .iter()
        .zip(lots.chunks_exact(2))
        .map(|(value, lot)| {
            let noise = (f32::from(lot[0]) - f32::from(lot[1])) * scale;
            // Rounds; what lies outside of 0..=255 saturates.
            (f32::from(*value) + noise + 0.5) as u8
        })
        .collect();
    Image::new(image.height(), image.width(), rgb).expect("noise keeps the size")
}

#[cfg(test)]
mod tests;
