use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};

use ort::session::{Session, SessionInputValue};
use ort::value::{TensorElementType, TensorRef, ValueType};
use rayon::prelude::*;

use super::{Engine, InferenceError};
use crate::model::ModelError;

/// Sessions beyond this number cost more memory than they save time.
const MOST_SESSIONS: usize = 8;

/// One ONNX file, with as many sessions as there are processors: a session computes one batch at a
/// time, on the thread that calls it.
pub(super) struct Network {
    engine: &'static Engine,
    stage: &'static str,
    bytes: Vec<u8>,
    sessions: Vec<OnceLock<Mutex<Session>>>,
}

/// The dimensions of an input or output, -1 where any length will do; none for what is no tensor of `f32`.
pub(super) type Shape = Option<Vec<i64>>;

/// A tensor of `f32`, row-major.
pub(super) struct Tensor<'a> {
    pub(super) name: &'a str,
    pub(super) shape: Vec<usize>,
    pub(super) values: &'a [f32],
}

impl Network {
    /// Takes a network that was checked against its digest; the first session is made now, so that a
    /// refusal shows here, the others when they are needed.
    pub(super) fn load(
        engine: &'static Engine,
        stage: &'static str,
        path: &Path,
        bytes: Vec<u8>,
    ) -> Result<Self, InferenceError> {
        let session = engine
            .session(&bytes)
            .map_err(|reason| InferenceError::EngineFailed {
                engine: engine.description(),
                place: path.display().to_string(),
                reason,
            })?;
        let count = std::thread::available_parallelism().map_or(1, |n| n.get().min(MOST_SESSIONS));
        let sessions: Vec<_> = (0..count).map(|_| OnceLock::new()).collect();
        sessions[0].get_or_init(|| Mutex::new(session));
        Ok(Self {
            engine,
            stage,
            bytes,
            sessions,
        })
    }

    /// Names of the inputs and of the outputs.
    pub(super) fn names(&self) -> (Vec<String>, Vec<String>) {
        let session = lock(self.sessions[0].get().expect("made by load"));
        let names =
            |outlets: &[ort::value::Outlet]| outlets.iter().map(|o| o.name().to_owned()).collect();
        (names(session.inputs()), names(session.outputs()))
    }

    /// The shapes of the inputs and of the outputs.
    pub(super) fn shapes(&self) -> (Vec<Shape>, Vec<Shape>) {
        let session = lock(self.sessions[0].get().expect("made by load"));
        let shapes = |outlets: &[ort::value::Outlet]| {
            let shape = |outlet: &ort::value::Outlet| match outlet.dtype() {
                ValueType::Tensor {
                    ty: TensorElementType::Float32,
                    shape,
                    ..
                } => Some(shape.to_vec()),
                _ => None,
            };
            outlets.iter().map(shape).collect()
        };
        (shapes(session.inputs()), shapes(session.outputs()))
    }

    /// Computes one batch of `rows` rows; `outputs` names what is wanted.
    pub(super) fn run<const N: usize>(
        &self,
        inputs: &[Tensor<'_>],
        rows: usize,
        outputs: [&str; N],
    ) -> Result<[Vec<f32>; N], ModelError> {
        let mut session = self.session()?;
        let mut values = Vec::with_capacity(inputs.len());
        for input in inputs {
            let view = TensorRef::from_array_view((input.shape.as_slice(), input.values))
                .map_err(|e| self.failed(e.to_string()))?;
            values.push((input.name, SessionInputValue::from(view)));
        }
        let computed = session
            .run(values)
            .map_err(|e| self.failed(e.to_string()))?;
        let mut results = [const { Vec::new() }; N];
        for (result, name) in results.iter_mut().zip(outputs) {
            let output = computed
                .get(name)
                .ok_or_else(|| self.failed(format!("there is no output '{name}'")))?;
            let (shape, values) = output
                .try_extract_tensor::<f32>()
                .map_err(|e| self.failed(e.to_string()))?;
            if shape.first().copied() != i64::try_from(rows).ok() {
                return Err(self.failed(format!("'{name}' has shape {shape:?} for {rows} rows")));
            }
            if values.iter().any(|v| !v.is_finite()) {
                return Err(self.failed(format!("'{name}' has values that are not finite")));
            }
            *result = values.to_vec();
        }
        Ok(results)
    }

    pub(super) fn failed(&self, reason: String) -> ModelError {
        ModelError::Engine {
            stage: self.stage.to_owned(),
            reason,
        }
    }

    /// An idle session; a new one if all are busy and there may be more; otherwise the next to become
    /// idle, or nearly so.
    fn session(&self) -> Result<MutexGuard<'_, Session>, ModelError> {
        for session in self.sessions.iter().filter_map(OnceLock::get) {
            match session.try_lock() {
                Ok(session) => return Ok(session),
                Err(TryLockError::Poisoned(session)) => return Ok(session.into_inner()),
                Err(TryLockError::WouldBlock) => {}
            }
        }
        if let Some(empty) = self.sessions.iter().find(|place| place.get().is_none()) {
            let session = self
                .engine
                .session(&self.bytes)
                .map_err(|e| self.failed(e))?;
            // Where another thread was faster, its session serves as well.
            return Ok(lock(empty.get_or_init(|| Mutex::new(session))));
        }
        let own = rayon::current_thread_index().unwrap_or(0) % self.sessions.len();
        Ok(lock(self.sessions[own].get().expect("no place is empty")))
    }
}

/// Computes `count` rows in batches of at most `batch` on all processors and joins the outputs in
/// order. The batches do not depend on the number of processors, so neither do the results.
pub(super) fn in_batches<const N: usize, F>(
    count: usize,
    batch: usize,
    compute: F,
) -> Result<[Vec<f32>; N], ModelError>
where
    F: Fn(Range<usize>) -> Result<[Vec<f32>; N], ModelError> + Sync,
{
    let parts: Vec<[Vec<f32>; N]> = (0..count.div_ceil(batch))
        .into_par_iter()
        .map(|i| compute(i * batch..((i + 1) * batch).min(count)))
        .collect::<Result<_, _>>()?;
    // Room for all of it at once: what grows step by step holds twice as much in between.
    let mut joined: [Vec<f32>; N] = std::array::from_fn(|output| {
        let lengths = parts.iter().map(|part| part[output].len());
        Vec::with_capacity(lengths.sum())
    });
    for part in parts {
        for (all, more) in joined.iter_mut().zip(part) {
            all.extend(more);
        }
    }
    Ok(joined)
}

/// A panic while a session computed leaves nothing half-done in it.
fn lock(session: &Mutex<Session>) -> MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}
