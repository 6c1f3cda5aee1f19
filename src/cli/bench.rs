use std::process::{Command, Stdio};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::arguments::{Arguments, BenchArguments, EngineArgument};
use super::error::CliError;
use super::loaded::Loaded;
use super::progress;
use crate::experiment::StepBench;
use crate::graph::resampled;
use crate::rollout::RolloutOptions;
use crate::simulator::Bedroom;

/// A row of the table.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    #[serde(flatten)]
    bench: StepBench,
    /// Memory of the process when the row was done, in MiB, where the system says it.
    resident_mib: Option<f64>,
}

/// `catena bench`: what a step of the loop costs on graphs of growing size.
pub(super) fn bench(
    bench_arguments: &BenchArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let rows = match arguments.engine {
        EngineArgument::Auto => both_engines(bench_arguments, arguments)?,
        _ => one_engine(bench_arguments, arguments)?,
    };
    if bench_arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows)?);
    } else {
        print_table(&rows);
    }
    Ok(())
}

/// A process has one engine, so each is measured in a process of its own; an engine that is not there
/// is said so and left out.
fn both_engines(
    bench_arguments: &BenchArguments,
    arguments: &Arguments,
) -> Result<Vec<Row>, CliError> {
    let program = std::env::current_exe().map_err(CliError::Child)?;
    let mut rows = Vec::new();
    for engine in ["native", "embedded"] {
        let sizes: Vec<String> = bench_arguments
            .states
            .iter()
            .map(usize::to_string)
            .collect();
        let nearest = bench_arguments.nearest_states;
        let output = Command::new(&program)
            .args(["--engine", engine, "--root"])
            .arg(&arguments.root)
            .arg("bench")
            .arg(&bench_arguments.file)
            .args(["--states", &sizes.join(",")])
            .args(["--steps", &bench_arguments.steps.to_string()])
            .args(["--plain-steps", &bench_arguments.plain_steps.to_string()])
            .args(["--seed", &bench_arguments.seed.to_string()])
            .args(nearest.map(|count| format!("--nearest-states={count}")))
            .arg("--json")
            .stderr(Stdio::inherit())
            .output()
            .map_err(CliError::Child)?;
        if output.status.success() {
            rows.extend(serde_json::from_slice::<Vec<Row>>(&output.stdout)?);
        } else if engine == "native" {
            eprintln!("the native engine is left out; see above");
        } else {
            return Err(CliError::ChildFailed);
        }
    }
    Ok(rows)
}

fn one_engine(
    bench_arguments: &BenchArguments,
    arguments: &Arguments,
) -> Result<Vec<Row>, CliError> {
    let loaded = Loaded::load(&bench_arguments.file.to_string_lossy(), arguments)?;
    let engine = loaded.model.engine().kind().to_string();
    let bar = progress::bar("timing", bench_arguments.states.len() as u64);
    let mut rows = Vec::new();
    for &states in &bench_arguments.states {
        bar.set_message(format!("{states} states, {engine} engine"));
        let graph = resampled(&loaded.graph, states, bench_arguments.seed)?;
        let planner = loaded.planner_on(Arc::new(graph), loaded.composition.planner.clone())?;
        let options = RolloutOptions {
            max_steps: bench_arguments.steps,
            ..loaded.rollout_options(bench_arguments.nearest_states)
        };
        let bench = StepBench::measure(
            loaded.rollout_model(),
            &engine,
            &planner,
            &mut Bedroom::new(loaded.bedroom()?),
            (bench_arguments.seed, bench_arguments.plain_steps),
            options,
        )?;
        rows.push(Row {
            bench,
            resident_mib: resident_mib(),
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(rows)
}

/// The memory that the process holds now, on systems with `/proc`.
fn resident_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

fn print_table(rows: &[Row]) {
    println!(
        "{:>8}  {:<7}  {:>9}  {:>9}  {:>10}  {:>7}  {:>9}  {:>12}  {:>7}  {:>8}",
        "states",
        "engine",
        "step ms",
        "p99 ms",
        "plain ms",
        "ratio",
        "search us",
        "plain us",
        "ratio",
        "MiB"
    );
    for Row {
        bench,
        resident_mib,
    } in rows
    {
        println!(
            "{:>8}  {:<7}  {:>9.2}  {:>9.2}  {:>10.2}  {:>7.1}  {:>9.1}  {:>12.1}  {:>7.1}  {:>8}",
            bench.states,
            bench.engine,
            bench.step_median_ms,
            bench.step_p99_ms,
            bench.plain_step_median_ms,
            bench.plain_step_median_ms / bench.step_median_ms,
            bench.search_median_us,
            bench.plain_search_median_us,
            bench.plain_search_median_us / bench.search_median_us,
            resident_mib.map_or_else(|| "?".to_owned(), |mib| format!("{mib:.0}")),
        );
    }
    println!(
        "step: encode, localise, plan, act; plain: every state scored in both directions, Dijkstra from \
         the current state"
    );
}
