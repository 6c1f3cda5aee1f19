use std::path::Path;
use std::process::Command;

/// The commit of a working tree, with `-dirty` where files differ from it, other than the results that an
/// experiment writes there itself; none outside of one.
pub(super) fn revision(root: &Path) -> Option<String> {
    let commit = git(
        root,
        &["describe", "--always", "--abbrev=12", "--exclude=*"],
    )?;
    let changed = git(
        root,
        &[
            "status",
            "--porcelain",
            "--untracked-files=no",
            "--",
            ":(top)",
            ":(top,exclude)results",
        ],
    )?;
    let dirty = if changed.is_empty() { "" } else { "-dirty" };
    Some(format!("{commit}{dirty}"))
}

fn git(root: &Path, words: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("-C")
        .arg(root)
        .args(words)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn results_do_not_make_a_tree_dirty_and_sources_do() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        assert_eq!(revision(root), None);
        let who = ["-c", "user.name=a", "-c", "user.email=a@b"];
        git(root, &["init", "--quiet"]).unwrap();
        fs::create_dir(root.join("results")).unwrap();
        fs::write(root.join("results/table.md"), "1").unwrap();
        fs::write(root.join("source.rs"), "1").unwrap();
        git(root, &["add", "."]).unwrap();
        git(
            root,
            &[&who[..], &["commit", "--quiet", "-m", "one"]].concat(),
        )
        .unwrap();
        let clean = revision(root).unwrap();
        assert_eq!(clean.len(), 12, "{clean}");
        fs::write(root.join("results/table.md"), "2").unwrap();
        fs::write(root.join("results/new.json"), "2").unwrap();
        assert_eq!(revision(root), Some(clean.clone()));
        fs::write(root.join("source.rs"), "2").unwrap();
        assert_eq!(
            revision(&root.join("results")),
            Some(format!("{clean}-dirty"))
        );
    }
}
