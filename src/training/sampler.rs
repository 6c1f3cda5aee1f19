//! Which states are encoded in a step, and which pairs of them are scored.
//!
//! The paper draws pairs: half of them near (same trajectory, `0 <= t' - t < d_max`, every
//! traversability class as often as the others), half of them far, uniformly at random (section
//! III-C). Encoding is what costs, so here a batch is `states` states, encoded once, and the pairs
//! are drawn among them such that the expected loss stays the paper's:
//!
//! - States come in windows of `window` consecutive steps. A window may hang over either end of its
//!   trajectory and is then cut, and a trajectory is drawn in proportion to its number of windows. So
//!   every state is covered by exactly `window` windows and every pair of neighbours `k` steps apart
//!   by exactly `window - k` of them, wherever it lies.
//! - Near pairs are all pairs within a window. Within a class each has the same chance, so their mean
//!   estimates the class's mean; the classes are then weighted alike. (Of the first class, a state with
//!   itself comes up `window` times where one with the next state does `window - 1` times.)
//! - Far pairs join states of different windows. These were drawn independently and every state is
//!   equally likely, so the pair is uniform over all ordered pairs; near ones are drawn again.
//!
//! The expectation is the same up to the usual small bias of a mean over a random number of pairs.
//! Optional hard pairs (look-alikes of the same trajectory, pairs backward in time, and closings that
//! missed beside closings that held) are additional and have weights of their own.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::alignment::Alignment;
use super::closings::Closings;
use super::look_alikes::LookAlikes;
use super::{Dataset, ImitationConfig, SamplingConfig, StateRef, TrainingError};

/// Two states of a batch that are few steps apart, `from` before `to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NearPair {
    /// Row of the earlier state.
    pub from: usize,
    /// Row of the later state, or the same.
    pub to: usize,
    /// Steps from one to the other, below `d_max`.
    pub gap_steps: usize,
}

/// A batch as drawn: states, and pairs of rows of these states.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Draw {
    /// The states; their index is their row.
    pub states: Vec<StateRef>,
    /// Number of the window that each state was drawn with.
    pub window_of: Vec<usize>,
    /// All near pairs within windows.
    pub near: Vec<NearPair>,
    /// Ordered far pairs, uniformly at random.
    pub far: Vec<(usize, usize)>,
    /// Ordered far pairs that are hard to tell from near ones.
    pub hard: Vec<(usize, usize)>,
    /// Ordered pairs of a gripper that closed on nothing and one that holds its thing.
    pub grasps: Vec<(usize, usize)>,
    /// A state, and one of another demonstration whose counterpart lies so many steps ahead: 1 or more.
    pub aligned: Vec<NearPair>,
}

impl Draw {
    fn add_window(&mut self, trajectory: u32, steps: std::ops::Range<u32>, windows: &mut usize) {
        for step in steps {
            self.states.push(StateRef { trajectory, step });
            self.window_of.push(*windows);
        }
        *windows += 1;
    }
}

/// Draws batches from some trajectories of a dataset.
#[derive(Clone)]
pub struct Sampler {
    trajectories: Vec<(u32, usize)>,
    config: SamplingConfig,
    d_max: usize,
    look_alikes: LookAlikes,
    alignment: Alignment,
    closings: Closings,
}

impl Sampler {
    /// A sampler over `trajectories` of `data`.
    ///
    /// # Errors
    /// [`TrainingError::NoPairs`] when none of them has two steps.
    pub fn new(
        data: &Dataset,
        trajectories: &[u32],
        config: &SamplingConfig,
        imitation: &ImitationConfig,
        d_max: usize,
    ) -> Result<Self, TrainingError> {
        let closings = if config.missed_grasp_share > 0.0 {
            Closings::find(data, trajectories, imitation)
        } else {
            Closings::default()
        };
        let alignment = if config.aligned_share > 0.0 {
            Alignment::find(data, trajectories)
        } else {
            Alignment::default()
        };
        let trajectories: Vec<_> = trajectories.iter().map(|t| (*t, data.steps(*t))).collect();
        if trajectories.iter().all(|(_, steps)| *steps < 2) {
            return Err(TrainingError::NoPairs { part: "training" });
        }
        let look_alikes = if config.look_alike_share > 0.0 {
            LookAlikes::find(data, &trajectories, d_max)
        } else {
            LookAlikes::default()
        };
        Ok(Self {
            trajectories,
            config: config.clone(),
            d_max,
            look_alikes,
            alignment,
            closings,
        })
    }

    /// Draws a batch.
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Draw {
        let share = |share: f64| (self.config.states as f64 * share) as usize;
        let partners = share(self.config.look_alike_share + self.config.missed_grasp_share);
        let plain = (self.config.states - partners).max(2 * self.config.window);
        let aligned = share(self.config.aligned_share);
        let anchors = plain
            .saturating_sub(aligned)
            .max(self.config.window.min(plain));
        let mut draw = Draw::default();
        let mut windows = 0;
        while draw.states.len() < anchors {
            let length = self.config.window.min(anchors - draw.states.len());
            let (trajectory, steps) = self.window(length, rng);
            draw.add_window(trajectory, steps, &mut windows);
        }
        self.add_aligned(&mut draw, plain, &mut windows, rng);
        self.pair_within_windows(&mut draw);
        self.pair_across_windows(&mut draw, rng);
        let grasps = share(self.config.missed_grasp_share).min(self.config.states - plain);
        self.add_closings(&mut draw, plain + grasps, &mut windows, rng);
        self.add_look_alikes(&mut draw, plain, &mut windows, rng);
        draw
    }

    /// A window that may hang over either end, cut to its trajectory.
    fn window(&self, length: usize, rng: &mut ChaCha8Rng) -> (u32, std::ops::Range<u32>) {
        let places = |steps: usize| steps + length - 1;
        let total: usize = self.trajectories.iter().map(|(_, s)| places(*s)).sum();
        let mut place = rng.random_range(0..total);
        for (trajectory, steps) in &self.trajectories {
            if place < places(*steps) {
                let first = (place + 1).saturating_sub(length);
                let end = (place + 1).min(*steps);
                return (*trajectory, first as u32..end as u32);
            }
            place -= places(*steps);
        }
        unreachable!("the place is below the total")
    }

    /// Fills the plain part of a batch up with windows of other demonstrations that show the phase of a
    /// window drawn before, and with others where there is none.
    fn add_aligned(
        &self,
        draw: &mut Draw,
        plain: usize,
        windows: &mut usize,
        rng: &mut ChaCha8Rng,
    ) {
        let anchors = draw.states.len();
        while draw.states.len() < plain {
            let length = self.config.window.min(plain - draw.states.len());
            let anchor = rng.random_range(0..anchors);
            let Some((partner, steps)) = self.counterpart_window(draw.states[anchor], length, rng)
            else {
                let (trajectory, steps) = self.window(length, rng);
                draw.add_window(trajectory, steps, windows);
                continue;
            };
            let rows = draw.states.len()..draw.states.len() + steps.len();
            draw.add_window(partner, steps, windows);
            for row in (0..anchors).filter(|r| draw.window_of[*r] == draw.window_of[anchor]) {
                for other in rows.clone() {
                    for (from, to) in [(row, other), (other, row)] {
                        draw.aligned.extend(self.aligned_pair(draw, from, to));
                    }
                }
            }
        }
    }

    /// Steps of a partner around the counterpart of a state.
    fn counterpart_window(
        &self,
        state: StateRef,
        length: usize,
        rng: &mut ChaCha8Rng,
    ) -> Option<(u32, std::ops::Range<u32>)> {
        let partners = self.alignment.partners(state.trajectory);
        let choice = rng.random_range(0..partners.len().max(1));
        let offset = rng.random_range(0..length) as u32;
        let (partner, counterparts) = partners.get(choice)?;
        let step = counterparts[state.step as usize]?;
        let first = step.saturating_sub(offset);
        let end = (step + length as u32 - offset).min(self.steps_of(*partner) as u32);
        Some((*partner, first..end))
    }

    fn aligned_pair(&self, draw: &Draw, from: usize, to: usize) -> Option<NearPair> {
        let (state, goal) = (draw.states[from], draw.states[to]);
        let step = self.alignment.counterpart(state, goal.trajectory)?;
        let gap_steps = goal.step.checked_sub(step)? as usize;
        (1..self.d_max).contains(&gap_steps).then_some(NearPair {
            from,
            to,
            gap_steps,
        })
    }

    fn pair_within_windows(&self, draw: &mut Draw) {
        for from in 0..draw.states.len() {
            for to in from..draw.states.len() {
                if draw.window_of[to] != draw.window_of[from] {
                    break;
                }
                let gap_steps = to - from;
                if gap_steps < self.d_max {
                    draw.near.push(NearPair {
                        from,
                        to,
                        gap_steps,
                    });
                }
                if gap_steps > 0 && self.config.hard_share > 0.0 {
                    draw.hard.push((to, from));
                }
            }
        }
    }

    fn pair_across_windows(&self, draw: &mut Draw, rng: &mut ChaCha8Rng) {
        let states = draw.states.len();
        // A dataset of one short trajectory may have no far pair at all, so the tries are limited.
        for _ in 0..self.config.far_pairs * 4 {
            if draw.far.len() == self.config.far_pairs {
                break;
            }
            let pair = (rng.random_range(0..states), rng.random_range(0..states));
            if draw.window_of[pair.0] != draw.window_of[pair.1]
                && is_far(draw.states[pair.0], draw.states[pair.1], self.d_max)
                && !self.alignment.may_be_alike(
                    draw.states[pair.0],
                    draw.states[pair.1],
                    self.d_max,
                )
            {
                draw.far.push(pair);
            }
        }
    }

    /// Adds closings that missed, each with one that held, up to so many states in all.
    fn add_closings(
        &self,
        draw: &mut Draw,
        states: usize,
        windows: &mut usize,
        rng: &mut ChaCha8Rng,
    ) {
        while let Some((missed, held)) = self.closings.draw(rng) {
            let start = draw.states.len();
            let middle = start + missed.1.len();
            let end = middle + held.1.len();
            if end > states {
                break;
            }
            for (trajectory, steps) in [missed, held] {
                draw.add_window(trajectory, steps, windows);
            }
            let pairs = self.far_pairs(draw, start..middle, middle..end);
            draw.grasps.extend(pairs);
        }
    }

    fn add_look_alikes(
        &self,
        draw: &mut Draw,
        plain: usize,
        windows: &mut usize,
        rng: &mut ChaCha8Rng,
    ) {
        let length = self.config.window.div_ceil(2);
        for _ in 0..self.config.states {
            let left = self.config.states.saturating_sub(draw.states.len());
            if left == 0 || self.look_alikes.is_empty() {
                break;
            }
            let anchor = rng.random_range(0..plain);
            let Some(twin) = self.look_alikes.one_of(draw.states[anchor], rng) else {
                continue;
            };
            let steps = self.steps_of(twin.trajectory);
            let first = (twin.step as usize).saturating_sub(length / 2);
            let end = (first + length.min(left)).min(steps);
            let rows = draw.states.len()..draw.states.len() + (end - first);
            draw.add_window(twin.trajectory, first as u32..end as u32, windows);
            let window = (0..plain).filter(|r| draw.window_of[*r] == draw.window_of[anchor]);
            let pairs = self.far_pairs(draw, window, rows);
            draw.hard.extend(pairs);
        }
    }

    /// The far pairs of rows, one of each kind, in both directions.
    fn far_pairs(
        &self,
        draw: &Draw,
        rows: impl Iterator<Item = usize>,
        others: std::ops::Range<usize>,
    ) -> Vec<(usize, usize)> {
        let far =
            |(from, to): &(usize, usize)| is_far(draw.states[*from], draw.states[*to], self.d_max);
        rows.flat_map(|row| others.clone().flat_map(move |o| [(row, o), (o, row)]))
            .filter(far)
            .collect()
    }

    fn steps_of(&self, trajectory: u32) -> usize {
        self.trajectories
            .iter()
            .find(|(t, _)| *t == trajectory)
            .map_or(0, |(_, steps)| *steps)
    }
}

/// Whether a pair is Case 2 of section III-C.
#[must_use]
pub fn is_far(from: StateRef, to: StateRef, d_max: usize) -> bool {
    from.trajectory != to.trajectory
        || to.step < from.step
        || (to.step - from.step) as usize >= d_max
}

#[cfg(test)]
mod tests;
