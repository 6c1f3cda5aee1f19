use super::*;

/// The names and contents of what lies in a folder; a folder in it has no contents.
fn held(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let read = |path: PathBuf| fs::read_to_string(path).unwrap_or_default();
    let mut held: Vec<_> = entries
        .map(|e| (e.file_name().into_string().unwrap(), read(e.path())))
        .collect();
    held.sort();
    held
}

fn holding(files: &[(&str, &str)]) -> Vec<(String, String)> {
    let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
    files.iter().map(owned).collect()
}

fn names(folder: &Path) -> Vec<String> {
    held(folder).into_iter().map(|(name, _)| name).collect()
}

/// Writes a model with a policy of this text and the manifest of another.
fn write(folder: &Path, text: &str, manifest: &str) -> Result<(), TrainingError> {
    let files = [(POLICY_FILE, text.as_bytes().to_vec())];
    write_folder(folder, &files, manifest.as_bytes())
}

const OLD: [(&str, &str); 2] = [("manifest.json", "one"), ("policy.onnx", "1")];

#[test]
fn another_model_takes_the_place_as_a_whole_and_leaves_what_is_none() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("deep/model");
    write(&folder, "1", "one").unwrap();
    assert_eq!(held(&folder), holding(&OLD));
    // Of the older model, of an export that was killed, and of its user.
    for name in ["landmarks.json", "policy.onnx.partial", "notes.txt"] {
        fs::write(folder.join(name), "x").unwrap();
    }
    fs::create_dir(folder.join("figures")).unwrap();
    fs::write(folder.join("figures/a.svg"), "a").unwrap();
    write(&folder, "2", "two").unwrap();
    let new = [
        ("figures", ""),
        ("manifest.json", "two"),
        ("notes.txt", "x"),
        ("policy.onnx", "2"),
    ];
    assert_eq!(held(&folder), holding(&new));
    assert_eq!(names(&folder.join("figures")), ["a.svg"]);
    assert_eq!(names(&root.path().join("deep")), ["model"]);
}

#[test]
fn a_failed_write_leaves_the_older_model_whole() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("model");
    write(&folder, "1", "one").unwrap();
    // The second file cannot be written, since its folder is not there.
    let files = [(POLICY_FILE, vec![b'2']), ("none/file", vec![b'2'])];
    let error = write_folder(&folder, &files, b"two").unwrap_err();
    assert!(error.to_string().contains("none/file"), "{error}");
    assert_eq!(held(&folder), holding(&OLD));
    assert_eq!(names(root.path()), ["model"]);
    let two: [(&str, &[u8]); 2] = [(POLICY_FILE, b"2"), ("none/file", b"2")];
    let error = write_within(&folder, &two).unwrap_err();
    assert!(error.to_string().contains("none/file"), "{error}");
    assert_eq!(held(&folder), holding(&OLD));
    // Nor is anything written over a folder.
    fs::remove_file(folder.join(POLICY_FILE)).unwrap();
    fs::create_dir(folder.join(POLICY_FILE)).unwrap();
    let error = write(&folder, "2", "two").unwrap_err();
    assert!(error.to_string().contains("policy.onnx"), "{error}");
    let kept = [("manifest.json", "one"), ("policy.onnx", "")];
    assert_eq!(held(&folder), holding(&kept));
    assert_eq!(names(root.path()), ["model"]);
}

#[test]
fn a_kill_at_any_moment_leaves_a_model_that_is_whole() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("model");
    let previous = root.path().join(".model.previous");
    write(&folder, "1", "one").unwrap();
    fs::write(folder.join("notes.txt"), "x").unwrap();
    // Between the renames: the older one comes back before it is replaced.
    fs::create_dir(root.path().join(".model.partial")).unwrap();
    fs::write(root.path().join(".model.partial/policy.onnx"), "ha").unwrap();
    fs::rename(&folder, &previous).unwrap();
    settle(&folder).unwrap();
    let old = [&OLD[..1], &[("notes.txt", "x")], &OLD[1..]].concat();
    assert_eq!(held(&folder), holding(&old));
    // The same, and somebody has made the folder that is missing.
    fs::rename(&folder, &previous).unwrap();
    fs::create_dir(&folder).unwrap();
    settle(&folder).unwrap();
    assert_eq!(held(&folder), holding(&old));
    // Before what is no part of a model was brought to the new one.
    fs::rename(&folder, &previous).unwrap();
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join(POLICY_FILE), "2").unwrap();
    write(&folder, "3", "three").unwrap();
    let new = [
        ("manifest.json", "three"),
        ("notes.txt", "x"),
        ("policy.onnx", "3"),
    ];
    assert_eq!(held(&folder), holding(&new));
    assert_eq!(names(root.path()), ["model"]);
    // What has the same name in both is lost in neither.
    fs::create_dir(&previous).unwrap();
    fs::write(previous.join("notes.txt"), "y").unwrap();
    let error = write(&folder, "4", "four").unwrap_err().to_string();
    assert!(error.contains("notes.txt"), "{error}");
    assert_eq!(held(&folder), holding(&new));
    assert_eq!(names(&previous), ["notes.txt"]);
}

#[test]
fn a_folder_that_was_moved_away_is_brought_back_to_be_read() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("model");
    recover_folder(&folder).unwrap();
    assert!(!folder.exists(), "there is none to bring back");
    write(&folder, "1", "one").unwrap();
    fs::rename(&folder, root.path().join(".model.previous")).unwrap();
    let taken = Alone::with(&folder).unwrap();
    let error = recover_folder(&folder).unwrap_err().to_string();
    assert!(error.contains("another process"), "{error}");
    assert!(!folder.exists(), "the other one is about to take the place");
    drop(taken);
    recover_folder(&folder).unwrap();
    assert_eq!(held(&folder), holding(&OLD));
    assert_eq!(names(root.path()), ["model"]);
}

#[test]
fn two_processes_do_not_write_one_folder() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("deep/model");
    let taken = Alone::with(&folder).unwrap();
    let error = write(&folder, "1", "one").unwrap_err().to_string();
    assert!(
        error.contains("another process") && error.contains("model") && error.contains("--out"),
        "{error}"
    );
    drop(taken);
    write(&folder, "1", "one").unwrap();
    assert_eq!(held(&folder), holding(&OLD));
    assert_eq!(names(&root.path().join("deep")), ["model"]);
}

#[test]
fn a_folder_that_cannot_be_made_is_named_itself() {
    let root = tempfile::tempdir().unwrap();
    let blocked = root.path().join("file");
    fs::write(&blocked, "in the way").unwrap();
    let error = write(&blocked.join("model"), "1", "one").unwrap_err();
    let message = error.to_string();
    assert!(
        message.starts_with("cannot create ") && message.contains("file/model: "),
        "{message}"
    );
}

#[test]
fn a_folder_that_cannot_be_moved_is_written_into() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("model");
    write(&folder, "1", "one").unwrap();
    fs::write(folder.join("notes.txt"), "x").unwrap();
    let two: [(&str, &[u8]); 2] = [(POLICY_FILE, b"2"), (MANIFEST_FILE, b"two")];
    write_within(&folder, &two).unwrap();
    let new = [
        ("manifest.json", "two"),
        ("notes.txt", "x"),
        ("policy.onnx", "2"),
    ];
    assert_eq!(held(&folder), holding(&new));
}

#[cfg(unix)]
#[test]
fn a_folder_that_is_protected_is_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("model");
    write(&folder, "1", "one").unwrap();
    let rights = fs::metadata(&folder).unwrap().permissions();
    let mut protected = rights.clone();
    protected.set_readonly(true);
    fs::set_permissions(&folder, protected).unwrap();
    let error = write(&folder, "2", "two").unwrap_err().to_string();
    fs::set_permissions(&folder, rights).unwrap();
    assert!(error.contains("model: permission denied"), "{error}");
    assert_eq!(held(&folder), holding(&OLD));
}

#[cfg(unix)]
#[test]
fn a_link_to_a_folder_stays_one() {
    let root = tempfile::tempdir().unwrap();
    let [folder, link] = ["model", "link"].map(|name| root.path().join(name));
    write(&folder, "1", "one").unwrap();
    std::os::unix::fs::symlink(&folder, &link).unwrap();
    write(&link, "2", "two").unwrap();
    assert!(link.is_symlink());
    let new = [("manifest.json", "two"), ("policy.onnx", "2")];
    assert_eq!(held(&folder), holding(&new));
    assert_eq!(names(root.path()), ["link", "model"]);
}
