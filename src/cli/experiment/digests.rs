//! Digests by which a cell names what it was measured with.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::cli::error::CliError;
use crate::cli::recipe::Ingredient;
use crate::cli::train::PRACTICE_OF;
use crate::model::{MANIFEST_FILE, sha256_hex};

/// Digests by the names of what they are of.
pub(super) type Digests = BTreeMap<String, String>;

/// What cells that name no recordings depend on.
pub(super) const RECORDINGS_UNNAMED: &str = "the recordings, where it does not name them";

/// What a cell calls the digest of a model's manifest.
const MODEL: &str = "model";
/// What a cell calls the digest of an image encoder that somebody else trained.
const ENCODER: &str = "frozen encoder";

/// Digests of the manifest in a model's folder and of the recordings that it says it was trained on, beside that of the
/// encoder that somebody else trained, if the model has one.
pub(super) fn digests_of(model: &Path, encoder: Option<&str>) -> Result<Digests, CliError> {
    let file = model.join(MANIFEST_FILE);
    let text = fs::read(&file).map_err(CliError::io(&file))?;
    let mut digests = Digests::from([(MODEL.to_owned(), sha256_hex(&text))]);
    digests.extend(encoder.map(|digest| (ENCODER.to_owned(), digest.to_owned())));
    let manifest: Value = serde_json::from_slice(&text).unwrap_or_default();
    let datasets = manifest["training"]["datasets"].as_object();
    for (task, digest) in datasets.into_iter().flatten() {
        if let Some(digest) = digest.as_str() {
            digests.insert(recordings_name(task), digest.to_owned());
        }
    }
    Ok(digests)
}

/// What a cell names of the recordings of a task, as they are now.
pub(super) fn recordings_now(task: &str, digest: String) -> Ingredient {
    let place = pointer_to(&recordings_name(task));
    Ingredient::Digest(format!("the recordings of {task}"), place, digest)
}

/// What a cell names of the encoder that somebody else trained, as it is now.
pub(super) fn encoder_now(digest: &str) -> Ingredient {
    let what = "the files of the frozen encoder".to_owned();
    Ingredient::Digest(what, pointer_to(ENCODER), digest.to_owned())
}

/// What a cell calls the digest of recordings that a manifest names by their task, or as practice of it.
fn recordings_name(named: &str) -> String {
    if named.starts_with(PRACTICE_OF) {
        named.to_owned()
    } else {
        format!("demonstrations of {named}")
    }
}

/// Where a cell has a digest, as a JSON pointer.
pub(super) fn pointer_to(name: &str) -> String {
    format!("/digests/{name}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::recipe::Recipe;

    #[test]
    fn a_cell_names_model_recordings_and_encoder_and_tells_which_of_them_differ() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = r#"{"training": {"datasets": {"sock": "ab", "practice of sock": "12"}}}"#;
        fs::write(folder.path().join(MANIFEST_FILE), manifest).unwrap();
        let digests = digests_of(folder.path(), Some("cd")).unwrap();
        let names: Vec<&str> = digests.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "demonstrations of sock",
                "frozen encoder",
                "model",
                "practice of sock"
            ]
        );
        assert_eq!(digests["model"], sha256_hex(manifest.as_bytes()));
        let without = digests_of(folder.path(), None).unwrap();
        assert!(!without.contains_key(ENCODER));
        let nowhere = digests_of(&folder.path().join("nowhere"), None);
        let refused = nowhere.unwrap_err().to_string();
        assert!(refused.contains("nowhere/manifest.json"), "{refused}");

        let cell = serde_json::json!({"digests": digests});
        let told = |recordings: &str, encoder| {
            let recordings = recordings_now("sock", recordings.to_owned());
            let recipe = Recipe {
                named: vec![recordings, encoder_now(encoder)],
                unnamed: vec!["the version"],
            };
            recipe.differences(&cell)
        };
        assert!(told("ab", "cd").ends_with("does not name: the version"));
        assert_eq!(told("ef", "cd"), "the recordings of sock differ");
        assert_eq!(told("ab", "ef"), "the files of the frozen encoder differ");
    }
}
