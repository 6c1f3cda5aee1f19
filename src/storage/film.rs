//! The decoded images of one camera.

use std::path::Path;

use rayon::prelude::*;

use super::align::{Alignment, align};
use super::decode::decode_image;
use super::layout::CameraTopic;
use super::scan::seconds_between;
use super::{Loss, StorageError};
use crate::trajectory::Image;

/// The images of a camera, of which only those are decoded that a step needs.
pub(super) struct Film<'a> {
    camera: &'a CameraTopic<'a>,
    frames: Vec<Frame<'a>>,
    undecodable: Vec<String>,
}

struct Frame<'a> {
    nanos: u64,
    message: &'a [u8],
    image: Option<Image>,
}

impl<'a> Film<'a> {
    pub fn new(camera: &'a CameraTopic<'a>) -> Self {
        let frames = camera
            .scan
            .kept
            .iter()
            .map(|(nanos, message)| Frame {
                nanos: *nanos,
                message,
                image: None,
            })
            .collect();
        Self {
            camera,
            frames,
            undecodable: Vec::new(),
        }
    }

    /// Aligns the films with the actions and decodes what the steps need; an image that cannot be
    /// decoded counts as not recorded, so that the one before it takes its place.
    pub fn develop(films: &mut [Self], action_times: &[u64]) -> Alignment {
        loop {
            let times: Vec<_> = films
                .iter()
                .map(|film| film.frames.iter().map(|f| f.nanos).collect())
                .collect();
            let alignment = align(action_times, &times);
            let mut complete = true;
            for (film, needed) in films.iter_mut().zip(&alignment.images) {
                complete &= film.decode(needed);
            }
            if complete {
                return alignment;
            }
        }
    }

    /// Decodes the frames at these indices and removes those that fail; whether none did.
    fn decode(&mut self, needed: &[usize]) -> bool {
        let mut wanted = vec![false; self.frames.len()];
        for frame in needed {
            wanted[*frame] = true;
        }
        let format = self.camera.format;
        let failures: Vec<_> = self
            .frames
            .par_iter_mut()
            .zip(wanted)
            .map(|(frame, wanted)| {
                if !wanted || frame.image.is_some() {
                    return None;
                }
                match decode_image(format, frame.message) {
                    Ok(image) => {
                        frame.image = Some(image);
                        None
                    }
                    Err(reason) => Some(reason),
                }
            })
            .collect();
        let mut failed = failures.iter().map(Option::is_some);
        self.frames.retain(|_| !failed.next().unwrap_or(false));
        let before = self.undecodable.len();
        self.undecodable.extend(failures.into_iter().flatten());
        self.undecodable.len() == before
    }

    /// The camera's name.
    pub fn name(&self) -> &str {
        &self.camera.name
    }

    /// A frame that [`develop`](Self::develop) found to be needed.
    pub fn image(&self, frame: usize) -> &Image {
        self.frames[frame]
            .image
            .as_ref()
            .expect("needed frames are decoded")
    }

    /// Checks that all decoded images have the size of the first.
    pub fn check_sizes(&self, path: &Path, start_nanos: u64) -> Result<(), StorageError> {
        let size = |image: &Image| (image.height(), image.width());
        let first = size(&self.camera.first);
        let other = self
            .frames
            .iter()
            .filter_map(|f| Some((f.nanos, size(f.image.as_ref()?))))
            .find(|(_, found)| *found != first);
        match other {
            None => Ok(()),
            Some((nanos, found)) => Err(StorageError::SizeChanges {
                path: path.to_owned(),
                camera: self.camera.name.clone(),
                topic: self.camera.scan.channel.topic.clone(),
                first,
                other: found,
                at_secs: seconds_between(start_nanos, nanos),
            }),
        }
    }

    /// What could not be decoded.
    pub fn loss(&self) -> Option<Loss> {
        Some(Loss::UndecodableImages {
            topic: self.camera.scan.channel.topic.clone(),
            images: self.undecodable.len(),
            reason: self.undecodable.first()?.clone(),
        })
    }
}
