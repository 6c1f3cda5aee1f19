use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use super::folder::write_folder;
use super::graphs;
use crate::model::{
    ENCODER_FILE, LANDMARKS_FILE, MODEL_FORMAT_VERSION, ModelManifest, POLICY_FILE,
    PROJECTION_FILE, TRAVERSABILITY_FILE, TrainingRecord, file_digests,
};
use crate::training::{TrainedModel, TrainingError};

/// How the name of a file ends that is not written to its end.
pub(super) const UNFINISHED: &str = ".partial";

/// Writes a model as ONNX files with a manifest, and returns the manifest.
///
/// The folder is written beside its place, which it then takes: whatever goes wrong, an older model there is whole or the
/// new one is, and what else lies there stays. A folder that cannot be moved, such as one that is mounted, is written into
/// once all files are on the disk. `datasets` are digests of the demonstrations by the name of their set; they are kept in
/// the manifest.
///
/// # Errors
/// [`TrainingError::Io`] when a file cannot be written, [`TrainingError::ModelInUse`] while another process writes the
/// folder.
///
/// # Panics
/// Never: what is known of landmarks has a JSON form.
pub fn export(
    model: &TrainedModel,
    datasets: BTreeMap<String, String>,
    folder: &Path,
) -> Result<ModelManifest, TrainingError> {
    let mut files = vec![
        (ENCODER_FILE, graphs::encoder(model)),
        (PROJECTION_FILE, graphs::projection(model)),
        (TRAVERSABILITY_FILE, graphs::traversability(model)),
        (POLICY_FILE, graphs::policy(model)),
    ];
    if let Some(book) = &model.landmarks {
        files.push((
            LANDMARKS_FILE,
            serde_json::to_vec(book).expect("a book of landmarks has a JSON form"),
        ));
    }
    let manifest = manifest(model, datasets, &files);
    write_folder(folder, &files, &manifest.to_json())?;
    Ok(manifest)
}

fn manifest(
    model: &TrainedModel,
    datasets: BTreeMap<String, String>,
    files: &[(&str, Vec<u8>)],
) -> ModelManifest {
    ModelManifest {
        format_version: MODEL_FORMAT_VERSION,
        spec: model.spec.clone(),
        projection_width: model.projection_width(),
        temperature: model.temperature,
        files: file_digests(files),
        training: TrainingRecord {
            config: serde_json::to_value(&model.config).expect("a configuration has a JSON form"),
            seed: model.config.seed,
            step: model.step,
            datasets,
            validation: model.metrics.clone(),
        },
    }
}

/// Writes a file beside its place, hands it to the disk and renames it, so that a reader sees the old
/// contents or the new, never a part.
///
/// # Errors
/// [`TrainingError::Io`].
pub fn write_beside(path: &Path, bytes: &[u8]) -> Result<(), TrainingError> {
    let temporary = beside(path);
    if let Err(source) = write_to_disk(&temporary, bytes) {
        // What was written of it is of no use to anybody.
        let _ = std::fs::remove_file(&temporary);
        return Err(failed("write", path)(source));
    }
    std::fs::rename(&temporary, path).map_err(failed("rename to", path))
}

/// Writes a file and hands it to the disk.
pub(super) fn write_to_disk(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = std::fs::File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

fn beside(path: &Path) -> std::path::PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(UNFINISHED);
    path.with_file_name(name)
}

/// What could not be done with a file or folder.
pub(super) fn failed<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(io::Error) -> TrainingError + 'a {
    move |source| TrainingError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::MANIFEST_FILE;
    use crate::training::{Dataset, Preset, synthetic};

    fn model(seed: u64) -> TrainedModel {
        let data = Dataset::new(&[synthetic::demonstrations("a", 2, 8, 3)]).unwrap();
        let mut config = Preset::Tiny.config();
        config.seed = seed;
        TrainedModel::untrained(&data, &config)
    }

    #[test]
    fn an_exported_folder_is_complete_and_its_digests_hold() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("model");
        for seed in [1, 2] {
            let manifest = export(&model(seed), BTreeMap::new(), &folder).unwrap();
            let read = std::fs::read(folder.join(MANIFEST_FILE)).unwrap();
            assert_eq!(ModelManifest::from_json(&read).unwrap(), manifest);
            assert_eq!(manifest.files.len(), 4);
            for file in manifest.files.keys() {
                let bytes = std::fs::read(folder.join(file)).unwrap();
                manifest.verify(file, &bytes).unwrap();
            }
            assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 5);
            assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let place = tempfile::tempdir().unwrap();
        let blocked = place.path().join("file");
        std::fs::write(&blocked, "in the way").unwrap();
        let error = export(&model(1), BTreeMap::new(), &blocked.join("model")).unwrap_err();
        assert!(matches!(error, TrainingError::Io { .. }), "{error}");
    }
}
