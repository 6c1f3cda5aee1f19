mod drive;
mod experiment;
mod graph;
mod recordings;
mod serve;
mod train;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

pub use drive::{
    BenchArguments, ComposeArguments, EvaluateArguments, LastStepsArgument, PlannerArgument,
    RunArguments,
};
pub use experiment::{ChainingArguments, ExperimentCommand, PaperArguments};
pub use graph::{
    GraphBuildArguments, GraphCommand, GraphGapsArguments, GraphLocaliseArguments,
    GraphMergeArguments, GraphShowArguments, GraphTrustArguments,
};
pub use recordings::{
    ConvertArguments, DemosArguments, FormatArgument, PicturesArgument, PracticeArgument,
    ReadArguments, RecordArguments,
};
pub use serve::{LimitArguments, ServeArguments, SimulateArguments};
pub use train::{MethodArgument, TrainArguments};

/// Chains robot behaviour out of demonstrations of single tasks.
#[derive(Debug, Parser)]
#[command(name = "catena", version, about, max_term_width = 100)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Which engine runs the networks.
    #[arg(long, global = true, value_enum, default_value_t = EngineArgument::Auto)]
    pub engine: EngineArgument,
    /// The folder that paths in tasks and compositions are relative to.
    #[arg(long, global = true, default_value = ".")]
    pub root: PathBuf,
    /// End with the standard input, which an experiment keeps open for its commands as long as it lives.
    #[arg(long, global = true, hide = true)]
    pub ends_with_stdin: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record demonstrations of a task in the simulated bedroom, one MCAP file each.
    Record(RecordArguments),
    /// Say what is in recordings: topics, cameras, steps, actions, and what was lost.
    Demos(DemosArguments),
    /// Write recordings as a LeRobot dataset, or as MCAP files.
    Convert(ConvertArguments),
    /// Train a model on demonstrations and export it as ONNX.
    Train(TrainArguments),
    /// Build, merge and look at topological graphs.
    #[command(subcommand)]
    Graph(GraphCommand),
    /// Check a composition and plan it without running it.
    Compose(ComposeArguments),
    /// Plan a composition and run it closed-loop in the simulator.
    Run(RunArguments),
    /// Measure the success rate of a task or a composition over many episodes.
    Evaluate(EvaluateArguments),
    /// Make tables and figures; what is finished is kept, so that a run that was cut goes on.
    #[command(subcommand)]
    Experiment(ExperimentCommand),
    /// Serve a composition to a robot's own program: observations in, actions out.
    Serve(ServeArguments),
    /// Serve the simulated bedroom to a program that drives it: actions in, observations out.
    Simulate(SimulateArguments),
    /// Time the steps of the closed loop on graphs of growing size, on this machine.
    Bench(BenchArguments),
}

/// Level of variation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LevelArgument {
    /// One real room, objects put back by hand.
    Paper,
    /// Twice the starts and the light, objects as far off as they have room; textures, colours and clutter
    /// drawn anew.
    Hard,
}

/// Inference engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EngineArgument {
    /// ONNX Runtime if it is found, else the embedded engine.
    Auto,
    /// ONNX Runtime or an error.
    Native,
    /// The engine that is compiled in.
    Embedded,
}

/// The largest seed of the first of several episodes or trainings, beyond which there is room for those that follow.
const LARGEST_FIRST_SEED: u64 = u64::MAX / 2;

/// How many of something there are that must not be missing.
fn positive(text: &str) -> Result<usize, String> {
    let number: NonZeroUsize = (text.parse()).map_err(|_| "give a whole number of 1 or more")?;
    Ok(number.get())
}

/// A time that is no time limit where it is not above 0.
fn minutes(text: &str) -> Result<f64, String> {
    let minutes = text.parse().ok();
    let minutes = minutes.filter(|m: &f64| m.is_finite() && *m > 0.0);
    minutes.ok_or_else(|| "give a number above 0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_states_and_no_steps_are_refused() {
        let calls: [&[&str]; 5] = [
            &["evaluate", "sock", "--nearest-states"],
            &["serve", "sock", "--nearest-states"],
            &["bench", "--nearest-states"],
            &["bench", "--steps"],
            &[
                "graph",
                "localise",
                "sock",
                "--demos",
                "demos/sock",
                "--nearest-states",
            ],
        ];
        for call in calls {
            let parsed =
                |count: &str| Arguments::try_parse_from([&["catena"], call, &[count]].concat());
            assert!(parsed("1").is_ok(), "{call:?}");
            let refused = parsed("0").unwrap_err().to_string();
            assert!(refused.contains("1 or more"), "{refused}");
        }
    }

    #[test]
    fn a_first_seed_without_room_for_those_that_follow_is_refused() {
        let calls: [&[&str]; 5] = [
            &["evaluate", "sock", "--seed"],
            &["evaluate", "shortcuts", "--seed"],
            &["experiment", "chaining", "--seed"],
            &["experiment", "table1", "--seed"],
            &["experiment", "fig5", "--training-seed"],
        ];
        for call in calls {
            let parsed = |seed: u64| {
                let seed = seed.to_string();
                Arguments::try_parse_from([&["catena"], call, &[seed.as_str()]].concat())
            };
            assert!(parsed(LARGEST_FIRST_SEED).is_ok(), "{call:?}");
            let refused = parsed(u64::MAX).unwrap_err().to_string();
            assert!(
                refused.contains(&LARGEST_FIRST_SEED.to_string()),
                "{refused}"
            );
        }
    }
}
