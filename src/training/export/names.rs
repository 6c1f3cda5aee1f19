//! What a network's file calls its inputs and outputs.

use crate::training::TrainingError;
use crate::trajectory::CameraSpec;

/// The output of an encoder, whose inputs are called like the cameras.
pub const LATENT: &str = "latent";

/// Refuses a camera that an encoder's file cannot have as an input, before a training whose model nobody could load.
///
/// # Errors
/// [`TrainingError::CameraNameTaken`].
pub fn check_camera_names(cameras: &[CameraSpec]) -> Result<(), TrainingError> {
    if cameras.iter().any(|camera| camera.name == LATENT) {
        return Err(TrainingError::CameraNameTaken {
            camera: LATENT.to_owned(),
        });
    }
    Ok(())
}
