//! Which actions of a recording begin a step, and the trajectory that they make.

use std::path::Path;
use std::sync::Arc;

use super::film::Film;
use super::mapping::ActionShape;
use super::scan::seconds_between;
use super::view::typical_rate_hz;
use super::{RecordingReport, StorageError};
use crate::trajectory::{Action, Binning, Observation, Step};

/// The actions of a recording that begin a step. Each lasts until the next one begins.
pub(super) struct Steps {
    pub shape: ActionShape,
    /// Times of all actions in nanoseconds, in order.
    pub times: Vec<u64>,
    /// Indices of those that begin a step.
    pub chosen: Vec<usize>,
}

impl Steps {
    /// When each step begins.
    pub fn chosen_times(&self) -> Vec<u64> {
        self.chosen.iter().map(|i| self.times[*i]).collect()
    }

    /// How steps were chosen, and which cameras come at another rate than the actions.
    pub fn remarks<'a>(&self, cameras: impl Iterator<Item = (&'a str, f64)>) -> Vec<String> {
        const SAME_RATE: std::ops::RangeInclusive<f64> = 0.8..=1.25;
        let mut remarks = Vec::new();
        let (all, chosen) = (self.times.len(), self.chosen.len());
        if chosen < all {
            remarks.push(format!(
                "{chosen} of {all} actions begin a step, counted from the last; those between are part of the \
                 step before them"
            ));
        }
        let Some(actions_hz) = typical_rate_hz(&self.times) else {
            return remarks;
        };
        for (camera, hz) in cameras {
            if !SAME_RATE.contains(&(hz / actions_hz)) {
                remarks.push(format!(
                    "actions come at {actions_hz:.1} Hz, images of camera '{camera}' at {hz:.1} Hz: each step takes \
                     the latest image at or before its action"
                ));
            }
        }
        remarks
    }

    /// Which values of the actions of the steps from the given one on lie beyond the ranges that a mapping file gives.
    pub fn values_beyond(&self, ranges: &Binning, all: &[Action], first: usize) -> Vec<String> {
        // What makes no action is told when the recording is read.
        let Ok(actions) = self.actions(Path::new(""), all, first) else {
            return Vec::new();
        };
        let beyond = ranges.beyond(&self.shape.space, actions.iter());
        beyond.iter().map(ToString::to_string).collect()
    }

    /// The action of each step from the given one on.
    fn actions(
        &self,
        path: &Path,
        all: &[Action],
        first: usize,
    ) -> Result<Vec<Action>, StorageError> {
        let ends = self.chosen.iter().skip(1).copied().chain([all.len()]);
        let ranges = self.chosen.iter().copied().zip(ends).skip(first);
        ranges
            .map(|(start, end)| {
                let fault = |reason: String| StorageError::BadAction {
                    path: path.to_owned(),
                    topic: "the actions".to_owned(),
                    message: start,
                    reason,
                };
                let action = self.shape.combined(&all[start..end]);
                let action = action.ok_or_else(|| fault("it has too few values".to_owned()))?;
                match &action {
                    Action::Continuous(values) if values.iter().any(|v| !v.is_finite()) => {
                        Err(fault(format!("combined with those after it: {action}")))
                    }
                    _ => Ok(action),
                }
            })
            .collect()
    }

    /// The steps of a trajectory, with the images of developed films; what was lost on the way is added to
    /// the report.
    pub fn trajectory_steps(
        &self,
        path: &Path,
        actions: &[Action],
        mut films: Vec<Film<'_>>,
        report: &mut RecordingReport,
    ) -> Result<Vec<Step>, StorageError> {
        let chosen_times = self.chosen_times();
        let alignment = Film::develop(&mut films, &chosen_times);
        let first = alignment.first_action;
        if first == chosen_times.len() {
            let cameras: Vec<&str> = films.iter().map(Film::name).collect();
            return Err(StorageError::NoSteps {
                path: path.to_owned(),
                actions: actions.len(),
                cameras: cameras.join(", "),
            });
        }
        let times = &chosen_times[first..];
        for film in &films {
            film.check_sizes(path, times[0])?;
            report.losses.extend(film.loss());
            let stopped = film.stopped(times, &report.losses);
            report.losses.extend(stopped);
        }
        let observation =
            |step: usize| {
                Observation::new(films.iter().zip(&alignment.images).map(|(film, images)| {
                    (film.name().to_owned(), film.image(images[step]).clone())
                }))
            };
        let actions = self.actions(path, actions, first)?;
        Ok(actions
            .into_iter()
            .enumerate()
            .map(|(step, action)| Step {
                time_secs: seconds_between(times[0], times[step]),
                observation: Arc::new(observation(step)),
                action,
            })
            .collect())
    }
}
