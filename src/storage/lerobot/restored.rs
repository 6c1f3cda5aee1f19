//! `meta/catena.json`: what recordings of ours say that a LeRobot dataset has no place for.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::info::read_text;
use super::{StorageError, fault};
use crate::trajectory::{ActionSpace, Marker};

pub(super) const FILE: &str = "meta/catena.json";
const FORMAT_VERSION: u32 = 1;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Restored {
    format_version: u32,
    /// What the actions mean; motion primitives are columns of ones and zeros in the dataset.
    pub action_space: ActionSpace,
    /// By their numbers.
    pub episodes: BTreeMap<u64, RestoredEpisode>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RestoredEpisode {
    /// What the recording was called.
    pub id: String,
    pub task: String,
    /// Times of the steps, where they are not regular.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times_secs: Option<Vec<f64>>,
    pub markers: Vec<Marker>,
    pub metadata: BTreeMap<String, String>,
}

impl Restored {
    pub fn new(action_space: ActionSpace) -> Self {
        Self {
            format_version: FORMAT_VERSION,
            action_space,
            episodes: BTreeMap::new(),
        }
    }

    pub fn load(root: &Path) -> Result<Option<Self>, StorageError> {
        let path = root.join(FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        let restored: Self = serde_json::from_str(&text).map_err(|e| {
            let help = "Write the dataset again with `catena convert`, or remove this file to do without it";
            fault(&path, format!("{e}. {help}"))
        })?;
        if restored.format_version != FORMAT_VERSION {
            let reason = format!(
                "it has format version {}, this program reads {FORMAT_VERSION}: write the dataset again",
                restored.format_version
            );
            return Err(fault(&path, reason));
        }
        Ok(Some(restored))
    }

    pub fn episode(&self, index: u64) -> Option<&RestoredEpisode> {
        self.episodes.get(&index)
    }
}
