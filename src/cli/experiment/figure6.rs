//! Figure 6: how sure a method is of what to do first.

mod plot;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::digests::{Digests, RECORDINGS_UNNAMED};
use super::heeded::ensure_heeded;
use super::ingredients::Ingredients;
use super::method::{BC, Method, OURS, OWN_GOALS, chosen};
use super::plan::{Size, digest, out, training_command, with_note};
use super::workshop::{Trained, Workshop};
use crate::cli::arguments::{Arguments, PaperArguments};
use crate::cli::baseline::goal_state;
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep, keep_text, kept};
use crate::cli::loaded::{Loaded, bedroom};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::training_config::training_commit;
use crate::cli::worlds::composed;
use crate::environment::Environment;
use crate::inference::Baseline;
use crate::model::{ActionDistribution, ReactivePolicy};
use crate::rollout::{
    Controller, Decision, ReactiveObserver, ReactiveRollout, ReactiveStep, RolloutOptions,
};
use crate::simulator::Bedroom;
use crate::trajectory::ActionSpace;

const NAME: &str = "fig6";
const TASK: &str = "sock";
const DEMONSTRATIONS: usize = 20;
/// Actions that are listed.
const LISTED: usize = 3;

/// What is measured of a method.
#[derive(Clone, Copy, Debug)]
struct Line {
    name: &'static str,
    described: &'static str,
    method: Method,
    /// How many goal states the policy is averaged over at most, where that is not as in all runs.
    hypotheses: Option<usize>,
    /// How many steps a goal state lies ahead at most, where that is not as in all runs.
    lookahead_steps: Option<u32>,
    /// What the paper's robot would do first, with what probability (Fu & Finn, Figure 6); it has one goal state at a time.
    paper: &'static [(&'static str, f64)],
}

/// What the paper's robot would do first: it has one goal state at a time.
const PAPER_OURS: [(&str, f64); 1] = [("base_forward", 0.99)];

const LINES: [Line; 7] = [
    Line {
        name: BC.name,
        described: BC.described,
        method: BC,
        hypotheses: None,
        lookahead_steps: None,
        paper: &[("base_forward", 0.68), ("base_turn_left", 0.31)],
    },
    Line {
        name: OURS.name,
        described: "ours",
        method: OURS,
        hypotheses: None,
        lookahead_steps: None,
        paper: &[],
    },
    Line {
        name: "ours_one_goal",
        described: "ours, one goal state",
        method: OURS,
        hypotheses: Some(1),
        lookahead_steps: None,
        paper: &PAPER_OURS,
    },
    Line {
        name: "ours_next_state",
        described: "ours, the next state as goal",
        method: OURS,
        hypotheses: Some(1),
        lookahead_steps: Some(1),
        paper: &[],
    },
    Line {
        name: OWN_GOALS.name,
        described: OWN_GOALS.described,
        method: OWN_GOALS,
        hypotheses: None,
        lookahead_steps: None,
        paper: &[],
    },
    Line {
        name: "own_goals_one_goal",
        described: "the same, one goal state",
        method: OWN_GOALS,
        hypotheses: Some(1),
        lookahead_steps: None,
        paper: &PAPER_OURS,
    },
    Line {
        name: "own_goals_next_state",
        described: "the same, the next state as goal",
        method: OWN_GOALS,
        hypotheses: Some(1),
        lookahead_steps: Some(1),
        paper: &[],
    },
];

/// What a method would do first in some episodes.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct CertaintyCell {
    method: String,
    demonstrations: usize,
    task: String,
    episodes: usize,
    seed: u64,
    /// Mean over the episodes of the Shannon entropy of the first action, in nats.
    entropy: f64,
    /// Entropy in each episode.
    entropies: Vec<f64>,
    /// Mean probability of each action, the most probable first.
    actions: Vec<(String, f64)>,
    /// Standard deviation over the episodes of each of these probabilities.
    deviations: Vec<f64>,
    digest: String,
    /// The commands that made what was measured; older cells have none.
    #[serde(default)]
    commands: Vec<String>,
    /// Digests of what it was measured with, by name; older cells have none.
    #[serde(default)]
    digests: Digests,
    commit: Option<String>,
    /// The commit that the training began with, which may be an older one; older cells do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    training_commit: Option<String>,
    is_quick: bool,
}

/// `catena experiment fig6`.
pub(super) fn figure_6(paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
    ensure_heeded(NAME, paper)?;
    let size = Size::new(paper, &[DEMONSTRATIONS], 1);
    let demonstrations = size.only_number(NAME)?;
    let out = out(paper, NAME)?;
    let workshop = Workshop::open(paper, arguments)?;
    let methods = chosen(&[BC, OURS, OWN_GOALS], &paper.methods)?;
    if !paper.only_draw {
        let mut jobs = Vec::new();
        for method in methods {
            let mut lines = Vec::new();
            for line in LINES.iter().filter(|line| line.method == method) {
                let digest = digest_of(&workshop.ingredients, line, demonstrations, &size)?;
                let recipe = || Ok(recipe(&workshop, &method, demonstrations, &size));
                let file = cell_file(&out, line);
                let missing = workshop.missing::<CertaintyCell>(file, digest, recipe)?;
                lines.extend(missing.map(|missing| (line, missing)));
            }
            jobs.push(lines);
        }
        workshop.side_by_side(jobs, |lines| {
            lines.into_iter().try_for_each(|(line, missing)| {
                measure(&workshop, line, demonstrations, &size, missing, arguments)
            })
        })?;
    }
    draw(&out)
}

fn cell_file(out: &Path, line: &Line) -> PathBuf {
    out.join(format!("{}.json", line.name))
}

/// The digest of what a cell of a line and a number of demonstrations depends on.
fn digest_of(
    ingredients: &Ingredients,
    line: &Line,
    demonstrations: usize,
    size: &Size,
) -> Result<String, CliError> {
    digest(&(
        line.name,
        demonstrations,
        size.training(&line.method, size.training_seed),
        ingredients.of(&line.method),
        size.episodes,
        size.seed,
    ))
}

/// What a cell would be made of now.
fn recipe(workshop: &Workshop<'_>, method: &Method, demonstrations: usize, size: &Size) -> Recipe {
    let number = |what, place, now: u64| Ingredient::Value(what, place, now.into());
    let mut named = workshop.recordings_now(demonstrations);
    named.extend([
        number(
            "the number of demonstrations",
            "/demonstrations",
            demonstrations as u64,
        ),
        number("the number of episodes", "/episodes", size.episodes as u64),
        number("the seed of the first episode", "/seed", size.seed),
        Ingredient::Commands(vec![command(method, size)]),
    ]);
    let flags = "the flags of the training, where it does not name them";
    let ingredients = &workshop.ingredients;
    ingredients.recipe(method, named, &[RECORDINGS_UNNAMED, flags])
}

/// The training behind a cell as a command.
fn command(method: &Method, size: &Size) -> String {
    training_command(&size.training(method, size.training_seed))
}

/// Measures a line, training its method if need be.
fn measure(
    workshop: &Workshop<'_>,
    line: &Line,
    demonstrations: usize,
    size: &Size,
    Missing { file, digest }: Missing,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let method = &line.method;
    let seed = size.training_seed;
    let trained = workshop.trained(method, demonstrations, size, seed, true)?;
    let (names, first) = first_actions(line, &trained, size, arguments)?;
    let mut cell = summed_up(&names, &first);
    line.name.clone_into(&mut cell.method);
    cell.demonstrations = demonstrations;
    cell.seed = size.seed;
    cell.digest = digest;
    cell.commands = vec![command(method, size)];
    cell.digests = workshop.digests(method, &trained)?;
    cell.commit.clone_from(&workshop.commit);
    cell.training_commit = training_commit(&trained.run);
    cell.is_quick = size.is_quick;
    keep(&file, &cell)
}

/// The distribution of the first action in each episode, and the names of the actions.
fn first_actions(
    line: &Line,
    trained: &Trained,
    size: &Size,
    arguments: &Arguments,
) -> Result<(Vec<String>, Vec<ActionDistribution>), CliError> {
    let composition = composed(TASK, &trained.root)?;
    let mut room = Bedroom::new(bedroom(&composition)?);
    let mut first = Vec::new();
    let seeds = (size.seed..).take(size.episodes);
    if !line.method.plans {
        let policy = Baseline::load(&trained.model, arguments.engine.into())?;
        let goal = goal_state(&composition.tasks[0], policy.spec())?;
        let options = RolloutOptions {
            max_steps: 1,
            ..RolloutOptions::default()
        };
        let rollout = ReactiveRollout::new(&policy, &goal, options)?;
        for seed in seeds {
            rollout.run(&mut room, seed, &mut Kept(&mut first), |_| false)?;
        }
        return Ok((names_of(&policy.spec().action_space)?, first));
    }
    let loaded = Loaded::of(composition, arguments)?;
    let mut planning = loaded.composition.planner.clone();
    planning.lookahead_steps = line.lookahead_steps.unwrap_or(planning.lookahead_steps);
    let planner = loaded.planner(planning)?;
    let mut options = loaded.rollout_options(None);
    options.hypotheses = line.hypotheses.unwrap_or(options.hypotheses);
    let mut controller = Controller::new(loaded.rollout_model(), planner, options)?;
    for seed in seeds {
        controller.reset(seed);
        let seen = room.reset(seed)?;
        if let Decision::Act(record) = controller.step(Arc::new(seen))? {
            first.push(record.distribution);
        }
    }
    Ok((names_of(&controller.spec().action_space)?, first))
}

struct Kept<'a>(&'a mut Vec<ActionDistribution>);

impl ReactiveObserver for Kept<'_> {
    fn on_step(&mut self, step: &ReactiveStep) {
        self.0.push(step.distribution.clone());
    }
}

/// Names of the classes of the first head.
fn names_of(space: &ActionSpace) -> Result<Vec<String>, CliError> {
    let classes = space.head_sizes().first().copied().unwrap_or(0);
    let others = space.head_sizes().len().saturating_sub(1);
    (0..classes)
        .map(|class| {
            let classes: Vec<usize> = [vec![class], vec![0; others]].concat();
            Ok(space.name(&space.action(&classes)?))
        })
        .collect()
}

fn summed_up(names: &[String], first: &[ActionDistribution]) -> CertaintyCell {
    let count = first.len().max(1) as f64;
    let of_action = |action: usize| -> (f64, f64) {
        let values = || first.iter().map(move |d| f64::from(d.heads[0][action]));
        let mean = values().sum::<f64>() / count;
        let spread = values().map(|p| (p - mean).powi(2)).sum::<f64>() / count;
        (mean, spread.sqrt())
    };
    let mut actions: Vec<(String, (f64, f64))> = (names.iter().enumerate())
        .map(|(action, name)| (name.clone(), of_action(action)))
        .collect();
    actions.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    let entropies: Vec<f64> = first.iter().map(|d| f64::from(d.entropy())).collect();
    CertaintyCell {
        method: String::new(),
        demonstrations: 0,
        task: TASK.to_owned(),
        episodes: first.len(),
        seed: 0,
        entropy: entropies.iter().sum::<f64>() / count,
        entropies,
        deviations: actions
            .iter()
            .map(|(_, (_, deviation))| *deviation)
            .collect(),
        actions: actions
            .into_iter()
            .map(|(name, (mean, _))| (name, mean))
            .collect(),
        digest: String::new(),
        commands: Vec::new(),
        digests: Digests::new(),
        commit: None,
        training_commit: None,
        is_quick: false,
    }
}

/// An action and its probability, for a table.
fn told(action: &str, probability: f64) -> String {
    format!("`{action}` {probability:.2}")
}

fn draw(out: &Path) -> Result<(), CliError> {
    let mut cells: Vec<(&Line, CertaintyCell)> = Vec::new();
    for line in &LINES {
        cells.extend(kept(&cell_file(out, line))?.map(|cell| (line, cell)));
    }
    let mut table = String::from(
        "| | entropy of the first action, nats | most probable actions | paper |\n|---|---|---|---|\n",
    );
    for (line, cell) in &cells {
        let described = line.described;
        let first = cell.actions.iter().take(LISTED);
        let listed: Vec<String> = first.map(|(name, p)| told(name, *p)).collect();
        let published: Vec<String> = line.paper.iter().map(|(name, p)| told(name, *p)).collect();
        let _ = writeln!(
            table,
            "| {described}, {} demonstrations | **{:.2}** | {} | {} |",
            cell.demonstrations,
            cell.entropy,
            listed.join(", "),
            published.join(", ")
        );
    }
    let table = with_note(table, cells.iter().any(|(_, cell)| cell.is_quick));
    keep_text(&out.join("table.md"), table.as_bytes())?;
    plot::draw(out, &cells)?;
    println!("\n{table}\nin {}", out.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::committed::{assert_kept, root, unflagged};
    use crate::cli::experiment::plan::QUICK_NOTE;

    #[test]
    fn a_cell_that_names_less_is_read() {
        let cell = summed_up(&["left".to_owned()], &[]);
        let mut older = serde_json::to_value(cell).unwrap();
        for field in ["commands", "digests"] {
            let fields = older.as_object_mut().unwrap();
            assert!(fields.remove(field).is_some(), "{field}");
        }
        let read: CertaintyCell = serde_json::from_value(older).unwrap();
        assert!(read.commands.is_empty() && read.digests.is_empty());
    }

    #[test]
    fn a_table_with_a_cell_of_the_small_version_says_so() {
        let place = tempfile::tempdir().unwrap();
        let names = ["left", "right"].map(String::from);
        let mut cell = summed_up(&names, &[]);
        for is_quick in [false, true] {
            cell.is_quick = is_quick;
            keep(&cell_file(place.path(), &LINES[0]), &cell).unwrap();
            draw(place.path()).unwrap();
            let table = std::fs::read_to_string(place.path().join("table.md")).unwrap();
            assert_eq!(table.starts_with(QUICK_NOTE), is_quick, "{table}");
        }
    }

    #[test]
    fn committed_cells_count_as_finished() {
        let paper = unflagged(NAME);
        let size = Size::new(&paper, &[DEMONSTRATIONS], 1);
        let ingredients = Ingredients::gather(&paper, root()).unwrap();
        assert_kept::<CertaintyCell>(NAME, |cell| {
            let line = LINES.iter().find(|line| line.name == cell.method).unwrap();
            Some(digest_of(&ingredients, line, cell.demonstrations, &size).unwrap())
        });
    }

    #[test]
    fn actions_are_sorted_by_their_mean_and_an_even_choice_has_the_largest_entropy() {
        let names = ["left", "right"].map(String::from);
        let of = |p: f32| ActionDistribution {
            heads: vec![vec![p, 1.0 - p]],
        };
        let cell = summed_up(&names, &[of(0.0), of(0.5)]);
        assert_eq!(
            cell.actions,
            [("right".to_owned(), 0.75), ("left".to_owned(), 0.25)]
        );
        assert!((cell.entropy - std::f64::consts::LN_2 / 2.0).abs() < 1e-6);
        assert!((cell.deviations[0] - 0.25).abs() < 1e-9);
    }
}
