use std::path::Path;
use std::process::Command;

/// The commit of a working tree, with `-dirty` where files differ from it; none outside of one.
pub(super) fn revision(root: &Path) -> Option<String> {
    let words = [
        "describe",
        "--always",
        "--dirty",
        "--abbrev=12",
        "--exclude=*",
    ];
    let git = Command::new("git")
        .arg("-C")
        .arg(root)
        .args(words)
        .output()
        .ok()?;
    let text = String::from_utf8(git.stdout).ok()?;
    git.status.success().then(|| text.trim().to_owned())
}
