//! Pictures of a graph's nodes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, BinaryArray, StringArray, UInt32Array};
use arrow::datatypes::DataType;

use super::pixels::{decode_compressed, encode_jpeg};
use super::tables::{TableReader, TableWriter};
use super::{StorageError, load_manifest};
use crate::graph::{NodeId, TopologicalGraph};
use crate::trajectory::Image;

/// The table's name in a graph folder.
pub(super) const FILE_NAME: &str = "images.parquet";
/// Enough to recognise a scene; a tenth of a demonstration's bytes.
const JPEG_QUALITY: u8 = 70;

/// What one camera showed at one node.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphImage {
    /// The node.
    pub node: NodeId,
    /// The camera's name.
    pub camera: String,
    /// The picture, of any size.
    pub image: Image,
}

/// The pictures of one graph folder, by demonstration and step, so that they are found for the nodes of
/// a merged graph as well.
#[derive(Clone, Debug, Default)]
pub struct GraphImages {
    path: PathBuf,
    jpegs: BTreeMap<(String, u32, String), Vec<u8>>,
}

impl GraphImages {
    /// Reads the pictures of a graph folder; none where it was saved without.
    ///
    /// # Errors
    /// Those of [`load_manifest`], [`StorageError::DigestMismatch`] and [`StorageError::Table`] for a
    /// table that is not the one saved.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        let manifest = load_manifest(folder)?;
        let path = folder.join(FILE_NAME);
        let mut jpegs = BTreeMap::new();
        if manifest.files.contains_key(FILE_NAME) {
            manifest.check_file(folder, FILE_NAME)?;
            for batch in TableReader::open(&path)? {
                let batch = batch?;
                let trajectories: &StringArray = batch.column("trajectory")?;
                let steps: &UInt32Array = batch.column("step")?;
                let cameras: &StringArray = batch.column("camera")?;
                let pictures: &BinaryArray = batch.column("jpeg")?;
                for row in 0..batch.rows() {
                    let key = (
                        trajectories.value(row).to_owned(),
                        steps.value(row),
                        cameras.value(row).to_owned(),
                    );
                    jpegs.insert(key, pictures.value(row).to_vec());
                }
            }
        }
        Ok(Self { path, jpegs })
    }

    /// Number of pictures.
    #[must_use]
    pub fn len(&self) -> usize {
        self.jpegs.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.jpegs.is_empty()
    }

    /// The steps of a demonstration with pictures, in order; once for each camera.
    pub fn steps_of(&self, trajectory: &str) -> impl Iterator<Item = u32> {
        let first = (trajectory.to_owned(), 0, String::new());
        self.jpegs
            .range(first..)
            .map(|((of, step, _), _)| (of, *step))
            .take_while(move |(of, _)| *of == trajectory)
            .map(|(_, step)| step)
    }

    /// What a camera showed at a step of a demonstration; `None` where no picture was saved.
    ///
    /// # Errors
    /// [`StorageError::Picture`] when the picture cannot be decoded.
    pub fn image(
        &self,
        trajectory: &str,
        step: u32,
        camera: &str,
    ) -> Result<Option<Image>, StorageError> {
        let key = (trajectory.to_owned(), step, camera.to_owned());
        let Some(jpeg) = self.jpegs.get(&key) else {
            return Ok(None);
        };
        decode_compressed(jpeg, "jpeg")
            .map(Some)
            .map_err(|reason| StorageError::Picture {
                path: self.path.clone(),
                what: format!("camera '{camera}' at step {step} of {trajectory}"),
                reason,
            })
    }
}

/// Pictures that are in memory at once: some megabytes of JPEG.
const BATCH_PICTURES: usize = 1024;

/// Writes the pictures into `folder`; whether there were any.
pub(super) fn write(
    folder: &Path,
    graph: &TopologicalGraph,
    images: impl IntoIterator<Item = GraphImage>,
) -> Result<bool, StorageError> {
    let path = folder.join(FILE_NAME);
    let mut images = images.into_iter().peekable();
    if images.peek().is_none() {
        return Ok(false);
    }
    let mut table = TableWriter::create(
        &path,
        vec![
            ("node", DataType::UInt32),
            ("trajectory", DataType::Utf8),
            ("step", DataType::UInt32),
            ("camera", DataType::Utf8),
            ("jpeg", DataType::Binary),
        ],
    )?;
    while images.peek().is_some() {
        let batch = images.by_ref().take(BATCH_PICTURES);
        table.write(columns(&path, graph, batch)?)?;
    }
    table.finish()?;
    Ok(true)
}

/// The columns of some pictures.
fn columns(
    path: &Path,
    graph: &TopologicalGraph,
    images: impl Iterator<Item = GraphImage>,
) -> Result<Vec<ArrayRef>, StorageError> {
    let (mut nodes, mut trajectories, mut steps) = (Vec::new(), Vec::new(), Vec::new());
    let (mut cameras, mut jpegs) = (Vec::new(), Vec::new());
    for GraphImage {
        node,
        camera,
        image,
    } in images
    {
        let jpeg = encode_jpeg(&image, JPEG_QUALITY).map_err(|reason| StorageError::Picture {
            path: path.to_owned(),
            what: format!("camera '{camera}' at node {}", node.0),
            reason,
        })?;
        let place = graph.node(node);
        nodes.push(node.0);
        trajectories.push(place.trajectory.as_str());
        steps.push(place.step);
        cameras.push(camera);
        jpegs.push(jpeg);
    }
    Ok(vec![
        Arc::new(UInt32Array::from(nodes)),
        Arc::new(StringArray::from(trajectories)),
        Arc::new(UInt32Array::from(steps)),
        Arc::new(StringArray::from(cameras)),
        Arc::new(BinaryArray::from_iter_values(jpegs)),
    ])
}
