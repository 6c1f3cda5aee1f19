//! `meta/info.json`.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::names::Names;
use super::{INFO, StorageError, fault};
use crate::wording;

/// Metadata beyond this is no metadata; that of 100,000 episodes has a tenth of it.
pub(super) const MAX_META_BYTES: u64 = 256 << 20;
/// No robot records faster.
pub(super) const MAX_FPS: f64 = 10_000.0;

/// Which layout the files have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Version {
    /// A file an episode, metadata as JSON lines.
    Two,
    /// Several episodes a file, metadata as Parquet.
    Three,
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct Info {
    pub codebase_version: String,
    #[serde(default)]
    pub robot_type: Option<String>,
    pub fps: f64,
    #[serde(default = "thousand")]
    pub chunks_size: u64,
    pub data_path: String,
    #[serde(default)]
    pub video_path: Option<String>,
    pub features: BTreeMap<String, Feature>,
    #[serde(skip)]
    pub version: Option<Version>,
}

fn thousand() -> u64 {
    1000
}

/// A column of the frames.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Feature {
    pub dtype: String,
    pub shape: Vec<u64>,
    #[serde(default)]
    pub names: Names,
    /// What is said of a video or of a depth map, under the name that it has now and the one that it had.
    #[serde(default)]
    pub info: Value,
    #[serde(default)]
    pub video_info: Value,
}

/// The column of actions.
pub(super) const ACTION: &str = "action";

impl Info {
    pub fn load(root: &Path) -> Result<Self, StorageError> {
        let path = root.join(INFO);
        let text = read_text(&path)?;
        let mut info: Self = serde_json::from_str(&text).map_err(|e| {
            let help = "This is not what LeRobot writes: fetch or write the file again";
            fault(&path, format!("{e}. {help}"))
        })?;
        info.check().map_err(|reason| fault(&path, reason))?;
        Ok(info)
    }

    fn check(&mut self) -> Result<(), String> {
        let number = self.codebase_version.trim_start_matches('v');
        self.version = Some(match number.split('.').next() {
            Some("2") => Version::Two,
            Some("3") => Version::Three,
            _ => {
                return Err(format!(
                    "codebase_version is '{}'; versions 2.x and 3.x are read. Convert the dataset with the scripts \
                     of the package lerobot",
                    self.codebase_version
                ));
            }
        });
        if !(self.fps > 0.0 && self.fps <= MAX_FPS) {
            return Err(format!(
                "fps is {}; it is the number of frames a second, above 0 and at most {MAX_FPS}",
                self.fps
            ));
        }
        if self.chunks_size == 0 {
            return Err(
                "chunks_size is 0; it is the number of files a folder, usually 1000".to_owned(),
            );
        }
        if self.cameras().next().is_none() {
            return Err(format!(
                "no feature has dtype 'image' or 'video'; the features are {}",
                listed(self.features.keys())
            ));
        }
        Ok(())
    }

    /// The features that hold images, with whether they are videos.
    pub fn cameras(&self) -> impl Iterator<Item = (&str, &Feature, bool)> {
        self.features
            .iter()
            .filter_map(|(key, feature)| match feature.dtype.as_str() {
                "image" => Some((key.as_str(), feature, false)),
                "video" => Some((key.as_str(), feature, true)),
                _ => None,
            })
    }
}

impl Feature {
    /// Names of the values of an action; `action_0` and so on where there are none that fit.
    pub fn action_names(&self) -> Vec<String> {
        let count = self.shape.first().map_or(0, |n| *n as usize);
        let names = self.names.0.clone();
        let mut distinct = names.clone();
        distinct.sort();
        distinct.dedup();
        if names.len() == count && distinct.len() == count {
            names
        } else {
            (0..count).map(|i| format!("action_{i}")).collect()
        }
    }

    /// Why the feature cannot hold actions, if it cannot.
    pub fn check_action(&self, key: &str) -> Result<(), String> {
        const MAX_DIMENSIONS: u64 = 4096;
        let number = [
            "float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "bool",
        ];
        if !number.contains(&self.dtype.as_str()) {
            return Err(format!(
                "the feature '{key}' has dtype '{}'; an action must be numbers, such as float32",
                self.dtype
            ));
        }
        match self.shape.as_slice() {
            [n] if (1..=MAX_DIMENSIONS).contains(n) => Ok(()),
            other => Err(format!(
                "the feature '{key}' has shape {other:?}; an action must be one list of 1 to {MAX_DIMENSIONS} numbers, \
                 such as [7]"
            )),
        }
    }

    /// Whether it holds images, one by one or as videos.
    pub fn holds_images(&self) -> bool {
        matches!(self.dtype.as_str(), "image" | "video")
    }

    /// Rows, columns and channels of an image: of the two layouts the one that its names say, else the one that
    /// has few channels.
    pub fn image_shape(&self) -> Option<[u64; 3]> {
        let [a, b, c] = match self.shape.as_slice() {
            [rows, columns] => return Some([*rows, *columns, 1]),
            [a, b, c] => [*a, *b, *c],
            _ => return None,
        };
        let channels_first = match self.names.0.first().map(String::as_str) {
            Some("channel" | "channels" | "c") => true,
            Some(_) => false,
            None => a <= 4 && c > 4,
        };
        Some(if channels_first { [b, c, a] } else { [a, b, c] })
    }

    /// Rows and columns of an image.
    pub fn image_size(&self) -> Option<(u32, u32)> {
        let [height, width, _] = self.image_shape()?;
        Some((u32::try_from(height).ok()?, u32::try_from(width).ok()?))
    }
}

pub(super) fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    const SHOWN: usize = 14;
    let all = wording::listed(names, SHOWN);
    if all.is_empty() {
        "none".to_owned()
    } else {
        all
    }
}

/// A file of metadata as text.
pub(super) fn read_text(path: &Path) -> Result<String, StorageError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|f| f.take(MAX_META_BYTES + 1).read_to_end(&mut bytes))
        .map_err(StorageError::io("read", path))?;
    if bytes.len() as u64 > MAX_META_BYTES {
        let reason = format!("the file is larger than {} MiB", MAX_META_BYTES >> 20);
        return Err(fault(path, reason));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        fault(path, format!("byte {at} is no UTF-8 text"))
    })
}
