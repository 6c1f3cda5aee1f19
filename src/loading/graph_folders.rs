use std::path::{Path, PathBuf};

use super::LoadError;
use crate::graph::TopologicalGraph;
use crate::inference::Model;
use crate::storage::{GraphManifest, ensure_same_model, load_graph};

/// What a graph is called in errors.
pub(crate) fn in_folder(folder: &Path) -> String {
    format!("the graph in {}", folder.display())
}

/// Graph folders with the graphs in them.
pub(crate) struct GraphFolders {
    pub(crate) graphs: Vec<TopologicalGraph>,
    pub(crate) manifests: Vec<GraphManifest>,
}

impl GraphFolders {
    /// Loads graphs, and refuses those that another model built or that have no states.
    pub(crate) fn load(folders: &[PathBuf], model: &Model) -> Result<Self, LoadError> {
        let mut loaded = Self {
            graphs: Vec::new(),
            manifests: Vec::new(),
        };
        for folder in folders {
            let (graph, manifest) = load_graph(folder)?;
            ensure_same_model(folder, &manifest.model_digest, &model.digest())?;
            let (what, spec) = (in_folder(folder), &model.manifest().spec);
            graph.ensure_states(&what)?;
            graph.ensure_fits(&what, spec.d_max, spec.latent_dim)?;
            loaded.graphs.push(graph);
            loaded.manifests.push(manifest);
        }
        Ok(loaded)
    }
}
