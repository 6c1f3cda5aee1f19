//! What lies in `results`, for the tests that hold its digests.

use std::fs;
use std::path::Path;

use clap::Parser;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::cli::arguments::{
    Arguments, ChainingArguments, Command, ExperimentCommand, PaperArguments,
};
use crate::cli::kept::kept;

/// This repository, in which cells were measured.
pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn parsed(words: &[&str]) -> ExperimentCommand {
    let words = [&["catena", "experiment"], words].concat();
    let Command::Experiment(command) = Arguments::try_parse_from(words).unwrap().command else {
        panic!("it is an experiment");
    };
    command
}

/// The arguments of an experiment of the paper that is given no flags.
pub(super) fn unflagged(name: &str) -> PaperArguments {
    paper_arguments(&[name])
}

/// The arguments of an experiment of the paper that is called with these words.
pub(super) fn paper_arguments(words: &[&str]) -> PaperArguments {
    match parsed(words) {
        ExperimentCommand::Table1(paper)
        | ExperimentCommand::Table2(paper)
        | ExperimentCommand::Table3(paper)
        | ExperimentCommand::Fig5(paper)
        | ExperimentCommand::Fig6(paper) => paper,
        ExperimentCommand::Chaining(_) => panic!("{words:?} is not of the paper"),
    }
}

/// The arguments of `catena experiment chaining` with some flags.
pub(super) fn chaining_arguments(flags: &[&str]) -> ChainingArguments {
    match parsed(&[&["chaining"], flags].concat()) {
        ExperimentCommand::Chaining(arguments) => arguments,
        other => panic!("{other:?}"),
    }
}

/// Holds the digest of each committed cell of an experiment to the one that the experiment would look for today.
/// `digest_of` gives none of a cell that depends on a file which is not in this repository.
pub(super) fn assert_kept<T: DeserializeOwned>(
    name: &str,
    digest_of: impl Fn(&T) -> Option<String>,
) {
    let mut held = 0;
    for entry in fs::read_dir(root().join("results").join(name)).unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let cell: T = kept(&file).unwrap().unwrap();
        if let Some(digest) = digest_of(&cell) {
            let written: Value = kept(&file).unwrap().unwrap();
            assert_eq!(
                written["digest"],
                digest,
                "{} would be refused: an ingredient of its digest is another one",
                file.display()
            );
            held += 1;
        }
    }
    assert!(held > 0, "no cell of {name} was held to anything");
}
