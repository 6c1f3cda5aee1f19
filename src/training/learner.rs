use std::path::Path;

use burn::grad_clipping::GradientClippingConfig;
use burn::module::Module;
use burn::optim::{AdamWConfig, ModuleOptimizer};
use burn::tensor::{Bytes, Tensor};

use super::checkpoint::{Checkpoint, CheckpointState};
use super::encodings::{Encodings, gradients_of};
use super::weights::{Average, NamedWeights, assign, check_fit, collect};
use super::{OptimiserConfig, TrainingError, TrainingEvent, TrainingObserver};

/// A network with what a training changes beside it: its optimiser, the averages of its weights, and the best
/// of these so far.
pub struct Learner<M> {
    /// The network as it trains.
    pub network: M,
    /// Averages of its weights.
    pub average: Average,
    /// The averages that did best; empty before the first validation.
    pub best: Vec<NamedWeights>,
    optimiser: ModuleOptimizer,
}

impl<M: Module> Learner<M> {
    /// Before the first step.
    pub fn new(network: M, config: &OptimiserConfig) -> Self {
        Self {
            average: Average::new(config.average_decay, collect(&network)),
            network,
            best: Vec::new(),
            optimiser: optimiser(config),
        }
    }

    /// Moves the averages towards the weights after so many steps.
    pub fn note_step(&mut self, step: u64) {
        self.average.update(&self.network, step);
    }

    /// Changes the weights against the gradient of `total`, whose value is `loss` and which was computed from
    /// `encodings`, in a step counted from 1.
    ///
    /// # Errors
    /// [`TrainingError::Diverged`] when the loss is no number any more.
    pub fn descend(
        &mut self,
        total: &Tensor<1>,
        encodings: &Encodings,
        loss: f32,
        learning_rate: f64,
        step: u64,
    ) -> Result<(), TrainingError> {
        if !loss.is_finite() {
            return Err(TrainingError::Diverged {
                step,
                loss,
                learning_rate,
            });
        }
        let gradients = gradients_of(total, encodings, &self.network);
        self.network = (self.optimiser).step(learning_rate, self.network.clone(), gradients);
        Ok(())
    }

    /// A network with the averaged weights, made of a `fresh` one.
    pub fn averaged(&self, fresh: M) -> M {
        assign(fresh, &self.average.weights).expect("the averages are of this network")
    }

    /// Keeps the averaged weights as the best so far.
    pub fn keep_average(&mut self) {
        self.best.clone_from(&self.average.weights);
    }

    /// Goes on from a checkpoint, and gives the rest of it back.
    ///
    /// # Errors
    /// [`TrainingError::CheckpointUnusable`] when weights or averages in it are of another network or its optimiser is
    /// damaged.
    pub fn resume<S: CheckpointState>(
        &mut self,
        checkpoint: Checkpoint<S>,
        config: &OptimiserConfig,
        run_folder: &Path,
    ) -> Result<S, TrainingError> {
        let unusable = |reason| Checkpoint::<S>::unusable(run_folder, reason);
        let mut parts = vec![
            ("weights", &checkpoint.weights),
            ("averages", &checkpoint.average),
        ];
        // There are none before the first validation.
        if !checkpoint.best.is_empty() {
            parts.push(("best averages", &checkpoint.best));
        }
        for (part, weights) in parts {
            check_fit(&self.network, weights)
                .map_err(|reason| unusable(format!("its {part} do not fit: {reason}")))?;
        }
        self.network = assign(self.network.clone(), &checkpoint.weights).map_err(unusable)?;
        self.optimiser = optimiser(config)
            .from_bytes(Bytes::from_bytes_vec(checkpoint.optimiser))
            .map_err(|e| unusable(format!("its optimiser state is damaged: {e}")))?;
        self.average = Average::new(config.average_decay, checkpoint.average);
        self.best = checkpoint.best;
        Ok(checkpoint.state)
    }

    /// Writes all that [`resume`](Self::resume) needs, after so many steps.
    ///
    /// # Errors
    /// As [`Checkpoint::save`].
    pub fn write_checkpoint<S: CheckpointState>(
        &mut self,
        state: S,
        step: u64,
        run_folder: &Path,
        observer: &mut dyn TrainingObserver,
    ) -> Result<(), TrainingError> {
        let optimiser = self.optimiser.into_bytes().map_err(|e| TrainingError::Io {
            action: "serialise the optimiser for",
            path: Checkpoint::<S>::path(run_folder),
            source: std::io::Error::other(e.to_string()),
        })?;
        let checkpoint = Checkpoint {
            state,
            weights: collect(&self.network),
            average: self.average.weights.clone(),
            best: self.best.clone(),
            optimiser: optimiser.to_vec(),
        };
        let path = checkpoint.save(run_folder)?;
        observer.notice(&TrainingEvent::CheckpointWritten { step, path });
        Ok(())
    }
}

/// `AdamW` as a configuration has it.
pub fn optimiser(config: &OptimiserConfig) -> ModuleOptimizer {
    AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(config.weight_decay)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(config.clip_norm)))
        .init()
}
