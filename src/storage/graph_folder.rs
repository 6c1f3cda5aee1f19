//! Graphs as folders: two tables, optional pictures, and a manifest.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::graph_images::{self, GraphImage};
use super::place::what_would_be_lost;
use super::replace::{replace_folder, settle_folder};
use super::tables::{self, ADVICE, EdgeReader, EdgeWriter};
use super::{GraphManifest, StorageError, manifest};
use crate::graph::{Edge, EdgeKind, NodeId, TopologicalGraph};
use crate::task::Task;

/// The table of nodes.
const NODES: &str = "nodes.parquet";
/// The table of edges.
const EDGES: &str = "edges.parquet";
/// All that a graph's folder may hold.
const FILES: [&str; 4] = [NODES, EDGES, graph_images::FILE_NAME, manifest::FILE_NAME];

/// Checks that a graph can be saved at a place without anything else being lost: that it is not there, empty, or a
/// graph.
///
/// # Errors
/// [`StorageError::NoGraphToReplace`] with what is there instead, [`StorageError::Io`] when it cannot be looked at.
pub fn check_graph_place(folder: &Path) -> Result<(), StorageError> {
    let refused = |what: String| {
        Err(StorageError::NoGraphToReplace {
            path: folder.to_owned(),
            what,
        })
    };
    if folder.file_name().is_none() {
        return refused("is where other things are, too".to_owned());
    }
    match what_would_be_lost(folder, |name| FILES.contains(&name))? {
        Some(what) if folder.is_dir() => refused(format!("{what}, which is no part of a graph")),
        Some(what) => refused(what),
        None => Ok(()),
    }
}

/// Checks that a place holds no graph of other tasks, which would be lost.
///
/// # Errors
/// [`StorageError::OtherTasks`].
pub fn check_same_tasks(folder: &Path, tasks: &[Task]) -> Result<(), StorageError> {
    let Ok(there) = load_manifest(folder) else {
        return Ok(());
    };
    let found: BTreeSet<&str> = there.tasks.iter().map(|t| t.name.as_str()).collect();
    let wanted: BTreeSet<&str> = tasks.iter().map(|t| t.name.as_str()).collect();
    if found == wanted {
        return Ok(());
    }
    let joined = |names: BTreeSet<&str>| names.into_iter().collect::<Vec<_>>().join(", ");
    Err(StorageError::OtherTasks {
        path: folder.to_owned(),
        found: joined(found),
        wanted: joined(wanted),
    })
}

/// Saves a graph as a folder, whole or not at all; a graph that is there is replaced.
///
/// `nodes.parquet` has a row a node (`id`, `task`, `trajectory`, `step`, `progress`, `reached`, `is_end`,
/// `latent`), `edges.parquet` a row an edge (`from`, `to`, `kind`, `steps`, `probabilities`),
/// `manifest.json` the rest. Returns the manifest as saved, with sizes and digests. The same graph gives
/// the same bytes.
///
/// # Errors
/// [`StorageError::Io`] or [`StorageError::Table`] when a file cannot be written, and those of
/// [`check_graph_place`].
pub fn save_graph(
    folder: &Path,
    graph: &TopologicalGraph,
    manifest: &GraphManifest,
) -> Result<GraphManifest, StorageError> {
    save_graph_with_images(folder, graph, manifest, std::iter::empty())
}

/// Saves a graph as [`save_graph`] does, and pictures of its nodes in `images.parquet` (`node`,
/// `trajectory`, `step`, `camera`, `jpeg`), so that goal images can be shown without the demonstrations.
///
/// # Errors
/// Those of [`save_graph`], and [`StorageError::Picture`] when an image cannot be encoded.
pub fn save_graph_with_images(
    folder: &Path,
    graph: &TopologicalGraph,
    manifest: &GraphManifest,
    images: impl IntoIterator<Item = GraphImage>,
) -> Result<GraphManifest, StorageError> {
    save(folder, graph, manifest, images, |edges| {
        edges.write(graph.edges())?;
        Ok(graph.edge_count())
    })
}

/// Saves a graph whose learned edges lie in tables of their own: each with how many it holds. Of `states`
/// it takes nodes and temporal edges. It holds one group of rows, however many edges there are.
pub(super) fn save_graph_from_parts(
    folder: &Path,
    states: &TopologicalGraph,
    parts: &[(PathBuf, usize)],
    manifest: &GraphManifest,
    images: impl IntoIterator<Item = GraphImage>,
) -> Result<GraphManifest, StorageError> {
    save(folder, states, manifest, images, |edges| {
        let is_temporal = |(_, _, edge): &(NodeId, NodeId, &Edge)| edge.kind == EdgeKind::Temporal;
        edges.write(states.edges().filter(is_temporal))?;
        let mut count = states.edges().filter(is_temporal).count();
        for (path, expected) in parts {
            let mut found = 0;
            for batch in EdgeReader::open(path, states.node_count(), states.d_max())? {
                let batch = batch?;
                found += batch.len();
                edges.write(batch.iter().map(|(from, to, edge)| (*from, *to, edge)))?;
            }
            if found != *expected {
                return Err(StorageError::Table {
                    path: path.clone(),
                    reason: format!(
                        "{found} edges, {expected} were kept. Remove the folder and build again"
                    ),
                });
            }
            count += found;
        }
        Ok(count)
    })
}

/// Saves nodes, the edges that `write` hands over and counts, and pictures.
fn save(
    folder: &Path,
    graph: &TopologicalGraph,
    manifest: &GraphManifest,
    images: impl IntoIterator<Item = GraphImage>,
    write: impl Fn(&mut EdgeWriter) -> Result<usize, StorageError>,
) -> Result<GraphManifest, StorageError> {
    check_graph_place(folder)?;
    let mut saved = manifest.clone();
    replace_folder(folder, |draft| {
        tables::write_nodes(&draft.join(NODES), graph)?;
        let mut edges = EdgeWriter::create(&draft.join(EDGES), graph.d_max())?;
        let edge_count = write(&mut edges)?;
        edges.finish()?;
        let mut names = vec![NODES, EDGES];
        if graph_images::write(draft, graph, images)? {
            names.push(graph_images::FILE_NAME);
        }
        saved = GraphManifest {
            edge_count,
            ..manifest.completed(draft, graph, &names)?
        };
        saved.save(draft)
    })?;
    Ok(saved)
}

/// Loads a graph and its manifest after checking that no table was changed.
///
/// # Errors
/// [`StorageError::NoGraph`] for a folder without manifest, [`StorageError::Manifest`] and
/// [`StorageError::FormatVersion`] for one that cannot be used, [`StorageError::DigestMismatch`] for a
/// table that is not the one saved, [`StorageError::Table`] for one that holds no graph,
/// [`StorageError::Io`] when a file cannot be read.
pub fn load_graph(folder: &Path) -> Result<(TopologicalGraph, GraphManifest), StorageError> {
    let manifest = load_manifest(folder)?;
    manifest.check_file(folder, NODES)?;
    manifest.check_file(folder, EDGES)?;
    let mut graph = TopologicalGraph::new(manifest.latent_dim, manifest.d_max);
    tables::read_nodes(&folder.join(NODES), &mut graph)?;
    read_edges(&folder.join(EDGES), &mut graph)?;
    for (what, expected, found, name) in [
        ("nodes", manifest.node_count, graph.node_count(), NODES),
        ("edges", manifest.edge_count, graph.edge_count(), EDGES),
    ] {
        if expected != found {
            return Err(StorageError::Table {
                path: folder.join(name),
                reason: format!("{found} {what}, the manifest says {expected}"),
            });
        }
    }
    Ok((graph, manifest))
}

/// Checks that every file that a graph's manifest names is the one that was saved, without reading the graph.
///
/// # Errors
/// [`StorageError::Manifest`] for one that names no tables, [`StorageError::DigestMismatch`] for a file that is
/// not the one saved, [`StorageError::Io`] for one that cannot be read.
pub fn check_graph_files(folder: &Path, manifest: &GraphManifest) -> Result<(), StorageError> {
    let tables = [NODES, EDGES];
    let names = manifest.files.keys().map(String::as_str);
    let others = names.filter(|name| !tables.contains(name));
    for name in tables.into_iter().chain(others) {
        manifest.check_file(folder, name)?;
    }
    Ok(())
}

/// Adds the rows of a table of edges to a graph that has all its nodes and no edges.
pub(super) fn read_edges(path: &Path, graph: &mut TopologicalGraph) -> Result<(), StorageError> {
    for edges in EdgeReader::open(path, graph.node_count(), graph.d_max())? {
        for (from, to, edge) in edges? {
            graph.push_edge(from, to, edge);
        }
    }
    let Some((from, to)) = graph.ends_joined_twice() else {
        return Ok(());
    };
    let rows: Vec<String> = graph
        .edges()
        .enumerate()
        .filter(|(_, (a, b, _))| (*a, *b) == (from, to))
        .map(|(row, _)| row.to_string())
        .collect();
    Err(StorageError::Table {
        path: path.to_owned(),
        reason: format!(
            "rows {} are the same edge {} -> {}. {ADVICE}",
            rows.join(" and "),
            from.0,
            to.0
        ),
    })
}

/// Loads only the manifest of a graph folder.
///
/// # Errors
/// [`StorageError::NoGraph`], [`StorageError::Manifest`], [`StorageError::FormatVersion`] or
/// [`StorageError::Io`].
pub fn load_manifest(folder: &Path) -> Result<GraphManifest, StorageError> {
    settle_folder(folder)?;
    GraphManifest::load(folder)
}

#[cfg(test)]
mod tests;
