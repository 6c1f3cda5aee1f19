//! Figures: scoring episodes against the simulator's truth, success rates with intervals, step times.
//!
//! Only this room and the operator look at the truth; what plans and acts never does.

mod calibration_score;
mod chaining;
mod detection;
mod edge_options;
mod edge_trust;
mod edge_trust_table;
mod error;
mod evaluation;
mod graph_truth;
mod interval;
mod labelled_pairs;
mod localisation;
mod loss_curve;
mod posture;
mod rate_cell;
mod reliability;
mod replay;
mod resumed;
mod score;
mod scored;
mod skipper;
mod step_bench;
mod true_steps;
mod walk;
mod watched;

pub use calibration_score::{BeforeAndAfter, CalibrationScore, Population};
pub use chaining::{ChainPart, ChainingCell, ChainingMethod, chaining_table};
pub use detection::ShortcutDetection;
pub use edge_options::{EdgeOptions, OptionEffect};
pub use edge_trust::{EdgeTrust, EdgeTrustInput};
pub use error::ExperimentError;
pub use evaluation::{EpisodeResult, Evaluation, SubgoalTally};
pub use graph_truth::{EdgeTally, FalseEdges};
pub use interval::{mean_interval_95, wilson_interval_95};
pub use localisation::{LocalisationError, LocalisationScore};
pub use loss_curve::{LossCurve, LossPoint, losses_table, of_common_seeds};
pub use rate_cell::{
    PAPER_TABLE_1, PAPER_TABLE_3, PAPER_TASKS, PublishedRate, RateCell, paper_rate,
    paper_rate_of_all, rate_of_all, rates_table,
};
pub use reliability::{Forecast, Reliability, ReliabilityBin};
pub use replay::Replay;
pub use resumed::ResumedBedroom;
pub use score::{Score, SubgoalOutcome};
pub use scored::ScoredBedroom;
pub use skipper::Skipper;
pub use step_bench::StepBench;
pub use true_steps::{RecordedState, TrueSteps};
pub use walk::WalkScore;
pub use watched::Watched;
