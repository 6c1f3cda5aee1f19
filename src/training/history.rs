use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::export::write_beside;
use super::{StepLosses, TrainingError};
use crate::model::ValidationMetrics;

const HEADER: &str = "step,learning_rate,total,near,far,policy,motion,landmarks,validation_traversability_loss,\
validation_traversability_accuracy,validation_wormhole_rate,validation_look_alike_wormhole_rate,validation_policy_loss,\
validation_policy_accuracy,validation_policy_accuracy_across,validation_motion_explained,validation_landmark_error_pixels\n";

/// The losses of a training as `losses.csv` in its run folder, a row a step.
pub struct History {
    table: LossTable,
}

impl History {
    /// Opens the file; rows beyond `step`, which a killed run may have left, are dropped.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn open(run_folder: &Path, step: u64) -> Result<Self, TrainingError> {
        Ok(Self {
            table: LossTable::open(run_folder, HEADER, step)?,
        })
    }

    /// Adds a row; `validation` where this step was followed by one.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn add(
        &mut self,
        step: u64,
        learning_rate: f64,
        losses: &StepLosses,
        validation: Option<&ValidationMetrics>,
    ) -> Result<(), TrainingError> {
        let StepLosses {
            total,
            near,
            far,
            policy,
            motion,
            landmarks,
        } = losses;
        let tail = validation.map_or_else(
            || ",,,,,,,,".to_owned(),
            |v| {
                format!(
                    "{:.5},{:.5},{:.5},{:.5},{:.5},{:.5},{},{},{}",
                    v.traversability_loss,
                    v.traversability_accuracy,
                    v.wormhole_rate,
                    v.look_alike_wormhole_rate,
                    v.policy_loss,
                    v.policy_accuracy,
                    optional(v.policy_accuracy_across),
                    optional(v.motion_explained),
                    optional(v.landmark_error_pixels),
                )
            },
        );
        let row = format!(
            "{step},{learning_rate:.3e},{total:.5},{near:.5},{far:.5},{policy:.5},{motion:.5},{landmarks:.5},{tail}"
        );
        self.table.add(&row, validation.is_some())
    }

    /// Hands all rows to the system.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn flush(&mut self) -> Result<(), TrainingError> {
        self.table.flush()
    }
}

/// A figure that there may be.
fn optional(figure: Option<f64>) -> String {
    figure.map_or_else(String::new, |f| format!("{f:.5}"))
}

/// `losses.csv` of any training: rows that begin with their step.
pub struct LossTable {
    path: PathBuf,
    file: BufWriter<File>,
}

impl LossTable {
    /// Opens the file with this header line; rows beyond `step` and rows that were cut off are dropped.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn open(run_folder: &Path, header: &str, step: u64) -> Result<Self, TrainingError> {
        let path = run_folder.join("losses.csv");
        let commas = header.matches(',').count();
        let failed = |action| {
            let path = path.clone();
            move |source| TrainingError::Io {
                action,
                path,
                source,
            }
        };
        let kept = match fs::read_to_string(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            kept => kept.map_err(failed("read"))?,
        };
        let mut text = String::from(header);
        for line in kept.lines().skip(1) {
            let number = line.split(',').next().and_then(|n| n.parse::<u64>().ok());
            if line.matches(',').count() == commas && number.is_some_and(|n| n <= step) {
                text.push_str(line);
                text.push('\n');
            }
        }
        write_beside(&path, text.as_bytes())?;
        let end = File::options().append(true).open(&path);
        let file = BufWriter::new(end.map_err(failed("write"))?);
        Ok(Self { path, file })
    }

    /// Adds a row, and hands all rows to the system if that is asked for.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn add(&mut self, row: &str, flush: bool) -> Result<(), TrainingError> {
        let written = writeln!(self.file, "{row}");
        written.map_err(|source| self.failed(source))?;
        if flush { self.flush() } else { Ok(()) }
    }

    /// Hands all rows to the system.
    ///
    /// # Errors
    /// [`TrainingError::Io`].
    pub fn flush(&mut self) -> Result<(), TrainingError> {
        let flushed = self.file.flush();
        flushed.map_err(|source| self.failed(source))
    }

    fn failed(&self, source: std::io::Error) -> TrainingError {
        TrainingError::Io {
            action: "write",
            path: self.path.clone(),
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_after_the_checkpoint_and_torn_rows_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let losses = StepLosses::default();
        let mut history = History::open(folder.path(), 0).unwrap();
        for step in 1..=4 {
            history.add(step, 1e-3, &losses, None).unwrap();
        }
        history.flush().unwrap();
        let path = folder.path().join("losses.csv");
        let torn = fs::read_to_string(&path).unwrap() + "2,1e-3,0.1";
        fs::write(&path, torn).unwrap();

        let mut history = History::open(folder.path(), 3).unwrap();
        let kept = fs::read_to_string(&path).unwrap();
        assert_eq!(
            kept.lines().count(),
            4,
            "a kill now loses none of the rows before"
        );
        let metrics = ValidationMetrics::default();
        history.add(4, 1e-3, &losses, Some(&metrics)).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let steps: Vec<_> = text.lines().skip(1).map(|l| &l[..1]).collect();
        assert_eq!(steps, ["1", "2", "3", "4"]);
        assert!(text.ends_with("0.00000,,,\n"));
    }
}
