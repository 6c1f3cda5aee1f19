//! What practice with the gripper teaches: what an empty one looks like wherever a run may carry it, and one that holds
//! a thing oddly.

use super::grasps::{Carried, Classes, all_shown, carried_camera, practised, sense_of};
use super::landmark_count;
use crate::model::LandmarkBook;
use crate::training::{Dataset, TrainingConfig, TrainingError};
use crate::trajectory::{CameraSpec, DemonstrationSet};

/// Recordings from which only the sense of grasps learns ([`GraspSense`](crate::model::GraspSense)), a set a task. A
/// closing of the gripper after which a subgoal was reached holds what the task is about, any other holds nothing. Of
/// their cameras the one on the gripper is used.
///
/// Demonstrations alone show an empty gripper only beside the thing that it missed, and things only as a practised
/// person takes them. In a *dry run* somebody goes through the motions of a task and closes the gripper beside
/// everything that lies loose; in an *askew run* things are taken too far in front, too far back or aside.
#[derive(Clone, Copy, Debug)]
pub struct GripperPractice<'a> {
    /// The recordings, by task.
    pub runs: &'a [DemonstrationSet],
    /// What the model was trained on.
    pub demonstrations: &'a [DemonstrationSet],
}

/// How many states of practice show what, of those that teach something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Practised {
    /// A gripper that is closed on nothing.
    pub empty: usize,
    /// One that holds something, in tasks whose demonstrations hold something.
    pub held: usize,
}

const TOO_FEW: &str = "of open grippers, of empty ones and of ones that hold something, the recordings never show one \
     kind, or too few";

fn refuse(reason: &str) -> TrainingError {
    let reason = reason.to_owned();
    TrainingError::NoPractice { reason }
}

impl GripperPractice<'_> {
    /// Refuses practice from which a model of that configuration can learn nothing.
    ///
    /// # Errors
    /// [`TrainingError::NoPractice`], and what is wrong with either kind of sets.
    pub fn check(&self, config: &TrainingConfig) -> Result<Practised, TrainingError> {
        let [demonstrations, runs] = self.read(config)?;
        Ok(usable(config, &demonstrations, &runs)?.practised)
    }

    /// Learns the sense of grasps anew, from the demonstrations and from practice, and puts it into what is known of a
    /// model's landmarks. The networks stay as they are.
    ///
    /// # Errors
    /// [`TrainingError::NoPractice`] where nothing can be learnt of it, and what is wrong with either kind of sets.
    pub fn teach(
        &self,
        config: &TrainingConfig,
        book: Option<&mut LandmarkBook>,
    ) -> Result<Practised, TrainingError> {
        let (Some(_), Some(book)) = (&config.landmarks, book) else {
            return Err(refuse("the model learns no landmarks"));
        };
        let [demonstrations, runs] = self.read(config)?;
        let usable = usable(config, &demonstrations, &runs)?;
        let learnt = sense_of(usable.carried, usable.classes);
        book.grasp = Some(learnt.ok_or_else(|| refuse(TOO_FEW))?);
        Ok(usable.practised)
    }

    /// Demonstrations as the model sees them, and practice, of which the camera on the gripper is enough.
    fn read(&self, config: &TrainingConfig) -> Result<[Dataset; 2], TrainingError> {
        let runs = Dataset::new(self.runs).map_err(|error| match error {
            TrainingError::TooFewDemonstrations { .. } => {
                refuse("it holds fewer than two recordings")
            }
            error => error,
        });
        let demonstrations = Dataset::new(self.demonstrations)?.seen_by(&config.cameras)?;
        Ok([demonstrations, runs?])
    }
}

/// Practice from which something can be learnt, with the demonstrations.
struct Usable<'a> {
    practised: Practised,
    carried: Carried<'a>,
    classes: Classes<'a>,
}

fn usable<'a>(
    config: &TrainingConfig,
    demonstrations: &'a Dataset,
    runs: &'a Dataset,
) -> Result<Usable<'a>, TrainingError> {
    let landmarks = (config.landmarks.as_ref()).filter(|_| landmark_count(config) > 0);
    let landmarks = landmarks.ok_or_else(|| refuse("the model learns no landmarks"))?;
    let carried = carried_camera(demonstrations, landmarks);
    let carried =
        carried.ok_or_else(|| refuse("no camera of landmarks.robot is on the gripper"))?;
    let camera = carried.0;
    if !runs.cameras().contains(camera) {
        let CameraSpec {
            name,
            height,
            width,
        } = camera;
        return Err(refuse(&format!(
            "the demonstrations have a camera '{name}' of {height}x{width}, and it does not"
        )));
    }
    let known = demonstrations.tasks();
    if let Some(other) = runs.tasks().iter().find(|task| !known.contains(task)) {
        return Err(refuse(&format!(
            "'{other}' is none of the tasks that are demonstrated ({}): give a folder of each task, named like it",
            known.join(", ")
        )));
    }
    let shown = practised(runs, &config.imitation);
    let empty = shown.empty.len();
    let held: Vec<usize> = shown.held.iter().map(Vec::len).collect();
    if empty + held.iter().sum::<usize>() == 0 {
        return Err(refuse("the gripper never closes in it"));
    }
    let classes = all_shown(demonstrations, Some((runs, shown)), &config.imitation);
    let classes = classes.ok_or_else(|| refuse(TOO_FEW))?;
    let of_things = (runs.tasks().iter().zip(held)).filter(|(task, _)| classes.1.contains(task));
    let practised = Practised {
        empty,
        held: of_things.map(|(_, held)| held).sum(),
    };
    if practised.empty + practised.held == 0 {
        return Err(refuse(
            "it shows nothing but grippers that hold something, in tasks whose demonstrations never do",
        ));
    }
    Ok(Usable {
        practised,
        carried,
        classes,
    })
}
