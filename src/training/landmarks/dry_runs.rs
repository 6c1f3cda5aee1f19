//! What dry runs teach: an empty gripper, wherever a run may carry one.

use super::grasps::{carried_camera, empty_states, grasp_sense};
use crate::training::{Dataset, TrainedModel, TrainingError};
use crate::trajectory::{CameraSpec, DemonstrationSet};

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
        let refuse = |reason: String| TrainingError::NoDryRuns { reason };
        let (Some(config), Some(book)) = (&self.config.landmarks, &mut self.landmarks) else {
            return Err(refuse("the model learns no landmarks".to_owned()));
        };
        let shown = Dataset::new(demonstrations)?.seen_by(&self.config.cameras)?;
        let runs = Dataset::new(dry_runs)?.seen_by(&self.config.cameras)?;
        let Some((camera, _)) = carried_camera(&shown, config) else {
            return Err(refuse(
                "no camera of landmarks.robot is on the gripper".to_owned(),
            ));
        };
        if !runs.cameras().contains(camera) {
            let CameraSpec {
                name,
                height,
                width,
            } = camera;
            return Err(refuse(format!(
                "the demonstrations have a camera '{name}' of {height}x{width}, and they do not"
            )));
        }
        let imitation = &self.config.imitation;
        let empty = empty_states(&runs, imitation).len();
        if empty == 0 {
            return Err(refuse(
                "the gripper never closes in them, or every closing reached a subgoal".to_owned(),
            ));
        }
        let learnt = grasp_sense(&shown, Some(&runs), config, imitation);
        book.grasp = Some(learnt.ok_or_else(|| {
            refuse("the demonstrations never show an open gripper, or one that holds something, or all show too few closed on nothing".to_owned())
        })?);
        Ok(empty)
    }
}
