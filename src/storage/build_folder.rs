use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::graph_folder::{read_edges, save_graph_from_parts};
use super::graph_images::GraphImage;
use super::place::what_would_be_lost;
use super::replace::write_file;
use super::tables::{self, EdgeWriter};
use super::{GraphManifest, StorageError};
use crate::graph::{EdgeKind, EdgeSink, JoinedEdges, TopologicalGraph};
use crate::lock::Lock;

/// What a build of the folder `graph` keeps in `graph.build` until it is finished.
const ENDING: &str = "build";
/// What the build is of, and its parts.
const PROGRESS: &str = "build.json";
/// What the build locks as long as it is at work.
const LOCK: &str = "build.lock";
/// The states.
const STATES: &str = "nodes.parquet";
/// The temporal edges between them.
const TEMPORAL: &str = "temporal.parquet";
/// How the table of a part's edges begins; its number follows.
const PART: &str = "edges-";
/// How it ends.
const TABLE: &str = ".parquet";

/// A build of a graph that can be gone on with when it was interrupted.
///
/// Beside the graph's folder lies one with the states, once they are encoded, and with the learned edges of
/// each part of the work that is done. A build of the same model, demonstrations and options takes them
/// up; of others, it begins anew. [`finish`](Self::finish) puts the graph together from its parts, one
/// batch of rows at a time. No other build takes the folder until this is dropped or the process ends, however it ends.
#[derive(Debug)]
pub struct BuildFolder {
    graph_folder: PathBuf,
    folder: PathBuf,
    progress: Progress,
    lock: Lock,
}

/// `build.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Progress {
    manifest: GraphManifest,
    /// Pairs of a part; other parts hold other states.
    part_pairs: u64,
    /// Of which kind the states are, once they are there.
    states: Option<States>,
    parts: BTreeMap<usize, Part>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct States {
    latent_dim: usize,
    d_max: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    edges: usize,
    pairs: u64,
}

impl BuildFolder {
    /// Takes up the build of the graph folder `graph_folder`, or begins it. `manifest` says what is built:
    /// what it was made from and the options; `part_pairs` into which parts the pairs are cut.
    ///
    /// # Errors
    /// [`StorageError::NoBuildToReplace`] when the folder holds what no build put there, [`StorageError::BuildInUse`]
    /// while another build of the same graph is at work, [`StorageError::Io`] when it cannot be read, made or emptied.
    pub fn open(
        graph_folder: &Path,
        manifest: &GraphManifest,
        part_pairs: u64,
    ) -> Result<Self, StorageError> {
        let mut name = graph_folder.file_name().unwrap_or_default().to_owned();
        name.push(".");
        name.push(ENDING);
        let folder = graph_folder.with_file_name(name);
        let fresh = Progress {
            manifest: manifest.clone(),
            part_pairs,
            states: None,
            parts: BTreeMap::new(),
        };
        check_build_place(&folder)?;
        let lock = locked(&folder)?;
        let kept = read_progress(&folder)?;
        let kept = kept.filter(|p| p.manifest == fresh.manifest && p.part_pairs == part_pairs);
        if kept.is_none() {
            empty(&folder)?;
        }
        let build = Self {
            graph_folder: graph_folder.to_owned(),
            folder,
            progress: kept.unwrap_or(fresh),
            lock,
        };
        build.save_progress()?;
        Ok(build)
    }

    /// Where it keeps what is done.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How many parts are done.
    #[must_use]
    pub fn kept_parts(&self) -> usize {
        self.progress.parts.len()
    }

    /// The states and temporal edges, if they were kept before.
    ///
    /// # Errors
    /// [`StorageError::Table`] or [`StorageError::Io`] when they cannot be read.
    pub fn states(&self) -> Result<Option<TopologicalGraph>, StorageError> {
        let Some(States { latent_dim, d_max }) = self.progress.states else {
            return Ok(None);
        };
        let mut graph = TopologicalGraph::new(latent_dim, d_max);
        tables::read_nodes(&self.folder.join(STATES), &mut graph)?;
        read_edges(&self.folder.join(TEMPORAL), &mut graph)?;
        Ok(Some(graph))
    }

    /// Keeps the states and temporal edges.
    ///
    /// # Errors
    /// [`StorageError::Io`] or [`StorageError::Table`] when they cannot be written.
    pub fn keep_states(&mut self, graph: &TopologicalGraph) -> Result<(), StorageError> {
        tables::write_nodes(&self.folder.join(STATES), graph)?;
        let mut edges = EdgeWriter::create(&self.folder.join(TEMPORAL), graph.d_max())?;
        edges.write(
            graph
                .edges()
                .filter(|(_, _, e)| e.kind == EdgeKind::Temporal),
        )?;
        edges.finish()?;
        self.progress.states = Some(States {
            latent_dim: graph.latents().dim(),
            d_max: graph.d_max(),
        });
        self.save_progress()
    }

    /// Saves the graph of the states and of all parts, with pictures, as
    /// [`save_graph_with_images`](super::save_graph_with_images) does, and removes what was kept.
    /// `manifest` is what the build was opened with and what became known since. Returns it as saved.
    ///
    /// # Errors
    /// Those of [`save_graph_with_images`](super::save_graph_with_images), and [`StorageError::Table`] when
    /// a part is not what was kept.
    pub fn finish(
        self,
        states: &TopologicalGraph,
        manifest: &GraphManifest,
        images: impl IntoIterator<Item = GraphImage>,
    ) -> Result<GraphManifest, StorageError> {
        let parts: Vec<(PathBuf, usize)> = self
            .progress
            .parts
            .iter()
            .map(|(part, kept)| (self.part_file(*part), kept.edges))
            .collect();
        let saved = save_graph_from_parts(&self.graph_folder, states, &parts, manifest, images)?;
        // What came into the folder meanwhile keeps it.
        if check_build_place(&self.folder).is_ok() {
            remove(&self.folder, self.lock)?;
        }
        Ok(saved)
    }

    fn part_file(&self, part: usize) -> PathBuf {
        self.folder.join(format!("{PART}{part:05}{TABLE}"))
    }

    fn save_progress(&self) -> Result<(), StorageError> {
        write_file(&self.folder.join(PROGRESS), |file| {
            serde_json::to_writer_pretty(&mut *file, &self.progress).map_err(io::Error::from)?;
            file.write_all(b"\n")
        })
    }
}

/// Whether a build writes a file of this name, or a draft of it.
fn is_of_build(name: &str) -> bool {
    let draft = name.strip_prefix('.').and_then(|n| n.strip_suffix(".tmp"));
    let name = draft.unwrap_or(name);
    let part = name.strip_prefix(PART).and_then(|n| n.strip_suffix(TABLE));
    [PROGRESS, LOCK, STATES, TEMPORAL].contains(&name)
        || part.is_some_and(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()))
}

/// Checks that nothing is lost with a folder but what a build kept there.
fn check_build_place(folder: &Path) -> Result<(), StorageError> {
    match what_would_be_lost(folder, is_of_build)? {
        None => Ok(()),
        Some(what) => Err(StorageError::NoBuildToReplace {
            path: folder.to_owned(),
            what,
        }),
    }
}

/// Makes a folder that is not there, and keeps other builds out of it.
fn locked(folder: &Path) -> Result<Lock, StorageError> {
    fs::create_dir_all(folder).map_err(StorageError::io("create", folder))?;
    let lock = Lock::take(&folder.join(LOCK)).map_err(StorageError::io("lock", folder))?;
    lock.ok_or_else(|| StorageError::BuildInUse {
        folder: folder.to_owned(),
    })
}

/// Removes what a build kept in a folder, all but its lock.
fn empty(folder: &Path) -> Result<(), StorageError> {
    for entry in fs::read_dir(folder).map_err(StorageError::io("empty", folder))? {
        let path = entry.map_err(StorageError::io("empty", folder))?.path();
        if path.file_name().is_none_or(|name| name != LOCK) {
            fs::remove_file(&path).map_err(StorageError::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Removes a folder that a build has finished with, and its lock. Some file systems, NFS among them, keep a name in the
/// folder for each file that is open, so that it only goes after the lock.
fn remove(folder: &Path, lock: Lock) -> Result<(), StorageError> {
    empty(folder)?;
    if fs::remove_dir_all(folder).is_ok() {
        return Ok(());
    }
    drop(lock);
    // What another build has put there meanwhile keeps it.
    fs::remove_dir(folder).map_err(StorageError::io("remove", folder))
}

/// What a build had done; none where there was none, or one that cannot be understood.
fn read_progress(folder: &Path) -> Result<Option<Progress>, StorageError> {
    let path = folder.join(PROGRESS);
    match fs::read(&path) {
        Ok(text) => Ok(serde_json::from_slice(&text).ok()),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(StorageError::io("read", &path)(e)),
    }
}

impl EdgeSink for BuildFolder {
    type Error = StorageError;

    fn kept_pairs(&self, part: usize) -> Option<u64> {
        self.progress.parts.get(&part).map(|kept| kept.pairs)
    }

    fn keep(&mut self, part: usize, edges: JoinedEdges, pairs: u64) -> Result<(), StorageError> {
        let d_max = self.progress.states.map_or(0, |states| states.d_max);
        let mut writer = EdgeWriter::create(&self.part_file(part), d_max)?;
        writer.write(edges.iter().map(|(from, to, edge)| (*from, *to, edge)))?;
        writer.finish()?;
        let edges = edges.len();
        self.progress.parts.insert(part, Part { edges, pairs });
        self.save_progress()
    }
}

#[cfg(test)]
mod tests;
