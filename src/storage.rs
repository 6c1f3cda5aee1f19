//! Files: demonstrations as MCAP recordings and LeRobot datasets, graphs as folders of Parquet tables,
//! digests that say which belong together.
//!
//! Whatever is written is written beside its place and renamed, so a killed process leaves either
//! the old file or the new one. Whatever is read is checked: chunk checksums of recordings, SHA-256
//! digests of tables; what is lost of a damaged recording is counted, never guessed.

mod action_message;
mod align;
mod bag;
mod build_folder;
mod cdr;
mod convert;
mod declared_space;
mod decode;
mod demonstrations;
mod depth;
mod digest;
mod ending;
mod episode;
mod error;
mod film;
#[cfg(test)]
mod fixtures;
mod graph_folder;
mod graph_images;
mod layout;
mod left_out;
mod lerobot;
mod manifest;
mod mapping;
mod messages;
mod nearest;
mod pixels;
mod place;
mod recording;
mod recordings;
mod replace;
mod report;
mod salvage;
mod scan;
mod schemas;
mod steps;
mod tables;
mod topic;
mod values;
mod view;

pub(crate) use bag::bag_in;
pub use build_folder::BuildFolder;
pub use convert::{Conversion, PictureFormat, convert_to_lerobot, convert_to_mcap};
pub use demonstrations::{demonstrations_digest, load_demonstrations, recording_files};
pub use digest::sha256_file;
pub(crate) use ending::is_mcap;
pub use episode::{EpisodeWriter, PRACTICE_NOTE, RecordingMetadata, write_trajectory};
pub use error::StorageError;
pub use graph_folder::{
    check_graph_files, check_graph_place, check_same_tasks, load_graph, load_manifest, save_graph,
    save_graph_with_images,
};
pub use graph_images::{GraphImage, GraphImages};
pub use manifest::{FileDigest, GraphManifest, GraphTask, ensure_same_model};
pub(crate) use mapping::MAX_BINS;
pub(crate) use nearest::nearest;
pub use place::what_would_be_lost;
pub use recording::{Recording, inspect, read_trajectory};
pub use recordings::Recordings;
pub use replace::write_file;
pub use report::{ActionReport, CameraReport, Loss, RecordingReport, TopicReport};
pub use values::read_values;
pub use view::{ImageSize, ReadOptions};
