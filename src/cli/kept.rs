//! Small files that commands keep.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::error::CliError;
use super::recipe::Recipe;
use crate::model::indented_json;
use crate::storage::write_file;
use crate::wording::counted;

/// What is kept in a file as JSON; none where the file is not there.
pub(super) fn kept<T: DeserializeOwned>(file: &Path) -> Result<Option<T>, CliError> {
    let text = match fs::read(file) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text.map_err(CliError::io(file))?,
    };
    match serde_json::from_slice(&text) {
        Ok(kept) => Ok(Some(kept)),
        Err(error) => Err(CliError::CellBroken {
            file: file.to_owned(),
            reason: error.to_string(),
        }),
    }
}

/// A file that is to be made of some ingredients.
pub(super) struct Missing {
    pub(super) file: PathBuf,
    /// The digest of the ingredients.
    pub(super) digest: String,
}

impl Missing {
    /// None where the file is there and was made of the same ingredients, so that it need not be made again; says so.
    /// `recipe` tells them by name.
    ///
    /// # Errors
    /// Unless it may be replaced, [`CliError::CellOfOthers`] where it was made of others, and [`CliError::CellBroken`] where
    /// it is none such.
    pub(super) fn unless_kept<T: DeserializeOwned>(
        file: PathBuf,
        digest: String,
        may_replace: bool,
        recipe: impl FnOnce() -> Result<Recipe, CliError>,
    ) -> Result<Option<Self>, CliError> {
        let found =
            kept::<Value>(&file).or_else(|e| if may_replace { Ok(None) } else { Err(e) })?;
        let Some(found) = found else {
            return Ok(Some(Self { file, digest }));
        };
        let is_same = found["digest"] == digest;
        let read = kept::<T>(&file);
        if is_same && read.is_ok() {
            println!("kept: {}", file.display());
            return Ok(None);
        }
        if may_replace {
            return Ok(Some(Self { file, digest }));
        }
        if is_same {
            read?;
        }
        let what = recipe()?.differences(&found);
        Err(CliError::CellOfOthers { file, what })
    }

    /// The same where a file is kept, too, that differs in the number of its episodes alone; says so. `digest_of` makes the
    /// digest of the ingredients with a number of episodes.
    ///
    /// # Errors
    /// Those of [`unless_kept`](Self::unless_kept), and those of `digest_of`.
    pub(super) fn unless_kept_of_any_episodes<T: DeserializeOwned>(
        file: PathBuf,
        episodes: usize,
        digest_of: impl Fn(usize) -> Result<String, CliError>,
        may_replace: bool,
        recipe: impl FnOnce() -> Result<Recipe, CliError>,
    ) -> Result<Option<Self>, CliError> {
        if !may_replace
            && let Some(found) = kept::<Value>(&file)?
            && let Some(others) = found["episodes"].as_u64()
            && others != episodes as u64
            && found["digest"] == digest_of(others as usize)?
        {
            kept::<T>(&file)?;
            println!(
                "kept: {} ({}, not {episodes}; --replace measures it anew)",
                file.display(),
                counted(others as usize, "episode")
            );
            return Ok(None);
        }
        Self::unless_kept::<T>(file, digest_of(episodes)?, may_replace, recipe)
    }
}

/// Keeps something in a file as JSON.
pub(super) fn keep(file: &Path, what: &impl Serialize) -> Result<(), CliError> {
    keep_text(file, &indented_json(what)?)
}

/// Keeps a text in a file.
pub(super) fn keep_text(file: &Path, text: &[u8]) -> Result<(), CliError> {
    Ok(write_file(file, |f| f.write_all(text))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::recipe::Ingredient;

    fn recipe() -> Recipe {
        Recipe {
            named: vec![Ingredient::Value("the seed", "/seed", serde_json::json!(2))],
            unnamed: vec!["the version"],
        }
    }

    #[test]
    fn a_cell_of_another_number_of_episodes_is_kept_unless_more_differs() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("cell.json");
        let missing = |ingredients: &str, episodes, may_replace| {
            let digest_of = |episodes: usize| Ok(format!("{ingredients}, {episodes}"));
            Missing::unless_kept_of_any_episodes::<Value>(
                file.clone(),
                episodes,
                digest_of,
                may_replace,
                || Ok(recipe()),
            )
        };
        let new = missing("a", 3, false).unwrap().expect("not there");
        assert_eq!(new.digest, "a, 3");
        keep(
            &file,
            &serde_json::json!({"digest": new.digest, "episodes": 3}),
        )
        .unwrap();
        assert!(missing("a", 3, false).unwrap().is_none());
        assert!(missing("a", 4, false).unwrap().is_none());
        let new = missing("a", 4, true).unwrap().expect("asked for");
        assert_eq!(new.digest, "a, 4");
        assert!(matches!(
            missing("b", 4, false),
            Err(CliError::CellOfOthers { .. })
        ));
    }

    #[test]
    fn what_was_made_of_other_ingredients_is_not_replaced_unasked() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("cell.json");
        let missing = |digest: &str, may_replace| {
            Missing::unless_kept::<Value>(file.clone(), digest.to_owned(), may_replace, || {
                Ok(recipe())
            })
        };
        assert!(missing("a", false).unwrap().is_some(), "not there");
        keep(&file, &serde_json::json!({"digest": "a"})).unwrap();
        assert!(missing("a", false).unwrap().is_none(), "the same");
        assert!(missing("a", true).unwrap().is_none(), "the same");
        let refused = missing("b", false).err().unwrap().to_string();
        assert!(
            refused.contains("cell.json") && refused.contains("--replace"),
            "{refused}"
        );
        assert!(refused.contains("does not name: the version"), "{refused}");
        let no_cell =
            Missing::unless_kept::<bool>(file.clone(), "a".to_owned(), false, || Ok(recipe()));
        let no_cell = no_cell.err().unwrap().to_string();
        assert!(no_cell.contains("restore it"), "{no_cell}");
        keep(&file, &serde_json::json!({"digest": "a", "seed": 1})).unwrap();
        let refused = missing("b", false).err().unwrap().to_string();
        assert!(
            refused.contains("the seed is 1 there and 2 here"),
            "{refused}"
        );
        assert!(missing("b", true).unwrap().is_some());
        fs::write(&file, "{").unwrap();
        let broken = missing("a", false).err().unwrap().to_string();
        assert!(
            broken.contains("cell.json") && broken.contains("line 1"),
            "{broken}"
        );
        assert!(missing("a", true).unwrap().is_some());
    }
}
