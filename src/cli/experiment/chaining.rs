use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::commands::{engine_name, quoted};
use super::digests::{Digests, digests_of, pointer_to};
use super::plan::{self, digest, make, place_of, with_note, with_version};
use crate::cli::arguments::{
    Arguments, ChainingArguments, EvaluateArguments, LastStepsArgument, PlannerArgument,
};
use crate::cli::error::CliError;
use crate::cli::evaluate::{bedroom, driving, episodes};
use crate::cli::kept::{Missing, keep, keep_text, kept};
use crate::cli::loaded::{Loaded, bedroom_at, digests_by_task, graph_digests};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::revision::revision;
use crate::cli::worlds::composed;
use crate::composer::Composition;
use crate::experiment::{
    ChainingCell, ChainingMethod, EpisodeResult, Evaluation, ScoredBedroom, chaining_table,
};
use crate::rollout::Rollout;
use crate::simulator::{Bedroom, BedroomConfig};
use crate::view::{Rate, write_rates_svg};

const NAME: &str = "chaining";
/// The root where none is named.
const HERE: &str = ".";

/// What the figures of a cell depend on.
#[derive(Serialize)]
struct Ingredients<'a> {
    method: ChainingMethod,
    composition: String,
    model: &'a str,
    graphs: &'a [String],
    seed: u64,
    episodes: usize,
    bedroom: BedroomConfig,
}

/// `catena experiment chaining`: a chain with all guards, with each switched off in turn, and with none.
pub(super) fn chaining(
    chaining_arguments: &ChainingArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let evaluated = &evaluation_of(chaining_arguments);
    let is_quick = chaining_arguments.quick;
    let out = &place_of(chaining_arguments.out.as_deref(), is_quick, NAME);
    make(out)?;
    // Before hours are spent.
    let mut missing = Vec::new();
    for method in ChainingMethod::ALL {
        let loaded = loaded_with(method, evaluated, arguments)?;
        let (composition, model) = (&loaded.composition, loaded.model.digest());
        let digest_of = |episodes| digest_of(method, composition, &model, evaluated, episodes);
        let cell = Missing::unless_kept_of_any_episodes::<ChainingCell>(
            cell_file(out, method),
            evaluated.episodes,
            digest_of,
            chaining_arguments.replace,
            || recipe(&loaded, evaluated),
        )?;
        missing.extend(cell.map(|missing| (method, missing)));
    }
    for (method, Missing { file, digest }) in missing {
        let loaded = loaded_with(method, evaluated, arguments)?;
        let measured = measure(method, &loaded, evaluated, arguments, digest)?;
        let cell = ChainingCell {
            commands: vec![command(
                evaluated,
                &measured.evaluation.level,
                is_quick,
                arguments,
            )],
            is_quick,
            ..measured
        };
        keep(&file, &cell)?;
        println!(
            "{}: {:.0} % of {}",
            method.described(),
            100.0 * cell.success_rate,
            cell.episodes
        );
    }
    draw(out)
}

/// Makes table and plot of all cells.
fn draw(out: &Path) -> Result<(), CliError> {
    let mut cells: Vec<ChainingCell> = Vec::new();
    for method in ChainingMethod::ALL {
        cells.extend(kept(&cell_file(out, method))?);
    }
    let is_quick = cells.iter().any(|cell| cell.is_quick);
    let table = with_note(chaining_table(&cells), is_quick);
    let name = cells
        .first()
        .map_or("", |cell| cell.evaluation.name.as_str());
    let title = format!("{} with its guards switched off", name.replace('_', " "));
    let title = with_version(&title, is_quick);
    keep_text(&out.join("table.md"), table.as_bytes())?;
    let rates: Vec<Rate> = cells.iter().map(rate).collect();
    let picture = out.join("chaining.svg");
    write_rates_svg(
        &picture,
        &rates,
        &title,
        Some(("the paper's robot: 2 of 10", 0.2)),
    )?;
    println!("\n{table}\nin {}", out.display());
    Ok(())
}

/// How each method is evaluated.
fn evaluation_of(arguments: &ChainingArguments) -> EvaluateArguments {
    EvaluateArguments {
        target: arguments.target.clone(),
        composition: None,
        episodes: plan::episodes(arguments.episodes, arguments.quick),
        seed: arguments.seed,
        json: false,
        level: arguments.level,
        nearest_states: None,
        last_steps: LastStepsArgument::Led,
        planner: PlannerArgument::InOrder,
        policy: None,
    }
}

fn cell_file(out: &Path, method: ChainingMethod) -> PathBuf {
    out.join(format!("{}.json", method.name()))
}

/// The composition as a method plans it, with what it needs.
fn loaded_with(
    method: ChainingMethod,
    evaluated: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<Loaded, CliError> {
    Loaded::of(planned_with(method, evaluated, &arguments.root)?, arguments)
}

/// The composition as a method plans it.
fn planned_with(
    method: ChainingMethod,
    evaluated: &EvaluateArguments,
    root: &Path,
) -> Result<Composition, CliError> {
    let mut composition = composed(&evaluated.target, root)?;
    method.plan(&mut composition.planner, &mut composition.calibration);
    Ok(composition)
}

/// The digest of what a method's figures depend on, with so many episodes.
fn digest_of(
    method: ChainingMethod,
    composition: &Composition,
    model: &str,
    evaluated: &EvaluateArguments,
    episodes: usize,
) -> Result<String, CliError> {
    let graphs = graph_digests(composition)?;
    digest(&Ingredients {
        method,
        composition: described(composition),
        model,
        graphs: &graphs,
        seed: evaluated.seed,
        episodes,
        bedroom: bedroom_at(composition, evaluated.level.into())?,
    })
}

/// What a cell would be made of now.
fn recipe(loaded: &Loaded, evaluated: &EvaluateArguments) -> Result<Recipe, CliError> {
    let composition = loaded.composition.name.as_str();
    let level = level_of(&bedroom(loaded, evaluated)?);
    let episodes = evaluated.episodes;
    let digests = named_digests(&loaded.composition)?;
    let mut named: Vec<Ingredient> = digests
        .into_iter()
        .map(|(name, digest)| {
            let what = format!("the digests of the {name}");
            Ingredient::Digest(what, pointer_to(&name), digest)
        })
        .collect();
    named.extend([
        Ingredient::Value("the composition", "/evaluation/name", composition.into()),
        Ingredient::Value("the level", "/evaluation/level", level.into()),
        Ingredient::Value("the number of episodes", "/episodes", episodes.into()),
        Ingredient::Value(
            "the seed of the first episode",
            "/seed",
            evaluated.seed.into(),
        ),
    ]);
    Ok(Recipe {
        named,
        unnamed: vec![
            "what the composition says",
            "model and graphs, where it does not name them",
            "what the bedroom's settings are",
            "the version of catena",
        ],
    })
}

/// Digests of the manifests of a composition's model and graphs, and of what the model says that it was trained on, as
/// cells name them.
fn named_digests(composition: &Composition) -> Result<Digests, CliError> {
    let mut digests = digests_of(&composition.model, None)?;
    let graphs = digests_by_task(composition)?.into_iter();
    digests.extend(graphs.map(|(task, digest)| (format!("graph of {task}"), digest)));
    Ok(digests)
}

/// The command that makes a cell, beside others. Without `--quick` it would find the cells of the whole version, and
/// keep them whatever their number of episodes.
fn command(
    evaluated: &EvaluateArguments,
    level: &str,
    is_quick: bool,
    arguments: &Arguments,
) -> String {
    let quick = if is_quick { " --quick" } else { "" };
    let mut command = format!(
        "catena experiment chaining {}{quick} --episodes {} --seed {} --level {level}",
        quoted(&evaluated.target),
        evaluated.episodes,
        evaluated.seed
    );
    if arguments.root != Path::new(HERE) {
        let root = quoted(&arguments.root.to_string_lossy());
        let _ = write!(command, " --root {root}");
    }
    if let Some(engine) = engine_name(arguments.engine) {
        let _ = write!(command, " --engine {engine}");
    }
    command
}

/// How much a bedroom varies, as evaluations call it.
fn level_of(bedroom: &BedroomConfig) -> String {
    format!("{:?}", bedroom.level).to_lowercase()
}

fn rate(cell: &ChainingCell) -> Rate {
    Rate {
        label: cell.method.described().to_owned(),
        rate: cell.success_rate,
        interval: cell.interval_95,
        stands_out: cell.method == ChainingMethod::Ours,
        published: None,
    }
}

/// What of a composition its figures depend on, beyond model and graphs.
fn described(composition: &Composition) -> String {
    format!(
        "{:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
        composition.order,
        composition.final_choice,
        composition.start,
        composition.regions(),
        composition.on_shortcut,
        composition.planner,
        composition.calibration,
        composition.limits
    )
}

fn measure(
    method: ChainingMethod,
    loaded: &Loaded,
    evaluated: &EvaluateArguments,
    arguments: &Arguments,
    digest: String,
) -> Result<ChainingCell, CliError> {
    let bedroom = bedroom(loaded, evaluated)?;
    let planner = loaded.own_planner()?;
    let mut options = driving(loaded, evaluated);
    method.run(&mut options);
    let judged = loaded.composition.demonstrated_automaton();
    let rollout = Rollout::new(loaded.rollout_model(), planner, options)?;
    let results = episodes(method.name(), evaluated, |seed| {
        let mut room = ScoredBedroom::new(Bedroom::new(bedroom), &judged);
        let episode = rollout.clone().run(&mut room, seed, &mut ())?;
        Ok(EpisodeResult::new(seed, &episode, room.score()))
    })?;
    let names: Vec<String> = judged.subgoals().iter().map(|s| s.name.clone()).collect();
    let evaluation = Evaluation::new(
        &loaded.composition.name,
        &level_of(&bedroom),
        evaluated.seed,
        loaded.model.engine().name(),
        &names,
        results,
    );
    let commit = revision(&arguments.root);
    let cell = ChainingCell::new(method, &judged, evaluation, digest, commit);
    Ok(ChainingCell {
        digests: named_digests(&loaded.composition)?,
        ..cell
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser;

    use super::*;
    use crate::cli::experiment::committed::{assert_kept, chaining_arguments, root};
    use crate::model::{MANIFEST_FILE, ModelManifest};

    #[test]
    fn a_small_version_is_of_few_episodes_and_says_so() {
        let flags: [&[&str]; 3] = [&[], &["--quick"], &["--quick", "--episodes", "3"]];
        let [whole, small, asked] =
            flags.map(|flags| evaluation_of(&chaining_arguments(flags)).episodes);
        assert_eq!((whole, asked), (100, 3));
        assert!(small < 10, "{small} episodes");

        let place = tempfile::tempdir().unwrap();
        let out = place.path();
        let of = |name: &str| fs::read_to_string(out.join(name)).unwrap();
        let committed = root().join("results/chaining/ours.json");
        let cell: ChainingCell = kept(&committed).unwrap().unwrap();
        for is_quick in [false, true] {
            let cell = ChainingCell {
                is_quick,
                ..cell.clone()
            };
            keep(&cell_file(out, cell.method), &cell).unwrap();
            draw(out).unwrap();
            assert_eq!(of("table.md").starts_with("small version"), is_quick);
            assert_eq!(of("chaining.svg").contains("(small version)"), is_quick);
        }
    }

    #[test]
    fn a_cell_names_its_command_and_what_it_was_measured_with() {
        let evaluated = evaluation_of(&chaining_arguments(&["--episodes", "3"]));
        let command = |more: &[&str], is_quick| {
            let words = [&["catena", "experiment", "chaining"], more].concat();
            let arguments = Arguments::try_parse_from(words).unwrap();
            command(&evaluated, "paper", is_quick, &arguments)
        };
        assert_eq!(
            command(&[], false),
            "catena experiment chaining tasks/sequences/sock_then_trash.yaml --episodes 3 --seed 100 \
             --level paper"
        );
        assert_eq!(
            command(&[], true),
            "catena experiment chaining tasks/sequences/sock_then_trash.yaml --quick --episodes 3 \
             --seed 100 --level paper"
        );
        assert_eq!(
            command(&["--engine", "embedded", "--root", "my work"], false),
            "catena experiment chaining tasks/sequences/sock_then_trash.yaml --episodes 3 --seed 100 \
             --level paper --root 'my work' --engine embedded"
        );
        let composition = planned_with(ChainingMethod::Ours, &evaluated, root()).unwrap();
        let digests = named_digests(&composition).unwrap();
        let names = [
            "model",
            "graph of sock",
            "graph of trash",
            "demonstrations of sock",
        ];
        for name in names {
            assert_eq!(digests.get(name).map(String::len), Some(64), "{name}");
        }
    }

    #[test]
    fn committed_cells_count_as_finished() {
        let evaluated = evaluation_of(&chaining_arguments(&[]));
        assert_kept::<ChainingCell>(NAME, |cell| {
            let composition = planned_with(cell.method, &evaluated, root()).unwrap();
            let manifest = fs::read(composition.model.join(MANIFEST_FILE)).unwrap();
            let model = ModelManifest::from_json(&manifest).unwrap().digest();
            let digest = digest_of(cell.method, &composition, &model, &evaluated, cell.episodes);
            Some(digest.unwrap())
        });
    }
}
