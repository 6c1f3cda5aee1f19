//! The command `catena`: arguments, printing, progress bars. Everything it does can be done through
//! the library.

mod arguments;
mod baseline;
mod bench;
mod compose;
mod convert;
mod demonstrations;
mod demos;
mod error;
mod evaluate;
mod experiment;
mod gaps;
mod graph;
mod kept;
mod loaded;
mod localise;
mod parent;
mod progress;
mod recipe;
mod record;
mod resume;
mod revision;
mod run;
mod serve;
mod shortcuts;
mod simulate;
mod train;
mod training_config;
mod trust;
mod worlds;

use std::process::ExitCode;

use clap::Parser;

use arguments::{Arguments, Command};
use parent::EndOfInput;

/// Runs the command line that the process was started with.
#[must_use]
pub fn main() -> ExitCode {
    end_quietly_without_a_reader();
    let arguments = Arguments::parse();
    let end_of_input = EndOfInput::watched(arguments.ends_with_stdin);
    let done = match &arguments.command {
        Command::Record(a) => record::record(a),
        Command::Demos(a) => demos::demos(a),
        Command::Convert(a) => convert::convert(a),
        Command::Train(a) => train::train(a, &arguments, &end_of_input),
        Command::Graph(a) => graph::graph(a, &arguments),
        Command::Compose(a) => compose::compose(a, &arguments),
        Command::Run(a) => run::run(a, &arguments),
        Command::Evaluate(a) => evaluate::evaluate(a, &arguments),
        Command::Experiment(c) => experiment::experiment(c, &arguments),
        Command::Serve(a) => serve::serve(a, &arguments),
        Command::Simulate(a) => simulate::simulate(a, &arguments),
        Command::Bench(a) => bench::bench(a, &arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}", error.report());
            ExitCode::FAILURE
        }
    }
}

/// Of a process whose output was piped into one that ended, such as `head`: what a shell says of it.
const BROKEN_PIPE: i32 = 128 + 13;

/// Where nobody reads the output any more there is nothing to tell and nobody to tell it to.
fn end_quietly_without_a_reader() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let said = panic.to_string();
        if said.contains("failed printing to stdout") && said.contains("Broken pipe") {
            std::process::exit(BROKEN_PIPE);
        }
        usual(panic);
    }));
}
