use std::path::Path;

use crate::cli::error::CliError;
use crate::storage::what_would_be_lost;
use crate::training::is_model_file;

/// Checks that a model can be written to a place that is not there, empty, or another model's, so that nothing else is
/// lost.
pub(super) fn check_model_place(out: &Path) -> Result<(), CliError> {
    let path = out.to_owned();
    if out.is_file() {
        return Err(CliError::OutIsFile { path });
    }
    match what_would_be_lost(out, is_model_file)? {
        None => Ok(()),
        Some(what) => Err(CliError::OutHoldsOthers { path, what }),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_model_takes_the_place_of_nothing_but_a_model() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("model");
        check_model_place(&out).unwrap();
        fs::create_dir(&out).unwrap();
        check_model_place(&out).unwrap();
        for file in ["landmarks.json", "manifest.json", "policy.onnx.partial"] {
            fs::write(out.join(file), "").unwrap();
        }
        check_model_place(&out).unwrap();
        let precious = out.join("thesis.tex");
        fs::write(&precious, "years").unwrap();
        let refused = check_model_place(&out).unwrap_err().to_string();
        assert!(
            refused.contains("model holds thesis.tex") && refused.contains("--out"),
            "{refused}"
        );
        let refused = check_model_place(&precious).unwrap_err().to_string();
        assert!(refused.contains("is a file"), "{refused}");
        // What another command wrote, whose manifest a model's would replace.
        let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bedroom");
        check_model_place(&graph.join("model")).unwrap();
        check_model_place(&graph.join("sock")).unwrap_err();
    }
}
