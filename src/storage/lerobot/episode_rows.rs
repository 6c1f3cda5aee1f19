//! Which rows of a table of frames are an episode's.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::episodes::Episode;
use super::frames::{Table, integers};
use super::{StorageError, fault};

const EPISODE_INDEX: &str = "episode_index";

/// The rows of all episodes. A table can hold thousands, and is looked through once, when the first of its own is
/// asked for.
#[derive(Debug)]
pub(super) struct EpisodeRows {
    /// By their paths within the dataset.
    tables: BTreeMap<PathBuf, TableRows>,
}

#[derive(Debug, Default)]
struct TableRows {
    /// The episodes that the metadata says are in the table.
    expected: BTreeSet<u64>,
    /// What is there, or why the table cannot be read.
    found: OnceLock<Result<Found, String>>,
}

#[derive(Debug, Default)]
struct Found {
    /// How many rows there are.
    rows: usize,
    /// Of those episodes that are expected.
    stretches: BTreeMap<u64, Stretch>,
}

/// Rows of one episode that follow each other.
#[derive(Debug)]
struct Stretch {
    rows: Range<usize>,
    /// The first row of the same episode that does not follow them.
    apart: Option<usize>,
}

impl EpisodeRows {
    /// The rows of these episodes, for which no table is opened yet.
    pub fn of(episodes: &[Episode]) -> Self {
        let mut tables: BTreeMap<PathBuf, TableRows> = BTreeMap::new();
        for episode in episodes {
            let table = tables.entry(episode.data.clone()).or_default();
            table.expected.insert(episode.index);
        }
        Self { tables }
    }

    /// The rows of an episode in its table, which lies at `path`: a stretch in which the column `episode_index` has
    /// its number.
    pub fn rows_of(
        &self,
        episode: &Episode,
        table: &Table,
        path: &Path,
    ) -> Result<Range<usize>, StorageError> {
        let known = self.tables.get(&episode.data);
        let known = known.expect("every episode has its table here");
        let found = known
            .found
            .get_or_init(|| Found::look(table, &known.expected));
        let rows = match found {
            Ok(found) => found.rows_of(episode.index),
            Err(reason) => Err(reason.clone()),
        };
        rows.map_err(|reason| fault(path, reason))
    }
}

/// What is wrong with a table, without its path.
fn why(error: StorageError) -> String {
    match error {
        StorageError::Dataset { reason, .. } => reason,
        other => other.to_string(),
    }
}

impl Found {
    fn look(table: &Table, expected: &BTreeSet<u64>) -> Result<Self, String> {
        let mut found = Self::default();
        let columns = [EPISODE_INDEX.to_owned()];
        for batch in table.read(&columns, None).map_err(why)? {
            let batch = batch.map_err(why)?;
            let indices = integers(batch.column(0))
                .ok_or_else(|| format!("the column '{EPISODE_INDEX}' holds no whole numbers"))?;
            for equal in indices.chunk_by(|a, b| a == b) {
                let rows = found.rows..found.rows + equal.len();
                found.rows = rows.end;
                let episode = u64::try_from(equal[0]).ok();
                if let Some(episode) = episode.filter(|e| expected.contains(e)) {
                    found.take(episode, rows);
                }
            }
        }
        Ok(found)
    }

    fn take(&mut self, episode: u64, rows: Range<usize>) {
        match self.stretches.get_mut(&episode) {
            None => {
                let stretch = Stretch { rows, apart: None };
                self.stretches.insert(episode, stretch);
            }
            Some(known) if known.rows.end == rows.start => known.rows.end = rows.end,
            Some(known) => known.apart = known.apart.or(Some(rows.start)),
        }
    }

    fn rows_of(&self, episode: u64) -> Result<Range<usize>, String> {
        match self.stretches.get(&episode) {
            Some(Stretch { rows, apart: None }) => Ok(rows.clone()),
            Some(Stretch {
                rows,
                apart: Some(row),
            }) => Err(format!(
                "rows {rows:?} and row {row} are of episode {episode}: an episode's rows must follow each other"
            )),
            None => Err(format!(
                "none of its {} rows is of episode {episode}, which the metadata says is here: is the dataset complete?",
                self.rows
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int64Array};
    use arrow::record_batch::RecordBatch;
    use parquet::arrow::ArrowWriter;

    use super::*;

    fn write(path: &Path, episodes: Vec<i64>) -> Table {
        let column: ArrayRef = Arc::new(Int64Array::from(episodes));
        let batch = RecordBatch::try_from_iter([(EPISODE_INDEX, column)]).unwrap();
        let file = File::create(path).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        Table::open(path).unwrap()
    }

    fn episode(index: u64) -> Episode {
        Episode {
            index,
            tasks: Vec::new(),
            length: 1,
            data: PathBuf::from("frames.parquet"),
            videos: BTreeMap::new(),
        }
    }

    #[test]
    fn each_episode_has_its_rows_or_a_reason_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        // More rows than are decoded at once.
        let mut episodes = vec![3_i64; 200];
        episodes.extend([5; 100]);
        episodes.extend([-1, 7, 5, 5, 8]);
        let table = write(&path, episodes);
        let known = EpisodeRows::of(&[3, 5, 6, 7].map(episode));
        let rows = |index| {
            let rows = known.rows_of(&episode(index), &table, &path);
            rows.map_err(|e| e.to_string())
        };
        assert_eq!(rows(3), Ok(0..200));
        assert_eq!(rows(7), Ok(301..302));
        let apart = rows(5).unwrap_err();
        assert!(
            apart.contains("frames.parquet: rows 200..300 and row 302 are of episode 5"),
            "{apart}"
        );
        let missing = rows(6).unwrap_err();
        assert!(
            missing.contains("none of its 305 rows is of episode 6"),
            "{missing}"
        );
    }

    #[test]
    fn a_table_is_looked_through_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        let table = write(&path, vec![0, 0, 1, 1, 1]);
        let known = EpisodeRows::of(&[0, 1].map(episode));
        assert_eq!(known.rows_of(&episode(0), &table, &path).unwrap(), 0..2);
        // Who looks again finds nothing.
        let table = write(&path, vec![9; 5]);
        assert_eq!(known.rows_of(&episode(1), &table, &path).unwrap(), 2..5);
    }
}
