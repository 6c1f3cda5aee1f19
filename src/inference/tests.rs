//! A model of four networks so small that their results can be worked out by hand.

#[cfg(feature = "train")]
mod agreement;
#[cfg(feature = "train")]
mod baselines;
mod fixture;
mod onnx;
#[cfg(feature = "train")]
mod trained;

use fixture::{DIM, TEMPERATURE, grey_state, model_folder};

use super::*;
use crate::model::{
    ENCODER_FILE, Encoder, Latents, LocalPolicy, MANIFEST_FILE, ModelError, Traversability,
};
use crate::trajectory::{Image, Observation, State};
use std::sync::Arc;

fn load() -> (tempfile::TempDir, Model) {
    let folder = model_folder();
    let model =
        Model::load(folder.path(), EngineChoice::Auto).expect("a model that was just written");
    (folder, model)
}

fn near(found: f32, expected: f32) -> bool {
    (found - expected).abs() <= 1e-4 * expected.abs().max(1.0)
}

#[test]
fn latents_are_the_planes_of_the_cameras_in_the_order_of_the_spec() {
    let (_folder, model) = load();
    let states: Vec<State> = (0..40).map(|i| grey_state(i, i + 100)).collect();
    let latents = model.encode(&states).expect("the states fit");
    assert_eq!((latents.len(), latents.dim()), (40, DIM));
    for (i, row) in (0..40).zip(latents.values().chunks_exact(DIM)) {
        // head before wrist, the older frame before the newer one, red, green, blue
        let head = i as f32;
        let wrist = head + 100.0;
        let expected = [head, head + 1.0, head + 2.0, head, head + 1.0, head + 2.0]
            .into_iter()
            .chain([
                wrist,
                wrist + 1.0,
                wrist + 2.0,
                wrist,
                wrist + 1.0,
                wrist + 2.0,
            ]);
        for (found, expected) in row.iter().zip(expected) {
            assert!(near(*found, expected), "state {i}: {row:?}");
        }
    }
}

#[test]
fn probabilities_of_pairs_follow_the_rows_that_they_name() {
    let (_folder, model) = load();
    let mut latents = Latents::new(DIM);
    for i in 0..300 {
        latents.push(&[i as f32 / 100.0; DIM]);
    }
    let projections = model
        .project(&latents)
        .expect("latents of the model's length");
    let pairs: Vec<(u32, u32)> = (0..5000).map(|i| (i % 300, (i * 7) % 300)).collect();
    let distributions = model
        .predict(&projections, &projections, &pairs)
        .expect("rows that exist");
    assert_eq!(distributions.len(), pairs.len());
    for ((from, to), row) in pairs.iter().zip(distributions.rows()) {
        // the network gives the logits (relu(difference), 0, 0)
        let difference = (*to as f32 - *from as f32) / 100.0;
        let weight = (difference.max(0.0) / TEMPERATURE).exp();
        assert!(
            near(row[0], weight / (weight + 2.0)),
            "{from}->{to}: {row:?}"
        );
        assert!(near(row.iter().sum(), 1.0));
    }
}

#[test]
fn policy_gives_a_distribution_a_head() {
    let (_folder, model) = load();
    let (from, mut goal) = ([1.0; DIM], [1.0; DIM]);
    goal[0] = 1.0 + 2.0_f32.ln();
    let heads = model
        .act(&from, &goal)
        .expect("latents of the model's length")
        .heads;
    // the network puts the first value of the difference on the last class of the second head
    assert_eq!(heads.iter().map(Vec::len).collect::<Vec<_>>(), [2, 3]);
    assert!(near(heads[0][0], 0.5) && near(heads[0][1], 0.5));
    assert!(
        near(heads[1][0], 0.25) && near(heads[1][2], 0.5),
        "{heads:?}"
    );
}

#[test]
fn nothing_in_gives_nothing_out() {
    let (_folder, model) = load();
    assert!(model.encode(&[]).expect("no states").is_empty());
    let projections = model.project(&Latents::new(DIM)).expect("no latents");
    assert!(
        model
            .predict(&projections, &projections, &[])
            .expect("no pairs")
            .is_empty()
    );
}

#[test]
fn latents_of_another_length_are_refused() {
    let (_folder, model) = load();
    let error = model.project(&Latents::new(DIM + 1)).expect_err("too long");
    assert!(
        matches!(error, ModelError::Length { expected: DIM, .. }),
        "{error}"
    );
    assert!(model.act(&[0.0; DIM - 1], &[0.0; DIM]).is_err());
}

#[test]
fn an_image_of_another_size_is_refused_by_the_camera_s_name() {
    let (_folder, model) = load();
    let image = |h, w| Image::new(h, w, vec![0; (h * w * 3) as usize]).expect("it is full");
    let observation = Observation::new([
        ("head".to_owned(), image(2, 3)),
        ("wrist".to_owned(), image(2, 3)),
    ]);
    let state = State::from_history(&[Arc::new(observation)], 2);
    let error = model
        .encode(&[state])
        .expect_err("the wrist camera is smaller")
        .to_string();
    assert!(error.contains("'wrist' at 4x3"), "{error}");
}

#[test]
fn a_mangled_network_never_reaches_an_engine() {
    let folder = model_folder();
    let path = folder.path().join(ENCODER_FILE);
    let mut bytes = std::fs::read(&path).expect("the encoder");
    bytes[40] ^= 1;
    std::fs::write(&path, &bytes).expect("writing it back");
    let error = Model::load(folder.path(), EngineChoice::Auto).expect_err("a byte was flipped");
    let message = error.to_string();
    assert!(
        matches!(error, InferenceError::ManifestRefused { .. }),
        "{message}"
    );
    assert!(
        message.contains(ENCODER_FILE) && message.contains(&folder.path().display().to_string())
    );
}

#[test]
fn missing_files_and_networks_under_each_other_s_name_are_named() {
    let folder = model_folder();
    std::fs::remove_file(folder.path().join(MANIFEST_FILE)).expect("it was there");
    let error = Model::load(folder.path(), EngineChoice::Auto).expect_err("no manifest");
    assert!(error.to_string().contains(MANIFEST_FILE), "{error}");
    let cause = std::error::Error::source(&error);
    let cause = cause.and_then(|e| e.downcast_ref::<std::io::Error>());
    let kind = cause.map(std::io::Error::kind);
    assert_eq!(kind, Some(std::io::ErrorKind::NotFound));

    let folder = fixture::model_folder_with_swapped_networks();
    let error = Model::load(folder.path(), EngineChoice::Auto).expect_err("networks are swapped");
    assert!(
        matches!(error, InferenceError::NetworkMisfit { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("policy.onnx"), "{error}");
}

#[test]
fn a_folder_that_was_moved_away_is_told_with_the_way_back() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let [folder, previous] = ["model", ".model.previous"].map(|name| place.path().join(name));
    let written = model_folder();
    std::fs::rename(written.path(), &previous).expect("moving it away");
    let of_model = Model::load(&folder, EngineChoice::Auto).map(drop);
    let of_baseline = Baseline::load(&folder, EngineChoice::Auto).map(drop);
    let way_back = format!("mv {} {}", previous.display(), folder.display());
    for loaded in [of_model, of_baseline] {
        let error = loaded.expect_err("it is not there");
        assert!(
            matches!(error, InferenceError::MovedAway { .. })
                && error.to_string().ends_with(&way_back),
            "{error}"
        );
    }
    std::fs::rename(&previous, &folder).expect("moving it back");
    Model::load(&folder, EngineChoice::Auto).expect("a model that is back");
}
