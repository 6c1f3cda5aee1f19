//! The paths of a dataset's files, as `info.json` spells them: Python format strings such as
//! `data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet`.

use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

/// What stands for a placeholder.
#[derive(Clone, Copy)]
pub(super) enum Value<'a> {
    Number(u64),
    Text(&'a str),
}

/// Longest number of digits that a template can ask for.
const MAX_DIGITS: usize = 20;

/// The path that a template gives, relative to the dataset.
pub(super) fn filled(template: &str, values: &[(&str, Value)]) -> Result<PathBuf, String> {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        text.push_str(before);
        let (placeholder, after) = after
            .split_once('}')
            .ok_or_else(|| format!("the path '{template}' has no '}}' for its '{{'"))?;
        let (name, digits) = placeholder.split_once(':').unwrap_or((placeholder, ""));
        let value = values.iter().find(|(known, _)| *known == name);
        let known = || {
            values
                .iter()
                .map(|(n, _)| *n)
                .collect::<Vec<_>>()
                .join(", ")
        };
        match value.ok_or_else(|| {
            format!(
                "the path '{template}' names '{{{name}}}', which is none of {}",
                known()
            )
        })? {
            (_, Value::Text(value)) => text.push_str(value),
            (_, Value::Number(value)) => {
                let width = digits.trim_end_matches('d').parse().unwrap_or(0);
                let width = usize::min(width, MAX_DIGITS);
                // Writing to a string cannot fail.
                let _ = write!(text, "{value:0width$}");
            }
        }
        rest = after;
    }
    text.push_str(rest);
    inside(&text)
}

/// A path that stays in the folder that it is relative to.
pub(super) fn inside(text: &str) -> Result<PathBuf, String> {
    let path = Path::new(text);
    let stays = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if text.is_empty() || !path.components().all(stays) {
        return Err(format!(
            "the path '{text}' does not lie in the dataset's folder"
        ));
    }
    Ok(path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_versions_are_filled() {
        let values = [
            ("episode_chunk", Value::Number(2)),
            ("episode_index", Value::Number(2017)),
            ("video_key", Value::Text("observation.images.top")),
        ];
        let path = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4";
        assert_eq!(
            filled(path, &values).unwrap(),
            Path::new("videos/chunk-002/observation.images.top/episode_002017.mp4")
        );
    }

    #[test]
    fn paths_that_leave_the_dataset_and_unknown_names_are_refused() {
        let values = [("key", Value::Text("../../etc"))];
        for wrong in ["/data/x", "../x", "data/{key}", "{nothing}", "a/{key", ""] {
            assert!(filled(wrong, &values).is_err(), "{wrong}");
        }
        let wide = filled("{n:0999999999d}", &[("n", Value::Number(1))]).unwrap();
        assert_eq!(wide.as_os_str().len(), MAX_DIGITS);
    }
}
