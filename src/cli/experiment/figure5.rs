//! Figure 5: losses of the networks on held-out demonstrations.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::digests::RECORDINGS_UNNAMED;
use super::heeded::ensure_heeded;
use super::ingredients::Ingredients;
use super::method::{Method, TABLE_3, chosen};
use super::plan::{Size, digest, out, training_command, with_note, with_version};
use super::workshop::Workshop;
use crate::cli::arguments::{Arguments, PaperArguments};
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep, keep_text, kept};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::training_config::training_commit;
use crate::experiment::{LossCurve, LossPoint, losses_table, of_common_seeds};
use crate::training::TrainedModel;
use crate::view::{Curve, Panel, write_curves_svg};

const NAME: &str = "fig5";
const DEMONSTRATIONS: usize = 20;
const SEEDS: u64 = 3;

/// `catena experiment fig5`.
pub(super) fn figure_5(paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
    ensure_heeded(NAME, paper)?;
    let size = Size::new(paper, &[DEMONSTRATIONS], SEEDS);
    let demonstrations = size.only_number(NAME)?;
    let methods = chosen(&TABLE_3, &paper.methods)?;
    let out = out(paper, NAME)?;
    let workshop = Workshop::open(paper, arguments)?;
    if !paper.only_draw {
        let seeds = size.training_seed..size.training_seed.saturating_add(size.seeds);
        let mut curves = Vec::new();
        for seed in seeds {
            for method in &methods {
                let of = (method, demonstrations, seed);
                let digest = digest_of(&workshop.ingredients, of, &size)?;
                let file = curve_file(&out, method.name, seed);
                let recipe = || Ok(recipe(&workshop, of, &size));
                let missing = workshop.missing::<LossCurve>(file, digest, recipe)?;
                curves.extend(missing.map(|missing| (method, seed, missing)));
            }
        }
        workshop.side_by_side(curves, |(method, seed, missing)| {
            measure(&workshop, method, demonstrations, &size, seed, missing)
        })?;
    }
    draw(&out)
}

fn curve_file(out: &Path, method: &str, seed: u64) -> PathBuf {
    out.join(format!("{method}_seed{seed}.json"))
}

/// The digest of what a curve of a method, a number of demonstrations and a seed depends on.
fn digest_of(
    ingredients: &Ingredients,
    (method, demonstrations, seed): (&Method, usize, u64),
    size: &Size,
) -> Result<String, CliError> {
    let words = size.training(method, seed);
    digest(&(method.name, demonstrations, words, ingredients.of(method)))
}

/// What a curve would be made of now.
fn recipe(
    workshop: &Workshop<'_>,
    (method, demonstrations, seed): (&Method, usize, u64),
    size: &Size,
) -> Recipe {
    let number = "the number of demonstrations";
    let command = training_command(&size.training(method, seed));
    let mut named = workshop.recordings_now(demonstrations);
    named.extend([
        Ingredient::Value(number, "/demonstrations", demonstrations.into()),
        Ingredient::Commands(vec![command]),
    ]);
    let ingredients = &workshop.ingredients;
    ingredients.recipe(method, named, &[RECORDINGS_UNNAMED])
}

fn measure(
    workshop: &Workshop<'_>,
    method: &Method,
    demonstrations: usize,
    size: &Size,
    seed: u64,
    Missing { file, digest }: Missing,
) -> Result<(), CliError> {
    let trained = workshop.trained(method, demonstrations, size, seed, false)?;
    let csv = trained.run.join("losses.csv");
    let text = fs::read_to_string(&csv).map_err(CliError::io(&csv))?;
    let model = TrainedModel::of_run(&trained.run)?;
    let curve = LossCurve {
        method: method.name.to_owned(),
        demonstrations,
        seed,
        weights: model.as_ref().map_or(0, TrainedModel::weight_count),
        digest,
        commands: vec![training_command(&size.training(method, seed))],
        digests: workshop.digests(method, &trained)?,
        commit: workshop.commit.clone(),
        training_commit: training_commit(&trained.run),
        is_quick: size.is_quick,
        config: model.map_or(Ok(serde_json::Value::Null), |m| {
            serde_json::to_value(&m.config)
        })?,
        points: LossPoint::of_csv(&text),
    };
    keep(&file, &curve)
}

/// The seeds of a method's curves that are there, whichever call measured them.
fn measured(out: &Path, method: &str) -> Result<BTreeSet<u64>, CliError> {
    let mut seeds = BTreeSet::new();
    for entry in fs::read_dir(out).map_err(CliError::io(out))? {
        let name = entry.map_err(CliError::io(out))?.file_name();
        let name = name.to_string_lossy();
        let seed = (name.strip_prefix(method))
            .and_then(|rest| rest.strip_prefix("_seed")?.strip_suffix(".json"));
        seeds.extend(seed.and_then(|seed| seed.parse::<u64>().ok()));
    }
    Ok(seeds)
}

/// Makes table and plot of all curves that are there.
fn draw(out: &Path) -> Result<(), CliError> {
    let mut curves: Vec<LossCurve> = Vec::new();
    for method in TABLE_3 {
        for seed in measured(out, method.name)? {
            curves.extend(kept(&curve_file(out, method.name, seed))?);
        }
    }
    let rows = TABLE_3.map(|method| (method.name, method.described));
    let is_quick = curves.iter().any(|curve| curve.is_quick);
    let table = with_note(losses_table(&curves, &rows), is_quick);
    keep_text(&out.join("table.md"), table.as_bytes())?;
    plot(out, &of_common_seeds(&curves), is_quick)?;
    println!("\n{table}\nin {}", out.display());
    Ok(())
}

/// The means over the seeds that all methods have, and each of these behind them: other seeds hold out other demonstrations.
fn plot(out: &Path, curves: &[&LossCurve], is_quick: bool) -> Result<(), CliError> {
    let panel = |label: &str, value: fn(&LossPoint) -> f64| Panel {
        label: label.to_owned(),
        lines: (TABLE_3.iter())
            .filter_map(|method| line(method, curves, value))
            .collect(),
    };
    let panels = [
        panel("traversability", |p| p.traversability),
        panel("policy", |p| p.policy),
    ];
    let has_behind = panels[0].lines.iter().any(|line| !line.behind.is_empty());
    Ok(write_curves_svg(
        &out.join("fig5.svg"),
        &panels,
        &title(curves, is_quick),
        "optimiser steps",
        has_behind.then_some("thin: each seed"),
    )?)
}

/// The mean of a method's curves with each of them behind it; none for a method without any.
fn line(method: &Method, curves: &[&LossCurve], value: fn(&LossPoint) -> f64) -> Option<Curve> {
    let of_method = curves.iter().copied().filter(|c| c.method == method.name);
    let of_method: Vec<&LossCurve> = of_method.collect();
    let points = |points: &[LossPoint]| -> Vec<[f64; 2]> {
        points.iter().map(|p| [p.step as f64, value(p)]).collect()
    };
    // One curve is its own mean.
    let behind = match &of_method[..] {
        [] => return None,
        [_] => &[][..],
        several => several,
    };
    Some(Curve {
        name: method.described.to_owned(),
        points: points(&LossCurve::mean(&of_method)),
        behind: behind.iter().map(|curve| points(&curve.points)).collect(),
    })
}

fn title(curves: &[&LossCurve], is_quick: bool) -> String {
    let seeds: BTreeSet<u64> = curves.iter().map(|c| c.seed).collect();
    let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
    let of = match &seeds[..] {
        [] => "no seed that all networks have".to_owned(),
        [seed] => format!("seed {seed}"),
        _ => format!("mean of the seeds {}", seeds.join(", ")),
    };
    with_version(&format!("Loss on held-out demonstrations, {of}"), is_quick)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::committed::{assert_kept, root, unflagged};
    use crate::cli::experiment::plan::QUICK_NOTE;

    #[test]
    fn committed_curves_count_as_finished() {
        let paper = unflagged(NAME);
        let size = Size::new(&paper, &[DEMONSTRATIONS], SEEDS);
        let ingredients = Ingredients::gather(&paper, root()).unwrap();
        assert_kept::<LossCurve>(NAME, |curve| {
            let method = TABLE_3.iter().find(|m| m.name == curve.method).unwrap();
            let of = (method, curve.demonstrations, curve.seed);
            Some(digest_of(&ingredients, of, &size).unwrap())
        });
    }

    #[test]
    fn curves_of_any_seed_are_drawn_and_each_of_its_own_method() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "ours_seed1.json",
            "ours_seed20261130.json",
            "ours_seedx.json",
            "siamese_seed2.json",
        ] {
            fs::write(folder.path().join(name), "{}").unwrap();
        }
        let seeds = measured(folder.path(), "ours").unwrap();
        assert_eq!(seeds.into_iter().collect::<Vec<_>>(), [1, 20_261_130]);
    }

    fn curve(seed: u64, losses: [f64; 2]) -> LossCurve {
        let point = |(step, policy): (u64, f64)| LossPoint {
            step,
            traversability: policy / 2.0,
            policy,
        };
        LossCurve {
            method: TABLE_3[0].name.to_owned(),
            demonstrations: 20,
            seed,
            weights: 7,
            digest: String::new(),
            commands: Vec::new(),
            commit: None,
            training_commit: None,
            is_quick: false,
            config: serde_json::Value::Null,
            digests: std::collections::BTreeMap::new(),
            points: [(10, losses[0]), (20, losses[1])].map(point).to_vec(),
        }
    }

    #[test]
    fn a_table_with_a_curve_of_the_small_version_says_so_and_its_plot_does() {
        let place = tempfile::tempdir().unwrap();
        for is_quick in [false, true] {
            let curve = LossCurve {
                is_quick,
                ..curve(1, [3.0, 1.0])
            };
            keep(&curve_file(place.path(), &curve.method, 1), &curve).unwrap();
            draw(place.path()).unwrap();
            let [table, plot] = ["table.md", "fig5.svg"]
                .map(|name| fs::read_to_string(place.path().join(name)).unwrap());
            assert_eq!(table.starts_with(QUICK_NOTE), is_quick, "{table}");
            assert_eq!(plot.contains("(small version)"), is_quick, "{plot}");
        }
    }

    #[test]
    fn each_seed_is_drawn_behind_the_mean_of_several() {
        let seeds = [curve(1, [3.0, 1.0]), curve(2, [5.0, 2.0])];
        let [first, second] = &seeds;
        let drawn = |curves: &[&LossCurve]| line(&TABLE_3[0], curves, |p| p.policy);
        let both = drawn(&[first, second]).unwrap();
        assert_eq!(both.points, [[10.0, 4.0], [20.0, 1.5]]);
        assert_eq!(
            both.behind,
            [
                vec![[10.0, 3.0], [20.0, 1.0]],
                vec![[10.0, 5.0], [20.0, 2.0]]
            ]
        );
        let alone = drawn(&[first]).unwrap();
        assert_eq!(alone.points, [[10.0, 3.0], [20.0, 1.0]]);
        assert!(alone.behind.is_empty());
        assert_eq!(drawn(&[]), None);
    }
}
