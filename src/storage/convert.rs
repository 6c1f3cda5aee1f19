//! Recordings of any kind to a LeRobot dataset or to MCAP files.

use std::collections::BTreeMap;
use std::path::Path;

use super::episode::{EpisodeWriter, RecordingMetadata, keys};
use super::lerobot::DatasetWriter;
use super::recordings::slug;
use super::replace::replace_folder;
use super::{Recording, RecordingReport, Recordings, StorageError};
use crate::trajectory::Trajectory;

pub use super::lerobot::PictureFormat;

/// What came of a conversion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conversion {
    /// Episodes that were written.
    pub episodes: usize,
    /// Steps of all of them.
    pub steps: usize,
    /// Tasks that they show.
    pub tasks: Vec<String>,
    /// Steps a second, where the format has one rate for all.
    pub fps: Option<u32>,
    /// Recordings that were left out, each with its reason.
    pub left_out: Vec<String>,
    /// What the new files do not hold, in words.
    pub lost: Vec<String>,
}

/// Writes recordings as one LeRobot dataset of version 3.0, with images within its tables.
///
/// Motion primitives become columns of ones and zeros. What a dataset has no place for (what
/// primitives are called, subgoals, success, metadata, times that are not regular) is kept in
/// `meta/catena.json`, which other programs pass over. Damaged recordings are left out, failed ones are
/// kept with their mark.
///
/// # Errors
/// [`StorageError::OutExists`], [`StorageError`] of the first recording that cannot be read,
/// [`StorageError::Conversion`] when cameras or actions differ, [`StorageError::NoDemonstrations`] when all
/// were left out. Nothing is at `out` then.
pub fn convert_to_lerobot(
    recordings: &Recordings,
    out: &Path,
    pictures: PictureFormat,
) -> Result<Conversion, StorageError> {
    refuse_existing(out)?;
    let mut conversion = Conversion::default();
    replace_folder(out, |draft| {
        let mut writer: Option<DatasetWriter> = None;
        let mut ids: BTreeMap<String, Ids> = BTreeMap::new();
        for recording in recordings.read() {
            let recording = recording?;
            if !conversion.takes(&recording.report) {
                continue;
            }
            let Recording { trajectory, report } = &recording;
            let writer = writer.get_or_insert_with(|| {
                let robot = report.metadata.get(keys::ROBOT).cloned();
                DatasetWriter::new(draft, trajectory, robot, pictures)
            });
            if let Some(reason) = writer.misfit(trajectory) {
                return Err(StorageError::Conversion {
                    recording: report.place(),
                    reason,
                });
            }
            let ids = ids.entry(slug(&trajectory.task)).or_default();
            writer.add(trajectory, report, &ids.unique(&trajectory.id))?;
            conversion.count(trajectory, report);
            conversion.fps = Some(writer.fps());
        }
        match writer {
            Some(writer) => writer.finish(),
            None => Err(conversion.nothing()),
        }
    })?;
    if pictures == PictureFormat::Jpeg {
        conversion
            .lost
            .push("pixels, as far as JPEG of quality 92 changes them".to_owned());
    }
    Ok(conversion)
}

/// Writes recordings as MCAP files, `OUT/TASK/ID.mcap`.
///
/// With [`PictureFormat::Png`] they hold every pixel. Damaged recordings are left out, failed ones are kept
/// with their mark.
///
/// # Errors
/// [`StorageError::OutExists`], [`StorageError`] of the first recording that cannot be read or written,
/// [`StorageError::NoDemonstrations`] when all were left out. Nothing is at `out` then.
pub fn convert_to_mcap(
    recordings: &Recordings,
    out: &Path,
    pictures: PictureFormat,
) -> Result<Conversion, StorageError> {
    refuse_existing(out)?;
    let mut conversion = Conversion::default();
    replace_folder(out, |draft| {
        let mut ids: BTreeMap<String, Ids> = BTreeMap::new();
        for recording in recordings.read() {
            let Recording { trajectory, report } = recording?;
            if !conversion.takes(&report) {
                continue;
            }
            let task = slug(&trajectory.task);
            let id = ids.entry(task.clone()).or_default().unique(&trajectory.id);
            let path = draft.join(task).join(format!("{id}.mcap"));
            write_mcap(&path, &trajectory, &report, pictures)?;
            conversion.count(&trajectory, &report);
        }
        if conversion.episodes == 0 {
            return Err(conversion.nothing());
        }
        Ok(())
    })?;
    if pictures == PictureFormat::Jpeg {
        conversion
            .lost
            .push("pixels, as far as JPEG of quality 92 changes them".to_owned());
    }
    Ok(conversion)
}

fn refuse_existing(out: &Path) -> Result<(), StorageError> {
    if out.exists() {
        return Err(StorageError::OutExists {
            path: out.to_owned(),
        });
    }
    Ok(())
}

fn write_mcap(
    path: &Path,
    trajectory: &Trajectory,
    report: &RecordingReport,
    pictures: PictureFormat,
) -> Result<(), StorageError> {
    let mut metadata = report.metadata.clone();
    for written in [keys::STEPS, keys::VERSION] {
        metadata.remove(written);
    }
    let metadata = RecordingMetadata {
        robot: metadata.remove(keys::ROBOT).unwrap_or_default(),
        seed: metadata.remove(keys::SEED).and_then(|s| s.parse().ok()),
        success: metadata.remove(keys::SUCCESS).and_then(|s| s.parse().ok()),
        notes: metadata,
    };
    let mut writer = EpisodeWriter::create(path, &trajectory.task, &trajectory.action_space)?;
    writer.keep_every_pixel(pictures == PictureFormat::Png);
    writer.add_all(trajectory)?;
    writer.finish(&metadata)
}

/// Names that were given out.
#[derive(Default)]
struct Ids {
    uses: BTreeMap<String, usize>,
}

impl Ids {
    /// The name itself the first time, then with a number.
    fn unique(&mut self, id: &str) -> String {
        let safe: String = id.replace(['/', '\\'], "_");
        let uses = self.uses.entry(safe.clone()).or_default();
        *uses += 1;
        match *uses {
            1 => safe,
            n => {
                let numbered = format!("{safe}_{n}");
                self.unique(&numbered)
            }
        }
    }
}

impl Conversion {
    /// Whether a recording is whole; one that is not is noted.
    fn takes(&mut self, report: &RecordingReport) -> bool {
        if let Some(reason) = &report.left_out {
            self.left_out.push(format!("{}: {reason}", report.place()));
        }
        report.left_out.is_none()
    }

    fn count(&mut self, trajectory: &Trajectory, report: &RecordingReport) {
        self.episodes += 1;
        self.steps += trajectory.steps.len();
        if !self.tasks.contains(&trajectory.task) {
            self.tasks.push(trajectory.task.clone());
        }
        let unused: Vec<&str> = report
            .topics
            .iter()
            .map(|t| t.topic.as_str())
            .filter(|t| !is_carried(t, report))
            .collect();
        if !unused.is_empty() {
            let lost = format!("the topics {}", unused.join(", "));
            if !self.lost.contains(&lost) {
                self.lost.push(lost);
            }
        }
        let losses = report.losses.iter();
        let losses = losses.map(|loss| format!("{}: {loss}", report.place()));
        self.lost.extend(losses);
    }

    fn nothing(&self) -> StorageError {
        StorageError::NoDemonstrations {
            task: "the conversion".to_owned(),
            count: self.left_out.len(),
            reasons: self.left_out.join("; "),
        }
    }
}

/// Whether what a topic says is in the trajectory.
fn is_carried(topic: &str, report: &RecordingReport) -> bool {
    const OF_EVERY_DATASET: [&str; 5] = [
        "timestamp",
        "frame_index",
        "episode_index",
        "index",
        "task_index",
    ];
    let is_camera = report.cameras.iter().any(|c| c.topic == topic);
    let is_action = report.actions.as_ref().is_some_and(|a| a.topic == topic);
    let is_text = report.texts.iter().any(|text| text == topic);
    is_camera || is_action || is_text || OF_EVERY_DATASET.contains(&topic)
}
