//! The images of an episode, from its table or from videos.

use std::collections::BTreeMap;

use super::dataset::Camera;
use super::frames::{Picture, pictures};
use super::rows::Frames;
use super::template::inside;
use super::video::{Wanted, read_frames};
use super::{StorageError, fault};
use crate::storage::decode::decode_image;
use crate::storage::film::Film;
use crate::storage::topic::ImageFormat;
use crate::storage::view::View;

impl Frames<'_> {
    /// The images of the table, by column, of the rows that are wanted.
    pub(super) fn images(
        &self,
        cameras: &[Camera<'_>],
        wanted: &[bool],
    ) -> Result<BTreeMap<String, Vec<Picture>>, StorageError> {
        let keys: Vec<String> = cameras
            .iter()
            .filter(|c| !c.is_video)
            .map(|c| c.key.to_owned())
            .collect();
        let mut images: BTreeMap<String, Vec<Picture>> = BTreeMap::new();
        if keys.is_empty() {
            return Ok(images);
        }
        for batch in self.table.read(&keys, Some(self.rows.clone()))? {
            let batch = batch?;
            for key in &keys {
                let column = batch.column_by_name(key);
                let all = column.map_or(Err("is missing".to_owned()), pictures);
                let all =
                    all.map_err(|reason| fault(&self.path, format!("column '{key}' {reason}")))?;
                let taken = images.entry(key.clone()).or_default();
                for picture in all {
                    let is_wanted = wanted.get(taken.len()).copied().unwrap_or(false);
                    taken.push(if is_wanted { picture } else { Picture::None });
                }
            }
        }
        for picture in images.values_mut().flatten() {
            if let Picture::Path(path) = picture {
                *picture = Picture::Bytes(self.picture_file(path)?);
            }
        }
        Ok(images)
    }

    /// An image that lies beside the table.
    fn picture_file(&self, path: &str) -> Result<Vec<u8>, StorageError> {
        let inside = inside(path).map_err(|reason| fault(&self.path, reason))?;
        let path = self.dataset.root.join(inside);
        std::fs::read(&path).map_err(StorageError::io("read", &path))
    }

    pub(super) fn film<'f>(
        &self,
        camera: &Camera<'_>,
        pictures: Option<&'f Vec<Picture>>,
        wanted: &[bool],
        view: &'f View,
    ) -> Result<Film<'f>, StorageError> {
        let Some(pictures) = pictures else {
            return self.video_film(camera, wanted, view);
        };
        let given: Vec<(u64, &[u8])> = pictures
            .iter()
            .zip(&self.times)
            .filter_map(|(picture, nanos)| match picture {
                Picture::Bytes(bytes) => Some((*nanos, bytes.as_slice())),
                _ => None,
            })
            .collect();
        let sizes = given.iter().find_map(|(_, bytes)| {
            let image = decode_image(ImageFormat::File, bytes).ok()?;
            Some((image.height(), image.width()))
        });
        let Some(size) = sizes else {
            let reason = given.first().map_or_else(
                || "no row holds an image".to_owned(),
                |(_, bytes)| {
                    decode_image(ImageFormat::File, bytes)
                        .err()
                        .unwrap_or_default()
                },
            );
            return Err(StorageError::UnusableCameras {
                path: self.path.clone(),
                reasons: format!("column '{}': {reason}", camera.key),
            });
        };
        let rows = pictures.iter().zip(wanted).enumerate();
        let lacking = rows.filter(|(_, (picture, wanted))| **wanted && **picture == Picture::None);
        let lacking = lacking.map(|(row, _)| format!("row {row} of the episode holds no image"));
        let packing = (ImageFormat::File, size);
        let images = given.into_iter();
        let film = Film::of_messages(&camera.name, camera.key, packing, view, images);
        Ok(film.lacking(lacking.collect()))
    }

    fn video_film<'f>(
        &self,
        camera: &Camera<'_>,
        wanted: &[bool],
        view: &'f View,
    ) -> Result<Film<'f>, StorageError> {
        let part = self.episode.videos.get(camera.key).ok_or_else(|| {
            let reason = format!(
                "episode {} has no video of '{}'",
                self.episode.index, camera.key
            );
            fault(&self.dataset.root.join("meta"), reason)
        })?;
        let rows = (0..wanted.len()).filter(|row| wanted[*row]);
        let numbers: Vec<u64> = rows.clone().map(|row| self.numbers[row]).collect();
        let time_of: BTreeMap<u64, u64> = rows
            .map(|row| (self.numbers[row], self.times[row]))
            .collect();
        let mut images = Vec::new();
        let request = Wanted {
            root: &self.dataset.root,
            camera: &camera.name,
            part,
            fps: self.dataset.info.fps,
            frames: &numbers,
        };
        let why = read_frames(&request, |number, image| {
            if let Some(nanos) = time_of.get(&number) {
                images.push((*nanos, view.sized(&camera.name, image)));
            }
        })?;
        let missing = numbers.len() - images.len();
        let missing = why.map_or_else(Vec::new, |why| vec![why; missing]);
        Ok(Film::of_images(&camera.name, camera.key, view, images).lacking(missing))
    }
}
