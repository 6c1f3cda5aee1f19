//! What the trainer exports of a baseline computes here what it computed there, and folders of the wrong kind
//! say what they are.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use tempfile::TempDir;

use super::onnx::Network;
use super::trained::{assert_near, demonstration, exported, softmax};
use crate::inference::{Baseline, EngineChoice, FrozenEncoder, InferenceError, Model};
use crate::model::{
    BaselineMethod, ENCODER_FILE, FeatureEncoder, Latents, MANIFEST_FILE, POLICY_FILE,
    ReactivePolicy,
};
use crate::training::{
    BaselineConfig, Dataset, Preset, RunFolder, TrainedBaseline, TrainingEvent, TrainingObserver,
    export_baseline, train_baseline,
};
use crate::trajectory::{Action, DemonstrationSet, Image, Observation, State, Step, Trajectory};

const STATES: usize = 9;

/// Mean red, green and blue of a picture of 8x8.
fn mean_colour(output: &[usize]) -> Vec<u8> {
    Network::default()
        .input("image", &[3, 8, 8])
        .node("GlobalAveragePool", &["image"], "means")
        .node("Flatten", &["means"], "features")
        .output("features", output)
        .model()
}

fn frozen_encoder(folder: &Path, choice: EngineChoice) -> FrozenEncoder {
    let path = folder.join("colours.onnx");
    std::fs::write(&path, mean_colour(&[3])).expect("writing the network");
    let pictures = r#"{"mean": [1, 2, 3], "deviation": [10, 20, 40]}"#;
    std::fs::write(folder.join("colours.json"), pictures).expect("writing beside it");
    FrozenEncoder::load(&path, choice).expect("an encoder of pictures")
}

fn trained(method: BaselineMethod, frozen: Option<&FrozenEncoder>) -> TrainedBaseline {
    let trajectory = demonstration();
    let again = Trajectory {
        id: "two".to_owned(),
        ..trajectory.clone()
    };
    let set = DemonstrationSet::new("toy", vec![trajectory, again]).expect("they agree");
    let data = Dataset::new(&[set]).expect("a set that agrees with itself");
    let config = BaselineConfig::of(method, Preset::Tiny);
    let frozen = frozen.map(|encoder| encoder as &dyn FeatureEncoder);
    TrainedBaseline::untrained(&data, &config, frozen).expect("a configuration that fits")
}

fn states(stack: usize) -> Vec<State> {
    let trajectory = demonstration();
    (0..STATES).map(|s| trajectory.state(s, stack)).collect()
}

fn write(baseline: &TrainedBaseline) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    export_baseline(baseline, BTreeMap::new(), folder.path()).expect("it can be written");
    folder
}

/// What the baselines of all methods give for the same states, with an engine.
pub fn outputs(choice: EngineChoice) -> Vec<f32> {
    let mut all = Vec::new();
    for (_, method) in BaselineMethod::NAMES {
        let place = tempfile::tempdir().expect("a temporary folder");
        let frozen = (method == BaselineMethod::Mvp).then(|| frozen_encoder(place.path(), choice));
        let folder = write(&trained(method, frozen.as_ref()));
        let baseline = Baseline::load(folder.path(), choice).expect("just exported");
        let spec = baseline.spec();
        let latents = baseline.encode(&states(spec.stack)).expect("they fit");
        let mut history = Latents::new(spec.latent_dim);
        for place in 0..spec.history {
            history.push(latents.row(place * 4 % STATES));
        }
        let found = baseline.act(&history, latents.row(8)).expect("it fits");
        all.extend(latents.values());
        all.extend(found.heads.concat());
    }
    all
}

#[test]
fn exported_baselines_agree_with_burn() {
    for (_, method) in BaselineMethod::NAMES {
        let place = tempfile::tempdir().expect("a temporary folder");
        let frozen = (method == BaselineMethod::Mvp)
            .then(|| frozen_encoder(place.path(), EngineChoice::Auto));
        let trained = trained(method, frozen.as_ref());
        let folder = write(&trained);
        let baseline = Baseline::load(folder.path(), EngineChoice::Auto).expect("just exported");
        assert_eq!(baseline.spec(), &trained.spec);

        let states = states(trained.spec.stack);
        let windows: Vec<(Vec<usize>, usize)> = (0..STATES)
            .map(|w| {
                let window = (0..trained.spec.history).map(|k| (w + k * 2) % STATES);
                (window.collect(), (w * 5 + 1) % STATES)
            })
            .collect();
        let frozen = frozen.as_ref().map(|e| e as &dyn FeatureEncoder);
        let reference = trained
            .reference_outputs(&states, &windows, frozen)
            .expect("the states fit");
        let latents = baseline.encode(&states).expect("the states fit");
        assert_near(
            &format!("{method}: latent"),
            latents.values(),
            reference.latents.values(),
        );
        for (row, (window, goal)) in windows.iter().enumerate() {
            let mut history = Latents::new(latents.dim());
            for state in window {
                history.push(latents.row(*state));
            }
            let found = baseline.act(&history, latents.row(*goal)).expect("it fits");
            let expected = softmax(reference.logits.row(row), 1.0);
            assert_near(&format!("{method}: action"), &found.heads[0], &expected);
        }
        let spread = reference.logits.row(0);
        assert!(
            spread.iter().any(|v| (v - spread[0]).abs() > 1e-4),
            "{method}: the logits differ, or nothing was compared: {spread:?}"
        );
    }
}

/// A demonstration in which the colour of the picture tells the action.
fn coloured(id: &str, level: u8) -> Trajectory {
    let step = |step: usize| {
        let mut pixel = [20_u8; 3];
        pixel[step % 3] = level;
        let image = Image::new(16, 16, pixel.repeat(16 * 16)).expect("it is full");
        Step {
            time_secs: step as f64,
            observation: Arc::new(Observation::new([("head".to_owned(), image)])),
            action: Action::Primitive(step % 3),
        }
    };
    Trajectory {
        id: id.to_owned(),
        steps: (0..12).map(step).collect(),
        ..demonstration()
    }
}

/// Keeps the loss of every step.
#[derive(Default)]
struct Losses(Vec<f32>);

impl TrainingObserver for Losses {
    fn notice(&mut self, event: &TrainingEvent) {
        if let TrainingEvent::Step { losses, .. } = event {
            self.0.push(losses.total);
        }
    }
}

#[test]
fn a_policy_learns_through_an_encoder_from_a_file_and_acts_when_it_is_exported() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let encoder = frozen_encoder(place.path(), EngineChoice::Auto);
    let levels = [("one", 180), ("two", 200), ("three", 220), ("four", 240)];
    let shown = levels.map(|(id, level)| coloured(id, level)).to_vec();
    let set = [DemonstrationSet::new("toy", shown).expect("they agree")];
    let mut config = BaselineConfig::of(BaselineMethod::Mvp, Preset::Tiny);
    config.steps = 80;
    config.dropout = 0.0;
    config.optimiser.learning_rate = 2e-2;
    let run = RunFolder::open(&place.path().join("run")).expect("a folder of its own");
    let mut losses = Losses::default();
    let report = train_baseline(&set, &config, Some(&encoder), &run, &mut losses);
    let report = report.expect("a training");
    let (first, last) = (losses.0[0], losses.0[losses.0.len() - 1]);
    assert!(last < 0.7 * first, "from {first} to {last}");

    let folder = write(&report.baseline);
    let given = std::fs::read(place.path().join("colours.onnx")).expect("the file");
    let kept = std::fs::read(folder.path().join(ENCODER_FILE)).expect("the encoder");
    assert_eq!(kept, given, "the encoder is not changed");
    let data = Dataset::new(&set).expect("a set that agrees with itself");
    let untrained = TrainedBaseline::untrained(&data, &config, Some(&encoder));
    let untrained = write(&untrained.expect("a configuration that fits"));
    let policy = |folder: &TempDir| std::fs::read(folder.path().join(POLICY_FILE)).expect("it");
    assert_ne!(policy(&folder), policy(&untrained));

    let baseline = Baseline::load(folder.path(), EngineChoice::Auto).expect("just exported");
    let unseen = coloured("five", 210);
    let states: Vec<State> = (0..12).map(|step| unseen.state(step, 1)).collect();
    let latents = baseline.encode(&states).expect("they fit");
    for right in 0..3 {
        let now = Latents::from_values(latents.dim(), latents.row(right).to_vec());
        let found = baseline.act(&now, latents.row(11)).expect("it fits");
        let head = &found.heads[0];
        assert!(head.iter().all(|p| *p <= head[right]), "{right}: {head:?}");
    }
}

#[test]
fn features_are_those_of_pictures_stretched_and_normalised() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let encoder = frozen_encoder(place.path(), EngineChoice::Auto);
    assert_eq!(encoder.pictures().feature_dim, 3);
    assert_eq!(
        (encoder.pictures().height, encoder.pictures().width),
        (8, 8)
    );
    let state = super::grey_state(40, 90);
    let cameras = state.newest().cameras();
    let features = encoder.features(&[state], &cameras).expect("they fit");
    // The pictures of a grey state are its level, one more and two more in red, green and blue.
    let level = |grey: f32| {
        [
            (grey - 1.0) / 10.0,
            (grey + 1.0 - 2.0) / 20.0,
            (grey + 2.0 - 3.0) / 40.0,
        ]
    };
    assert_near(
        "features",
        features.values(),
        &[level(40.0), level(90.0)].concat(),
    );
}

#[test]
fn encoders_that_are_none_are_refused_by_what_is_wrong() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let path = place.path().join("encoder.onnx");
    let refusal = |network: Vec<u8>| {
        std::fs::write(&path, network).expect("writing the network");
        let error = FrozenEncoder::load(&path, EngineChoice::Auto).expect_err("it does not fit");
        error.to_string()
    };
    let grey = Network::default()
        .input("image", &[1, 8, 8])
        .node("GlobalAveragePool", &["image"], "means")
        .node("Flatten", &["means"], "features")
        .output("features", &[1])
        .model();
    let message = refusal(grey);
    assert!(message.contains("its input"), "{message}");
    let map = Network::default()
        .input("image", &[3, 8, 8])
        .node("GlobalAveragePool", &["image"], "features")
        .output("features", &[3, 1, 1])
        .model();
    let message = refusal(map);
    assert!(message.contains("its output"), "{message}");
    let two = Network::default()
        .input("image", &[3, 8, 8])
        .input("depth", &[3, 8, 8])
        .node("Add", &["image", "depth"], "sum")
        .node("GlobalAveragePool", &["sum"], "means")
        .node("Flatten", &["means"], "features")
        .output("features", &[3])
        .model();
    let message = refusal(two);
    assert!(message.contains("one input and one output"), "{message}");

    let beside = place.path().join("encoder.json");
    std::fs::write(&beside, r#"{"deviation": [1, 0, 1]}"#).expect("writing beside it");
    let message = refusal(mean_colour(&[3]));
    assert!(message.contains("encoder.json"), "{message}");
    std::fs::write(&beside, r#"{"height": 9}"#).expect("writing beside it");
    let message = refusal(mean_colour(&[3]));
    assert!(message.contains("the height of its input"), "{message}");
}

#[test]
fn a_mangled_policy_never_reaches_an_engine() {
    let folder = write(&trained(BaselineMethod::Bc, None));
    let path = folder.path().join(POLICY_FILE);
    let mut bytes = std::fs::read(&path).expect("the policy");
    bytes[40] ^= 1;
    std::fs::write(&path, &bytes).expect("writing it back");
    let error = Baseline::load(folder.path(), EngineChoice::Auto).expect_err("a byte was flipped");
    assert!(
        matches!(error, InferenceError::ManifestRefused { .. })
            && error.to_string().contains(POLICY_FILE),
        "{error}"
    );
    std::fs::remove_file(folder.path().join(MANIFEST_FILE)).expect("it was there");
    let error = Baseline::load(folder.path(), EngineChoice::Auto).expect_err("no manifest");
    assert!(matches!(error, InferenceError::FileUnreadable { .. }));
}

#[test]
fn models_and_baselines_say_what_they_are() {
    let (ours, _) = exported();
    let error = Baseline::load(ours.path(), EngineChoice::Auto).expect_err("a model");
    assert!(error.to_string().contains("no baseline policy"), "{error}");
    let theirs = write(&trained(BaselineMethod::Rt1, None));
    let error = Model::load(theirs.path(), EngineChoice::Auto).expect_err("a baseline");
    assert!(error.to_string().contains("--policy"), "{error}");
}

#[test]
fn a_history_of_another_length_is_refused() {
    let folder = write(&trained(BaselineMethod::BcRnn, None));
    let baseline = Baseline::load(folder.path(), EngineChoice::Auto).expect("just exported");
    let dim = baseline.spec().latent_dim;
    let short = Latents::from_values(dim, vec![0.0; dim]);
    let error = baseline.act(&short, short.row(0)).expect_err("one state");
    assert!(error.to_string().contains("history"), "{error}");
}
