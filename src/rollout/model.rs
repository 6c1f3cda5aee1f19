use std::fmt;

use crate::model::{Encoder, LandmarkBook, LocalPolicy, Traversability};

/// The parts of a learned model that a [`Monitor`](super::Monitor) asks: it watches, so it needs no policy.
#[derive(Clone, Copy)]
pub struct MonitorModel<'a> {
    /// Images to latents.
    pub encoder: &'a (dyn Encoder + Sync),
    /// Steps between states.
    pub traversability: &'a (dyn Traversability + Sync),
    /// What is known of landmarks, of which a monitor takes what tells the gripper's state; `None` goes without. It
    /// must have been written with the encoder.
    pub landmarks: Option<&'a LandmarkBook>,
}

/// The parts of a learned model; one object often is all of them.
#[derive(Clone, Copy)]
pub struct RolloutModel<'a> {
    /// Images to latents.
    pub encoder: &'a (dyn Encoder + Sync),
    /// Steps between states.
    pub traversability: &'a (dyn Traversability + Sync),
    /// Actions towards a goal state.
    pub policy: &'a (dyn LocalPolicy + Sync),
    /// What is known of landmarks that the encoder tells, if it tells any. It must belong to the encoder's latents
    /// and cameras, as [`LandmarkBook::misfit`] tells; that of a [loaded model](crate::inference::Model::landmarks)
    /// does.
    pub landmarks: Option<&'a LandmarkBook>,
}

impl<'a> From<RolloutModel<'a>> for MonitorModel<'a> {
    fn from(model: RolloutModel<'a>) -> Self {
        Self {
            encoder: model.encoder,
            traversability: model.traversability,
            landmarks: model.landmarks,
        }
    }
}

impl fmt::Debug for MonitorModel<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MonitorModel")
            .field("spec", self.encoder.spec())
            .field("has_landmarks", &self.landmarks.is_some())
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for RolloutModel<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RolloutModel")
            .field("spec", self.encoder.spec())
            .field("has_landmarks", &self.landmarks.is_some())
            .finish_non_exhaustive()
    }
}
