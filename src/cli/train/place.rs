use std::path::Path;

use crate::cli::error::CliError;
use crate::model::{
    ENCODER_FILE, LANDMARKS_FILE, MANIFEST_FILE, POLICY_FILE, PROJECTION_FILE, TRAVERSABILITY_FILE,
};
use crate::storage::what_would_be_lost;

/// All files that a model's or a baseline's folder may hold.
const MODEL_FILES: [&str; 6] = [
    ENCODER_FILE,
    PROJECTION_FILE,
    TRAVERSABILITY_FILE,
    POLICY_FILE,
    LANDMARKS_FILE,
    MANIFEST_FILE,
];
/// How the name of one ends that a killed export left.
const UNFINISHED: &str = ".partial";

/// Checks that a model can be written to a place that is not there, empty, or another model's, so that nothing else is
/// lost.
pub(super) fn check_model_place(out: &Path) -> Result<(), CliError> {
    let path = out.to_owned();
    if out.is_file() {
        return Err(CliError::OutIsFile { path });
    }
    let is_of_model = |name: &str| {
        let finished = name.strip_suffix(UNFINISHED).unwrap_or(name);
        MODEL_FILES.contains(&finished)
    };
    match what_would_be_lost(out, is_of_model)? {
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
        for file in MODEL_FILES {
            fs::write(out.join(file), "").unwrap();
        }
        fs::write(out.join("policy.onnx.partial"), "").unwrap();
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
