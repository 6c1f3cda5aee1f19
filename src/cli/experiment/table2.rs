//! Table II: time that a step takes.

mod plot;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::digests::{Digests, RECORDINGS_UNNAMED};
use super::heeded::ensure_heeded;
use super::ingredients::Ingredients;
use super::method::{Method, OURS, TABLE_2, chosen};
use super::plan::{Size, digest, out, rising, with_note};
use super::workshop::{Workshop, evaluation};
use crate::cli::arguments::{Arguments, PaperArguments};
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep, keep_text, kept};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::training_config::training_commit;
use crate::experiment::Evaluation;
use crate::inference::{Engine, EngineChoice, InferenceError};

const NAME: &str = "table2";
/// Numbers of demonstrations of the whole table.
const DEMONSTRATIONS: [usize; 2] = [10, 30];
/// Training does not change how long a network takes.
const STEPS: u64 = 20;
/// The task whose steps are timed: one with a graph of middle size.
const TASK: &str = "trash";
/// The engines as `--engine` names them, and what they are.
const ENGINES: [(&str, &str); 2] = [("native", "ONNX Runtime"), ("embedded", "tract")];
/// What the paper measured on an Intel NUC: method, demonstrations (0 for any), milliseconds.
const PAPER: [(&str, usize, f64); 6] = [
    ("ours", 10, 23.0),
    ("ours", 30, 32.0),
    ("bc", 0, 8.0),
    ("bc_rnn", 0, 10.0),
    ("rt1", 0, 130.0),
    ("mvp", 0, 230.0),
];

/// The time of a method's step with one engine.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct TimeCell {
    method: String,
    demonstrations: usize,
    engine: String,
    /// Milliseconds to see, localise, plan and act at the median.
    step_median_ms: f64,
    /// 99th percentile.
    step_p99_ms: f64,
    /// Steps that were timed.
    steps: usize,
    /// Processors of the machine.
    cores: usize,
    digest: String,
    commands: Vec<String>,
    commit: Option<String>,
    /// The commit that the training began with, which may be an older one; older cells do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    training_commit: Option<String>,
    /// Seed of the episode; older cells do not tell.
    #[serde(default)]
    seed: Option<u64>,
    /// Digests of what it was measured with, by name; older cells have none.
    #[serde(default)]
    digests: Digests,
    /// Whether it is from a small version of the experiment; older cells do not tell.
    #[serde(default)]
    is_quick: bool,
}

/// A cell that is not there yet.
struct Job {
    method: Method,
    demonstrations: usize,
    /// As `--engine` names it.
    engine: &'static str,
    /// What the engine is.
    described: &'static str,
    missing: Missing,
}

/// `catena experiment table2`: one episode at a time, as on a robot.
pub(super) fn table_2(paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
    ensure_heeded(NAME, paper)?;
    let size = table_size(paper);
    let out = out(paper, NAME)?;
    let mut workshop = Workshop::open(paper, arguments)?;
    workshop.one_after_the_other();
    let methods = chosen(&TABLE_2, &paper.methods)?;
    let measured = if paper.only_draw {
        Vec::new()
    } else {
        rows(&methods, &size.demonstrations)
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut jobs = Vec::new();
    for (method, demonstrations) in measured {
        if !workshop.can_train(&method) {
            continue;
        }
        for (engine, described) in ENGINES {
            let of = (&method, demonstrations, engine);
            let digest = digest_of(&workshop.ingredients, of, &size, cores)?;
            let file = cell_file(&out, &method, demonstrations, engine);
            let recipe = || recipe(&workshop, (&method, demonstrations), &size, engine, cores);
            let missing = workshop.missing::<TimeCell>(file, digest, recipe)?;
            jobs.extend(missing.map(|missing| Job {
                method,
                demonstrations,
                engine,
                described,
                missing,
            }));
        }
    }
    leave_out_what_is_not_here(&mut jobs);
    let all = jobs.len();
    let mut failed = 0;
    for job in jobs {
        failed += usize::from(!job.measure(&workshop, &size, cores)?);
    }
    // What is missing of the whole table is said; a small version has no whole.
    let whole: &[usize] = if size.is_quick { &[] } else { &DEMONSTRATIONS };
    draw(&out, &rising(&[whole, &size.demonstrations].concat()))?;
    if failed > 0 {
        return Err(CliError::CellsFailed { failed, all });
    }
    Ok(())
}

/// Leaves out what ONNX Runtime is to compute on a machine that has none, and says so. One that is named and cannot be
/// used is left for the measurement to refuse.
fn leave_out_what_is_not_here(jobs: &mut Vec<Job>) {
    let [(native, described), _] = ENGINES;
    if jobs.iter().all(|job| job.engine != native) {
        return;
    }
    if let Err(error @ InferenceError::NativeMissing { .. }) = Engine::select(EngineChoice::Native)
    {
        println!("{described}: left out: {error}");
        jobs.retain(|job| job.engine != native);
    }
}

impl Job {
    /// Trains the method and measures its step; whether that could be done. Where not, it says why.
    fn measure(self, workshop: &Workshop<'_>, size: &Size, cores: usize) -> Result<bool, CliError> {
        let (method, demonstrations) = (&self.method, self.demonstrations);
        let seed = size.training_seed;
        let trained = workshop.trained(method, demonstrations, size, seed, true)?;
        let command = evaluation(method, &trained, TASK, size);
        let found: Evaluation = match workshop.json(&trained, &command, Some(self.engine)) {
            Ok(found) => found,
            Err(error) => {
                eprintln!(
                    "{} with {}: not measured: {error}",
                    method.described, self.described
                );
                return Ok(false);
            }
        };
        let cell = TimeCell {
            method: method.name.to_owned(),
            demonstrations,
            engine: self.engine.to_owned(),
            step_median_ms: found.step_median_ms,
            step_p99_ms: found.step_p99_ms,
            steps: found.results.iter().map(|r| r.steps).sum(),
            cores,
            digest: self.missing.digest,
            commands: vec![workshop.shown(&trained, &command, Some(self.engine))],
            commit: workshop.commit.clone(),
            training_commit: training_commit(&trained.run),
            seed: Some(size.seed),
            digests: workshop.digests(method, &trained)?,
            is_quick: size.is_quick,
        };
        keep(&self.missing.file, &cell)?;
        Ok(true)
    }
}

/// How large the table is: of hardly any training.
fn table_size(paper: &PaperArguments) -> Size {
    Size {
        steps: paper.steps.unwrap_or(STEPS),
        baseline_steps: paper.baseline_steps.unwrap_or(STEPS),
        episodes: 1,
        ..Size::new(paper, &DEMONSTRATIONS, 1)
    }
}

/// A method of which only the time of a step counts: how its network learns does not change it.
fn timed(method: &Method) -> Method {
    Method {
        has_memory: false,
        ..*method
    }
}

/// The digest of what a cell of a method, a number of demonstrations and an engine depends on.
fn digest_of(
    ingredients: &Ingredients,
    (method, demonstrations, engine): (&Method, usize, &str),
    size: &Size,
    cores: usize,
) -> Result<String, CliError> {
    digest(&(
        method.name,
        demonstrations,
        engine,
        size.training(method, size.training_seed),
        ingredients.of(&timed(method)),
        size.seed,
        cores,
    ))
}

/// What a cell of a method and a number of demonstrations would be made of now.
fn recipe(
    workshop: &Workshop<'_>,
    (method, demonstrations): (&Method, usize),
    size: &Size,
    engine: &str,
    cores: usize,
) -> Result<Recipe, CliError> {
    let place = workshop.place(method, demonstrations, size, size.training_seed)?;
    let command = evaluation(method, &place, TASK, size);
    let command = workshop.shown(&place, &command, Some(engine));
    let mut named = workshop.recordings_now(demonstrations);
    named.extend([
        Ingredient::Value("the number of processors", "/cores", cores.into()),
        Ingredient::Value("the seed of the episode", "/seed", size.seed.into()),
        Ingredient::Commands(vec![command]),
    ]);
    let unnamed = [RECORDINGS_UNNAMED, "the flags of the training"];
    Ok(workshop.ingredients.recipe(&timed(method), named, &unnamed))
}

fn cell_file(out: &Path, method: &Method, demonstrations: usize, engine: &str) -> PathBuf {
    out.join(format!("{}_{demonstrations}_{engine}.json", method.name))
}

/// Makes the table of all cells that are there, whichever call measured them.
fn draw(out: &Path, demonstrations: &[usize]) -> Result<(), CliError> {
    let mut cells: Vec<TimeCell> = Vec::new();
    for method in &TABLE_2 {
        for number in demonstrations {
            for (engine, _) in ENGINES {
                cells.extend(kept(&cell_file(out, method, *number, engine))?);
            }
        }
    }
    let table = table(demonstrations, &cells);
    keep_text(&out.join("table.md"), table.as_bytes())?;
    plot::draw(out, &drawn(demonstrations, &cells), &cells)?;
    println!("\n{table}\nin {}", out.display());
    Ok(())
}

/// What is measured: ours on each graph, whose size makes its time; the others on the last number of demonstrations.
fn rows(methods: &[Method], demonstrations: &[usize]) -> Vec<(Method, usize)> {
    let last = demonstrations.last().copied().unwrap_or(10);
    let of = |method: &Method| -> Vec<(Method, usize)> {
        let numbers = if *method == OURS {
            demonstrations
        } else {
            &[last][..]
        };
        numbers.iter().map(|n| (*method, *n)).collect()
    };
    methods.iter().flat_map(of).collect()
}

/// The rows of the table: those that would be measured, but of the others each number of demonstrations that some call
/// measured them on.
fn drawn(demonstrations: &[usize], cells: &[TimeCell]) -> Vec<(Method, usize)> {
    let of = |method: &Method| -> Vec<(Method, usize)> {
        let is_measured = |number: &&usize| {
            let is_of = |c: &TimeCell| c.method == method.name && c.demonstrations == **number;
            cells.iter().any(is_of)
        };
        let measured = demonstrations.iter().filter(is_measured);
        let measured: Vec<(Method, usize)> = measured.map(|number| (*method, *number)).collect();
        if *method == OURS || measured.is_empty() {
            rows(std::slice::from_ref(method), demonstrations)
        } else {
            measured
        }
    };
    TABLE_2.iter().flat_map(of).collect()
}

/// The milliseconds that the paper has of a method with so many demonstrations.
fn published(method: &Method, demonstrations: usize) -> Option<f64> {
    let of_row = |(name, number, _): &&(&str, usize, f64)| {
        *name == method.name && (*number == 0 || *number == demonstrations)
    };
    PAPER.iter().find(of_row).map(|(.., millis)| *millis)
}

fn table(demonstrations: &[usize], cells: &[TimeCell]) -> String {
    let mut table = String::from("| milliseconds a step, median (99th percentile) |");
    for (_, described) in ENGINES {
        let _ = write!(table, " {described} |");
    }
    table.push_str(" paper, on a NUC |\n|---|---|---|---|\n");
    for (method, number) in drawn(demonstrations, cells) {
        let described = if method == OURS || demonstrations.last() != Some(&number) {
            format!("{}, {number} demonstrations", method.described)
        } else {
            method.described.to_owned()
        };
        let _ = write!(table, "| {described} |");
        for (engine, _) in ENGINES {
            let cell = cells.iter().find(|c| {
                c.method == method.name && c.demonstrations == number && c.engine == engine
            });
            let text = cell.map_or_else(
                || "not measured".to_owned(),
                |c| format!("**{:.1}** ({:.1})", c.step_median_ms, c.step_p99_ms),
            );
            let _ = write!(table, " {text} |");
        }
        let paper = published(&method, number).map_or_else(String::new, |ms| format!("{ms:.0}"));
        let _ = writeln!(table, " {paper} |");
    }
    with_note(table, cells.iter().any(|cell| cell.is_quick))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::committed::{assert_kept, root, unflagged};
    use crate::cli::experiment::method::{BC, MVP};

    #[test]
    fn committed_cells_count_as_finished() {
        let paper = unflagged(NAME);
        let size = table_size(&paper);
        let ingredients = Ingredients::gather(&paper, root()).unwrap();
        assert_kept::<TimeCell>(NAME, |cell| {
            let method = TABLE_2.iter().find(|m| m.name == cell.method).unwrap();
            let of = (method, cell.demonstrations, cell.engine.as_str());
            let digest = digest_of(&ingredients, of, &size, cell.cores).unwrap();
            (method.name != MVP).then_some(digest)
        });
    }

    fn cell(method: &str) -> TimeCell {
        TimeCell {
            method: method.to_owned(),
            demonstrations: 30,
            engine: "native".to_owned(),
            step_median_ms: 4.25,
            step_p99_ms: 9.0,
            steps: 50,
            cores: 2,
            digest: String::new(),
            commands: Vec::new(),
            commit: None,
            training_commit: None,
            seed: Some(100),
            digests: Digests::new(),
            is_quick: false,
        }
    }

    #[test]
    fn a_table_has_what_other_calls_measured() {
        let place = tempfile::tempdir().unwrap();
        for method in [TABLE_2[0], TABLE_2[1]] {
            let file = cell_file(place.path(), &method, 30, "native");
            keep(&file, &cell(method.name)).unwrap();
        }
        draw(place.path(), &[10, 30]).unwrap();
        let table = std::fs::read_to_string(place.path().join("table.md")).unwrap();
        assert_eq!(table.matches("**4.2** (9.0)").count(), 2, "{table}");
    }

    #[test]
    fn the_plot_has_the_cells_that_are_there_and_the_papers_times() {
        let place = tempfile::tempdir().unwrap();
        for (method, engine) in [("ours", "native"), ("ours", "embedded"), ("bc", "embedded")] {
            let file = place.path().join(format!("{method}_30_{engine}.json"));
            let engine = engine.to_owned();
            keep(
                &file,
                &TimeCell {
                    engine,
                    ..cell(method)
                },
            )
            .unwrap();
        }
        draw(place.path(), &[10, 30]).unwrap();
        let svg = std::fs::read_to_string(place.path().join("table2.svg")).unwrap();
        let count = |text: &str| svg.matches(text).count();
        assert_eq!(count(">4.2 ms<"), 3, "{svg}");
        // Those of ours of 10 demonstrations are not measured, so that the paper's time is not told, either.
        assert_eq!(
            [count(">32 ms<"), count(">8 ms<"), count(">23 ms<")],
            [1, 1, 0]
        );
        assert_eq!(count(", 30 demonstrations<"), 2);
        assert_eq!([count(">ONNX Runtime<"), count(">tract<")], [1, 1]);
    }

    #[test]
    fn ours_has_a_row_for_each_graph_and_what_is_missing_says_so() {
        let table = table(&[10, 30], &[cell("ours")]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 2 + 2 + 4);
        assert!(
            lines[2].ends_with("| not measured | not measured | 23 |"),
            "{}",
            lines[2]
        );
        assert!(
            lines[3].contains("30 demonstrations | **4.2** (9.0) | not measured | 32 |"),
            "{}",
            lines[3]
        );
        assert!(lines[4].starts_with("| BC | not measured |"));
    }

    #[test]
    fn a_baseline_that_was_measured_on_fewer_demonstrations_than_usual_is_seen_and_says_so() {
        let place = tempfile::tempdir().unwrap();
        let of_10 = TimeCell {
            demonstrations: 10,
            ..cell("bc")
        };
        let file = cell_file(place.path(), &BC, 10, "native");
        keep(&file, &of_10).unwrap();
        draw(place.path(), &[10, 30]).unwrap();
        let [table_of_file, svg] = ["table.md", "table2.svg"]
            .map(|name| std::fs::read_to_string(place.path().join(name)).unwrap());
        let row = "| BC, 10 demonstrations | **4.2** (9.0) | not measured | 8 |";
        assert!(table_of_file.contains(row), "{table_of_file}");
        assert!(!table_of_file.contains("| BC |"), "{table_of_file}");
        assert!(svg.contains("BC, 10 demonstrations"), "{svg}");

        // One that was measured on the usual number is the row without a number.
        let both = table(&[10, 30], &[of_10, cell("bc")]);
        assert!(both.contains(row), "{both}");
        assert!(both.contains("| BC | **4.2** (9.0) |"), "{both}");
        let usual = table(&[10, 30], &[cell("bc")]);
        assert!(!usual.contains("| BC, "), "{usual}");
    }

    #[test]
    fn a_table_with_a_cell_of_the_small_version_says_so() {
        let mut small = cell("ours");
        assert!(table(&[30], std::slice::from_ref(&small)).starts_with("| mill"));
        small.is_quick = true;
        let said = table(&[30], &[small]);
        assert!(said.starts_with("small version (--quick)"), "{said}");
    }

    #[test]
    fn a_cell_that_names_less_is_read() {
        let mut older = serde_json::to_value(cell("ours")).unwrap();
        for field in ["seed", "digests", "is_quick"] {
            let fields = older.as_object_mut().unwrap();
            assert!(fields.remove(field).is_some(), "{field}");
        }
        let read: TimeCell = serde_json::from_value(older).unwrap();
        assert_eq!((read.seed, read.is_quick), (None, false));
        assert!(read.digests.is_empty());
    }
}
