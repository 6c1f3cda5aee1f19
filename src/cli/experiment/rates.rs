//! Tables I and III: how often each method does each task.

use std::path::{Path, PathBuf};

use super::heeded::ensure_heeded;
use super::ingredients::Ingredients;
use super::method::{Method, TABLE_1, TABLE_3, chosen};
use super::plan::{Size, digest, out, rising, training_command, with_note, with_version};
use super::workshop::{Workshop, evaluation};
use crate::cli::arguments::{Arguments, PaperArguments};
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep, keep_text, kept};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::training_config::training_commit;
use crate::experiment::{
    Evaluation, PAPER_TABLE_1, PAPER_TABLE_3, PAPER_TASKS, PublishedRate, RateCell,
    paper_rate_of_all, rate_of_all, rates_table,
};
use crate::view::{Rate, write_rates_svg};

/// An experiment of this kind.
struct Table {
    name: &'static str,
    title: &'static str,
    methods: &'static [Method],
    demonstrations: &'static [usize],
    paper: &'static [PublishedRate],
    /// Whether some of the networks encode pairs.
    is_costly: bool,
}

const FIRST: Table = Table {
    name: "table1",
    title: "Table I: success on sock, trash and wine",
    methods: &TABLE_1,
    demonstrations: &[10, 20, 30],
    paper: &PAPER_TABLE_1,
    is_costly: false,
};

const THIRD: Table = Table {
    name: "table3",
    title: "Table III: success on sock, trash and wine",
    methods: &TABLE_3,
    demonstrations: &[20],
    paper: &PAPER_TABLE_3,
    is_costly: true,
};

/// `catena experiment table1`.
pub(super) fn table_1(paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
    FIRST.make(paper, arguments)
}

/// `catena experiment table3`.
pub(super) fn table_3(paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
    THIRD.make(paper, arguments)
}

impl Table {
    fn size(&self, paper: &PaperArguments) -> Size {
        if self.is_costly {
            Size::of_costly_networks(paper, self.demonstrations)
        } else {
            Size::new(paper, self.demonstrations, 1)
        }
    }

    fn make(&self, paper: &PaperArguments, arguments: &Arguments) -> Result<(), CliError> {
        ensure_heeded(self.name, paper)?;
        let size = self.size(paper);
        let methods = chosen(self.methods, &paper.methods)?;
        let out = out(paper, self.name)?;
        let workshop = Workshop::open(paper, arguments)?;
        if !paper.only_draw {
            let trainable = methods.iter().filter(|method| workshop.can_train(method));
            let trainable: Vec<&Method> = trainable.collect();
            // What shares a training is one job, so that two never train the same.
            let mut jobs: Vec<Vec<Row>> = Vec::new();
            for demonstrations in &size.demonstrations {
                for of_training in trainable.chunk_by(|a, b| a.trained_as == b.trained_as) {
                    let mut rows = Vec::new();
                    for method in of_training {
                        let row = Row::missing(&workshop, method, *demonstrations, &size, &out)?;
                        if !row.cells.is_empty() {
                            rows.push(row);
                        }
                    }
                    if !rows.is_empty() {
                        jobs.push(rows);
                    }
                }
            }
            workshop.side_by_side(jobs, |rows| {
                rows.into_iter()
                    .try_for_each(|row| row.measure(&workshop, &size))
            })?;
        }
        self.draw(&out, &size)
    }

    /// Makes table and plot of all cells that are there, whichever call measured them.
    fn draw(&self, out: &Path, size: &Size) -> Result<(), CliError> {
        let mut cells = Vec::new();
        let mut rows = Vec::new();
        // What is missing of the whole table is said; a small version has no whole.
        let whole: &[usize] = if size.is_quick {
            &[]
        } else {
            self.demonstrations
        };
        for demonstrations in rising(&[whole, &size.demonstrations].concat()) {
            for method in self.methods {
                let before = cells.len();
                for task in PAPER_TASKS {
                    cells.extend(kept(&cell_file(out, method, demonstrations, task))?);
                }
                if cells.len() > before || whole.contains(&demonstrations) {
                    rows.push((method.name, method.described, demonstrations));
                }
            }
        }
        let table = rates_table(&cells, &rows, self.paper);
        let is_quick = cells.iter().any(|cell| cell.is_quick);
        let table = with_note(table, is_quick);
        keep_text(&out.join("table.md"), table.as_bytes())?;
        let bar = |(name, described, demonstrations): &(&str, &str, usize)| {
            let of_row = cells
                .iter()
                .filter(|c| c.method == *name && c.demonstrations == *demonstrations);
            let (rate, interval) = rate_of_all(of_row)?;
            Some(Rate {
                label: format!("{described}, {demonstrations} demonstrations"),
                rate,
                interval,
                stands_out: *name == self.methods[0].name,
                published: paper_rate_of_all(self.paper, name, *demonstrations),
            })
        };
        let rates: Vec<Rate> = rows.iter().filter_map(bar).collect();
        let title = with_version(self.title, is_quick);
        write_rates_svg(
            &out.join(format!("{}.svg", self.name)),
            &rates,
            &title,
            None,
        )?;
        println!("\n{table}\nin {}", out.display());
        Ok(())
    }
}

fn cell_file(out: &Path, method: &Method, demonstrations: usize, task: &str) -> PathBuf {
    out.join(format!("{}_{demonstrations}_{task}.json", method.name))
}

/// The cells of a method that are not there yet.
struct Row<'a> {
    method: &'a Method,
    demonstrations: usize,
    cells: Vec<(&'static str, Missing)>,
}

impl<'a> Row<'a> {
    fn missing(
        workshop: &Workshop<'_>,
        method: &'a Method,
        demonstrations: usize,
        size: &Size,
        out: &Path,
    ) -> Result<Self, CliError> {
        let mut cells = Vec::new();
        for task in PAPER_TASKS {
            let of = (method, demonstrations, task);
            let digest_of = |episodes| digest_of(&workshop.ingredients, of, size, episodes);
            let file = cell_file(out, method, demonstrations, task);
            let recipe = || recipe(workshop, method, demonstrations, size, task);
            let missing = workshop.missing_of_any_episodes::<RateCell>(
                file,
                size.episodes,
                digest_of,
                recipe,
            )?;
            cells.extend(missing.map(|missing| (task, missing)));
        }
        Ok(Self {
            method,
            demonstrations,
            cells,
        })
    }

    /// Trains the method and measures it.
    fn measure(self, workshop: &Workshop<'_>, size: &Size) -> Result<(), CliError> {
        let (method, demonstrations) = (self.method, self.demonstrations);
        let seed = size.training_seed;
        let words = size.training(method, seed);
        let trained = &workshop.trained(method, demonstrations, size, seed, true)?;
        for (task, Missing { file, digest }) in self.cells {
            let command = evaluation(method, trained, task, size);
            let evaluation: Evaluation = workshop.json(trained, &command, None)?;
            let cell = RateCell {
                method: method.name.to_owned(),
                demonstrations,
                task: task.to_owned(),
                episodes: evaluation.episodes,
                seed: evaluation.seed,
                success_rate: evaluation.success_rate,
                interval_95: evaluation.interval_95,
                digest,
                commands: commands(method, &words, workshop.shown(trained, &command, None)),
                digests: workshop.digests(method, trained)?,
                commit: workshop.commit.clone(),
                training_commit: training_commit(&trained.run),
                is_quick: size.is_quick,
                evaluation,
            };
            keep(&file, &cell)?;
            println!(
                "{}, {demonstrations} demonstrations, {task}: {:.0} % of {}",
                method.described,
                100.0 * cell.success_rate,
                cell.episodes
            );
        }
        Ok(())
    }
}

/// The digest of what a cell of a method, a number of demonstrations and a task depends on, with so many episodes.
fn digest_of(
    ingredients: &Ingredients,
    (method, demonstrations, task): (&Method, usize, &str),
    size: &Size,
    episodes: usize,
) -> Result<String, CliError> {
    let words = size.training(method, size.training_seed);
    let told: Vec<&str> = (words.iter().map(String::as_str))
        .chain(method.building.iter().copied())
        .chain(method.running.iter().copied())
        .collect();
    digest(&(
        method.name,
        demonstrations,
        told,
        ingredients.of(method),
        (task, episodes, size.seed),
    ))
}

/// What a cell would be made of now.
fn recipe(
    workshop: &Workshop<'_>,
    method: &Method,
    demonstrations: usize,
    size: &Size,
    task: &str,
) -> Result<Recipe, CliError> {
    let seed = size.training_seed;
    let place = workshop.place(method, demonstrations, size, seed)?;
    let evaluated = workshop.shown(&place, &evaluation(method, &place, task, size), None);
    let commands = commands(method, &size.training(method, seed), evaluated);
    let mut named = workshop.recordings_now(demonstrations);
    let unnamed: &[&str] = if named.len() < PAPER_TASKS.len() {
        &["the recordings, which are not all there"]
    } else {
        &[]
    };
    named.push(Ingredient::Commands(commands));
    Ok(workshop.ingredients.recipe(method, named, unnamed))
}

/// The commands behind a cell, in order, without the folder that they work in.
fn commands(method: &Method, words: &[String], evaluation: String) -> Vec<String> {
    let mut commands = vec![training_command(words)];
    if !method.building.is_empty() {
        let building = method.building.join(" ");
        commands.push(format!("catena graph build ... {building}"));
    }
    commands.push(evaluation);
    commands
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::cli::experiment::committed::{assert_kept, root, unflagged};
    use crate::cli::experiment::method::MVP;
    use crate::cli::experiment::plan::QUICK_NOTE;

    #[test]
    fn a_table_with_a_cell_of_the_small_version_says_so_and_its_plot_does() {
        let place = tempfile::tempdir().unwrap();
        let size = Size::new(&unflagged(FIRST.name), FIRST.demonstrations, 1);
        let file = cell_file(place.path(), &TABLE_1[0], 10, "sock");
        let committed = root().join("results/table1/ours_10_sock.json");
        let cell: RateCell = kept(&committed).unwrap().unwrap();
        for is_quick in [false, true] {
            let cell = RateCell {
                is_quick,
                ..cell.clone()
            };
            keep(&file, &cell).unwrap();
            FIRST.draw(place.path(), &size).unwrap();
            let [table, plot] = ["table.md", "table1.svg"]
                .map(|name| fs::read_to_string(place.path().join(name)).unwrap());
            assert_eq!(table.starts_with(QUICK_NOTE), is_quick, "{table}");
            assert_eq!(plot.contains("(small version)"), is_quick, "{plot}");
        }
    }

    #[test]
    fn committed_cells_count_as_finished() {
        for table in [FIRST, THIRD] {
            let paper = unflagged(table.name);
            let size = table.size(&paper);
            let ingredients = Ingredients::gather(&paper, root()).unwrap();
            assert_kept::<RateCell>(table.name, |cell| {
                let method = table.methods.iter().find(|m| m.name == cell.method);
                let of = (method.unwrap(), cell.demonstrations, cell.task.as_str());
                let digest = digest_of(&ingredients, of, &size, cell.episodes).unwrap();
                (cell.method != MVP).then_some(digest)
            });
        }
    }
}
