//! Looking for recordings where paths lead.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::list;
use super::source::{Container, Source, real};
use crate::storage::lerobot::{self, Dataset};
use crate::storage::mapping::Mapping;
use crate::storage::salvage::check_begins_as_mcap;
use crate::storage::view::{ReadOptions, View};
use crate::storage::{StorageError, bag, is_mcap};

/// How the names of files of recorders end whose format is not read.
const OF_OTHER_FORMATS: [&str; 6] = ["bag", "db3", "h5", "hdf5", "zst", "zstd"];

/// What was found so far.
pub(super) struct Search {
    options: ReadOptions,
    sources: Vec<Source>,
    /// The files of the bags that were taken, from the root on: whoever names another one of them means the same bag.
    parts: BTreeSet<PathBuf>,
    /// Of the files of other formats that were passed over the first.
    passed_over: Option<PathBuf>,
    /// Of the folders with a bag's metadata that is none of several files the first.
    bag: Option<PathBuf>,
}

impl Search {
    pub(super) fn new(options: &ReadOptions) -> Self {
        Self {
            options: options.clone(),
            sources: Vec::new(),
            parts: BTreeSet::new(),
            passed_over: None,
            bag: None,
        }
    }

    /// The recordings to which `paths` led, sorted and each once.
    pub(super) fn found(mut self, paths: &[PathBuf]) -> Result<Vec<Source>, StorageError> {
        self.sources.sort_by(|a, b| a.order().cmp(&b.order()));
        self.leave_out_repeated();
        if self.sources.is_empty() {
            // What is there says more than what is not.
            if let Some(file) = &self.passed_over {
                check_begins_as_mcap(file)?;
            }
            if let Some(error) = self.bag.as_deref().and_then(bag::why_without_files) {
                return Err(error);
            }
            return Err(StorageError::NoRecordings {
                paths: list(paths.iter().map(|p| p.display().to_string())),
            });
        }
        Ok(self.sources)
    }

    /// Keeps one of the sources that are the same recording, as where a folder holds a link to another one of its own:
    /// that of its own path, or else the first. A file of a bag that is taken is not taken by itself as well.
    fn leave_out_repeated(&mut self) {
        let parts = self.sources.iter().flat_map(Source::parts);
        let parts: BTreeSet<PathBuf> = parts.map(|part| real(part)).collect();
        if !parts.is_empty() {
            let is_part = |s: &Source| s.parts().is_empty() && parts.contains(&real(&s.place));
            self.sources.retain(|source| !is_part(source));
        }
        let identities: Vec<_> = self.sources.iter().map(Source::identity).collect();
        let mut seen = BTreeSet::new();
        let mut is_kept = vec![false; identities.len()];
        for of_own_path in [true, false] {
            for ((identity, is_own_path), is_kept) in identities.iter().zip(&mut is_kept) {
                if *is_own_path == of_own_path && seen.insert(identity) {
                    *is_kept = true;
                }
            }
        }
        let mut is_kept = is_kept.into_iter();
        self.sources.retain(|_| is_kept.next().unwrap_or(true));
    }

    /// Takes the recordings that a path leads to.
    pub(super) fn take(
        &mut self,
        path: &Path,
        mapping: Option<&Arc<Mapping>>,
    ) -> Result<(), StorageError> {
        let view = View {
            mapping: mapping.cloned(),
            options: self.options.clone(),
        };
        if path.is_dir() {
            return self.take_folder(path, &view);
        }
        fs::metadata(path).map_err(StorageError::io("read", path))?;
        if bag::is_metadata(path) {
            return self.take_bag(path, &view);
        }
        if self.parts.contains(&from_root(path)) {
            return Ok(());
        }
        if let Some(folder) = bag::around(path)
            && let Some(parts) = bag::parts(&folder)?
        {
            self.take_mcap(&folder, parts, &view);
        } else {
            self.take_mcap(path, vec![path.to_owned()], &view);
        }
        Ok(())
    }

    /// Takes the bag whose metadata is named, which stands for it as any of its files does. Metadata by another name
    /// than a bag's stands for nothing.
    fn take_bag(&mut self, metadata: &Path, view: &View) -> Result<(), StorageError> {
        let name = metadata.file_name().unwrap_or_default();
        if name != bag::METADATA_FILE {
            return Ok(());
        }
        if let Some(folder) = bag::folder_of(metadata)
            && let Some(parts) = bag::parts(&folder)?
        {
            self.take_mcap(&folder, parts, view);
            return Ok(());
        }
        let folder = metadata.parent().unwrap_or(Path::new(""));
        keep_first(&mut self.bag, folder);
        for file in bag::present(folder) {
            self.take_file(&file, view);
        }
        Ok(())
    }

    /// Takes a file that nobody named if it is an MCAP file.
    fn take_file(&mut self, path: &Path, view: &View) {
        if is_mcap(path) {
            self.take_mcap(path, vec![path.to_owned()], view);
        } else if is_of_other_format(path) {
            keep_first(&mut self.passed_over, path);
        }
    }

    /// Takes a recording of one file or several.
    fn take_mcap(&mut self, place: &Path, files: Vec<PathBuf>, view: &View) {
        if files.len() > 1 {
            self.parts.extend(files.iter().map(|file| from_root(file)));
        }
        self.sources.push(Source {
            place: place.to_owned(),
            container: Container::Mcap { files },
            view: view.clone(),
            task_by_mapping: None,
        });
    }

    fn take_folder(&mut self, folder: &Path, view: &View) -> Result<(), StorageError> {
        if lerobot::is_dataset(folder) {
            let dataset = Arc::new(Dataset::open(folder)?);
            for number in 0..dataset.episodes.len() {
                self.sources.push(Source {
                    place: folder.join(dataset.episode_name(number)),
                    container: Container::Episode {
                        dataset: Arc::clone(&dataset),
                        number,
                    },
                    view: view.clone(),
                    task_by_mapping: None,
                });
            }
            return Ok(());
        }
        if let Some(parts) = bag::parts(folder)? {
            self.take_mcap(folder, parts, view);
        } else if bag::bag_in(folder).is_some() {
            keep_first(&mut self.bag, folder);
        }
        let entries = fs::read_dir(folder).map_err(StorageError::io("read", folder))?;
        for entry in entries {
            let path = entry.map_err(StorageError::io("read", folder))?.path();
            let is_hidden = path
                .file_name()
                .is_some_and(|n| n.to_string_lossy().starts_with('.'));
            if is_hidden {
                continue;
            }
            if path.is_dir() {
                // A link to a folder around it would lead there again and again.
                if !(path.is_symlink() && real(folder).starts_with(real(&path))) {
                    self.take_folder(&path, view)?;
                }
            } else {
                self.take_file(&path, view);
            }
        }
        Ok(())
    }
}

/// Keeps the first of two paths, in whatever order they come.
fn keep_first(kept: &mut Option<PathBuf>, path: &Path) {
    if kept.as_deref().is_none_or(|first| path < first) {
        *kept = Some(path.to_owned());
    }
}

fn is_of_other_format(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|e| OF_OTHER_FORMATS.iter().any(|other| e == *other))
}

/// A path from the root on, as it is written.
fn from_root(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_of_which_all_files_are_named_is_taken_once() {
        const PARTS: [&str; 3] = ["run_0.mcap", "run_1.mcap", "run_2.mcap"];
        let bag = tempfile::tempdir().unwrap();
        let listed = PARTS.map(|part| format!("    - {part}\n")).concat();
        let metadata = format!("rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}");
        fs::write(bag.path().join(bag::METADATA_FILE), metadata).unwrap();
        let mut search = Search::new(&ReadOptions::default());
        let mut files = PARTS.map(|part| bag.path().join(part)).to_vec();
        files.push(bag.path().join("beside.mcap"));
        for file in &files {
            fs::write(file, "").unwrap();
        }
        for file in &files {
            search.take(file, None).unwrap();
        }
        let places: Vec<&Path> = search.sources.iter().map(|s| s.place.as_path()).collect();
        assert_eq!(places, [bag.path(), files[3].as_path()]);
    }
}
