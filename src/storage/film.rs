//! The decoded images of one camera.

use std::path::Path;

use rayon::prelude::*;

use super::align::{Alignment, align, missing_tail};
use super::decode::decode_image;
use super::layout::CameraTopic;
use super::scan::seconds_between;
use super::topic::ImageFormat;
use super::view::View;
use super::{Loss, StorageError};
use crate::trajectory::Image;

/// The images of a camera, of which only those are decoded that a step needs.
pub(super) struct Film<'a> {
    camera: String,
    /// Where they come from.
    topic: String,
    format: ImageFormat,
    view: &'a View,
    /// Rows and columns of the first image as recorded.
    recorded_size: (u32, u32),
    frames: Vec<Frame<'a>>,
    undecodable: Vec<String>,
}

struct Frame<'a> {
    nanos: u64,
    message: &'a [u8],
    image: Option<Shown>,
    is_damaged: bool,
}

/// An image in the size that is asked for.
struct Shown {
    image: Image,
    recorded_size: (u32, u32),
}

impl<'a> Film<'a> {
    /// The film of a camera topic.
    pub fn new(camera: &'a CameraTopic<'a>, view: &'a View) -> Self {
        let messages = camera.scan.kept.iter();
        Self::of_messages(
            &camera.name,
            &camera.scan.channel.topic,
            (camera.format, camera.recorded_size),
            view,
            messages.map(|(nanos, message)| (*nanos, message.as_slice())),
        )
    }

    /// A film of images that are still to be decoded, in order of time; `packing` is their format, and rows
    /// and columns of the first.
    pub fn of_messages(
        camera: &str,
        topic: &str,
        packing: (ImageFormat, (u32, u32)),
        view: &'a View,
        messages: impl Iterator<Item = (u64, &'a [u8])>,
    ) -> Self {
        let frame = |(nanos, message)| Frame {
            nanos,
            message,
            image: None,
            is_damaged: false,
        };
        Self {
            camera: camera.to_owned(),
            topic: topic.to_owned(),
            format: packing.0,
            view,
            recorded_size: packing.1,
            frames: messages.map(frame).collect(),
            undecodable: Vec::new(),
        }
    }

    /// A film of images that are decoded and sized already.
    pub fn of_images(camera: &str, topic: &str, view: &'a View, images: Vec<(u64, Image)>) -> Self {
        let recorded_size = images
            .first()
            .map_or((0, 0), |(_, i)| (i.height(), i.width()));
        let frame = |(nanos, image): (u64, Image)| Frame {
            nanos,
            message: &[],
            image: Some(Shown {
                recorded_size: (image.height(), image.width()),
                image,
            }),
            is_damaged: false,
        };
        Self {
            camera: camera.to_owned(),
            topic: topic.to_owned(),
            format: ImageFormat::File,
            view,
            recorded_size,
            frames: images.into_iter().map(frame).collect(),
            undecodable: Vec::new(),
        }
    }

    /// The film where other images should have been; `reasons` says why each of them is not there.
    pub fn lacking(mut self, reasons: Vec<String>) -> Self {
        self.undecodable = reasons;
        self
    }

    /// Whether the images that are not there, or cannot be decoded, leave none long before the last step, where that is
    /// not `told` already. The film is developed; times are in nanoseconds and sorted.
    pub fn stopped(&self, step_times: &[u64], told: &[Loss]) -> Option<Loss> {
        let is_of_this =
            |loss: &Loss| matches!(loss, Loss::CameraStopped { topic, .. } if *topic == self.topic);
        if self.undecodable.is_empty() || told.iter().any(is_of_this) {
            return None;
        }
        let shown = self.frames.iter().filter(|f| f.image.is_some());
        let times: Vec<u64> = shown.map(|f| f.nanos).collect();
        missing_tail(&times, step_times)?.stopped(&self.topic)
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

    /// Decodes the frames at these indices, which are in order, or the next one before each that can be decoded, and
    /// removes those that cannot; whether there were none.
    fn decode(&mut self, needed: &[usize]) -> bool {
        let (format, view, camera) = (self.format, self.view, self.camera.as_str());
        // Each stretch ends with a needed frame, so that no frame is tried twice.
        let mut stretches = Vec::new();
        let (mut rest, mut start) = (self.frames.as_mut_slice(), 0);
        for end in needed.iter().map(|last| last + 1) {
            if end > start {
                let (stretch, later) = rest.split_at_mut(end - start);
                stretches.push(stretch);
                (rest, start) = (later, end);
            }
        }
        let reasons: Vec<Vec<String>> = stretches
            .into_par_iter()
            .map(|stretch| {
                let mut reasons = Vec::new();
                for frame in stretch.iter_mut().rev() {
                    if frame.image.is_some() {
                        break;
                    }
                    match decode_image(format, frame.message) {
                        Ok(image) => {
                            frame.image = Some(Shown {
                                recorded_size: (image.height(), image.width()),
                                image: view.sized(camera, image),
                            });
                            break;
                        }
                        Err(reason) => {
                            frame.is_damaged = true;
                            reasons.push(reason);
                        }
                    }
                }
                reasons
            })
            .collect();
        self.frames.retain(|frame| !frame.is_damaged);
        let before = self.undecodable.len();
        self.undecodable.extend(reasons.into_iter().flatten());
        self.undecodable.len() == before
    }

    /// The camera's name.
    pub fn name(&self) -> &str {
        &self.camera
    }

    /// A frame that [`develop`](Self::develop) found to be needed.
    pub fn image(&self, frame: usize) -> &Image {
        let sized = self.frames[frame].image.as_ref();
        &sized.expect("needed frames are decoded").image
    }

    /// Checks that all decoded images have the size of the first.
    pub fn check_sizes(&self, path: &Path, start_nanos: u64) -> Result<(), StorageError> {
        let first = self.recorded_size;
        let other = self
            .frames
            .iter()
            .filter_map(|f| Some((f.nanos, f.image.as_ref()?.recorded_size)))
            .find(|(_, found)| *found != first);
        match other {
            None => Ok(()),
            Some((nanos, found)) => Err(StorageError::SizeChanges {
                path: path.to_owned(),
                camera: self.camera.clone(),
                topic: self.topic.clone(),
                first,
                other: found,
                at_secs: seconds_between(start_nanos, nanos),
            }),
        }
    }

    /// What could not be decoded.
    pub fn loss(&self) -> Option<Loss> {
        Some(Loss::UndecodableImages {
            topic: self.topic.clone(),
            images: self.undecodable.len(),
            reason: self.undecodable.first()?.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::fixtures::picture;
    use crate::storage::pixels::encode_png;

    /// Images at 0, 10, 20 and so on, of which those at these places are sound.
    fn images(count: usize, sound: &[usize]) -> Vec<(u64, Vec<u8>)> {
        let bytes = |i: usize| {
            if sound.contains(&i) {
                encode_png(&picture(4, 6, i)).unwrap()
            } else {
                b"x".repeat(10 + i)
            }
        };
        (0..count).map(|i| (10 * i as u64, bytes(i))).collect()
    }

    fn film<'a>(images: &'a [(u64, Vec<u8>)], view: &'a View) -> Film<'a> {
        let packing = (ImageFormat::File, (4, 6));
        let messages = images.iter().map(|(nanos, data)| (*nanos, data.as_slice()));
        Film::of_messages("top", "/camera/top", packing, view, messages)
    }

    #[test]
    fn all_damaged_images_before_a_needed_one_go_in_one_pass() {
        let view = View::default();
        let images = images(40, &[0]);
        let mut film = film(&images, &view);
        assert!(!film.decode(&[39]));
        assert_eq!(film.frames.len(), 1);
        assert_eq!(film.image(0), &picture(4, 6, 0));
        assert_eq!(film.undecodable.len(), 39);
        assert!(film.decode(&[0]));
    }

    #[test]
    fn each_step_shows_the_last_sound_image_and_others_are_not_looked_at() {
        let view = View::default();
        let images = images(12, &[1, 2, 7, 10]);
        let mut films = [film(&images, &view)];
        let alignment = Film::develop(&mut films, &[5, 20, 60, 80, 85]);
        let [film] = &films;
        // The first step has no sound image at or before it.
        assert_eq!(alignment.first_action, 1);
        let shown = alignment.images[0].iter().map(|i| film.frames[*i].nanos);
        assert_eq!(shown.collect::<Vec<_>>(), [20, 20, 70, 70]);
        for (shown, sound) in alignment.images[0].iter().zip([2, 2, 7, 7]) {
            assert_eq!(film.image(*shown), &picture(4, 6, sound));
        }
        // Those at 0, 30 to 60 and 80; the reason that is told is of the first that a step needs.
        assert_eq!(film.undecodable.len(), 6);
        let told = &film.undecodable[0];
        assert!(told.starts_with("10 bytes"), "{told}");
    }
}
