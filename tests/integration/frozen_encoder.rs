//! A policy on an image encoder that was trained elsewhere and is given as an ONNX file.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::command::{catena, json_of, path, root, succeeded, text};
use crate::training::recorded;

#[path = "../../src/inference/tests/onnx.rs"]
mod onnx;

/// Four mixtures of the mean red, green and blue of a picture of 8x8, as a file.
fn encoder(folder: &Path, name: &str, weights: [f32; 12]) -> PathBuf {
    let network = onnx::Network::default()
        .input("image", &[3, 8, 8])
        .constant("mixtures", &[3, 4], &weights)
        .constant("nothing", &[4], &[0.0; 4])
        .node("GlobalAveragePool", &["image"], "means")
        .node("Flatten", &["means"], "colours")
        .node("Gemm", &["colours", "mixtures", "nothing"], "features")
        .output("features", &[4])
        .model();
    let file = folder.join(name);
    fs::write(&file, network).expect("written");
    file
}

/// A project whose task `wine` is shown in `demos/wine`, and a composition of it that ends after six steps.
fn project(folder: &Path) -> PathBuf {
    let tasks = folder.join("tasks");
    fs::create_dir(&tasks).expect("a folder");
    fs::copy(root().join("tasks/wine.yaml"), tasks.join("wine.yaml")).expect("copied");
    let composition = folder.join("short.yaml");
    let keys = "name: short\nmodel: graphs/bedroom/model\ndo: [wine]\nlimits: {steps: 6}\n";
    fs::write(&composition, keys).expect("written");
    composition
}

#[test]
fn a_policy_on_an_encoder_from_a_file_is_trained_and_evaluated_and_its_run_names_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let demos = recorded(&at("demos"), "wine", "2");
    let mut weights = [1.0, 0.0, 0.0, 0.3, 0.0, 1.0, 0.0, 0.3, 0.0, 0.0, 1.0, 0.3];
    let given = encoder(folder.path(), "colours.onnx", weights);
    weights[0] = 2.0;
    let other = encoder(folder.path(), "others.onnx", weights);
    let (model, run) = (at("model"), at("run"));
    let words = |encoder: &Path| {
        let words = ["train", path(&demos), "--method", "mvp", "--preset", "tiny"];
        let flags = ["--steps", "12", "--frozen-encoder", path(encoder)];
        let places = ["--out", path(&model), "--run", path(&run), "--resume"];
        let all = [&words[..], &flags, &places].concat();
        all.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let called = |words: &[String]| catena(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let output = called(&words(&given));
    assert!(output.status.success(), "{}", text(&output.stderr));

    let losses = fs::read_to_string(run.join("losses.csv")).expect("losses");
    assert_eq!(losses.lines().count(), 13);
    let kept = fs::read(model.join("encoder.onnx")).expect("the encoder");
    assert_eq!(kept, fs::read(&given).expect("the file"));
    let record = json_of(&run.join("run.json"));
    assert_eq!(record["frozen_encoder"]["file"], "colours.onnx");
    let manifest = json_of(&model.join("manifest.json"));
    let digest = &manifest["files"]["encoder.onnx"];
    assert_eq!(&record["frozen_encoder"]["sha256"], digest);
    let output = called(&words(&other));
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("frozen encoders"),
        "{said}"
    );

    let composition = project(folder.path());
    let words = ["evaluate", path(&composition), "--policy", path(&model)];
    let flags = ["--episodes", "1", "--json", "--root", path(folder.path())];
    let evaluation = succeeded(&[&words[..], &flags].concat());
    let evaluation: Value = serde_json::from_str(&evaluation).expect("JSON");
    assert_eq!(evaluation["name"], "short");
    assert_eq!(evaluation["results"].as_array().map(Vec::len), Some(1));
}
