use std::collections::BTreeMap;
use std::sync::Arc;

use super::{CameraSpec, Image, TrajectoryError};

/// One image from each camera, taken at the same moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Observation {
    images: BTreeMap<String, Image>,
}

impl Observation {
    /// An observation of the named cameras; a name given twice keeps the last image.
    #[must_use]
    pub fn new(images: impl IntoIterator<Item = (String, Image)>) -> Self {
        Self {
            images: images.into_iter().collect(),
        }
    }

    /// The image of one camera.
    ///
    /// # Errors
    /// [`TrajectoryError::CameraMissing`] when there is no camera of that name.
    pub fn image(&self, camera: &str) -> Result<&Image, TrajectoryError> {
        self.images
            .get(camera)
            .ok_or_else(|| TrajectoryError::CameraMissing {
                wanted: camera.to_owned(),
                present: self.images.keys().cloned().collect::<Vec<_>>().join(", "),
            })
    }

    /// The images of these cameras alone, each in the size of its camera by [`Image::resized`]: what a model
    /// with these cameras sees.
    ///
    /// # Errors
    /// [`TrajectoryError::CameraMissing`] when one of them is not there.
    pub fn fitted(&self, cameras: &[CameraSpec]) -> Result<Self, TrajectoryError> {
        let images = cameras.iter().map(|camera| {
            let image = self.image(&camera.name)?;
            Ok((
                camera.name.clone(),
                image.resized(camera.height, camera.width),
            ))
        });
        images.collect::<Result<Vec<_>, _>>().map(Self::new)
    }

    /// All cameras with their images, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Image)> {
        self.images.iter().map(|(n, i)| (n.as_str(), i))
    }

    /// Names and sizes of the cameras, by name.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraSpec> {
        self.iter()
            .map(|(name, image)| CameraSpec {
                name: name.to_owned(),
                height: image.height(),
                width: image.width(),
            })
            .collect()
    }
}

/// What the network sees of one moment: the last few observations, oldest first
/// (Fu & Finn, section IV-B: the last two frames).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    frames: Vec<Arc<Observation>>,
}

impl State {
    /// The state at the end of a history (oldest first), `stack` frames deep.
    ///
    /// A history shorter than `stack` is filled up by repeating its oldest observation, so the first
    /// state of an episode is that observation twice.
    ///
    /// # Panics
    /// If the history is empty or `stack` is 0.
    #[must_use]
    pub fn from_history(history: &[Arc<Observation>], stack: usize) -> Self {
        assert!(
            !history.is_empty() && stack > 0,
            "a state needs an observation"
        );
        let frames = (0..stack)
            .rev()
            .map(|back| Arc::clone(&history[(history.len() - 1).saturating_sub(back)]))
            .collect();
        Self { frames }
    }

    /// The stacked observations, oldest first.
    #[must_use]
    pub fn frames(&self) -> &[Arc<Observation>] {
        &self.frames
    }

    /// The newest observation.
    ///
    /// # Panics
    /// Never: a state has at least one frame.
    #[must_use]
    pub fn newest(&self) -> &Observation {
        self.frames.last().expect("a state has a frame")
    }
}
