use std::sync::Arc;

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::missed_grasps::{lasting_events, missed_grasps};
use super::{ImitationConfig, TrainingError};
use crate::task::{GripperEvent, GripperSignal};
use crate::trajectory::{
    ActionSpace, CameraSpec, DemonstrationSet, Observation, State, Trajectory, printed_cameras,
    told_apart,
};

/// One state of a [`Dataset`]: a step of one of its trajectories.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StateRef {
    /// Index of the trajectory in the dataset.
    pub trajectory: u32,
    /// Step within the trajectory.
    pub step: u32,
}

/// All demonstrations of a training with their actions as classes. The images are shared with the
/// demonstration sets, not copied.
#[derive(Debug)]
pub struct Dataset {
    cameras: Vec<CameraSpec>,
    action_space: ActionSpace,
    /// The task of each set.
    tasks: Vec<String>,
    trajectories: Vec<Labelled>,
}

#[derive(Debug)]
struct Labelled {
    id: String,
    set: usize,
    observations: Vec<Arc<Observation>>,
    /// The class of each head, step after step.
    classes: Vec<Vec<usize>>,
    /// Steps of the markers, in order of time.
    markers: Vec<usize>,
    /// When the gripper was told to close or open; empty where the action space has no such primitives.
    gripper: Vec<(usize, GripperEvent)>,
}

/// Indices of trajectories that are trained on, and of those that are held out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Trained on, in rising order.
    pub training: Vec<u32>,
    /// Held out, in rising order.
    pub validation: Vec<u32>,
}

impl Dataset {
    /// Puts the demonstrations of several tasks together.
    ///
    /// # Errors
    /// [`TrainingError::TooFewDemonstrations`] for fewer than two, and the variants that name what
    /// differs between sets or does not fit within a trajectory.
    pub fn new(sets: &[DemonstrationSet]) -> Result<Self, TrainingError> {
        let found = sets.iter().map(|s| s.trajectories().len()).sum();
        let Some(first) = sets.first().filter(|_| found >= 2) else {
            return Err(TrainingError::TooFewDemonstrations { found });
        };
        if first.action_space().head_sizes().is_empty() {
            return Err(TrainingError::ActionsWithoutClasses {
                set: first.task().to_owned(),
                space: first.action_space().to_string(),
            });
        }
        let mut trajectories = Vec::with_capacity(found);
        for (index, set) in sets.iter().enumerate() {
            check_same_kind(first, set)?;
            for trajectory in set.trajectories() {
                trajectories.push(labelled(index, trajectory, &first.cameras())?);
            }
        }
        Ok(Self {
            cameras: first.cameras(),
            action_space: first.action_space().clone(),
            tasks: sets.iter().map(|set| set.task().to_owned()).collect(),
            trajectories,
        })
    }

    /// The same demonstrations, seen by some of the cameras alone; no name leaves all.
    ///
    /// # Errors
    /// [`TrainingError::CameraUnknown`] for one that the demonstrations do not have.
    pub fn seen_by(mut self, cameras: &[String]) -> Result<Self, TrainingError> {
        if let Some(unknown) = (cameras.iter()).find(|c| self.cameras.iter().all(|p| p.name != **c))
        {
            return Err(TrainingError::CameraUnknown {
                camera: unknown.clone(),
                present: printed_cameras(&self.cameras),
            });
        }
        if !cameras.is_empty() {
            self.cameras
                .retain(|present| cameras.contains(&present.name));
        }
        Ok(self)
    }

    /// Cameras of every state, by name.
    #[must_use]
    pub fn cameras(&self) -> &[CameraSpec] {
        &self.cameras
    }

    /// The actions of every step.
    #[must_use]
    pub fn action_space(&self) -> &ActionSpace {
        &self.action_space
    }

    /// Number of trajectories.
    #[must_use]
    pub fn trajectory_count(&self) -> usize {
        self.trajectories.len()
    }

    /// Number of steps of a trajectory.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn steps(&self, trajectory: u32) -> usize {
        self.trajectories[trajectory as usize].classes.len()
    }

    /// Number of states of all trajectories together.
    #[must_use]
    pub fn state_count(&self) -> usize {
        self.trajectories.iter().map(|t| t.classes.len()).sum()
    }

    /// The state at a step, `stack` frames deep.
    ///
    /// # Panics
    /// If there is no such state or `stack` is 0.
    #[must_use]
    pub fn state(&self, at: StateRef, stack: usize) -> State {
        let last = at.step as usize;
        let first = (last + 1).saturating_sub(stack);
        let observations = &self.trajectories[at.trajectory as usize].observations;
        State::from_history(&observations[first..=last], stack)
    }

    /// What was seen at a step.
    ///
    /// # Panics
    /// If there is no such step.
    #[must_use]
    pub fn observation(&self, at: StateRef) -> &Observation {
        &self.trajectories[at.trajectory as usize].observations[at.step as usize]
    }

    /// The class of each head of the action at a step.
    ///
    /// # Panics
    /// If there is no such step.
    #[must_use]
    pub fn classes(&self, at: StateRef) -> &[usize] {
        &self.trajectories[at.trajectory as usize].classes[at.step as usize]
    }

    /// The task of each of the demonstration sets.
    #[must_use]
    pub fn tasks(&self) -> &[String] {
        &self.tasks
    }

    /// Which of the demonstration sets a trajectory is from.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn set_of(&self, trajectory: u32) -> usize {
        self.trajectories[trajectory as usize].set
    }

    /// The id of a trajectory.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn id_of(&self, trajectory: u32) -> &str {
        &self.trajectories[trajectory as usize].id
    }

    /// The steps of a trajectory's markers, in order of time.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn marker_steps(&self, trajectory: u32) -> &[usize] {
        &self.trajectories[trajectory as usize].markers
    }

    /// When the gripper was told to close or open, in order of time; empty where the action space has no
    /// such primitives.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn gripper_events(&self, trajectory: u32) -> &[(usize, GripperEvent)] {
        &self.trajectories[trajectory as usize].gripper
    }

    /// When the gripper closed and opened, missed grasps left out.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn lasting_events(
        &self,
        trajectory: u32,
        config: &ImitationConfig,
    ) -> Vec<(usize, GripperEvent)> {
        let trajectory = &self.trajectories[trajectory as usize];
        lasting_events(&trajectory.gripper, &trajectory.markers, config)
    }

    /// Whether the action at a step is one to imitate: not part of a missed grasp.
    ///
    /// # Panics
    /// If there is no such trajectory.
    #[must_use]
    pub fn is_imitated(&self, at: StateRef, config: &ImitationConfig) -> bool {
        let trajectory = &self.trajectories[at.trajectory as usize];
        !missed_grasps(&trajectory.gripper, &trajectory.markers, config)
            .any(|steps| steps.contains(&(at.step as usize)))
    }

    /// Every state of some trajectories, in order.
    pub fn states_of<'a>(&'a self, trajectories: &'a [u32]) -> impl Iterator<Item = StateRef> + 'a {
        trajectories.iter().flat_map(|trajectory| {
            (0..self.steps(*trajectory)).map(|step| StateRef {
                trajectory: *trajectory,
                step: step as u32,
            })
        })
    }

    /// Holds out `share` of each set's trajectories, at least one in all; the same seed holds out
    /// the same ones. A set of one trajectory is trained on unless nothing else could be held out.
    #[must_use]
    pub fn split(&self, share: f64, seed: u64) -> Split {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let sets = self
            .trajectories
            .iter()
            .map(|t| t.set + 1)
            .max()
            .unwrap_or(0);
        let mut validation = Vec::new();
        for set in 0..sets {
            let mut members = self.members(set);
            members.shuffle(&mut rng);
            let wanted = (members.len() as f64 * share).round() as usize;
            validation.extend(members.iter().take(wanted.min(members.len() - 1)));
        }
        if validation.is_empty() {
            let all = 0..self.trajectories.len() as u32;
            let is_one_of_several = |t: &u32| self.members(self.set_of(*t)).len() > 1;
            let mut some: Vec<u32> = all.clone().filter(is_one_of_several).collect();
            if some.is_empty() {
                some = all.collect();
            }
            some.shuffle(&mut rng);
            validation.extend(some.first());
        }
        validation.sort_unstable();
        let training = (0..self.trajectories.len() as u32)
            .filter(|t| !validation.contains(t))
            .collect();
        Split {
            training,
            validation,
        }
    }

    /// A fingerprint of all images, actions and markers, and of what is in which set, to notice that a checkpoint
    /// belongs to others. Not cryptographic, since it is computed over all pixels at every start.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        const PRIME: u64 = 0x0000_0100_0000_01b3;
        let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
        let mut add = |word: u64| hash = (hash ^ word).wrapping_mul(PRIME).rotate_left(23);
        let cameras = self.cameras.iter().map(|camera| &camera.name);
        for name in self.tasks.iter().chain(cameras) {
            add(name.len() as u64);
            name.bytes().for_each(|byte| add(u64::from(byte)));
        }
        for trajectory in 0..self.trajectory_count() as u32 {
            let Labelled { set, markers, .. } = &self.trajectories[trajectory as usize];
            for number in [*set, self.steps(trajectory), markers.len()]
                .iter()
                .chain(markers)
            {
                add(*number as u64);
            }
            for state in self.states_of(&[trajectory]) {
                for (_, image) in self.observation(state).iter() {
                    for bytes in image.rgb().chunks(8) {
                        let mut word = [0; 8];
                        word[..bytes.len()].copy_from_slice(bytes);
                        add(u64::from_le_bytes(word));
                    }
                }
                for class in self.classes(state) {
                    add(*class as u64);
                }
            }
        }
        format!("{hash:016x}")
    }

    fn members(&self, set: usize) -> Vec<u32> {
        (0..self.trajectories.len() as u32)
            .filter(|t| self.trajectories[*t as usize].set == set)
            .collect()
    }
}

fn check_same_kind(first: &DemonstrationSet, set: &DemonstrationSet) -> Result<(), TrainingError> {
    if set.cameras() != first.cameras() {
        return Err(TrainingError::CamerasDiffer {
            first_set: first.task().to_owned(),
            expected: printed_cameras(&first.cameras()),
            set: set.task().to_owned(),
            found: printed_cameras(&set.cameras()),
        });
    }
    if set.action_space() != first.action_space() {
        let (expected, found) = told_apart(first.action_space(), set.action_space());
        return Err(TrainingError::ActionSpacesDiffer {
            first_set: first.task().to_owned(),
            expected,
            set: set.task().to_owned(),
            found,
        });
    }
    Ok(())
}

fn labelled(
    set: usize,
    trajectory: &Trajectory,
    cameras: &[CameraSpec],
) -> Result<Labelled, TrainingError> {
    let mut observations = Vec::with_capacity(trajectory.steps.len());
    let mut classes = Vec::with_capacity(trajectory.steps.len());
    for (index, step) in trajectory.steps.iter().enumerate() {
        let misfit = |source| TrainingError::Step {
            trajectory: trajectory.id.clone(),
            step: index,
            source,
        };
        for camera in cameras {
            let image = step.observation.image(&camera.name).map_err(misfit)?;
            if (image.height(), image.width()) != (camera.height, camera.width) {
                return Err(TrainingError::ImageSize {
                    trajectory: trajectory.id.clone(),
                    step: index,
                    camera: camera.name.clone(),
                    expected: format!("{}x{}", camera.height, camera.width),
                    found: format!("{}x{}", image.height(), image.width()),
                });
            }
        }
        classes.push(
            trajectory
                .action_space
                .classes(&step.action)
                .map_err(misfit)?,
        );
        observations.push(Arc::clone(&step.observation));
    }
    let mut markers: Vec<usize> = trajectory.markers.iter().map(|m| m.step).collect();
    markers.sort_unstable();
    let actions = trajectory.steps.iter().map(|s| &s.action);
    let gripper = GripperSignal::default().events(&trajectory.action_space, actions);
    Ok(Labelled {
        id: trajectory.id.clone(),
        set,
        observations,
        classes,
        markers,
        gripper: gripper.unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::synthetic;
    use crate::trajectory::Action;

    #[test]
    fn one_demonstration_is_refused() {
        let sets = [synthetic::demonstrations("only", 1, 8, 3)];
        let error = Dataset::new(&sets).unwrap_err();
        assert!(matches!(
            error,
            TrainingError::TooFewDemonstrations { found: 1 }
        ));
    }

    #[test]
    fn a_primitive_that_there_is_not_is_told_with_its_trajectory_and_step() {
        let shown = synthetic::demonstrations("a", 2, 8, 3);
        let mut trajectories = shown.trajectories().to_vec();
        trajectories[1].steps[5].action = Action::Primitive(9);
        let sets = [DemonstrationSet::new("a", trajectories).unwrap()];
        let message = Dataset::new(&sets).unwrap_err().to_string();
        for part in [
            "trajectory 'a_1', step 5",
            "primitive 9",
            "4 primitives",
            "not below 4",
        ] {
            assert!(message.contains(part), "{part} is not in {message}");
        }
    }

    #[test]
    fn sets_with_other_cameras_are_refused_by_name() {
        let sets = [
            synthetic::demonstrations("wide", 2, 8, 3),
            synthetic::demonstrations_sized("narrow", 2, 8, 3, (16, 16)),
        ];
        let message = Dataset::new(&sets).unwrap_err().to_string();
        assert!(
            message.contains("'narrow'") && message.contains("16x16"),
            "{message}"
        );
    }

    #[test]
    fn the_split_is_seeded_and_holds_out_whole_trajectories_of_each_set() {
        let sets = [
            synthetic::demonstrations("a", 10, 8, 3),
            synthetic::demonstrations("b", 10, 8, 4),
        ];
        let data = Dataset::new(&sets).unwrap();
        let split = data.split(0.1, 5);
        assert_eq!(split, data.split(0.1, 5));
        assert_ne!(split, data.split(0.1, 6));
        assert_eq!(split.validation.len(), 2);
        assert!(split.validation[0] < 10 && split.validation[1] >= 10);
        assert_eq!(split.training.len(), 18);
    }

    #[test]
    fn a_set_of_one_is_trained_on_unless_all_are() {
        let of = |counts: [usize; 2]| {
            let sets = counts.map(|count| synthetic::demonstrations("a", count, 8, 3));
            Dataset::new(&sets).unwrap()
        };
        for seed in 0..20 {
            let split = of([1, 2]).split(0.1, seed);
            assert!(split.training.contains(&0), "{split:?}");
            assert_eq!((split.training.len(), split.validation.len()), (2, 1));
        }
        let split = of([1, 1]).split(0.1, 5);
        assert_eq!((split.training.len(), split.validation.len()), (1, 1));
    }

    #[test]
    fn a_state_stacks_the_frame_before_it() {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 8, 3)]).unwrap();
        let at = StateRef {
            trajectory: 1,
            step: 4,
        };
        let state = data.state(at, 2);
        assert_eq!(state.newest(), data.observation(at));
        let before = StateRef { step: 3, ..at };
        assert_eq!(&*state.frames()[0], data.observation(before));
    }
}
