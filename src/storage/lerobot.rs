//! LeRobot datasets, versions 2.x and 3.0: a folder with `meta/info.json`, tables of frames as Parquet,
//! images in these tables or in videos.
//!
//! | | 2.x | 3.0 |
//! |---|---|---|
//! | episodes | `meta/episodes.jsonl` | `meta/episodes/*/*.parquet` |
//! | tasks | `meta/tasks.jsonl` | `meta/tasks.parquet` |
//! | frames | a file an episode | several episodes a file |
//! | videos | a file an episode and camera | several episodes a file |
//!
//! Of the frames the columns `action`, `timestamp`, `frame_index`, `episode_index` and the images are read. What
//! recordings of ours say besides (motion primitives, subgoals, success) is kept in `meta/catena.json`,
//! which other readers pass over.

mod dataset;
mod depth;
mod episode_rows;
mod episodes;
mod films;
mod frames;
mod info;
mod names;
mod read;
mod restored;
mod rows;
mod statistics;
mod template;
mod video;
mod write;

use std::path::Path;

use super::StorageError;

pub(super) use dataset::Dataset;
pub(super) use read::{inspect_episode, read_episode};
pub(super) use write::DatasetWriter;
pub use write::PictureFormat;

/// The file that makes a folder a dataset.
const INFO: &str = "meta/info.json";

/// Whether a folder is a dataset.
pub(super) fn is_dataset(folder: &Path) -> bool {
    folder.join(INFO).is_file()
}

fn fault(path: &Path, reason: impl Into<String>) -> StorageError {
    StorageError::Dataset {
        path: path.to_owned(),
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests;
