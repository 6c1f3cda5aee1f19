use std::sync::Arc;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::reflex::{Reflex, Stillness};
use crate::planner::LiveDistances;
use crate::trajectory::{ActionSpace, Observation};

/// What changes during an episode.
#[derive(Clone)]
pub(super) struct Run {
    pub(super) step: usize,
    /// What was done last, and what was seen before it.
    last: Option<(Vec<usize>, Arc<Observation>)>,
    pub(super) distances: LiveDistances,
    pub(super) stage_step: usize,
    pub(super) lost_steps: usize,
    pub(super) least_cost: f64,
    /// The least cost-to-go of this stage, whatever was made dearer.
    pub(super) nearest_cost: f64,
    pub(super) progress_step: usize,
    pub(super) reflex: Reflex,
    pub(super) rng: ChaCha8Rng,
}

impl Run {
    pub(super) fn new(seed: u64, space: &ActionSpace) -> Self {
        Self {
            step: 0,
            last: None,
            distances: LiveDistances::unknown(0, 1),
            stage_step: 0,
            lost_steps: 0,
            least_cost: f64::INFINITY,
            nearest_cost: f64::INFINITY,
            progress_step: 0,
            reflex: Reflex::new(space),
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// A new stage: cost-to-go starts afresh.
    pub(super) fn enter(&mut self) {
        self.stage_step = self.step;
        self.least_cost = f64::INFINITY;
        self.nearest_cost = f64::INFINITY;
        self.progress_step = self.step;
    }

    /// What is done at this step.
    pub(super) fn acted(&mut self, classes: Vec<usize>, before: Arc<Observation>) {
        self.last = Some((classes, before));
    }

    /// What is seen after it. The class of what was done is returned, and whether it had an effect.
    pub(super) fn see(
        &mut self,
        observation: &Observation,
        stillness: Stillness,
    ) -> Option<(usize, bool)> {
        let (classes, before) = self.last.take()?;
        self.step += 1;
        let has_moved = self.reflex.note(&classes, &before, observation, stillness);
        classes.first().map(|class| (*class, has_moved))
    }
}

/// Times the parts of a step.
pub(super) struct Watch(Instant);

impl Watch {
    pub(super) fn start() -> Self {
        Self(Instant::now())
    }

    pub(super) fn lap_ms(&mut self) -> f64 {
        let now = Instant::now();
        let ms = (now - self.0).as_secs_f64() * 1e3;
        self.0 = now;
        ms
    }
}
