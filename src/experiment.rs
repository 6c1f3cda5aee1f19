//! Figures: scoring episodes against the simulator's truth, success rates with intervals, step times.
//!
//! Only this room and the operator look at the truth; what plans and acts never does.

mod counted;
mod detection;
mod evaluation;
mod interval;
mod localisation;
mod score;
mod scored;
mod step_bench;
mod watched;

pub(crate) use counted::counted;
pub use detection::ShortcutDetection;
pub use evaluation::{EpisodeResult, Evaluation, SubgoalTally};
pub use interval::wilson_interval_95;
pub use localisation::{LocalisationError, LocalisationScore};
pub use score::{Score, SubgoalOutcome};
pub use scored::ScoredBedroom;
pub use step_bench::StepBench;
pub use watched::Watched;
