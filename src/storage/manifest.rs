use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::replace::write_file;
use super::{StorageError, sha256_file};
use crate::graph::{ScoringReport, TopologicalGraph};
use crate::task::{Subgoal, SubgoalRule, Task};

/// Version of the folder's format; another one is refused.
const FORMAT_VERSION: u32 = 1;
/// The manifest's name in a graph folder.
pub(super) const FILE_NAME: &str = "manifest.json";

/// What a graph was made from and which files hold it: `manifest.json` of a graph folder.
///
/// Made by [`new`](Self::new); what says how large the graph is and how its files are digested is filled
/// in when it is saved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraphManifest {
    /// Version of the folder's format.
    pub format_version: u32,
    /// Version of the program that wrote it.
    pub catena_version: String,
    /// The tasks that the demonstrations show.
    pub tasks: Vec<GraphTask>,
    /// Digest of the model that made the latents and the learned edges.
    pub model_digest: String,
    /// Digest of the demonstrations ([`demonstrations_digest`](super::demonstrations_digest)).
    pub demonstrations_digest: String,
    /// The options that the graph was built with.
    pub build_options: serde_json::Value,
    /// How its subgoals were found in the demonstrations, where the program wrote that down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subgoal_rules: Option<Vec<SubgoalRule>>,
    /// What the learned edges took, where the program wrote that down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scoring: Option<ScoringReport>,
    /// Number of traversability classes.
    pub d_max: usize,
    /// Values in a latent.
    pub latent_dim: usize,
    /// Number of nodes.
    pub node_count: usize,
    /// Number of edges of all kinds.
    pub edge_count: usize,
    /// The other files of the folder by name.
    pub files: BTreeMap<String, FileDigest>,
}

/// A task of a graph with its subgoals.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraphTask {
    /// The task's name.
    pub name: String,
    /// Names of its subgoals, in the order in which they must be reached.
    pub subgoals: Vec<String>,
}

/// What a file must be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileDigest {
    /// SHA-256 of its bytes, 64 hexadecimal digits.
    pub sha256: String,
    /// Its length.
    pub bytes: u64,
}

impl GraphManifest {
    /// A manifest that is not saved yet. `build_options` is whatever the graph was built with, as JSON.
    #[must_use]
    pub fn new(
        tasks: &[Task],
        model_digest: impl Into<String>,
        demonstrations_digest: impl Into<String>,
        build_options: serde_json::Value,
    ) -> Self {
        Self {
            format_version: FORMAT_VERSION,
            catena_version: env!("CARGO_PKG_VERSION").to_owned(),
            tasks: tasks.iter().map(GraphTask::from).collect(),
            model_digest: model_digest.into(),
            demonstrations_digest: demonstrations_digest.into(),
            build_options,
            subgoal_rules: None,
            scoring: None,
            d_max: 0,
            latent_dim: 0,
            node_count: 0,
            edge_count: 0,
            files: BTreeMap::new(),
        }
    }

    /// The same manifest with the sizes of `graph` and the digests of the named files of `folder`.
    pub(super) fn completed(
        &self,
        folder: &Path,
        graph: &TopologicalGraph,
        names: &[&str],
    ) -> Result<Self, StorageError> {
        let mut files = BTreeMap::new();
        for name in names {
            let path = folder.join(name);
            let bytes = fs::metadata(&path)
                .map_err(StorageError::io("read", &path))?
                .len();
            let sha256 = sha256_file(&path)?;
            files.insert((*name).to_owned(), FileDigest { sha256, bytes });
        }
        Ok(Self {
            d_max: graph.d_max(),
            latent_dim: graph.latents().dim(),
            node_count: graph.node_count(),
            edge_count: graph.edge_count(),
            files,
            ..self.clone()
        })
    }

    pub(super) fn save(&self, folder: &Path) -> Result<(), StorageError> {
        write_file(&folder.join(FILE_NAME), |file| {
            serde_json::to_writer_pretty(&mut *file, self).map_err(io::Error::from)?;
            file.write_all(b"\n")
        })
    }

    pub(super) fn load(folder: &Path) -> Result<Self, StorageError> {
        #[derive(Deserialize)]
        struct Version {
            format_version: u32,
        }
        let path = folder.join(FILE_NAME);
        let text = match fs::read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Err(StorageError::NoGraph {
                    folder: folder.to_owned(),
                });
            }
            read => read.map_err(StorageError::io("read", &path))?,
        };
        let invalid = |e: serde_json::Error| StorageError::Manifest {
            path: path.clone(),
            reason: e.to_string(),
            source: Some(e),
        };
        // The version first: another version may have other fields.
        let version: Version = serde_json::from_slice(&text).map_err(invalid)?;
        if version.format_version != FORMAT_VERSION {
            return Err(StorageError::FormatVersion {
                path,
                found: version.format_version,
                expected: FORMAT_VERSION,
            });
        }
        serde_json::from_slice(&text).map_err(invalid)
    }

    /// Checks that a file of the folder is the one that was saved.
    pub(super) fn check_file(&self, folder: &Path, name: &str) -> Result<(), StorageError> {
        let expected = self.files.get(name).ok_or_else(|| StorageError::Manifest {
            path: folder.join(FILE_NAME),
            reason: format!("'files' does not name {name}"),
            source: None,
        })?;
        let path = folder.join(name);
        let found = sha256_file(&path)?;
        if found == expected.sha256 {
            return Ok(());
        }
        Err(StorageError::DigestMismatch {
            path,
            expected: expected.sha256.clone(),
            found,
        })
    }
}

impl From<&Task> for GraphTask {
    fn from(task: &Task) -> Self {
        Self {
            name: task.name.clone(),
            subgoals: task.subgoals.iter().map(|s| s.name.clone()).collect(),
        }
    }
}

impl From<&GraphTask> for Task {
    fn from(task: &GraphTask) -> Self {
        let subgoal = |name: &String| Subgoal {
            task: task.name.clone(),
            name: name.clone(),
        };
        Self {
            name: task.name.clone(),
            subgoals: task.subgoals.iter().map(subgoal).collect(),
        }
    }
}

/// Checks that the graph in `folder` was built with the model at hand.
///
/// # Errors
/// [`StorageError::ModelMismatch`] with both digests when it was not.
pub fn ensure_same_model(
    folder: &Path,
    graph_digest: &str,
    model_digest: &str,
) -> Result<(), StorageError> {
    if graph_digest == model_digest {
        return Ok(());
    }
    Err(StorageError::ModelMismatch {
        folder: folder.to_owned(),
        graph_digest: graph_digest.to_owned(),
        model_digest: model_digest.to_owned(),
    })
}
