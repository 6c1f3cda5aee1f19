//! What dry runs teach: an empty gripper, wherever a run may carry one.

use super::grasps::{carried_camera, empty_states, grasp_sense};
use super::landmark_count;
use crate::training::{Dataset, TrainedModel, TrainingConfig, TrainingError};
use crate::trajectory::{CameraSpec, DemonstrationSet};

fn refuse(reason: &str) -> TrainingError {
    let reason = reason.to_owned();
    TrainingError::NoDryRuns { reason }
}

/// Refuses dry runs from which a training of that configuration can learn nothing. Returns how many of their states
/// show a gripper that is closed on nothing.
///
/// # Errors
/// [`TrainingError::NoDryRuns`], and what is wrong with either kind of sets.
pub fn check_dry_runs(
    config: &TrainingConfig,
    demonstrations: &[DemonstrationSet],
    dry_runs: &[DemonstrationSet],
) -> Result<usize, TrainingError> {
    let demonstrations = Dataset::new(demonstrations)?.seen_by(&config.cameras)?;
    let dry_runs = Dataset::new(dry_runs)?.seen_by(&config.cameras)?;
    usable(config, &demonstrations, &dry_runs)
}

fn usable(
    config: &TrainingConfig,
    demonstrations: &Dataset,
    dry_runs: &Dataset,
) -> Result<usize, TrainingError> {
    let landmarks = (config.landmarks.as_ref()).filter(|_| landmark_count(config) > 0);
    let landmarks = landmarks.ok_or_else(|| refuse("the model learns no landmarks"))?;
    let (camera, _) = carried_camera(demonstrations, landmarks)
        .ok_or_else(|| refuse("no camera of landmarks.robot is on the gripper"))?;
    if !dry_runs.cameras().contains(camera) {
        let CameraSpec {
            name,
            height,
            width,
        } = camera;
        return Err(refuse(&format!(
            "the demonstrations have a camera '{name}' of {height}x{width}, and they do not"
        )));
    }
    let empty = empty_states(dry_runs, &config.imitation).len();
    if empty == 0 {
        return Err(refuse(
            "the gripper never closes in them, or every closing reached a subgoal",
        ));
    }
    Ok(empty)
}

impl TrainedModel {
    /// Learns anew to tell an empty gripper from a full one: from the demonstrations that the model was trained on, and
    /// from dry runs, in which somebody went through the motions and every closing that reached no subgoal closed on
    /// nothing. Demonstrations alone show an empty gripper only beside the thing that it missed. The networks stay as
    /// they are. Returns how many states of the dry runs show a gripper that is closed on nothing.
    ///
    /// # Errors
    /// [`TrainingError::NoDryRuns`] where nothing can be learnt of them, and what is wrong with either kind of sets.
    pub fn learn_empty_gripper(
        &mut self,
        demonstrations: &[DemonstrationSet],
        dry_runs: &[DemonstrationSet],
    ) -> Result<usize, TrainingError> {
        let (Some(landmarks), Some(book)) = (&self.config.landmarks, &mut self.landmarks) else {
            return Err(refuse("the model learns no landmarks"));
        };
        let demonstrations = Dataset::new(demonstrations)?.seen_by(&self.config.cameras)?;
        let dry_runs = Dataset::new(dry_runs)?.seen_by(&self.config.cameras)?;
        let empty = usable(&self.config, &demonstrations, &dry_runs)?;
        let imitation = &self.config.imitation;
        let learnt = grasp_sense(&demonstrations, Some(&dry_runs), landmarks, imitation);
        book.grasp = Some(learnt.ok_or_else(|| {
            refuse("the demonstrations never show an open gripper, or one that holds something, or all show too few closed on nothing")
        })?);
        Ok(empty)
    }
}
