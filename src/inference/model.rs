use std::fmt;
use std::path::Path;

use super::network::Network;
use super::{Engine, EngineChoice, InferenceError};
use crate::hidden::moved_from;
use crate::model::{
    ENCODER_FILE, LANDMARKS_FILE, LandmarkBook, Latents, LocalPolicy, MANIFEST_FILE, ManifestError,
    ModelError, ModelManifest, POLICY_FILE, PROJECTION_FILE, TRAVERSABILITY_FILE, Traversability,
};

/// A trained model, ready to run: the encoder, the traversability function and the local policy.
pub struct Model {
    engine: &'static Engine,
    pub(super) temperature: f32,
    pub(super) manifest: ModelManifest,
    pub(super) encoder: Network,
    pub(super) projection: Network,
    pub(super) traversability: Network,
    pub(super) policy: Network,
    landmarks: Option<LandmarkBook>,
}

impl Model {
    /// Loads the model in a folder, after checking each of its files against the manifest.
    ///
    /// # Errors
    /// [`InferenceError::FileUnreadable`] for a missing file, [`InferenceError::MovedAway`] for a folder that
    /// a killed command had moved away, [`InferenceError::ManifestRefused`] when the manifest is of another
    /// version or a file differs from it, [`InferenceError::SpecImpossible`] when it says what no model has,
    /// [`InferenceError::EngineFailed`] when the engine refuses a network,
    /// [`InferenceError::NetworkMisfit`] when one is not what the manifest says, and the errors
    /// of [`Engine::select`].
    pub fn load(folder: &Path, choice: EngineChoice) -> Result<Self, InferenceError> {
        let refused = |source: ManifestError| InferenceError::ManifestRefused {
            folder: folder.to_path_buf(),
            source,
        };
        let manifest =
            ModelManifest::from_json(&read(&folder.join(MANIFEST_FILE))?).map_err(refused)?;
        check_spec(&folder.join(MANIFEST_FILE), &manifest)?;
        let engine = Engine::select(choice)?;
        let network = |stage, file: &str| {
            let path = folder.join(file);
            let bytes = read(&path)?;
            manifest.verify(file, &bytes).map_err(refused)?;
            Network::load(engine, stage, &path, bytes)
        };
        let model = Self {
            engine,
            temperature: manifest.temperature,
            encoder: network("the encoder", ENCODER_FILE)?,
            projection: network("the projection", PROJECTION_FILE)?,
            traversability: network("the traversability function", TRAVERSABILITY_FILE)?,
            policy: network("the local policy", POLICY_FILE)?,
            landmarks: landmarks(folder, &manifest)?,
            manifest,
        };
        model.check_names(folder)?;
        model.check_widths(folder)?;
        Ok(model)
    }

    /// The same model with its traversability at another temperature; 1 is without calibration. Its digest
    /// stays, since the files are the same.
    ///
    /// # Panics
    /// If the temperature is not above 0 and finite.
    #[must_use]
    pub fn at_temperature(mut self, temperature: f32) -> Self {
        assert!(
            temperature > 0.0 && temperature.is_finite(),
            "a temperature of {temperature}"
        );
        self.temperature = temperature;
        self
    }

    /// What the traversability logits are divided by: the manifest's temperature unless another was set.
    #[must_use]
    pub fn temperature(&self) -> f32 {
        self.temperature
    }

    /// What the model's folder says of it.
    #[must_use]
    pub fn manifest(&self) -> &ModelManifest {
        &self.manifest
    }

    /// What is known of the model's landmarks, if its encoder tells any.
    #[must_use]
    pub fn landmarks(&self) -> Option<&LandmarkBook> {
        self.landmarks.as_ref()
    }

    /// The digest by which graphs know the model that they were built with.
    #[must_use]
    pub fn digest(&self) -> String {
        self.manifest.digest()
    }

    /// What computes it.
    #[must_use]
    pub fn engine(&self) -> &'static Engine {
        self.engine
    }

    fn check_names(&self, folder: &Path) -> Result<(), InferenceError> {
        let cameras: Vec<&str> = self.cameras().collect();
        let networks: [(&str, &Network, &[&str], &[&str]); 4] = [
            (ENCODER_FILE, &self.encoder, &cameras, &["latent"]),
            (
                PROJECTION_FILE,
                &self.projection,
                &["latent"],
                &["from", "to"],
            ),
            (
                TRAVERSABILITY_FILE,
                &self.traversability,
                &["from", "to"],
                &["logits"],
            ),
            (POLICY_FILE, &self.policy, &["from", "goal"], &["logits"]),
        ];
        for (file, network, inputs, outputs) in networks {
            check_names(&folder.join(file), network, inputs, outputs)?;
        }
        Ok(())
    }

    /// Runs the small networks once, so that a width that does not fit shows before the robot moves.
    fn check_widths(&self, folder: &Path) -> Result<(), InferenceError> {
        let spec = &self.manifest.spec;
        let zeros = Latents::from_values(spec.latent_dim, vec![0.0; spec.latent_dim]);
        let misfit = |file: &str, error: &ModelError| InferenceError::NetworkMisfit {
            path: folder.join(file),
            what: "the result for a latent of zeros".to_owned(),
            expected: "what the manifest says".to_owned(),
            found: error.to_string(),
        };
        let projections = self
            .project(&zeros)
            .map_err(|e| misfit(PROJECTION_FILE, &e))?;
        self.predict(&projections, &projections, &[(0, 0)])
            .map_err(|e| misfit(TRAVERSABILITY_FILE, &e))?;
        self.act(zeros.row(0), zeros.row(0))
            .map_err(|e| misfit(POLICY_FILE, &e))?;
        Ok(())
    }

    fn cameras(&self) -> impl Iterator<Item = &str> {
        self.manifest.spec.cameras.iter().map(|c| c.name.as_str())
    }
}

impl fmt::Debug for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Model")
            .field("digest", &self.digest())
            .field("engine", &self.engine.description())
            .finish_non_exhaustive()
    }
}

/// A network has these inputs and outputs and no others.
pub(super) fn check_names(
    path: &Path,
    network: &Network,
    inputs: &[&str],
    outputs: &[&str],
) -> Result<(), InferenceError> {
    let found = network.names();
    for (what, expected, found) in [
        ("the set of inputs", inputs, found.0),
        ("the set of outputs", outputs, found.1),
    ] {
        let mut expected = expected.to_vec();
        let mut found: Vec<&str> = found.iter().map(String::as_str).collect();
        expected.sort_unstable();
        found.sort_unstable();
        if expected != found {
            return Err(InferenceError::NetworkMisfit {
                path: path.to_path_buf(),
                what: what.to_owned(),
                expected: expected.join(", "),
                found: found.join(", "),
            });
        }
    }
    Ok(())
}

/// The bytes of a file in the folder of a model or a baseline.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, InferenceError> {
    std::fs::read(path).map_err(|source| {
        let folder = path.parent().unwrap_or(path);
        match moved_from(folder) {
            Some(previous) => InferenceError::MovedAway {
                folder: folder.to_path_buf(),
                previous,
            },
            None => InferenceError::FileUnreadable {
                path: path.to_path_buf(),
                source,
            },
        }
    })
}

/// The landmarks of a model whose manifest names them.
fn landmarks(
    folder: &Path,
    manifest: &ModelManifest,
) -> Result<Option<LandmarkBook>, InferenceError> {
    if !manifest.files.contains_key(LANDMARKS_FILE) {
        return Ok(None);
    }
    let path = folder.join(LANDMARKS_FILE);
    let bytes = read(&path)?;
    (manifest.verify(LANDMARKS_FILE, &bytes)).map_err(|source| {
        InferenceError::ManifestRefused {
            folder: folder.to_path_buf(),
            source,
        }
    })?;
    let misfit = |found: String| InferenceError::NetworkMisfit {
        path: path.clone(),
        what: "what it says of landmarks".to_owned(),
        expected: "what the encoder tells".to_owned(),
        found,
    };
    let book: LandmarkBook =
        serde_json::from_slice(&bytes).map_err(|error| misfit(error.to_string()))?;
    match book.misfit(manifest.spec.latent_dim, &manifest.spec.cameras) {
        Some(reason) => Err(misfit(reason)),
        None => Ok(Some(book)),
    }
}

fn check_spec(path: &Path, manifest: &ModelManifest) -> Result<(), InferenceError> {
    let spec = &manifest.spec;
    let positive = |what: &str, value: usize| (what.to_owned(), value > 0, value.to_string());
    let checks = [
        positive("the number of cameras", spec.cameras.len()),
        positive("`stack`", spec.stack),
        positive("`latent_dim`", spec.latent_dim),
        positive("`projection_width`", manifest.projection_width),
        positive(
            "the number of action heads",
            spec.action_space.head_sizes().len(),
        ),
        ("`d_max`".to_owned(), spec.d_max > 1, spec.d_max.to_string()),
        (
            "`temperature`".to_owned(),
            manifest.temperature.is_finite() && manifest.temperature > 0.0,
            manifest.temperature.to_string(),
        ),
    ];
    match checks.into_iter().find(|(_, fine, _)| !fine) {
        None => Ok(()),
        Some((what, _, found)) => Err(InferenceError::SpecImpossible {
            path: path.to_path_buf(),
            what,
            found,
        }),
    }
}
