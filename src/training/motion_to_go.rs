//! What a robot still did, in all, before its gripper next closed or opened: read off the actions of a
//! demonstration, it says how far aside, ahead and above that place lies of what a state shows.

use std::collections::HashMap;

use super::augmentation::Mirror;
use super::{Dataset, ImitationConfig, StateRef, TrainingConfig, TrainingError};
use crate::task::GripperSignal;
use crate::trajectory::ActionSpace;

/// Two primitives that undo each other; the first counts forward.
type Axis = (usize, usize);

/// The axes along which an action space moves to and fro; none for actions that are no primitives.
#[must_use]
pub fn axes(space: &ActionSpace) -> Vec<Axis> {
    let opposites = space.opposites().into_iter().enumerate();
    opposites
        .filter_map(|(one, other)| Some((one, other?)))
        .filter(|(one, other)| one < other)
        .collect()
}

/// How many values the motion to go has that a network is to tell; 0 where it is to tell none.
#[must_use]
pub fn motion_axes(space: &ActionSpace, config: &TrainingConfig) -> usize {
    if config.tells_motion() {
        axes(space).len()
    } else {
        0
    }
}

/// The motion to go of each state of some demonstrations.
///
/// For each axis it is `sign(n) ln(1 + |n|)` of the number `n` of primitives in the one direction less those
/// in the other, from this state to the next state whose action closes or opens the gripper. A closing that missed
/// and the opening that took it back are passed over, since they were not where the thing is.
#[derive(Clone, Debug, Default)]
pub struct MotionToGo {
    axes: Vec<Axis>,
    of: HashMap<u32, Vec<Option<Vec<f32>>>>,
}

/// The motion to go of those rows of a batch that have one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionTargets {
    /// Rows of the states.
    pub rows: Vec<i32>,
    /// The values of all axes, row after row.
    pub values: Vec<f32>,
}

impl MotionToGo {
    /// That of all states of some demonstrations; empty where it is not learnt.
    #[must_use]
    pub fn of_training(data: &Dataset, trajectories: &[u32], config: &TrainingConfig) -> Self {
        if config.tells_motion() {
            Self::find(data, trajectories, &config.imitation)
        } else {
            Self::default()
        }
    }

    fn find(data: &Dataset, trajectories: &[u32], imitation: &ImitationConfig) -> Self {
        let axes = axes(data.action_space());
        let of = (trajectories.iter())
            .map(|trajectory| (*trajectory, along(data, *trajectory, &axes, imitation)))
            .collect();
        Self { axes, of }
    }

    /// That of a state, a value an axis; none after the gripper's last event.
    #[must_use]
    pub fn of(&self, at: StateRef) -> Option<&[f32]> {
        self.of.get(&at.trajectory)?[at.step as usize].as_deref()
    }

    /// Those of the states of a batch, as `mirror` shows them.
    #[must_use]
    pub fn targets(&self, states: &[StateRef], mirror: &Mirror) -> MotionTargets {
        let signs: Vec<f32> = (self.axes.iter())
            .map(|(one, _)| if mirror.turns(*one) { -1.0 } else { 1.0 })
            .collect();
        let mut targets = MotionTargets::default();
        for (row, at) in states.iter().enumerate() {
            if let Some(values) = self.of(*at) {
                targets.rows.push(row as i32);
                let shown = values.iter().zip(&signs).map(|(value, sign)| value * sign);
                targets.values.extend(shown);
            }
        }
        targets
    }
}

/// Refuses a configuration that learns a motion to go where there is none.
///
/// # Errors
/// [`TrainingError::NoMotionToGo`].
pub fn check_motion(config: &TrainingConfig, data: &Dataset) -> Result<(), TrainingError> {
    let space = data.action_space();
    let is_without = axes(space).is_empty() || GripperSignal::default().classes(space).is_empty();
    if config.motion_weight > 0.0 && is_without {
        return Err(TrainingError::NoMotionToGo {
            weight: config.motion_weight,
            space: space.to_string(),
        });
    }
    Ok(())
}

fn along(
    data: &Dataset,
    trajectory: u32,
    axes: &[Axis],
    imitation: &ImitationConfig,
) -> Vec<Option<Vec<f32>>> {
    let events = data.lasting_events(trajectory, imitation);
    let mut counted: Option<Vec<i32>> = None;
    let mut found = vec![None; data.steps(trajectory)];
    for (step, values) in found.iter_mut().enumerate().rev() {
        if events.iter().any(|(at, _)| *at == step) {
            counted = Some(vec![0; axes.len()]);
        }
        let Some(counts) = counted.as_mut() else {
            continue;
        };
        let at = StateRef {
            trajectory,
            step: step as u32,
        };
        let action = data.classes(at).first();
        for (count, (one, other)) in counts.iter_mut().zip(axes) {
            *count += i32::from(action == Some(one)) - i32::from(action == Some(other));
        }
        *values = Some(counts.iter().map(|count| compressed(*count)).collect());
    }
    found
}

/// Large motions are roughly told, small ones exactly.
fn compressed(count: i32) -> f32 {
    let count = count as f32;
    count.signum() * count.abs().ln_1p()
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::training::{AugmentationConfig, synthetic};

    const NAMES: [&str; 6] = [
        "left",
        "right",
        "up",
        "down",
        "gripper_close",
        "gripper_open",
    ];

    fn dataset(actions: [usize; 9]) -> Dataset {
        Dataset::new(&[synthetic::acting(&NAMES, &actions)]).unwrap()
    }

    fn counts(motion: &MotionToGo, step: u32) -> Option<Vec<i32>> {
        let at = StateRef {
            trajectory: 0,
            step,
        };
        let back = |v: &f32| (v.signum() * v.abs().exp_m1()).round() as i32;
        motion
            .of(at)
            .map(|values| values.iter().map(back).collect())
    }

    #[test]
    fn presses_to_the_next_event_are_counted_net() {
        let data = dataset([0, 0, 1, 3, 4, 2, 2, 5, 0]);
        let motion = MotionToGo::find(&data, &[0, 1], &ImitationConfig::default());
        assert_eq!(motion.axes, [(0, 1), (2, 3)]);
        let expected = [
            Some([1, -1]),
            Some([0, -1]),
            Some([-1, -1]),
            Some([0, -1]),
            Some([0, 0]),
            Some([0, 2]),
            Some([0, 1]),
            Some([0, 0]),
            None,
        ];
        for (step, counted) in (0..).zip(expected) {
            assert_eq!(counts(&motion, step), counted.map(Vec::from), "{step}");
        }
    }

    #[test]
    fn a_missed_grasp_is_passed_over() {
        let data = dataset([0, 4, 5, 0, 0, 3, 3, 4, 2]);
        let config = ImitationConfig {
            missed_grasp_steps: 2,
            lead_steps: 0,
        };
        let motion = MotionToGo::find(&data, &[0], &config);
        assert_eq!(counts(&motion, 0), Some(vec![3, -2]));
        assert_eq!(counts(&motion, 2), Some(vec![2, -2]));
        assert_eq!(
            motion.of(StateRef {
                trajectory: 1,
                step: 0
            }),
            None
        );
    }

    #[test]
    fn a_mirrored_batch_goes_to_the_other_side() {
        let data = dataset([0, 2, 4, 0, 0, 0, 0, 0, 0]);
        let motion = MotionToGo::find(&data, &[0], &ImitationConfig::default());
        let states = [3, 0].map(|step| StateRef {
            trajectory: 0,
            step,
        });
        let mut config = AugmentationConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let ln_2 = 2.0_f32.ln();
        for (share, side) in [(0.0, 1.0), (1.0, -1.0)] {
            config.mirror_share = share;
            let mirror = Mirror::draw(&config, data.action_space(), &mut rng);
            let targets = motion.targets(&states, &mirror);
            assert_eq!(targets.rows, [1]);
            assert_eq!(targets.values, [side * ln_2, ln_2]);
        }
    }
}
