use std::path::Path;

use burn::tensor::Bytes;

use super::Run;
use crate::training::baseline::trained::BaselineState;
use crate::training::checkpoint::Checkpoint;
use crate::training::trainer::optimiser;
use crate::training::weights::{Average, assign, collect};
use crate::training::{TrainingError, TrainingEvent, TrainingObserver};

impl Run<'_> {
    /// Goes on from a checkpoint of the same training.
    pub(super) fn resume(
        &mut self,
        checkpoint: Checkpoint<BaselineState>,
    ) -> Result<(), TrainingError> {
        let unusable = |reason| unusable(self.folder, reason);
        let config = self.state.config.clone();
        self.network = assign(self.network.clone(), &checkpoint.weights).map_err(unusable)?;
        self.optimiser = optimiser(&config.optimiser)
            .from_bytes(Bytes::from_bytes_vec(checkpoint.optimiser))
            .map_err(|e| unusable(format!("its optimiser state is damaged: {e}")))?;
        self.average = Average::new(config.optimiser.average_decay, checkpoint.average);
        self.best = checkpoint.best;
        self.state = BaselineState {
            config,
            ..checkpoint.state
        };
        Ok(())
    }

    /// Writes all that [`resume`](Self::resume) needs.
    pub(super) fn write_checkpoint(
        &mut self,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError> {
        self.losses.flush()?;
        let optimiser = self.optimiser.into_bytes().map_err(|e| TrainingError::Io {
            action: "serialise the optimiser for",
            path: Checkpoint::<BaselineState>::path(self.folder),
            source: std::io::Error::other(e.to_string()),
        })?;
        let checkpoint = Checkpoint {
            state: self.state.clone(),
            weights: collect(&self.network),
            average: self.average.weights.clone(),
            best: self.best.clone(),
            optimiser: optimiser.to_vec(),
        };
        let path = checkpoint.save(self.folder)?;
        observer.notice(&TrainingEvent::CheckpointWritten {
            step: self.state.step,
            path,
        });
        Ok(())
    }
}

/// A checkpoint that is damaged.
pub(super) fn unusable(folder: &Path, reason: String) -> TrainingError {
    TrainingError::CheckpointUnusable {
        path: Checkpoint::<BaselineState>::path(folder),
        reason,
    }
}

/// Refuses the checkpoint of another training. The time limit may be changed: it says when to stop, not what
/// to learn.
pub(super) fn check_same(
    found: &BaselineState,
    wanted: &BaselineState,
    folder: &Path,
) -> Result<(), TrainingError> {
    let mut config = found.config.clone();
    config.max_minutes = wanted.config.max_minutes;
    let differs = [
        (config != wanted.config, "configurations"),
        (
            found.demonstrations != wanted.demonstrations,
            "demonstrations",
        ),
        (
            (&found.frozen, &found.spec) != (&wanted.frozen, &wanted.spec),
            "frozen encoders",
        ),
    ];
    match differs.into_iter().find(|(differs, _)| *differs) {
        None => Ok(()),
        Some((_, what)) => Err(TrainingError::CheckpointOfAnother {
            path: Checkpoint::<BaselineState>::path(folder),
            what,
        }),
    }
}
