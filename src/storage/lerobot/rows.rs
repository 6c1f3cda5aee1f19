//! The rows of an episode without their images, checked.

use std::ops::Range;
use std::path::PathBuf;

use super::dataset::Dataset;
use super::episodes::Episode;
use super::frames::{Table, integers, numbers, vectors};
use super::{StorageError, fault};
use crate::storage::Loss;
use crate::storage::view::View;
use crate::trajectory::{Action, ActionSpace};

const TIMESTAMP: &str = "timestamp";
const FRAME_INDEX: &str = "frame_index";
/// Times as 32-bit floats are off by less.
const TIME_TOLERANCE_SECS: f64 = 1e-3;

/// The frames of an episode without their images.
pub(super) struct Frames<'a> {
    pub dataset: &'a Dataset,
    pub episode: &'a Episode,
    pub path: PathBuf,
    pub table: Table,
    pub rows: Range<usize>,
    pub bytes: u64,
    /// The number of each frame within the episode.
    pub numbers: Vec<u64>,
    /// In nanoseconds, in order.
    pub times: Vec<u64>,
    pub action_key: String,
    pub space: ActionSpace,
    pub actions: Vec<Action>,
    pub losses: Vec<Loss>,
}

impl<'a> Frames<'a> {
    pub fn load(dataset: &'a Dataset, place: usize, view: &View) -> Result<Self, StorageError> {
        let episode = &dataset.episodes[place];
        let path = dataset.root.join(&episode.data);
        let (action_key, feature) = dataset.action(view)?;
        let width = feature.shape[0] as usize;
        let table = Table::open(&path)?;
        let rows = dataset.episode_rows.rows_of(episode, &table, &path)?;
        let columns = [action_key, TIMESTAMP, FRAME_INDEX].map(str::to_owned);
        let (mut actions, mut secs, mut indices) = (Vec::new(), Vec::new(), Vec::new());
        for batch in table.read(&columns, Some(rows.clone()))? {
            let batch = batch?;
            let column = |name: &str| batch.column_by_name(name).cloned();
            let wrong = |name: &str, reason: &str| {
                let from = rows.start + actions.len();
                fault(
                    &path,
                    format!("column '{name}', rows from {from} on: {reason}"),
                )
            };
            let array = column(action_key).ok_or_else(|| wrong(action_key, "is missing"))?;
            let values = vectors(&array).map_err(|reason| wrong(action_key, &reason))?;
            let times = column(TIMESTAMP).as_ref().and_then(numbers);
            let times = times.ok_or_else(|| wrong(TIMESTAMP, "no numbers"))?;
            let numbers = column(FRAME_INDEX).as_ref().and_then(integers);
            let numbers = numbers.ok_or_else(|| wrong(FRAME_INDEX, "no whole numbers"))?;
            actions.extend(values);
            secs.extend(times);
            indices.extend(numbers);
        }
        let action_key = action_key.to_owned();
        let mut frames = Self {
            dataset,
            episode,
            bytes: std::fs::metadata(&path).map_or(0, |m| m.len()),
            path,
            table,
            rows,
            numbers: Vec::new(),
            times: Vec::new(),
            action_key,
            space: ActionSpace::Continuous {
                names: feature.action_names(),
            },
            actions: Vec::new(),
            losses: Vec::new(),
        };
        frames.number(&indices)?;
        frames.time(&secs)?;
        frames.act(&actions, width)?;
        Ok(frames)
    }

    fn at(&self, row: usize, column: &str, reason: &str) -> StorageError {
        let reason = format!(
            "row {} (frame {row} of episode {}), column '{column}': {reason}",
            self.rows.start + row,
            self.episode.index
        );
        fault(&self.path, reason)
    }

    /// Takes the numbers of the frames, which must rise; what is missing is a loss.
    fn number(&mut self, indices: &[i64]) -> Result<(), StorageError> {
        for (row, index) in indices.iter().enumerate() {
            let is_next = row == 0 || *index > indices[row - 1];
            match u64::try_from(*index) {
                Ok(number) if is_next => self.numbers.push(number),
                _ => {
                    let reason = format!("{index} does not come after the frame before it");
                    return Err(self.at(row, FRAME_INDEX, &reason));
                }
            }
        }
        let (found, said) = (indices.len() as u64, self.episode.length);
        if found > said {
            let reason = format!(
                "{found} rows are of episode {}, whose metadata says {said}: the two do not belong together",
                self.episode.index
            );
            return Err(fault(&self.path, reason));
        }
        let last = self.numbers.last().map_or(0, |n| n + 1);
        let missing = said.max(last) - found;
        if missing > 0 {
            self.losses.push(Loss::MissingFrames { frames: missing });
        }
        Ok(())
    }

    /// Times: those that were restored, else those of the frames' numbers, which the column must not
    /// contradict by going back.
    fn time(&mut self, secs: &[f64]) -> Result<(), StorageError> {
        if let Some(bad) = secs.iter().position(|s| !s.is_finite()) {
            return Err(self.at(bad, TIMESTAMP, &format!("{} is no time", secs[bad])));
        }
        let restored = self.dataset.restored.as_ref();
        let restored = restored.and_then(|r| r.episode(self.episode.index)?.times_secs.as_ref());
        let rises = |times: &[f64]| times.windows(2).all(|w| w[0] <= w[1]);
        if let Some(times) = restored.filter(|t| t.len() == secs.len() && rises(t)) {
            self.times = times.iter().map(|s| nanos(*s)).collect();
            return Ok(());
        }
        let fps = self.dataset.info.fps;
        let counted: Vec<f64> = self.numbers.iter().map(|n| *n as f64 / fps).collect();
        let late = |w: &&[f64]| w[1] < w[0];
        let back: Vec<f64> = secs.windows(2).filter(late).map(|w| w[0] - w[1]).collect();
        let is_regular = secs
            .iter()
            .zip(&counted)
            .all(|(a, b)| (a - secs[0] - (b - counted[0])).abs() < TIME_TOLERANCE_SECS);
        if !back.is_empty() {
            self.losses.push(Loss::TimesGoBack {
                topic: format!("column '{TIMESTAMP}'"),
                messages: back.len(),
                by_millis: (back.iter().fold(0.0, |a: f64, b| a.max(*b)) * 1e3) as u64,
            });
        }
        let times = if is_regular || !back.is_empty() {
            &counted
        } else {
            secs
        };
        self.times = times.iter().map(|s| nanos(*s)).collect();
        Ok(())
    }

    fn act(&mut self, rows: &[Vec<f64>], width: usize) -> Result<(), StorageError> {
        let restored = self.dataset.restored.as_ref().map(|r| &r.action_space);
        let restored = restored.filter(|_| self.action_key == super::info::ACTION);
        match restored {
            Some(ActionSpace::Primitives { names }) if names.len() == width => {
                self.space = ActionSpace::Primitives {
                    names: names.clone(),
                };
            }
            Some(ActionSpace::Continuous { names }) if names.len() == width => {
                self.space = ActionSpace::Continuous {
                    names: names.clone(),
                };
            }
            _ => {}
        }
        for (row, values) in rows.iter().enumerate() {
            let wrong = |reason: &str| self.at(row, &self.action_key, reason);
            if values.len() != width {
                let reason = format!("{} values, but info.json says {width}", values.len());
                return Err(wrong(&reason));
            }
            if let Some(bad) = values.iter().position(|v| !(*v as f32).is_finite()) {
                let reason = format!(
                    "value {bad} is {}: a robot cannot be told that. Leave the episode out, or mend the recording",
                    values[bad]
                );
                return Err(wrong(&reason));
            }
            let action = match &self.space {
                ActionSpace::Primitives { .. } => {
                    let ones = values.iter().filter(|v| **v == 1.0).count();
                    let zeros = values.iter().filter(|v| **v == 0.0).count();
                    let index = values.iter().position(|v| *v == 1.0);
                    let index = index.filter(|_| ones == 1 && ones + zeros == width);
                    Action::Primitive(index.ok_or_else(|| {
                        wrong("a motion primitive is a one among zeros, as meta/catena.json says")
                    })?)
                }
                _ => Action::Continuous(values.iter().map(|v| *v as f32).collect()),
            };
            self.actions.push(action);
        }
        Ok(())
    }
}

fn nanos(secs: f64) -> u64 {
    (secs.max(0.0) * 1e9).round() as u64
}
