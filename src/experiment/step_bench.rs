use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::evaluation::quantile;
use crate::environment::Environment;
use crate::planner::{LiveDistances, Localisation, PlainSearch, Planner};
use crate::rollout::{
    Rollout, RolloutError, RolloutModel, RolloutObserver, RolloutOptions, StepRecord, StepTimes,
};
use crate::trajectory::{Observation, State};

/// What a step of the deployed loop costs on a graph of some size, and what it costs a plain
/// implementation: score every state in both directions, insert the current state, run Dijkstra.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepBench {
    /// States of the graph.
    pub states: usize,
    /// Name of the engine.
    pub engine: String,
    /// Steps that were timed.
    pub steps: usize,
    /// Median of encoding, localising, planning and acting, in milliseconds.
    pub step_median_ms: f64,
    /// 99th percentile of the same.
    pub step_p99_ms: f64,
    /// Median of encoding alone, in milliseconds.
    pub encode_median_ms: f64,
    /// Median of asking for distances and of the filter, in milliseconds.
    pub localise_median_ms: f64,
    /// Median of choosing the goal state, in microseconds.
    pub search_median_us: f64,
    /// Steps of the plain implementation that were timed.
    pub plain_steps: usize,
    /// Median of a step of the plain implementation, in milliseconds.
    pub plain_step_median_ms: f64,
    /// 99th percentile of the same.
    pub plain_step_p99_ms: f64,
    /// Median of its search, the insertion of the current state included, in microseconds.
    pub plain_search_median_us: f64,
}

/// Times of a list of steps, sorted.
struct Times(Vec<f64>);

impl Times {
    fn new(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_by(f64::total_cmp);
        Self(times)
    }

    fn median(&self) -> f64 {
        quantile(&self.0, 0.5)
    }

    fn p99(&self) -> f64 {
        quantile(&self.0, 0.99)
    }
}

/// Keeps what the plain implementation is to be shown.
#[derive(Default)]
struct Witness {
    seen: Vec<(Arc<Observation>, Localisation)>,
}

impl RolloutObserver for Witness {
    fn on_step(&mut self, record: &StepRecord) {
        let seen = (Arc::clone(&record.observation), record.localisation.clone());
        self.seen.push(seen);
    }
}

impl StepBench {
    /// Runs one episode of at most `options.max_steps` steps, and shows the first `plain_steps` of what
    /// it saw to the plain implementation.
    ///
    /// # Errors
    /// [`RolloutError`] when the robot or the model fails, or they do not belong together.
    pub fn measure(
        model: RolloutModel<'_>,
        engine: &str,
        planner: &Planner,
        environment: &mut dyn Environment,
        (seed, plain_steps): (u64, usize),
        options: RolloutOptions,
    ) -> Result<Self, RolloutError> {
        let mut witness = Witness::default();
        let mut rollout = Rollout::new(model, planner.clone(), options)?;
        let episode = rollout.run(environment, seed, &mut witness)?;
        let (plain, search) = plain(model, planner, &witness, plain_steps)?;
        let times = &episode.times;
        let step = Times::new(times.iter().map(StepTimes::total_ms));
        Ok(Self {
            states: planner.graph().node_count(),
            engine: engine.to_owned(),
            steps: times.len(),
            step_median_ms: step.median(),
            step_p99_ms: step.p99(),
            encode_median_ms: Times::new(times.iter().map(|t| t.encode_ms)).median(),
            localise_median_ms: Times::new(times.iter().map(|t| t.localise_ms)).median(),
            search_median_us: 1e3 * Times::new(times.iter().map(|t| t.plan_ms)).median(),
            plain_steps: plain.0.len(),
            plain_step_median_ms: plain.median(),
            plain_step_p99_ms: plain.p99(),
            plain_search_median_us: search.median(),
        })
    }
}

/// Milliseconds of each plain step, and microseconds of its search.
fn plain(
    model: RolloutModel<'_>,
    planner: &Planner,
    witness: &Witness,
    steps: usize,
) -> Result<(Times, Times), RolloutError> {
    let stack = model.encoder.spec().stack;
    let latents = planner.graph().latents();
    let nodes: Vec<_> = planner.graph().nodes().map(|(id, _)| id).collect();
    let failed = |step| move |source| RolloutError::Model { step, source };
    let graph = model.traversability.project(latents).map_err(failed(0))?;
    let mut search = PlainSearch::new(planner);
    let (mut step_ms, mut search_us) = (Vec::new(), Vec::new());
    for step in 0..witness.seen.len().min(steps) {
        let first = (step + 1).saturating_sub(stack.max(1));
        let history: Vec<_> = witness.seen[first..=step]
            .iter()
            .map(|(observation, _)| Arc::clone(observation))
            .collect();
        let started = Instant::now();
        let state = State::from_history(&history, stack);
        let latent = model.encoder.encode(&[state]).map_err(failed(step))?;
        let current = model
            .traversability
            .project(&latent)
            .map_err(failed(step))?;
        let distances = LiveDistances::query(model.traversability, &graph, &current, &nodes, 0.0)
            .map_err(failed(step))?;
        let searching = Instant::now();
        std::hint::black_box(search.cost(&witness.seen[step].1, &distances));
        search_us.push(1e6 * searching.elapsed().as_secs_f64());
        let goal = latents.row(witness.seen[step].1.node.index());
        std::hint::black_box(
            model
                .policy
                .act(latent.row(0), goal)
                .map_err(failed(step))?,
        );
        step_ms.push(1e3 * started.elapsed().as_secs_f64());
    }
    Ok((Times::new(step_ms), Times::new(search_us)))
}
