//! A model that is trained and exported: its networks stay, what is known of its landmarks may be learnt anew.

use std::collections::BTreeMap;
use std::path::Path;

use super::export::{recover_folder, write_folder};
use super::landmarks::learn_offsets;
use super::{Dataset, GripperPractice, Practised, TrainingConfig, TrainingError};
use crate::model::{
    Encoder, LANDMARKS_FILE, LandmarkBook, MANIFEST_FILE, ManifestError, ModelManifest, sha256_hex,
};

/// An exported model, with the configuration that it was trained by.
#[derive(Debug)]
pub struct FinishedModel {
    manifest: ModelManifest,
    config: TrainingConfig,
    book: Option<LandmarkBook>,
    files: BTreeMap<String, Vec<u8>>,
}

impl FinishedModel {
    /// Reads a model's folder. One that a process which was killed had moved away, to put another in its place, is brought
    /// back.
    ///
    /// # Errors
    /// [`TrainingError::Io`] for a file that cannot be read, [`TrainingError::ModelRefused`] for one that is not what
    /// the manifest says, or a manifest of another version, [`TrainingError::ModelInUse`] while another takes its place.
    pub fn load(folder: &Path) -> Result<Self, TrainingError> {
        recover_folder(folder)?;
        let refused = |source: ManifestError| TrainingError::ModelRefused {
            folder: folder.to_path_buf(),
            source,
        };
        let malformed = |source: serde_json::Error| refused(source.into());
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read(&path).map_err(|source| TrainingError::Io {
                action: "read",
                path,
                source,
            })
        };
        let manifest = ModelManifest::from_json(&read(MANIFEST_FILE)?).map_err(refused)?;
        let config = serde_json::from_value(manifest.training.config.clone()).map_err(malformed)?;
        let mut files = BTreeMap::new();
        for name in manifest.files.keys() {
            let bytes = read(name)?;
            manifest.verify(name, &bytes).map_err(refused)?;
            files.insert(name.clone(), bytes);
        }
        let book = files.get(LANDMARKS_FILE);
        let book = book.map(|bytes| serde_json::from_slice(bytes)).transpose();
        Ok(Self {
            book: book.map_err(malformed)?,
            manifest,
            config,
            files,
        })
    }

    /// What its folder says of it.
    #[must_use]
    pub const fn manifest(&self) -> &ModelManifest {
        &self.manifest
    }

    /// Learns anew what the networks stay out of, the sense of grasps and how far off landmarks are seen, and writes the
    /// model with it to a folder, which may be its own. `encoder` is this model's, `datasets` are digests of demonstrations
    /// and practice by the name of their set. Of the cameras of the demonstrations those of the model are used.
    ///
    /// # Errors
    /// What [`GripperPractice::teach`] refuses, [`TrainingError::Encoder`], [`TrainingError::Io`], and
    /// [`TrainingError::ModelInUse`].
    ///
    /// # Panics
    /// Never: what is known of landmarks has a JSON form.
    pub fn practised(
        mut self,
        practice: &GripperPractice<'_>,
        encoder: &dyn Encoder,
        datasets: BTreeMap<String, String>,
        folder: &Path,
    ) -> Result<(ModelManifest, Practised), TrainingError> {
        // More cameras may have seen these demonstrations than those that it was trained on.
        let mut config = self.config;
        let cameras = self.manifest.spec.cameras.iter();
        config.cameras = cameras.map(|camera| camera.name.clone()).collect();
        let practised = practice.teach(&config, self.book.as_mut())?;
        if let Some(book) = &mut self.book {
            let data = Dataset::new(practice.demonstrations)?.seen_by(&config.cameras)?;
            learn_offsets(book, &data, &config, |states| encoder.encode(states))
                .map_err(|source| TrainingError::Encoder { source })?;
        }
        let json = serde_json::to_vec(&self.book).expect("a book of landmarks has a JSON form");
        let digest = sha256_hex(&json);
        self.files.insert(LANDMARKS_FILE.to_owned(), json);
        self.manifest
            .files
            .insert(LANDMARKS_FILE.to_owned(), digest);
        self.manifest.training.datasets = datasets;
        let files = self.files.into_iter().collect::<Vec<_>>();
        write_folder(folder, &files, &self.manifest.to_json())?;
        Ok((self.manifest, practised))
    }
}
