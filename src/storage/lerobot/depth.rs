//! Features that are depth maps and no cameras.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use super::dataset::Dataset;
use super::frames::{Picture, Table, pictures};
use super::info::Feature;
use super::template::inside;
use crate::storage::depth::depths_in;
use crate::storage::topic::ImageFormat;

/// What a feature is taken for a depth map by.
pub(super) struct Depth {
    /// In words.
    pub told_by: String,
    /// Else a mapping file that names it as a camera knows better.
    pub is_sure: bool,
}

impl Depth {
    /// By what a picture of the feature holds.
    pub fn seen(told_by: &str) -> Self {
        Self {
            told_by: told_by.to_owned(),
            is_sure: true,
        }
    }

    /// By what the metadata says. That it is none is said of most depth maps, too, and means nothing.
    pub fn said(feature: &Feature) -> Option<Self> {
        let says_so = |info: &Value| {
            let keys = ["is_depth_map", "video.is_depth_map"].into_iter();
            keys.filter_map(|key| info.get(key))
                .any(|said| said.as_bool() == Some(true))
        };
        let is_said =
            feature.dtype == "depth" || says_so(&feature.info) || says_so(&feature.video_info);
        is_said.then(|| Self::seen("info.json says that it is a depth map"))
    }

    /// By the name of a feature, or by its shape.
    pub fn guessed(key: &str, feature: &Feature) -> Option<Self> {
        let seems = match feature.image_shape()? {
            _ if is_called_so(key) => "it is called a depth map",
            [_, _, 1] if feature.dtype == "video" => "it is a video of one channel, as of depths",
            _ => return None,
        };
        let has_pictures = feature.holds_images();
        let told_by = if has_pictures {
            format!("{seems}; a mapping file may name it as a camera")
        } else {
            format!("{seems}, and its dtype is '{}'", feature.dtype)
        };
        Some(Self {
            told_by,
            is_sure: !has_pictures,
        })
    }
}

/// Whether `depth` is a word of a name, as in `observation.images.head_depth`.
fn is_called_so(key: &str) -> bool {
    let words = key.split(|c: char| !c.is_ascii_alphabetic());
    let mut words = words.map(str::to_ascii_lowercase);
    words.any(|word| matches!(word.as_str(), "depth" | "depths" | "depthmap"))
}

/// The columns of pictures of which the first that is there holds depths, with how that is told. Of a table that cannot
/// be read nothing is known; who reads the frames is told.
pub(super) fn columns_of_depths(dataset: &Dataset) -> BTreeMap<String, String> {
    let cameras = dataset.info.cameras();
    let columns = cameras.filter(|(_, _, is_video)| !is_video);
    let mut columns = columns.map(|(key, _, _)| key).peekable();
    let first = dataset
        .episodes
        .first()
        .filter(|_| columns.peek().is_some());
    let table = first.and_then(|e| Table::open(&dataset.root.join(&e.data)).ok());
    let Some(table) = table else {
        return BTreeMap::new();
    };
    let held = |key: &str| depths_in(ImageFormat::File, &first_picture(dataset, &table, key)?);
    columns
        .filter_map(|key| Some((key.to_owned(), held(key)?)))
        .collect()
}

fn first_picture(dataset: &Dataset, table: &Table, key: &str) -> Option<Vec<u8>> {
    const LOOKED_AT: usize = 8;
    let rows = 0..table.rows().min(LOOKED_AT);
    let batches = table.read(&[key.to_owned()], Some(rows)).ok()?;
    batches.map_while(Result::ok).find_map(|batch| {
        let looked_at = pictures(batch.column_by_name(key)?).ok()?;
        looked_at.into_iter().find_map(|picture| match picture {
            Picture::Bytes(bytes) => Some(bytes),
            Picture::Path(path) => fs::read(dataset.root.join(inside(&path).ok()?)).ok(),
            Picture::None => None,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(dtype: &str, shape: &str, more: &str) -> Feature {
        let text = format!("{{\"dtype\": \"{dtype}\", \"shape\": {shape}{more}}}");
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn metadata_says_what_is_a_depth_map_and_never_what_is_none() {
        let is_said = |more: &str| Depth::said(&feature("video", "[4, 6, 3]", more)).is_some();
        assert!(is_said(r#", "info": {"is_depth_map": true}"#));
        assert!(is_said(r#", "info": {"video.is_depth_map": true}"#));
        assert!(is_said(r#", "video_info": {"video.is_depth_map": true}"#));
        assert!(!is_said(r#", "info": {"video.is_depth_map": false}"#));
        assert!(!is_said(r#", "info": null"#) && !is_said(""));
        assert!(Depth::said(&feature("depth", "[4, 6, 1]", "")).is_some());
    }

    #[test]
    fn names_and_shapes_let_a_feature_seem_a_depth_map() {
        let is_sure = |key: &str, dtype: &str, shape: &str| {
            let guessed = Depth::guessed(key, &feature(dtype, shape, ""));
            guessed.map(|depth| depth.is_sure)
        };
        for key in [
            "observation.depth",
            "top_Depth",
            "depths.top",
            "images.depth2",
        ] {
            assert_eq!(is_sure(key, "video", "[4, 6, 3]"), Some(false), "{key}");
        }
        let depth = "observation.depth";
        assert_eq!(is_sure(depth, "uint16", "[480, 640]"), Some(true));
        assert_eq!(is_sure(depth, "float32", "[1]"), None, "of a gripper");
        let top = "observation.images.top";
        for shape in ["[480, 640, 1]", "[1, 480, 640]", "[480, 640]"] {
            assert_eq!(is_sure(top, "video", shape), Some(false), "{shape}");
            assert_eq!(is_sure(top, "image", shape), None, "it may be grey");
        }
        assert_eq!(is_sure("images.depthai_left", "video", "[4, 6, 3]"), None);
    }
}
