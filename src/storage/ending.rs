//! What a file is by the ending of its name.

use std::path::Path;

/// Whether a file is called as an MCAP file.
pub(crate) fn is_mcap(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "mcap")
}

/// Whether a file is called as a YAML file.
pub(super) fn is_yaml(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|ending| ending == "yaml" || ending == "yml")
}
