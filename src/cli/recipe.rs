//! What a kept file is made of, to tell what differs of one that was made otherwise.

use serde_json::Value;

/// What a file would be made of now.
pub(super) struct Recipe {
    /// What the file names itself.
    pub(super) named: Vec<Ingredient>,
    /// What it depends on and does not name.
    pub(super) unnamed: Vec<&'static str>,
}

/// An ingredient that a file names.
pub(super) enum Ingredient {
    /// A number or a word: what it is, where the file has it (a JSON pointer), and what it would be now.
    Value(&'static str, &'static str, Value),
    /// What is known by a digest, the same way.
    Digest(String, String, String),
    /// The commands that make the file.
    Commands(Vec<String>),
}

impl Recipe {
    /// How what a file was made of differs, so far as it tells.
    pub(super) fn differences(&self, found: &Value) -> String {
        let told = self.named.iter().filter_map(|one| one.difference(found));
        let told: Vec<String> = told.collect();
        if !told.is_empty() {
            return told.join("; ");
        }
        let commit = found["commit"].as_str();
        let commit = commit.map_or_else(String::new, |c| format!(" (it is of commit {c})"));
        format!(
            "what it names of its ingredients is the same{commit}, so it is one that it does not name: {}",
            self.unnamed.join(", ")
        )
    }
}

impl Ingredient {
    /// How it differs from what a file names; none where it does not, or where the file does not name it.
    fn difference(&self, found: &Value) -> Option<String> {
        match self {
            Self::Value(what, place, now) => {
                let there = found.pointer(place).filter(|there| !there.is_null())?;
                (there != now).then(|| format!("{what} is {there} there and {now} here"))
            }
            Self::Digest(what, place, now) => {
                let there = found.pointer(place)?.as_str()?;
                (there != now).then(|| format!("{what} differ"))
            }
            Self::Commands(now) => {
                let there = found.get("commands")?.as_array()?.iter();
                let there: Vec<&str> = there.filter_map(Value::as_str).map(of_any_engine).collect();
                let now: Vec<&str> = now.iter().map(|c| of_any_engine(c)).collect();
                let [only_there, only_here] = [only_in(&there, &now), only_in(&now, &there)];
                (there != now).then(|| {
                    format!("the commands differ: {only_there} there and {only_here} here")
                })
            }
        }
    }
}

/// A command without the engine, which files do not depend on.
fn of_any_engine(command: &str) -> &str {
    command
        .split_once(" --engine ")
        .map_or(command, |(rest, _)| rest)
}

/// Those of some commands that are not among others.
fn only_in(some: &[&str], others: &[&str]) -> String {
    let only = some.iter().filter(|command| !others.contains(*command));
    let only: Vec<String> = only.map(|command| format!("`{command}`")).collect();
    if only.is_empty() {
        "no other".to_owned()
    } else {
        only.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn recipe(steps: usize, seed: u64, recordings: &str) -> Recipe {
        Recipe {
            named: vec![
                Ingredient::Value("the seed", "/seed", json!(seed)),
                Ingredient::Digest(
                    "the recordings of sock".to_owned(),
                    "/digests/demonstrations of sock".to_owned(),
                    recordings.to_owned(),
                ),
                Ingredient::Commands(vec![
                    format!("catena train ... --steps {steps}"),
                    "catena evaluate sock --json --engine native".to_owned(),
                ]),
            ],
            unnamed: vec!["the tasks' files", "the version"],
        }
    }

    #[test]
    fn what_a_file_names_is_told_where_it_differs() {
        let found = json!({
            "seed": 100,
            "commit": "abc",
            "digests": {"demonstrations of sock": "ab"},
            "commands": ["catena train ... --steps 7", "catena evaluate sock --json"],
        });
        let told = |recipe: Recipe| recipe.differences(&found);
        assert_eq!(told(recipe(7, 3, "ab")), "the seed is 100 there and 3 here");
        assert_eq!(
            told(recipe(8, 100, "cd")),
            "the recordings of sock differ; the commands differ: `catena train ... --steps 7` there and \
             `catena train ... --steps 8` here"
        );
        let untold = told(recipe(7, 100, "ab"));
        assert!(
            untold.contains("of commit abc") && untold.ends_with(": the tasks' files, the version"),
            "{untold}"
        );
    }

    #[test]
    fn what_a_file_does_not_name_is_not_compared() {
        let untold = recipe(7, 100, "ab").differences(&json!({"seed": null}));
        assert!(untold.contains("does not name"), "{untold}");
    }
}
