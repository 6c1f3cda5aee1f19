//! What would be lost if something took a place.

use std::fs;
use std::path::Path;

use super::StorageError;

/// What a place is or holds that is none of the files which `is_own` knows by their names, such as
/// `holds thesis.tex`; none where nothing would be lost.
///
/// # Errors
/// [`StorageError::Io`] when the folder cannot be read.
pub fn what_would_be_lost(
    place: &Path,
    is_own: impl Fn(&str) -> bool,
) -> Result<Option<String>, StorageError> {
    if !place.exists() {
        return Ok(None);
    }
    if !place.is_dir() {
        return Ok(Some("is a file".to_owned()));
    }
    for entry in fs::read_dir(place).map_err(StorageError::io("read", place))? {
        let entry = entry.map_err(StorageError::io("read", place))?;
        let name = entry.file_name();
        if entry.path().is_dir() {
            return Ok(Some(format!("holds the folder {}", name.display())));
        }
        if !name.to_str().is_some_and(&is_own) {
            return Ok(Some(format!("holds {}", name.display())));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_known_names_are_nothing_to_lose() {
        let root = tempfile::tempdir().unwrap();
        let lost = |place: &str| {
            let found = what_would_be_lost(&root.path().join(place), |name| name == "own");
            found.unwrap()
        };
        assert_eq!(lost("nowhere"), None);
        assert_eq!(lost(""), None);
        fs::write(root.path().join("own"), "").unwrap();
        assert_eq!(lost(""), None);
        assert_eq!(lost("own").as_deref(), Some("is a file"));
        fs::create_dir(root.path().join("deep")).unwrap();
        assert_eq!(lost("").as_deref(), Some("holds the folder deep"));
        fs::write(root.path().join("deep/thesis.tex"), "").unwrap();
        assert_eq!(lost("deep").as_deref(), Some("holds thesis.tex"));
        fs::create_dir_all(root.path().join("odd/own")).unwrap();
        assert_eq!(lost("odd").as_deref(), Some("holds the folder own"));
    }
}
