//! What tasks and demonstrations are called.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The words of a text in small letters: texts with the same ones tell the same task.
pub(super) fn words(text: &str) -> String {
    let words = text.split(|c: char| !c.is_alphanumeric());
    let words = words.filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().join("_")
}

/// A name that can be part of a path and the name of a task: letters, digits and `_`.
pub(in crate::storage) fn slug(text: &str) -> String {
    const MAX_CHARS: usize = 60;
    let words: Vec<String> = text
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|w| !w.is_empty())
        .map(str::to_ascii_lowercase)
        .collect();
    let slug: String = words.join("_").chars().take(MAX_CHARS).collect();
    if slug.is_empty() {
        "task".to_owned()
    } else {
        slug
    }
}

/// The stem of each file, with its folder where the stem alone is not unique, or the whole path where
/// that is not either.
pub(super) fn unique_ids(places: &[&Path]) -> Vec<String> {
    let stem = |p: &Path| p.with_extension("").file_name().map(PathBuf::from);
    let with_folder = |p: &Path| Some(Path::new(p.parent()?.file_name()?).join(stem(p)?));
    let candidates = |p: &Path| [stem(p), with_folder(p), Some(p.with_extension(""))];
    let mut uses: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for place in places {
        // Of a short path some are the same, which is one use of it.
        let own: BTreeSet<PathBuf> = candidates(place).into_iter().flatten().collect();
        for candidate in own {
            *uses.entry(candidate).or_default() += 1;
        }
    }
    places
        .iter()
        .map(|p| {
            let id = candidates(p).into_iter().flatten().find(|c| uses[c] == 1);
            id.unwrap_or_else(|| p.to_path_buf())
                .to_string_lossy()
                .into_owned()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_stems_however_short_the_paths_are() {
        let ids = |places: &[&str]| -> Vec<String> {
            let places: Vec<&Path> = places.iter().map(Path::new).collect();
            unique_ids(&places)
        };
        assert_eq!(ids(&["x.mcap", "y.mcap"]), ["x", "y"]);
        for above in ["", "demos/", "/demos/"] {
            let places = ["a/x", "b/x", "b/y"].map(|place| format!("{above}{place}.mcap"));
            let places = places.each_ref().map(String::as_str);
            assert_eq!(ids(&places), ["a/x", "b/x", "y"], "{above}");
        }
    }
}
