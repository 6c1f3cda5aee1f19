use std::fmt;
use std::path::Path;

use super::contract::{STATES_A_BATCH, distribution, encode_cameras};
use super::model::{check_names, read};
use super::network::{Network, Tensor, in_batches};
use super::{Engine, EngineChoice, FrozenEncoder, InferenceError};
use crate::model::{
    ActionDistribution, BaselineManifest, BaselineSpec, ENCODER_FILE, FeatureEncoder, Latents,
    MANIFEST_FILE, ManifestError, ModelError, POLICY_FILE, ReactivePolicy,
};
use crate::trajectory::State;

/// A trained baseline, ready to run (Fu & Finn, section IV-A).
pub struct Baseline {
    engine: &'static Engine,
    manifest: BaselineManifest,
    encoder: Encoder,
    policy: Network,
}

enum Encoder {
    Trained(Network),
    Frozen(FrozenEncoder),
}

impl Baseline {
    /// Loads the baseline in a folder, after checking each of its files against the manifest.
    ///
    /// # Errors
    /// [`InferenceError::FileUnreadable`] for a missing file, [`InferenceError::MovedAway`] for a folder that
    /// a killed command had moved away, [`InferenceError::ManifestRefused`] when the manifest is a model's or
    /// of another version, or a file differs from it, [`InferenceError::SpecImpossible`] when it says what no
    /// baseline has, [`InferenceError::EngineFailed`] when the engine refuses a network,
    /// [`InferenceError::NetworkMisfit`] when one is not what the manifest says, and the errors of
    /// [`Engine::select`].
    pub fn load(folder: &Path, choice: EngineChoice) -> Result<Self, InferenceError> {
        let refused = |source: ManifestError| InferenceError::ManifestRefused {
            folder: folder.to_path_buf(),
            source,
        };
        let place = folder.join(MANIFEST_FILE);
        let manifest = BaselineManifest::from_json(&read(&place)?).map_err(refused)?;
        check_spec(&place, &manifest.spec)?;
        let engine = Engine::select(choice)?;
        let file = |name: &str| {
            let bytes = read(&folder.join(name))?;
            manifest.verify(name, &bytes).map_err(refused)?;
            Ok(bytes)
        };
        let (encoder, policy) = (folder.join(ENCODER_FILE), folder.join(POLICY_FILE));
        let bytes = file(ENCODER_FILE)?;
        let policy_network = Network::load(engine, "the policy", &policy, file(POLICY_FILE)?)?;
        check_names(&policy, &policy_network, &["history", "goal"], &["logits"])?;
        let encoder = if let Some(pictures) = &manifest.spec.frozen {
            let frozen = FrozenEncoder::of_baseline(&encoder, engine, bytes, pictures)?;
            Encoder::Frozen(frozen)
        } else {
            let network = Network::load(engine, "the encoder", &encoder, bytes)?;
            let cameras = manifest.spec.cameras.iter().map(|c| c.name.as_str());
            check_names(
                &encoder,
                &network,
                &cameras.collect::<Vec<_>>(),
                &["latent"],
            )?;
            Encoder::Trained(network)
        };
        let baseline = Self {
            engine,
            manifest,
            encoder,
            policy: policy_network,
        };
        baseline.check_widths(&policy)?;
        Ok(baseline)
    }

    /// What the baseline's folder says of it.
    #[must_use]
    pub fn manifest(&self) -> &BaselineManifest {
        &self.manifest
    }

    /// What computes it.
    #[must_use]
    pub fn engine(&self) -> &'static Engine {
        self.engine
    }

    /// Runs the policy once, so that a width that does not fit shows before the robot moves.
    fn check_widths(&self, path: &Path) -> Result<(), InferenceError> {
        let spec = &self.manifest.spec;
        let zeros = vec![0.0; spec.history * spec.latent_dim];
        let history = Latents::from_values(spec.latent_dim, zeros);
        let acted = self.act(&history, history.row(0));
        acted
            .map(|_| ())
            .map_err(|error| InferenceError::NetworkMisfit {
                path: path.to_path_buf(),
                what: "the result for latents of zeros".to_owned(),
                expected: "what the manifest says".to_owned(),
                found: error.to_string(),
            })
    }
}

impl ReactivePolicy for Baseline {
    fn spec(&self) -> &BaselineSpec {
        &self.manifest.spec
    }

    fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
        let spec = &self.manifest.spec;
        let network = match &self.encoder {
            Encoder::Trained(network) => network,
            Encoder::Frozen(encoder) => return encoder.features(states, &spec.cameras),
        };
        let [latents] = in_batches(states.len(), STATES_A_BATCH, |range| {
            encode_cameras(network, &spec.cameras, spec.stack, &states[range])
        })?;
        let expected = states.len() * spec.latent_dim;
        ModelError::unless_as_many("values of the encoder", expected, latents.len())?;
        Ok(Latents::from_values(spec.latent_dim, latents))
    }

    fn act(&self, history: &Latents, goal: &[f32]) -> Result<ActionDistribution, ModelError> {
        let spec = &self.manifest.spec;
        let values = spec.history * spec.latent_dim;
        ModelError::unless_as_many("latents of the history", values, history.values().len())?;
        ModelError::unless_as_many("latents", spec.latent_dim, goal.len())?;
        let inputs = [("history", history.values()), ("goal", goal)].map(|(name, values)| Tensor {
            name,
            shape: vec![1, values.len()],
            values,
        });
        let [mut logits] = self.policy.run(&inputs, 1, ["logits"])?;
        distribution(&mut logits, &spec.action_space)
    }
}

impl fmt::Debug for Baseline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Baseline")
            .field("method", &self.manifest.spec.method)
            .field("digest", &self.manifest.digest())
            .field("engine", &self.engine.description())
            .finish_non_exhaustive()
    }
}

fn check_spec(path: &Path, spec: &BaselineSpec) -> Result<(), InferenceError> {
    let heads = spec.action_space.head_sizes().len();
    let frozen = spec.frozen.as_ref();
    let of_features = frozen.map_or(spec.latent_dim, |f| f.feature_dim * spec.cameras.len());
    let checks = [
        (
            "the number of cameras",
            spec.cameras.len(),
            spec.cameras.is_empty(),
        ),
        ("`stack`", spec.stack, spec.stack == 0),
        ("`history`", spec.history, spec.history == 0),
        (
            "`latent_dim`",
            spec.latent_dim,
            spec.latent_dim == 0 || spec.latent_dim != of_features,
        ),
        ("the number of action heads", heads, heads == 0),
    ];
    match checks.into_iter().find(|(.., is_wrong)| *is_wrong) {
        None => Ok(()),
        Some((what, found, _)) => Err(InferenceError::SpecImpossible {
            path: path.to_path_buf(),
            what: what.to_owned(),
            found: found.to_string(),
        }),
    }
}
