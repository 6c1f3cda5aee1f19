//! Recordings of all kinds under one roof: MCAP files, LeRobot datasets, mapping files that name them.

mod names;
mod search;
mod sizes;
mod source;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::bag;
use super::digest::hexadecimal;
use super::left_out::{why_damaged, why_left_out, why_not_practised_on};
use super::mapping::{Mapping, is_mapping};
use super::view::ReadOptions;
use super::{Recording, RecordingReport, StorageError, sha256_file};
use crate::trajectory::{Binning, DemonstrationSet};
pub(super) use names::slug;
use names::{unique_ids, words};
use search::Search;
use sizes::check_sizes;
use source::{Container, Source};

/// The recordings among some paths, found but not read.
///
/// A path is an MCAP file, a bag of several (a folder whose `metadata.yaml`, as `ros2 bag record` writes it, names them,
/// or any of its files, that one included), a LeRobot dataset (a folder with `meta/info.json`), a folder in which any of
/// these lies at any depth except in hidden folders, or a mapping file (any other `*.yaml`), which names recordings and
/// says how they are read. A recording to which several paths lead counts once.
#[derive(Clone, Debug)]
pub struct Recordings {
    /// Sorted.
    sources: Vec<Source>,
    mappings: Vec<Arc<Mapping>>,
    options: ReadOptions,
    paths: Vec<PathBuf>,
}

impl Recordings {
    /// Finds the recordings among paths. Of datasets the metadata is read, of other recordings nothing.
    ///
    /// # Errors
    /// [`StorageError::Io`] when a path cannot be read, [`StorageError::NoRecordings`] when there are none,
    /// [`StorageError::PartMissing`], [`StorageError::BagDamaged`] and [`StorageError::BagWithoutFiles`] for a bag that is
    /// not whole, [`StorageError::Mapping`] for a wrong mapping file, [`StorageError::Dataset`] for wrong metadata.
    pub fn open(paths: &[PathBuf], options: &ReadOptions) -> Result<Self, StorageError> {
        let mut search = Search::new(options);
        let mut mappings = Vec::new();
        for path in paths {
            if is_mapping(path) {
                let mapping = Arc::new(Mapping::load(path)?);
                for recordings in &mapping.recordings {
                    search.take(recordings, Some(&mapping))?;
                }
                mappings.push(mapping);
            } else {
                search.take(path, None)?;
            }
        }
        let mut found = Self {
            sources: search.found(paths)?,
            mappings,
            options: options.clone(),
            paths: paths.to_vec(),
        };
        if found.told_tasks().len() <= 1 {
            for source in &mut found.sources {
                let mapping = source.view.mapping.as_ref();
                let said = mapping.and_then(|m| m.said_task());
                source.task_by_mapping = said.map(str::to_owned);
            }
        }
        Ok(found)
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sources.len()
    }

    /// Says what is in each recording, without decoding more images than needed.
    #[must_use]
    pub fn inspect(&self) -> Vec<Result<RecordingReport, StorageError>> {
        self.sources.par_iter().map(Source::inspect).collect()
    }

    /// Reads the recordings one after another, in order. Of one that is so damaged that nothing is left of it the
    /// trajectory has no steps, and its report says why it is left out.
    pub fn read(&self) -> impl Iterator<Item = Result<Recording, StorageError>> {
        self.sources.iter().map(|source| {
            let mut recording = source.read()?;
            let report = &mut recording.report;
            if report.left_out.is_none() {
                report.left_out = why_damaged(report);
            }
            Ok(recording)
        })
    }

    /// The tasks that are shown, by names that can be parts of paths. Datasets say which they are; other
    /// recordings are all of one task, that of the mapping file or else of the first path's name.
    #[must_use]
    pub fn tasks(&self) -> Vec<String> {
        let said: Vec<String> = self.told_tasks().into_keys().collect();
        if said.len() > 1 {
            return said;
        }
        let mapped = self.mappings.first().map(|m| m.task());
        let named = self.paths.first().map(|path| {
            let is_metadata = bag::is_metadata(path);
            let folder = is_metadata.then(|| bag::folder_of(path)).flatten();
            let path = folder.as_ref().unwrap_or(path);
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        });
        vec![mapped.or(named).unwrap_or_default()]
    }

    /// The tasks that datasets tell, by the names that they have here. Texts of which a name holds too little to tell
    /// them apart, long ones or those in other letters, have numbers.
    fn told_tasks(&self) -> BTreeMap<String, String> {
        let texts = self.sources.iter().filter_map(Source::task);
        let texts: BTreeMap<String, String> = texts.map(|text| (words(&text), text)).collect();
        let mut told: BTreeMap<String, String> = BTreeMap::new();
        for text in texts.into_values() {
            let name = slug(&text);
            let numbered = (2_usize..).map(|n| format!("{name}_{n}"));
            let mut names = std::iter::once(name.clone()).chain(numbered);
            let free = names.find(|name| !told.contains_key(name));
            told.insert(free.unwrap_or(name), text);
        }
        told
    }

    /// How continuous actions are cut: as the mapping files say, else into `bins` equal bins.
    #[must_use]
    pub fn binning(&self, bins: usize) -> Binning {
        let mapping = self.mappings.first();
        mapping.map_or_else(|| Binning::uniform(bins), |m| m.binning(bins))
    }

    /// Reads the demonstrations of one task, in order, and says of every recording what is in it.
    ///
    /// Where datasets tell of several tasks, those are taken that have this name or the one that
    /// [`tasks`](Self::tasks) gives them. The trajectories carry the name `task`, whatever the files call it.
    /// Their ids are the files' stems, with the folder before them where stems repeat. Left out, and
    /// marked so in their reports, are recordings that say that they failed or are practice, and damaged ones:
    /// where steps are missing, neighbours need not follow each other and the last step need not be the end
    /// of the task, and of some nothing is left.
    ///
    /// # Errors
    /// [`StorageError`] of the first recording in order that cannot be read; [`StorageError::NoSuchTask`];
    /// [`StorageError::NoDemonstrations`] when every recording was left out; [`StorageError::SizesDiffer`] when a
    /// camera has several sizes; [`StorageError::Set`] when cameras or action spaces differ.
    pub fn demonstrations(
        &self,
        task: &str,
    ) -> Result<(DemonstrationSet, Vec<RecordingReport>), StorageError> {
        self.whole(task, why_left_out)
    }

    /// Reads practice with the gripper at one task, as [`demonstrations`](Self::demonstrations) reads those, but
    /// for what says that it is practice.
    ///
    /// # Errors
    /// Those of [`demonstrations`](Self::demonstrations).
    pub fn practice(
        &self,
        task: &str,
    ) -> Result<(DemonstrationSet, Vec<RecordingReport>), StorageError> {
        self.whole(task, why_not_practised_on)
    }

    fn whole(
        &self,
        task: &str,
        why_left_out: impl Fn(&RecordingReport) -> Option<String>,
    ) -> Result<(DemonstrationSet, Vec<RecordingReport>), StorageError> {
        let sources = self.of_task(task)?;
        let read: Vec<Result<Recording, StorageError>> =
            sources.par_iter().map(|source| source.read()).collect();
        // Collected apart, so that of several errors always the first one is reported.
        let recordings = read.into_iter().collect::<Result<Vec<_>, _>>()?;
        let places: Vec<&Path> = sources.iter().map(|s| s.place.as_path()).collect();
        let ids = unique_ids(&places);
        let mut trajectories = Vec::new();
        let mut reports = Vec::new();
        for (recording, id) in recordings.into_iter().zip(ids) {
            let mut report = recording.report;
            if report.left_out.is_none() {
                report.left_out = why_left_out(&report);
            }
            if report.left_out.is_none() {
                let mut trajectory = recording.trajectory;
                task.clone_into(&mut trajectory.task);
                trajectory.id = id;
                trajectories.push(trajectory);
            }
            reports.push(report);
        }
        if trajectories.is_empty() {
            return Err(StorageError::NoDemonstrations {
                task: task.to_owned(),
                count: reports.len(),
                reasons: list(reports.iter().map(|r| {
                    let reason = r.left_out.as_deref().unwrap_or_default();
                    format!("{}: {reason}", r.place())
                })),
            });
        }
        check_sizes(task, &trajectories, &reports)?;
        let set =
            DemonstrationSet::new(task, trajectories).map_err(|source| StorageError::Set {
                task: task.to_owned(),
                source,
            })?;
        Ok((set, reports))
    }

    fn of_task(&self, task: &str) -> Result<Vec<&Source>, StorageError> {
        let told = self.told_tasks();
        if told.len() <= 1 {
            return Ok(self.sources.iter().collect());
        }
        let by_text = || told.values().find(|text| words(text) == words(task));
        let meant = told.get(task).or_else(by_text);
        // A name that holds too little of the text would be that of another task.
        let named = || told.get(&slug(task)).filter(|_| slug(task) == words(task));
        let meant = meant.or_else(named);
        let wanted = meant.map(|text| words(text));
        let is_wanted = |s: &&Source| s.task().is_none_or(|t| Some(words(&t)) == wanted);
        let sources: Vec<&Source> = self.sources.iter().filter(is_wanted).collect();
        if sources.is_empty() {
            return Err(StorageError::NoSuchTask {
                task: task.to_owned(),
                paths: list(self.paths.iter().map(|p| p.display().to_string())),
                known: list(told.into_iter().map(|(name, text)| {
                    if name == words(&text) {
                        name
                    } else {
                        format!("{name} ('{text}')")
                    }
                })),
            });
        }
        Ok(sources)
    }

    /// All files that the recordings consist of, with those that name the files of bags, and the mapping files; sorted.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> = self.mappings.iter().map(|m| m.path().to_owned()).collect();
        for source in &self.sources {
            match &source.container {
                Container::Mcap { .. } => files.extend(source.mcap_files()),
                Container::Episode { dataset, number: 0 } => {
                    files.extend(dataset.files().iter().map(|f| dataset.root.join(f)));
                }
                Container::Episode { .. } => {}
            }
        }
        files.sort();
        files.dedup();
        files
    }

    /// The recordings in MCAP: the place of each, as its report names it, and the files that it consists of, with the
    /// one that names those of a bag.
    pub(crate) fn mcap_recordings(&self) -> Vec<(&Path, Vec<PathBuf>)> {
        let all = self.sources.iter().map(|s| (&*s.place, s.mcap_files()));
        all.filter(|(_, files)| !files.is_empty()).collect()
    }

    /// A digest of the bytes of all files, in sorted order and whatever their names, and of what was asked
    /// for beside them: 64 hexadecimal digits.
    ///
    /// # Errors
    /// [`StorageError::Io`] when a file cannot be read.
    pub fn digest(&self) -> Result<String, StorageError> {
        let digests: Vec<Result<String, StorageError>> = self
            .files()
            .par_iter()
            .map(|path| sha256_file(path))
            .collect();
        let digests = digests.into_iter().collect::<Result<Vec<_>, _>>()?;
        let asked = self.options.digested();
        Ok(hexadecimal(&Sha256::digest(digests.concat() + &asked)))
    }
}

fn list(items: impl Iterator<Item = String>) -> String {
    const SHOWN: usize = 5;
    let items: Vec<_> = items.collect();
    let mut shown = items[..items.len().min(SHOWN)].join("; ");
    if items.len() > SHOWN {
        shown = format!("{shown}; and {} more", items.len() - SHOWN);
    }
    shown
}
