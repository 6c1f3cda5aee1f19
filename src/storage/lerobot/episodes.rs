//! Which episodes a dataset has, and where their frames and videos lie.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use arrow::array::{Array, ArrayRef, AsArray, Float64Array, Int64Array, LargeStringArray};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use serde::Deserialize;

use super::frames::Table;
use super::info::{Info, Version, read_text};
use super::template::{Value, filled};
use super::{StorageError, fault};

/// An episode as the metadata describes it.
#[derive(Clone, Debug)]
pub(in crate::storage) struct Episode {
    pub index: u64,
    pub tasks: Vec<String>,
    pub length: u64,
    /// The table with its frames, relative to the dataset.
    pub data: PathBuf,
    /// Of each camera that is a video.
    pub videos: BTreeMap<String, VideoPart>,
}

/// Where an episode lies in a video.
#[derive(Clone, Debug)]
pub(in crate::storage) struct VideoPart {
    /// The file, relative to the dataset.
    pub path: PathBuf,
    /// Seconds from the start of the file to the first frame.
    pub from_secs: f64,
}

/// The files that describe the episodes, sorted: of version 2 a text, of version 3 tables, such as
/// `meta/episodes/chunk-000/file-000.parquet`.
pub(super) fn episode_files(root: &Path, info: &Info) -> Result<Vec<PathBuf>, StorageError> {
    match info.version {
        Some(Version::Three) => tables_below(&root.join("meta/episodes")),
        _ => Ok(vec![root.join("meta/episodes.jsonl")]),
    }
}

/// The episodes that these files describe.
pub(super) fn load_episodes(
    root: &Path,
    info: &Info,
    files: &[PathBuf],
) -> Result<Vec<Episode>, StorageError> {
    let mut episodes = Vec::new();
    for file in files {
        episodes.extend(match info.version {
            Some(Version::Three) => load_table(file, info)?,
            _ => load_lines(file, info)?,
        });
    }
    episodes.sort_by_key(|e| e.index);
    let path = root.join("meta");
    if let Some(twice) = episodes.windows(2).find(|w| w[0].index == w[1].index) {
        let reason = format!(
            "episode {} is described twice: keep one of them",
            twice[0].index
        );
        return Err(fault(&path, reason));
    }
    if episodes.is_empty() {
        return Err(fault(
            &path,
            "no episodes are described: is the dataset complete?",
        ));
    }
    Ok(episodes)
}

#[derive(Deserialize)]
struct EpisodeLine {
    episode_index: u64,
    #[serde(default)]
    tasks: Vec<String>,
    length: u64,
}

/// Version 2: a JSON object a line.
fn load_lines(path: &Path, info: &Info) -> Result<Vec<Episode>, StorageError> {
    let text = read_text(path)?;
    let mut episodes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let at = |reason: String| fault(path, format!("line {}: {reason}", number + 1));
        let line: EpisodeLine = serde_json::from_str(line).map_err(|e| {
            let told = e.to_string().replace("at line 1 column", "at column");
            at(format!("{told}. Each line is one episode: {{\"episode_index\": 0, \"tasks\": [..], \"length\": 10}}"))
        })?;
        let index = line.episode_index;
        let values = |key| {
            [
                ("episode_chunk", Value::Number(index / info.chunks_size)),
                ("episode_index", Value::Number(index)),
                ("video_key", Value::Text(key)),
            ]
        };
        let data = filled(&info.data_path, &values("")).map_err(&at)?;
        let mut videos = BTreeMap::new();
        for (key, _, _) in info.cameras().filter(|(_, _, is_video)| *is_video) {
            let template = info.video_path.as_deref().unwrap_or(DEFAULT_VIDEO_PATH);
            let part = VideoPart {
                path: filled(template, &values(key)).map_err(&at)?,
                from_secs: 0.0,
            };
            videos.insert(key.to_owned(), part);
        }
        episodes.push(Episode {
            index,
            tasks: line.tasks,
            length: line.length,
            data,
            videos,
        });
    }
    Ok(episodes)
}

const DEFAULT_VIDEO_PATH: &str =
    "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4";

/// Version 3: a table.
fn load_table(path: &Path, info: &Info) -> Result<Vec<Episode>, StorageError> {
    let mut episodes = Vec::new();
    let table = Table::open(path)?;
    let wanted = |name: &str| {
        matches!(name, "episode_index" | "tasks" | "length")
            || name.starts_with("data/")
            || name.starts_with("videos/")
    };
    let names: Vec<String> = table.columns().into_iter().filter(|n| wanted(n)).collect();
    for batch in table.read(&names, None)? {
        let batch = batch?;
        let columns = Columns {
            path,
            batch: &batch,
        };
        for row in 0..batch.num_rows() {
            episodes.push(columns.episode(row, info)?);
        }
    }
    Ok(episodes)
}

/// All tables two levels below a folder, sorted.
fn tables_below(folder: &Path) -> Result<Vec<PathBuf>, StorageError> {
    let mut tables = Vec::new();
    let mut open = vec![(folder.to_owned(), 0)];
    while let Some((folder, depth)) = open.pop() {
        let entries = fs::read_dir(&folder).map_err(StorageError::io("read", &folder))?;
        for entry in entries {
            let path = entry.map_err(StorageError::io("read", &folder))?.path();
            if path.is_dir() && depth < 2 {
                open.push((path, depth + 1));
            } else if path.extension().is_some_and(|e| e == "parquet") {
                tables.push(path);
            }
        }
    }
    tables.sort();
    if tables.is_empty() {
        return Err(fault(
            folder,
            "it holds no table of episodes (*.parquet): is the dataset complete?",
        ));
    }
    Ok(tables)
}

/// A part of a table of episodes.
struct Columns<'a> {
    path: &'a Path,
    batch: &'a arrow::record_batch::RecordBatch,
}

impl Columns<'_> {
    fn column(&self, name: &str) -> Result<&ArrayRef, StorageError> {
        self.batch
            .column_by_name(name)
            .ok_or_else(|| fault(self.path, format!("the column '{name}' is missing")))
    }

    fn number(&self, name: &str, row: usize) -> Result<u64, StorageError> {
        let array = self.column(name)?;
        let wrong = || {
            let reason = format!("row {row}, column '{name}': no number of at least 0");
            fault(self.path, reason)
        };
        let array = cast(&array.slice(row, 1), &DataType::Int64).map_err(|_| wrong())?;
        let array = array
            .as_any()
            .downcast_ref::<Int64Array>()
            .ok_or_else(wrong)?;
        let value = (!array.is_null(0))
            .then(|| array.value(0))
            .ok_or_else(wrong)?;
        u64::try_from(value).map_err(|_| wrong())
    }

    fn seconds(&self, name: &str, row: usize) -> Result<f64, StorageError> {
        let array = self.column(name)?;
        let wrong = || {
            let reason = format!("row {row}, column '{name}': no time in seconds");
            fault(self.path, reason)
        };
        let array = cast(&array.slice(row, 1), &DataType::Float64).map_err(|_| wrong())?;
        let array = array
            .as_any()
            .downcast_ref::<Float64Array>()
            .ok_or_else(wrong)?;
        let value = (!array.is_null(0)).then(|| array.value(0));
        value
            .filter(|v| v.is_finite() && *v >= 0.0)
            .ok_or_else(wrong)
    }

    fn tasks(&self, row: usize) -> Result<Vec<String>, StorageError> {
        let Some(array) = self.batch.column_by_name("tasks") else {
            return Ok(Vec::new());
        };
        let wrong = || {
            fault(
                self.path,
                format!("row {row}, column 'tasks': no list of texts"),
            )
        };
        // A list with large offsets, too, which as a text would be one in brackets.
        let list = if let Some(list) = array.as_list_opt::<i32>() {
            list.value(row)
        } else if let Some(list) = array.as_list_opt::<i64>() {
            list.value(row)
        } else {
            array.slice(row, 1)
        };
        let texts = cast(&list, &DataType::LargeUtf8).map_err(|_| wrong())?;
        let texts = texts
            .as_any()
            .downcast_ref::<LargeStringArray>()
            .ok_or_else(wrong)?;
        Ok(texts.iter().flatten().map(str::to_owned).collect())
    }

    fn episode(&self, row: usize, info: &Info) -> Result<Episode, StorageError> {
        let index = self.number("episode_index", row)?;
        let at = |reason: String| fault(self.path, format!("row {row}: {reason}"));
        let place = |prefix: &str, key: &str, template: &str| {
            let values = [
                (
                    "chunk_index",
                    Value::Number(self.number(&format!("{prefix}/chunk_index"), row)?),
                ),
                (
                    "file_index",
                    Value::Number(self.number(&format!("{prefix}/file_index"), row)?),
                ),
                ("video_key", Value::Text(key)),
            ];
            filled(template, &values).map_err(at)
        };
        let mut videos = BTreeMap::new();
        for (key, _, _) in info.cameras().filter(|(_, _, is_video)| *is_video) {
            let prefix = format!("videos/{key}");
            let template = info.video_path.as_deref();
            let template = template.ok_or_else(|| {
                at(format!(
                    "feature '{key}' is a video, but info.json has no video_path"
                ))
            })?;
            let part = VideoPart {
                path: place(&prefix, key, template)?,
                from_secs: self.seconds(&format!("{prefix}/from_timestamp"), row)?,
            };
            videos.insert(key.to_owned(), part);
        }
        Ok(Episode {
            index,
            tasks: self.tasks(row)?,
            length: self.number("length", row)?,
            data: place("data", "", &info.data_path)?,
            videos,
        })
    }
}
