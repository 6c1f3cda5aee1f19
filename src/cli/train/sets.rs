use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::cli::demonstrations::ReadSet;
use crate::cli::error::CliError;
use crate::storage::{ReadOptions, Recordings};
use crate::trajectory::{ActionDimension, ActionSpace, Binning, DemonstrationSet};

/// Each path as a set of its own, or several of a dataset that has several tasks, with their digests by the
/// tasks' names. Continuous actions of all sets are binned together.
pub(super) fn load_sets(
    paths: &[PathBuf],
    bins: usize,
    options: &ReadOptions,
    read: fn(&Recordings, &str) -> Result<ReadSet, CliError>,
) -> Result<(Vec<DemonstrationSet>, BTreeMap<String, String>), CliError> {
    let mut sets = Vec::new();
    let mut digests = BTreeMap::new();
    let mut binning: Option<(&Path, Binning)> = None;
    for path in paths {
        let recordings = Recordings::open(std::slice::from_ref(path), options)?;
        let digest = recordings.digest()?;
        for task in recordings.tasks() {
            let (set, _) = read(&recordings, &task)?;
            if digests.insert(task.clone(), digest.clone()).is_some() {
                return Err(CliError::TaskTwice {
                    task,
                    path: path.clone(),
                });
            }
            sets.push(set);
        }
        let own = recordings.binning(bins);
        match &binning {
            Some((first, other)) if *other != own => {
                return Err(CliError::BinningsDiffer {
                    first: first.to_path_buf(),
                    other: path.clone(),
                });
            }
            _ => binning = Some((path, own)),
        }
    }
    let binning = binning.map_or_else(|| Binning::uniform(bins), |(_, binning)| binning);
    Ok((binned(sets, &binning)?, digests))
}

fn binned(
    sets: Vec<DemonstrationSet>,
    binning: &Binning,
) -> Result<Vec<DemonstrationSet>, CliError> {
    let Some(first) = sets.first() else {
        return Ok(sets);
    };
    let actions = sets
        .iter()
        .flat_map(DemonstrationSet::trajectories)
        .flat_map(|t| t.steps.iter().map(|s| &s.action));
    let space = first.action_space().binned_by(actions, binning)?;
    if space == *first.action_space() {
        return Ok(sets);
    }
    let unbinned = first.action_space().clone();
    let rebinned = sets.into_iter().map(|set| {
        if *set.action_space() == unbinned {
            set.with_action_space(&space)
        } else {
            // Told by the training, with the names of both sets.
            set
        }
    });
    Ok(rebinned.collect())
}

/// How each dimension of binned actions is cut, a line each.
pub(super) fn describe_bins(space: &ActionSpace) -> String {
    let ActionSpace::Binned { dimensions } = space else {
        return String::new();
    };
    let line = |d: &ActionDimension| {
        let spacing = if d.edges.is_empty() {
            "equal"
        } else {
            "by quantiles"
        };
        format!(
            "\n  {:<12} {:>3} bins, {spacing}, {} to {}",
            d.name, d.bins, d.low, d.high
        )
    };
    dimensions.iter().map(line).collect()
}
