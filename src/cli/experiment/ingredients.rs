//! What an experiment's networks learn from and are measured on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::digests::encoder_now;
use super::given::Given;
use super::method::{MVP, Method};
use super::workshop::task_file;
use crate::cli::arguments::PaperArguments;
use crate::cli::error::CliError;
use crate::cli::recipe::{Ingredient, Recipe};
use crate::experiment::PAPER_TASKS;
use crate::model::sha256_hex;
use crate::storage::{ReadOptions, Recordings, sha256_file};
use crate::wording::counted;

/// Seed with which demonstrations are recorded, those of README.md.
pub(super) const RECORDING_SEED: u64 = 1;
/// Networks that learnt otherwise, the last states of a demonstration less than others, are not these.
const OF_MEMORY: &str = "every state counts alike";
/// Digits of a digest that tell folders apart.
const MARK_DIGITS: usize = 8;

/// The recordings of each task, each as its files.
type GivenOfTasks = BTreeMap<&'static str, Vec<Vec<PathBuf>>>;

/// Digests of all that goes into a method, by which cells and folders are told apart. Empty where nothing is
/// measured.
#[derive(Default)]
pub(super) struct Ingredients {
    /// What the recordings of each task are: how they are recorded, or the SHA-256 of those that were given.
    recordings: Vec<String>,
    /// The recordings of each task that were given and count as demonstrations; none where they are recorded.
    given: Option<GivenOfTasks>,
    /// SHA-256 of the file of each task.
    tasks: Vec<String>,
    /// SHA-256 of the encoder that somebody else trained, and of what is said beside it.
    encoder: Vec<String>,
    /// How methods with a memory learn, which their flags do not tell.
    of_memory: Vec<String>,
}

impl Ingredients {
    pub(super) fn gather(paper: &PaperArguments, root: &Path) -> Result<Self, CliError> {
        let digest_of = |task: &str| sha256_file(&root.join(task_file(task)));
        let tasks = PAPER_TASKS.into_iter().map(digest_of);
        let mut encoder = Vec::new();
        if let Some(file) = &paper.frozen_encoder {
            encoder.push(sha256_file(file)?);
            let beside = file.with_extension("json");
            if beside.exists() {
                encoder.push(sha256_file(&beside)?);
            }
        }
        let recorded = format!("recorded with seed {RECORDING_SEED}, varied");
        let (recordings, given) = match paper.demos.as_deref().map(told_of).transpose()? {
            None => (vec![recorded; PAPER_TASKS.len()], None),
            Some((told, given)) => (told, Some(given)),
        };
        Ok(Self {
            tasks: tasks.collect::<Result<_, _>>()?,
            recordings,
            given,
            encoder,
            of_memory: vec![OF_MEMORY.to_owned()],
        })
    }

    /// The recordings of a task that were given and count as demonstrations, each as its files; none where they are
    /// recorded.
    pub(super) fn given(&self, task: &str) -> Option<&[Vec<PathBuf>]> {
        let given = self.given.as_ref()?;
        Some(given.get(task).map(Vec::as_slice).unwrap_or_default())
    }

    /// What a method learns from and is measured on, for digests.
    pub(super) fn of(&self, method: &Method) -> [&[String]; 3] {
        [&self.recordings, &self.tasks, self.particulars(method)]
    }

    /// The digest of the encoder that somebody else trained, of a method that has one.
    pub(super) fn encoder_of(&self, method: &Method) -> Option<&str> {
        let encoder = self.encoder.first().map(String::as_str);
        encoder.filter(|_| method.name == MVP)
    }

    /// What a cell of a method would be made of now: what it names, and what it does not, beside what none does.
    pub(super) fn recipe(
        &self,
        method: &Method,
        mut named: Vec<Ingredient>,
        unnamed: &[&'static str],
    ) -> Recipe {
        named.extend(self.encoder_of(method).map(encoder_now));
        let unnamed = [unnamed, &Self::unnamed(method)].concat();
        Recipe { named, unnamed }
    }

    /// What cells of a method depend on and do not name.
    fn unnamed(method: &Method) -> Vec<&'static str> {
        let mut unnamed = vec![
            "the files of the tasks",
            "whether recordings are given (--demos)",
            "the version of catena",
        ];
        if method.name == MVP {
            unnamed
                .push("the frozen encoder, where it does not name it, and what is said beside it");
        }
        if method.has_memory {
            unnamed.push("how states are weighed in its training");
        }
        unnamed
    }

    /// A mark in a folder's name of what a method learns from and how, where its name does not tell: what is made
    /// otherwise lies beside it. None of what this program records.
    pub(super) fn mark(&self, method: &Method) -> Result<String, CliError> {
        let recordings: &[String] = if self.given.is_some() {
            &self.recordings
        } else {
            &[]
        };
        let given = [recordings, self.particulars(method)];
        if given.concat().is_empty() {
            return Ok(String::new());
        }
        let digest = sha256_hex(&serde_json::to_vec(&given)?);
        Ok(format!("_{}", &digest[..MARK_DIGITS]))
    }

    /// What one method learns from beside recordings, or how.
    fn particulars(&self, method: &Method) -> &[String] {
        if method.name == MVP {
            &self.encoder
        } else if method.has_memory {
            &self.of_memory
        } else {
            &[]
        }
    }
}

/// What the recordings in a folder of each task are, for digests, and those that count as demonstrations; the others are
/// told.
fn told_of(folder: &Path) -> Result<(Vec<String>, GivenOfTasks), CliError> {
    let (mut told, mut given) = (Vec::new(), GivenOfTasks::new());
    for task in PAPER_TASKS {
        let folder = folder.join(task);
        let found = Recordings::open(std::slice::from_ref(&folder), &ReadOptions::default())?;
        let digest = found.digest()?;
        let of_task = Given::of(&folder)?;
        for report in &of_task.left_out {
            let reason = report.left_out.as_deref().unwrap_or_default();
            eprintln!("warning: {} is left out: {reason}", report.place());
        }
        told.push(told_with(digest, of_task.left_out.len(), of_task.bags));
        given.insert(task, of_task.recordings);
    }
    Ok((told, given))
}

/// The digest of recordings, and what says that the first so many of them are other ones than where each file counted.
fn told_with(digest: String, left_out: usize, bags: usize) -> String {
    let mut told = vec![digest];
    if left_out > 0 {
        told.push(format!("{left_out} left out"));
    }
    if bags > 0 {
        told.push(counted(bags, "bag"));
    }
    told.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::method::{BC, TABLE_1};

    #[test]
    fn only_the_method_that_has_an_encoder_names_it() {
        let ingredients = Ingredients {
            encoder: vec!["ab".to_owned()],
            ..Ingredients::default()
        };
        let named = |method: &Method| {
            let recipe = ingredients.recipe(method, Vec::new(), &[]);
            (ingredients.encoder_of(method), recipe.named.len())
        };
        let of_mvp = TABLE_1.iter().find(|method| method.name == MVP);
        assert_eq!(named(of_mvp.unwrap()), (Some("ab"), 1));
        assert_eq!(named(&BC), (None, 0));
    }

    #[test]
    fn only_what_changes_which_recordings_come_first_is_told_beside_their_digest() {
        let told = |left_out, bags| told_with("123".to_owned(), left_out, bags);
        assert_eq!(told(0, 0), "123");
        assert_eq!(told(1, 0), "123, 1 left out");
        assert_eq!(told(1, 2), "123, 1 left out, 2 bags");
    }
}
