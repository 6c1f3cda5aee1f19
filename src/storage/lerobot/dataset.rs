//! A dataset that is open: its metadata, and what of it a view uses.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::depth::{Depth, columns_of_depths};
use super::episode_rows::EpisodeRows;
use super::episodes::{Episode, episode_files, load_episodes};
use super::info::{ACTION, Feature, Info, listed};
use super::restored::Restored;
use super::{INFO, StorageError, fault};
use crate::storage::mapping::SaidOfTopic;
use crate::storage::view::View;

/// The metadata of a dataset.
#[derive(Debug)]
pub(in crate::storage) struct Dataset {
    pub root: PathBuf,
    pub(super) info: Info,
    pub episodes: Vec<Episode>,
    /// Where their frames are in the tables.
    pub(super) episode_rows: EpisodeRows,
    /// The files that describe them.
    described_in: Vec<PathBuf>,
    pub(super) restored: Option<Restored>,
    /// Columns whose pictures hold depths, with how that is told; looked for when cameras are first asked for.
    columns_of_depths: OnceLock<BTreeMap<String, String>>,
}

/// The features that a view uses as cameras.
#[derive(Default)]
pub(super) struct Cameras<'a> {
    /// By name.
    pub used: Vec<Camera<'a>>,
    /// Depth maps that no mapping file speaks of, each with what tells that it is one.
    pub left_out: Vec<String>,
}

/// A feature that is used as a camera.
pub(super) struct Camera<'a> {
    /// Its column, or the name of its videos.
    pub key: &'a str,
    /// What it is called.
    pub name: String,
    pub feature: &'a Feature,
    pub is_video: bool,
}

impl Dataset {
    /// Reads the metadata of a dataset.
    pub fn open(root: &Path) -> Result<Self, StorageError> {
        let info = Info::load(root)?;
        let described_in = episode_files(root, &info)?;
        let episodes = load_episodes(root, &info, &described_in)?;
        Ok(Self {
            root: root.to_owned(),
            episode_rows: EpisodeRows::of(&episodes),
            episodes,
            described_in,
            restored: Restored::load(root)?,
            columns_of_depths: OnceLock::new(),
            info,
        })
    }

    /// All files that the episodes consist of, relative to the dataset, sorted; but not images that lie beside a table,
    /// which only its rows name.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> = self
            .episodes
            .iter()
            .flat_map(|e| {
                e.videos
                    .values()
                    .map(|v| v.path.clone())
                    .chain([e.data.clone()])
            })
            .collect();
        files.push(PathBuf::from(INFO));
        let within = |file: &PathBuf| Some(file.strip_prefix(&self.root).ok()?.to_owned());
        files.extend(self.described_in.iter().filter_map(within));
        let ours = super::restored::FILE;
        if self.restored.is_some() {
            files.push(PathBuf::from(ours));
        }
        files.sort();
        files.dedup();
        files
    }

    /// What an episode is called: as it was before it came into the dataset, if that is known.
    pub fn episode_name(&self, number: usize) -> String {
        let index = self.episodes[number].index;
        let restored = self.restored.as_ref().and_then(|r| r.episode(index));
        restored.map_or_else(|| format!("episode_{index:06}"), |r| r.id.clone())
    }

    /// What an episode's task is called.
    pub fn task(&self, episode: &Episode) -> String {
        let restored = self.restored.as_ref();
        let ours = restored.and_then(|r| Some(r.episode(episode.index)?.task.clone()));
        ours.unwrap_or_else(|| episode.tasks.join("; "))
    }

    /// The cameras that a view uses.
    pub(super) fn cameras(&self, view: &View) -> Result<Cameras<'_>, StorageError> {
        let mut cameras = Cameras::default();
        for (key, feature) in &self.info.features {
            self.take_camera(key, feature, view, &mut cameras)?;
        }
        let Cameras { used, left_out } = &mut cameras;
        used.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(twice) = used.windows(2).find(|w| w[0].name == w[1].name) {
            let reason = format!(
                "features '{}' and '{}' are both camera '{}': give them names in a mapping file",
                twice[0].key, twice[1].key, twice[0].name
            );
            return Err(fault(&self.root.join(INFO), reason));
        }
        if used.is_empty() && !left_out.is_empty() {
            let reason = format!("no feature is a camera: {}", left_out.join("; "));
            return Err(fault(&self.root.join(INFO), reason));
        }
        if used.is_empty() {
            let reason = format!(
                "no feature that is used has dtype 'image' or 'video'; the features are {}",
                listed(self.info.features.keys())
            );
            return Err(fault(&self.root.join(INFO), reason));
        }
        Ok(cameras)
    }

    /// Takes a feature for what it is, or refuses a mapping file that names as a camera what gives no pictures.
    fn take_camera<'a>(
        &'a self,
        key: &'a str,
        feature: &'a Feature,
        view: &View,
        cameras: &mut Cameras<'a>,
    ) -> Result<(), StorageError> {
        let camera = |name: String| Camera {
            key,
            name,
            feature,
            is_video: feature.dtype == "video",
        };
        let mapping = view.mapping.as_ref();
        match mapping.map_or(SaidOfTopic::Nothing, |m| m.camera_of(key)) {
            SaidOfTopic::NoCamera => {}
            SaidOfTopic::Nothing => match self.depth(key, feature) {
                Some(depth) => cameras.left_out.push(format!("{key}: {}", depth.told_by)),
                None if feature.holds_images() => cameras.used.push(camera(plain_name(key))),
                None => {}
            },
            SaidOfTopic::Camera(name) => {
                let depth = self.depth(key, feature).filter(|depth| depth.is_sure);
                let other =
                    (!feature.holds_images()).then(|| format!("its dtype is '{}'", feature.dtype));
                let why_none = depth.map(|depth| depth.told_by).or(other);
                if let (Some(mapping), Some(why_none)) = (mapping, why_none) {
                    mapping.check_camera(&self.root, key, &why_none)?;
                }
                cameras.used.push(camera(name.to_owned()));
            }
        }
        Ok(())
    }

    /// What a feature is taken for a depth map by, if it is.
    fn depth(&self, key: &str, feature: &Feature) -> Option<Depth> {
        let seen = || {
            let columns = &self.columns_of_depths;
            let columns = columns.get_or_init(|| columns_of_depths(self));
            columns.get(key).map(|told_by| Depth::seen(told_by))
        };
        // A dataset of ours holds pictures alone, whatever its cameras are called.
        let is_ours = self.restored.is_some();
        let guessed = || Depth::guessed(key, feature).filter(|_| !is_ours);
        Depth::said(feature).or_else(seen).or_else(guessed)
    }

    /// The column of actions that a view uses.
    pub(super) fn action(&self, view: &View) -> Result<(&str, &Feature), StorageError> {
        let mapped = view.mapping.as_ref().and_then(|m| m.action_topic());
        let key = mapped.unwrap_or(ACTION);
        let path = self.root.join(INFO);
        if let Some(mapping) = &view.mapping {
            let keys: Vec<&str> = self.info.features.keys().map(String::as_str).collect();
            mapping.check_topics(&self.root, "feature", &keys)?;
        }
        let Some((key, feature)) = self.info.features.get_key_value(key) else {
            let reason = format!(
                "there is no feature '{key}'; the features are {}. Name the one that says what the robot was told \
                 in a mapping file",
                listed(self.info.features.keys())
            );
            return Err(fault(&path, reason));
        };
        feature
            .check_action(key)
            .map_err(|reason| fault(&path, reason))?;
        Ok((key, feature))
    }
}

/// `observation.images.top` is `top`, `observation.image` is `image`.
fn plain_name(key: &str) -> String {
    let key = key.strip_prefix("observation.").unwrap_or(key);
    let name = key.strip_prefix("images.").unwrap_or(key);
    name.replace(['/', '\\'], "_")
}
