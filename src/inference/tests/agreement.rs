//! Both engines give the same results. A process keeps its engine, so each computes in a process of
//! its own: this test binary once more.

use std::process::Command;

use super::trained::exported;
use super::*;

const MARK: &str = "outputs: ";

fn print_outputs(choice: EngineChoice) {
    let (folder, states) = exported();
    let model = match Model::load(folder.path(), choice) {
        Ok(model) => model,
        Err(InferenceError::NativeMissing { .. }) => return println!("{MARK}absent"),
        Err(error) => panic!("{error}"),
    };
    let latents = model.encode(&states).expect("the states fit");
    let projections = model.project(&latents).expect("the latents fit");
    let pairs: Vec<(u32, u32)> = (0..400).map(|i| (i / 20, i % 20)).collect();
    let steps = model
        .predict(&projections, &projections, &pairs)
        .expect("the rows exist");
    let actions = model
        .act(latents.row(0), latents.row(7))
        .expect("the latents fit");
    let all: Vec<f32> = latents
        .values()
        .iter()
        .chain(steps.rows().flatten())
        .chain(actions.heads.iter().flatten())
        .copied()
        .chain(baselines::outputs(choice))
        .collect();
    println!("{MARK}{}", serde_json::to_string(&all).expect("numbers"));
}

fn outputs_of(test: &str) -> Option<Vec<f32>> {
    let name = format!(
        "{}::{test}",
        module_path!().split_once("::").expect("a module").1
    );
    let output = Command::new(std::env::current_exe().expect("this test binary"))
        .args(["--exact", &name, "--ignored", "--nocapture"])
        .output()
        .expect("this test binary runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let line = text
        .split_once(MARK)
        .expect("the child prints its outputs")
        .1;
    let line = line.lines().next().unwrap_or_default();
    (line != "absent").then(|| serde_json::from_str(line).expect("numbers"))
}

#[test]
#[ignore = "prints for engines_agree"]
fn native_outputs() {
    print_outputs(EngineChoice::Native);
}

#[test]
#[ignore = "prints for engines_agree"]
fn tract_outputs() {
    print_outputs(EngineChoice::Tract);
}

#[test]
fn engines_agree() {
    let tract = outputs_of("tract_outputs").expect("it is compiled in");
    let Some(native) = outputs_of("native_outputs") else {
        eprintln!("no ONNX Runtime library here: only the compiled-in engine was run");
        return;
    };
    assert_eq!(tract.len(), native.len());
    for (a, b) in tract.iter().zip(&native) {
        assert!((a - b).abs() <= 1e-4 * a.abs().max(1.0), "{a} and {b}");
    }
}
