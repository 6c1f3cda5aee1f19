use std::path::Path;

use super::super::plan::with_version;
use super::{CertaintyCell, LISTED, Line, NAME, TASK};
use crate::cli::error::CliError;
use crate::experiment::mean_interval_95;
use crate::view::{Rate, Spread, write_rates_svg, write_spreads_svg};

/// Makes the plots of the cells that are there: of probabilities, and of how sure each episode's first action is, which means
/// of probabilities do not show.
pub(super) fn draw(out: &Path, cells: &[(&Line, CertaintyCell)]) -> Result<(), CliError> {
    let rates = cells.iter().flat_map(|(line, cell)| rates(line, cell));
    let rates: Vec<Rate> = rates.collect();
    let is_quick = cells.iter().any(|(_, cell)| cell.is_quick);
    let title = format!("First action of {TASK}: mean probability, 95 % interval");
    let title = with_version(&title, is_quick);
    let file = out.join(format!("{NAME}.svg"));
    write_rates_svg(&file, &rates, &title, None)?;
    let spreads = cells.iter().map(|(line, cell)| spread(line, cell));
    let spreads: Vec<Spread> = spreads.collect();
    let title = format!("First action of {TASK}: entropy in each episode, mean, 95 % interval");
    let title = with_version(&title, is_quick);
    let file = out.join(format!("{NAME}_entropy.svg"));
    let scale = "nats; the surer of its action, the less";
    Ok(write_spreads_svg(&file, &spreads, &title, scale)?)
}

/// The entropies of a line.
fn spread(line: &Line, cell: &CertaintyCell) -> Spread {
    let of_mean = |value: f64| (value - cell.entropy).powi(2);
    let square = cell.entropies.iter().copied().map(of_mean).sum::<f64>();
    let deviation = (square / cell.entropies.len().max(1) as f64).sqrt();
    Spread {
        label: line.described.to_owned(),
        values: cell.entropies.clone(),
        interval: mean_interval_95(cell.entropy, deviation, cell.entropies.len()),
        stands_out: line.method.plans,
    }
}

/// The most probable actions of a line, and those that the paper tells of it beside what they are here.
fn rates(line: &Line, cell: &CertaintyCell) -> Vec<Rate> {
    let published = |action: &str| {
        let of_action = line.paper.iter().find(|(name, _)| *name == action);
        of_action.map(|(_, probability)| *probability)
    };
    let mut rates = Vec::new();
    for (place, (action, mean)) in cell.actions.iter().enumerate() {
        let published = published(action);
        let Some(deviation) = cell.deviations.get(place) else {
            continue;
        };
        if place < LISTED || published.is_some() {
            rates.push(Rate {
                label: format!("{}: {action}", line.described),
                rate: *mean,
                interval: interval(*mean, *deviation, cell.episodes),
                stands_out: line.method.plans,
                published,
            });
        }
    }
    rates
}

/// The 95 % interval of a mean probability over the episodes, cut off at 0 and 1: `p ± t d / √(n - 1)` with the standard
/// deviation `d` over the `n` episodes and Student's `t` ([`mean_interval_95`]). One episode says nothing of it: 0 to 1.
fn interval(mean: f64, deviation: f64, episodes: usize) -> [f64; 2] {
    let interval = mean_interval_95(mean, deviation, episodes);
    interval.map_or([0.0, 1.0], |ends| ends.map(|p| p.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::super::{LINES, summed_up};
    use super::*;
    use crate::model::ActionDistribution;

    fn cell() -> CertaintyCell {
        let names = [
            "base_backward",
            "base_turn_right",
            "base_turn_left",
            "base_forward",
            "terminate",
        ];
        let of = |p: f32| ActionDistribution {
            heads: vec![vec![p, 0.8 - p, 0.125, 0.05, 0.025]],
        };
        summed_up(&names.map(String::from), &[of(0.5), of(0.6), of(0.7)])
    }

    #[test]
    fn what_the_paper_tells_is_drawn_beside_what_it_is_here() {
        let rates = rates(&LINES[0], &cell());
        let drawn = rates.iter().map(|r| (r.label.as_str(), r.published));
        assert_eq!(
            drawn.collect::<Vec<_>>(),
            [
                ("BC: base_backward", None),
                ("BC: base_turn_right", None),
                ("BC: base_turn_left", Some(0.31)),
                ("BC: base_forward", Some(0.68)),
            ]
        );
        assert!((rates[3].rate - 0.05).abs() < 1e-6);
    }

    #[test]
    fn whiskers_are_the_interval_of_the_mean() {
        let rates = rates(&LINES[1], &cell());
        assert!((rates[0].rate - 0.6).abs() < 1e-6);
        // The sample's deviation is 0.1: 0.6 ± 4.303 0.1 / √3.
        let [low, high] = rates[0].interval;
        assert!(
            (low - 0.3516).abs() < 1e-4 && (high - 0.8484).abs() < 1e-4,
            "{low} {high}"
        );
        let [low, high] = rates[2].interval;
        assert!((high - low).abs() < 1e-6, "each episode has the same");
        assert_eq!(interval(0.5, 0.4, 2), [0.0, 1.0]);
        assert_eq!(interval(0.5, 0.0, 1), [0.0, 1.0]);
    }

    #[test]
    fn entropies_are_drawn_one_by_one_with_the_interval_of_their_mean() {
        let mut cell = cell();
        (cell.entropies, cell.entropy) = (vec![1.0, 2.0, 3.0], 2.0);
        let spread = spread(&LINES[0], &cell);
        assert_eq!((spread.values.len(), spread.stands_out), (3, false));
        // The sample's deviation is 1: 2 ± 4.303 / √3.
        let [low, high] = spread.interval.unwrap();
        assert!((high - low - 2.0 * 4.302_653 / 3.0_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_plot_of_the_small_version_says_so() {
        let place = tempfile::tempdir().unwrap();
        for is_quick in [false, true] {
            let cell = CertaintyCell { is_quick, ..cell() };
            draw(place.path(), &[(&LINES[2], cell)]).unwrap();
            let svg = std::fs::read_to_string(place.path().join("fig6.svg")).unwrap();
            assert_eq!(svg.contains("(small version)"), is_quick, "{svg}");
            assert!(svg.contains("95 % interval") && svg.contains(">the paper's robot<"));
            let sure = std::fs::read_to_string(place.path().join("fig6_entropy.svg")).unwrap();
            assert_eq!(sure.contains("(small version)"), is_quick, "{sure}");
            assert!(
                svg.contains(">ours, one goal state: base_forward<"),
                "{svg}"
            );
        }
    }
}
