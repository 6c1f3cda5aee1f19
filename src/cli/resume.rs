//! `catena run --resume`: where an earlier run is gone on from.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::arguments::RunArguments;
use super::error::CliError;
use super::graph::results_folder;
use super::loaded::Loaded;
use crate::experiment::{ExperimentError, ResumedBedroom, ScoredBedroom};
use crate::simulator::Bedroom;
use crate::storage::read_trajectory;
use crate::task::Automaton;
use crate::trajectory::Step;

/// Name of a run's recording in its folder.
pub(super) const RECORDING: &str = "rollout.mcap";

/// Names the recording that a run was gone on from, in the metadata of its own.
const RESUMED_NOTE: &str = "resumed_from";

/// Where a run goes on from, as `summary.json` says it.
#[derive(Serialize)]
pub(super) struct ResumeReport {
    stage: usize,
    recording: PathBuf,
    replayed_steps: usize,
}

impl ResumeReport {
    /// What the run's recording says of itself where it begins in the middle of the episode; one of the whole episode
    /// says nothing.
    pub(super) fn note(&self) -> Option<(String, String)> {
        let recording = self.recording.display().to_string();
        (self.replayed_steps > 0).then(|| (RESUMED_NOTE.to_owned(), recording))
    }
}

impl fmt::Display for ResumeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            " on from the {} of {}",
            self.replayed_steps,
            self.recording.display()
        )
    }
}

/// The stage that a run is to begin at, by its number or by the subgoal that begins it.
pub(super) fn stage_named(name: &str, automaton: &Automaton) -> Result<usize, CliError> {
    let subgoals = automaton.subgoals();
    let by_number = name.parse::<usize>().ok();
    let by_name = subgoals
        .iter()
        .position(|s| s.name == *name)
        .map(|at| at + 1);
    let stage = by_number
        .or(by_name)
        .filter(|stage| *stage < subgoals.len());
    stage.ok_or_else(|| {
        let before_last = subgoals[..subgoals.len() - 1].iter();
        let begun = before_last.map(|subgoal| subgoal.name.as_str());
        let names: Vec<String> = std::iter::once("the beginning")
            .chain(begun)
            .enumerate()
            .map(|(stage, name)| format!("{name} ({stage})"))
            .collect();
        CliError::UnknownStage {
            found: name.to_owned(),
            known: names.join(", "),
        }
    })
}

/// The folder of the results of a run that is gone on with.
pub(super) fn folder(name: &str, stage: usize) -> PathBuf {
    results_folder(name).join(format!("from_stage_{stage}"))
}

/// Checks that the recording that is gone on from is not where the run's own is to be.
fn check_kept(recording: &Path, out: &Path) -> Result<(), CliError> {
    let kept = fs::canonicalize(recording);
    let replaced = fs::canonicalize(out.join(RECORDING));
    if kept.is_ok_and(|kept| replaced.is_ok_and(|replaced| kept == replaced)) {
        return Err(CliError::ResumedIntoItself {
            recording: recording.to_owned(),
        });
    }
    Ok(())
}

/// The room as the recorded run left it when the stage began, what is to be said of it, and the recorded steps up to
/// then, the last one of which only its pictures count. `out` is the folder that the run leaves its files in.
pub(super) fn room(
    loaded: &Loaded,
    run_arguments: &RunArguments,
    stage: usize,
    out: &Path,
) -> Result<(ResumedBedroom, ResumeReport, Vec<Step>), CliError> {
    let composition = &loaded.composition;
    let earlier = || results_folder(&composition.name).join(RECORDING);
    let path = run_arguments.from.clone().unwrap_or_else(earlier);
    if !path.is_file() {
        return Err(CliError::NothingToResume {
            recording: path,
            composition: composition.name.clone(),
        });
    }
    check_kept(&path, out)?;
    let recording = read_trajectory(&path)?;
    if let Some(original) = recording.report.metadata.get(RESUMED_NOTE) {
        return Err(CliError::ResumedTwice {
            recording: path,
            original: original.clone(),
        });
    }
    let seed = recording
        .report
        .metadata
        .get("seed")
        .and_then(|s| s.parse().ok());
    let seed = seed.ok_or_else(|| ExperimentError::SeedMissing {
        recording: path.display().to_string(),
    })?;
    let bedroom = Bedroom::new(loaded.bedroom()?);
    let room = ScoredBedroom::new(bedroom, &composition.demonstrated_automaton());
    let due = composition.demonstrated_stage(stage);
    let room = ResumedBedroom::new(room, &recording.trajectory, seed, due)?;
    let report = ResumeReport {
        stage,
        recording: path,
        replayed_steps: room.replayed_steps(),
    };
    let mut steps = recording.trajectory.steps;
    steps.truncate(room.replayed_steps() + 1);
    Ok((room, report, steps))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Subgoal, Task};

    #[test]
    fn a_recording_names_the_one_that_it_was_gone_on_from_where_it_lacks_the_beginning() {
        let note = |replayed_steps| {
            let report = ResumeReport {
                stage: 0,
                recording: PathBuf::from("first.mcap"),
                replayed_steps,
            };
            report.note()
        };
        assert_eq!(note(0), None);
        let named = (RESUMED_NOTE.to_owned(), "first.mcap".to_owned());
        assert_eq!(note(7), Some(named));
    }

    #[test]
    fn a_run_does_not_replace_the_recording_that_it_goes_on_from() {
        let root = tempfile::tempdir().unwrap();
        let [first, second] = ["first", "second"].map(|name| root.path().join(name));
        fs::create_dir(&first).unwrap();
        fs::create_dir(&second).unwrap();
        let recording = first.join(RECORDING);
        fs::write(&recording, "").unwrap();
        check_kept(&recording, &second).unwrap();
        fs::write(second.join(RECORDING), "").unwrap();
        check_kept(&recording, &second).unwrap();
        let roundabout = second.join("../first");
        for out in [&first, &roundabout] {
            let refused = check_kept(&recording, out).unwrap_err().to_string();
            assert!(
                refused.contains("first/rollout.mcap") && refused.contains("--out"),
                "{refused}"
            );
        }
    }

    #[test]
    fn a_stage_is_named_by_its_number_or_by_what_begins_it() {
        let subgoal = |name: &str| Subgoal {
            task: "t".to_owned(),
            name: name.to_owned(),
        };
        let automaton = Automaton::in_order(&[Task {
            name: "t".to_owned(),
            subgoals: ["open", "held", "done"].map(subgoal).to_vec(),
        }]);
        let stage = |name: &str| stage_named(name, &automaton).ok();
        assert_eq!(
            ["0", "2", "open", "held"].map(stage),
            [Some(0), Some(2), Some(1), Some(2)]
        );
        assert_eq!(["3", "done", "opened", "-1"].map(stage), [None; 4]);
        let error = stage_named("opened", &automaton).unwrap_err().to_string();
        assert!(
            error.ends_with("it can from: the beginning (0), open (1), held (2)"),
            "{error}"
        );
        let of_one = Automaton::in_order(&[Task {
            name: "t".to_owned(),
            subgoals: vec![subgoal("done")],
        }]);
        let error = stage_named("done", &of_one).unwrap_err().to_string();
        assert!(error.ends_with("it can from: the beginning (0)"), "{error}");
    }
}
