use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::{AugmentationConfig, TrainingError};
use crate::trajectory::ActionSpace;

/// How the frames of one camera are varied: moved by whole pixels and multiplied per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Rows that the picture moves down.
    pub down_pixels: i32,
    /// Columns that the picture moves right.
    pub right_pixels: i32,
    /// Factor of each colour channel.
    pub gain: [f32; 3],
    /// Whether left and right change places.
    pub is_mirrored: bool,
}

impl Variation {
    /// No change.
    pub const NONE: Self = Self {
        down_pixels: 0,
        right_pixels: 0,
        gain: [1.0; 3],
        is_mirrored: false,
    };

    /// Draws a variation.
    pub fn draw(config: &AugmentationConfig, rng: &mut ChaCha8Rng) -> Self {
        let reach = config.shift_pixels as i32;
        let mut around_one = |spread: f32| 1.0 + spread * rng.random_range(-1.0..=1.0_f32);
        let brightness = around_one(config.brightness);
        let gain = [(); 3].map(|()| brightness * around_one(config.tint));
        Self {
            down_pixels: rng.random_range(-reach..=reach),
            right_pixels: rng.random_range(-reach..=reach),
            gain,
            is_mirrored: false,
        }
    }
}

/// A variation for each state and camera, the same for all states of a group. `group_of` names the group of each
/// state; groups are numbered from 0.
pub fn vary(
    config: &AugmentationConfig,
    cameras: usize,
    group_of: &[usize],
    mirror: &Mirror,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<Variation>> {
    let groups = group_of.iter().max().map_or(0, |group| group + 1);
    let mut draw = || Variation {
        is_mirrored: mirror.classes.is_some(),
        ..Variation::draw(config, rng)
    };
    let each: Vec<Vec<Variation>> = (0..groups)
        .map(|_| (0..cameras).map(|_| draw()).collect())
        .collect();
    group_of.iter().map(|group| each[*group].clone()).collect()
}

/// Whether left and right change places in a batch: in all its pictures, and in its actions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mirror {
    /// For each class of the actions' head, the one on the other side; none in a batch that is as it was.
    classes: Option<Vec<usize>>,
}

impl Mirror {
    /// A batch that is as it was.
    pub const NONE: Self = Self { classes: None };

    /// Draws for a batch. Nothing is drawn where no batch ever is mirrored.
    ///
    /// # Panics
    /// If batches are to be mirrored and the actions have no other side, which a training refuses.
    pub fn draw(config: &AugmentationConfig, space: &ActionSpace, rng: &mut ChaCha8Rng) -> Self {
        let is_mirrored = config.mirror_share > 0.0 && rng.random_bool(config.mirror_share);
        let classes = || space.mirrored().expect("checked before the training");
        Self {
            classes: is_mirrored.then(classes),
        }
    }

    /// Whether a class of the one head stands for another in this batch.
    pub fn turns(&self, class: usize) -> bool {
        (self.classes.as_ref()).is_some_and(|other_side| other_side[class] != class)
    }

    /// Mirrors the classes of the one head, if the batch is mirrored.
    pub fn change(&self, classes: &mut [Vec<i32>]) {
        let Some(other_side) = &self.classes else {
            return;
        };
        for class in classes.iter_mut().flatten() {
            *class = other_side[*class as usize] as i32;
        }
    }
}

/// Refuses a configuration that mirrors what has no other side.
///
/// # Errors
/// [`TrainingError::NotMirrored`].
pub fn check_mirror(config: &AugmentationConfig, space: &ActionSpace) -> Result<(), TrainingError> {
    if config.mirror_share > 0.0 && space.mirrored().is_none() {
        return Err(TrainingError::NotMirrored {
            share: config.mirror_share,
            space: space.to_string(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn nothing_configured_changes_nothing() {
        let still = AugmentationConfig {
            shift_pixels: 0,
            brightness: 0.0,
            tint: 0.0,
            mirror_share: 0.0,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert_eq!(Variation::draw(&still, &mut rng), Variation::NONE);
    }

    #[test]
    fn variations_stay_within_their_bounds() {
        let config = AugmentationConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let v = Variation::draw(&config, &mut rng);
            assert!(v.down_pixels.abs() <= 4 && v.right_pixels.abs() <= 4);
            assert!(v.gain.iter().all(|g| (0.75..1.27).contains(g)));
        }
    }

    #[test]
    fn as_many_batches_are_mirrored_as_are_to_be_and_none_costs_no_draw() {
        let space = ActionSpace::Primitives {
            names: ["turn_left", "up", "turn_right"].map(String::from).to_vec(),
        };
        let mut config = AugmentationConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let before = rng.clone();
        assert_eq!(Mirror::draw(&config, &space, &mut rng).classes, None);
        assert_eq!(rng, before);
        config.mirror_share = 0.4;
        let drawn = (0..1_000).map(|_| Mirror::draw(&config, &space, &mut rng));
        let mirrors: Vec<Mirror> = drawn.filter(|mirror| mirror.classes.is_some()).collect();
        assert!((350..450).contains(&mirrors.len()), "{}", mirrors.len());
        let mut classes = vec![vec![0, 1, 2]];
        mirrors[0].change(&mut classes);
        assert_eq!(classes, [[2, 1, 0]]);
        let one_sided = ActionSpace::Primitives {
            names: vec!["left".to_owned()],
        };
        let message = check_mirror(&config, &one_sided).unwrap_err().to_string();
        assert!(message.contains("mirror_share"), "{message}");
        check_mirror(&config, &space).unwrap();
    }
}
