//! Which moments of two demonstrations of a task show the same phase of it.

use rayon::prelude::*;

use super::{Dataset, StateRef};

/// Other demonstrations that each one is compared with, at most: bounds the work for large sets.
const PARTNERS: usize = 32;
/// What a step without a counterpart costs in a correspondence, where a pair of equal actions is worth 1.
const GAP: f32 = -0.25;
/// Worse than leaving both actions without a counterpart, so never chosen.
const UNLIKE: f32 = 2.0 * GAP - 1.0;
/// Steps to either side that are looked at to judge a correspondence.
const REACH: usize = 6;
/// Least share of actions with a counterpart within that reach: below it the two went different ways.
const LEAST_SHARE: f32 = 0.6;

/// For each demonstration and each of its partners (others of the same task), the step of the partner at
/// which the same actions are still to come.
///
/// Found from actions and markers alone: between one marker and the next, the correspondence in which
/// most actions agree in their order. A step that only one of the two needed, such as another 3 cm forward
/// or a correction, has the same counterpart as the step after it. Where the two demonstrations went
/// different ways there is none.
#[derive(Clone, Debug, Default)]
pub struct Alignment {
    /// By trajectory: its partners in rising order, each with the counterpart of every step.
    partners: Vec<Vec<(u32, Counterparts)>>,
    /// By trajectory: the set that it is from. Empty where nothing was to be compared.
    sets: Vec<usize>,
}

type Counterparts = Vec<Option<u32>>;

impl Alignment {
    /// Compares demonstrations of the same set with each other.
    pub fn find(data: &Dataset, trajectories: &[u32]) -> Self {
        let mut partners = vec![Vec::new(); data.trajectory_count()];
        let found: Vec<_> = trajectories
            .par_iter()
            .map(|one| (*one, partners_of(data, *one, trajectories)))
            .collect();
        for (trajectory, of) in found {
            partners[trajectory as usize] = of;
        }
        let all = 0..data.trajectory_count() as u32;
        let sets = all.map(|trajectory| data.set_of(trajectory)).collect();
        Self { partners, sets }
    }

    /// The demonstrations that a trajectory was compared with.
    pub fn partners(&self, trajectory: u32) -> &[(u32, Counterparts)] {
        self.partners
            .get(trajectory as usize)
            .map_or(&[], Vec::as_slice)
    }

    /// The step of `partner` that corresponds to a state.
    pub fn counterpart(&self, state: StateRef, partner: u32) -> Option<u32> {
        let partners = self.partners(state.trajectory);
        let place = partners.binary_search_by_key(&partner, |(p, _)| *p).ok()?;
        partners[place].1[state.step as usize]
    }

    /// Whether two states of different demonstrations may show nearly the same phase: they are fewer than
    /// `within_steps` apart, or their demonstrations are of one set and were not compared. Nothing says that such
    /// states are far from each other.
    pub fn may_be_alike(&self, one: StateRef, other: StateRef, within_steps: usize) -> bool {
        let near = |a: StateRef, b: StateRef| {
            self.counterpart(a, b.trajectory)
                .is_some_and(|step| (step.abs_diff(b.step) as usize) < within_steps)
        };
        near(one, other) || near(other, one) || self.were_left_out(one.trajectory, other.trajectory)
    }

    /// Whether two demonstrations of one set were not compared, which happens where it has more than
    /// `2 * PARTNERS + 1`.
    fn were_left_out(&self, one: u32, other: u32) -> bool {
        let set = |trajectory: u32| self.sets.get(trajectory as usize);
        let is_partner = |of: u32, wanted: u32| {
            let partners = self.partners(of);
            partners.binary_search_by_key(&wanted, |(p, _)| *p).is_ok()
        };
        one != other
            && set(one).is_some()
            && set(one) == set(other)
            && !is_partner(one, other)
            && !is_partner(other, one)
    }
}

fn partners_of(data: &Dataset, one: u32, trajectories: &[u32]) -> Vec<(u32, Counterparts)> {
    let others: Vec<u32> = trajectories
        .iter()
        .copied()
        .filter(|t| *t != one && data.set_of(*t) == data.set_of(one))
        .collect();
    let first = others.partition_point(|t| *t < one);
    let mut chosen: Vec<u32> = others
        .iter()
        .cycle()
        .skip(first)
        .take(others.len().min(PARTNERS))
        .copied()
        .collect();
    chosen.sort_unstable();
    chosen
        .into_iter()
        .map(|other| (other, counterparts(data, one, other)))
        .collect()
}

/// The counterpart of each step of `one` in `other`.
fn counterparts(data: &Dataset, one: u32, other: u32) -> Counterparts {
    let (rows, columns) = (data.steps(one), data.steps(other));
    let (left, right) = (data.marker_steps(one), data.marker_steps(other));
    let mut ends: Vec<(usize, usize)> = if left.len() == right.len() {
        left.iter().copied().zip(right.iter().copied()).collect()
    } else {
        Vec::new()
    };
    ends.push((rows, columns));
    let mut path = Vec::with_capacity(rows);
    let mut start = (0, 0);
    for end in ends {
        let part = |trajectory, from: usize, to: usize| -> Vec<&[usize]> {
            (from..to.max(from))
                .map(|step| data.classes(at(trajectory, step)))
                .collect()
        };
        let steps = correspondence(&part(one, start.0, end.0), &part(other, start.1, end.1));
        path.extend(steps.into_iter().map(|(step, same)| (start.1 + step, same)));
        start = (start.0.max(end.0), start.1.max(end.1));
    }
    judged(&path, columns)
}

fn at(trajectory: u32, step: usize) -> StateRef {
    StateRef {
        trajectory,
        step: step as u32,
    }
}

/// For each action of `one`, the place in `other` up to which the two agree, and whether the action has a
/// counterpart there: the best alignment of two sequences by dynamic programming.
fn correspondence(one: &[&[usize]], other: &[&[usize]]) -> Vec<(usize, bool)> {
    let width = other.len() + 1;
    let mut best = vec![0.0_f32; (one.len() + 1) * width];
    // From the end, so that the way is read off from the start.
    for row in (0..=one.len()).rev() {
        for column in (0..=other.len()).rev() {
            let here = row * width + column;
            best[here] = match (row < one.len(), column < other.len()) {
                (false, false) => 0.0,
                (true, false) => GAP + best[here + width],
                (false, true) => GAP + best[here + 1],
                (true, true) => {
                    let both = agreement(one[row], other[column]) + best[here + width + 1];
                    both.max(GAP + best[here + width].max(best[here + 1]))
                }
            };
        }
    }
    let mut steps = Vec::with_capacity(one.len());
    let (mut row, mut column) = (0, 0);
    while row < one.len() {
        let here = row * width + column;
        if column < other.len() {
            let same = agreement(one[row], other[column]);
            if same > 0.0 && best[here] == same + best[here + width + 1] {
                steps.push((column, true));
                (row, column) = (row + 1, column + 1);
                continue;
            }
            if best[here] == GAP + best[here + 1] {
                column += 1;
                continue;
            }
        }
        steps.push((column, false));
        row += 1;
    }
    steps
}

/// What it is worth that two actions correspond: the share of their dimensions that agree, [`UNLIKE`] if
/// that is less than half.
fn agreement(one: &[usize], other: &[usize]) -> f32 {
    let same = one.iter().zip(other).filter(|(a, b)| a == b).count();
    let share = same as f32 / one.len().max(1) as f32;
    if share < 0.5 { UNLIKE } else { share }
}

/// Keeps the counterparts around which most actions of both demonstrations have one.
fn judged(path: &[(usize, bool)], columns: usize) -> Counterparts {
    (0..path.len())
        .map(|step| {
            let first = step.saturating_sub(REACH);
            let last = (step + REACH).min(path.len() - 1);
            let around = &path[first..=last];
            let matched = around.iter().filter(|(_, same)| *same).count();
            let passed = path[last].0 - path[first].0 + 1;
            let share = matched as f32 / around.len().max(passed) as f32;
            let counterpart = path[step].0;
            (share >= LEAST_SHARE && counterpart < columns).then_some(counterpart as u32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::synthetic;
    use crate::trajectory::{DemonstrationSet, Trajectory};

    fn steps(one: &str, other: &str) -> Vec<usize> {
        let actions = |letters: &str| -> Vec<[usize; 1]> {
            letters.bytes().map(|b| [usize::from(b)]).collect()
        };
        let (one, other) = (actions(one), actions(other));
        let one: Vec<&[usize]> = one.iter().map(<[usize; 1]>::as_slice).collect();
        let other: Vec<&[usize]> = other.iter().map(<[usize; 1]>::as_slice).collect();
        correspondence(&one, &other)
            .into_iter()
            .map(|(step, _)| step)
            .collect()
    }

    #[test]
    fn a_step_that_only_one_needed_waits_for_the_next_one() {
        assert_eq!(steps("ffffc", "fffc").last(), Some(&3));
        assert_eq!(steps("abxcd", "abcd"), [0, 1, 2, 2, 3]);
        assert_eq!(steps("abcd", "abxcd"), [0, 1, 3, 4]);
    }

    #[test]
    fn different_ways_have_no_counterparts() {
        let path: Vec<(usize, bool)> = correspondence(
            &[&[1], &[1], &[1], &[1], &[1], &[1], &[1]],
            &[&[2], &[2], &[2], &[2], &[2], &[2], &[2]],
        );
        assert!(judged(&path, 7).iter().all(Option::is_none));
    }

    /// How so many demonstrations of 20 steps that all show the same are aligned.
    fn of_copies(count: u32) -> Alignment {
        let one = synthetic::demonstrations("a", 1, 20, 3).trajectories()[0].clone();
        let copy = |number: u32| Trajectory {
            id: format!("copy {number}"),
            ..one.clone()
        };
        let set = DemonstrationSet::new("a", (0..count).map(copy).collect()).unwrap();
        let all: Vec<u32> = (0..count).collect();
        Alignment::find(&Dataset::new(&[set]).unwrap(), &all)
    }

    #[test]
    fn a_demonstration_and_its_copy_correspond_step_by_step() {
        let alignment = of_copies(2);
        for step in 0..20 {
            assert_eq!(alignment.counterpart(at(0, step), 1), Some(step as u32));
        }
        assert!(alignment.may_be_alike(at(0, 5), at(1, 8), 4));
        assert!(!alignment.may_be_alike(at(0, 5), at(1, 9), 4));
    }

    #[test]
    fn of_more_demonstrations_than_are_compared_it_is_known_which_were_not() {
        for (count, left_out) in [(65, 0), (66, 1), (70, 5)] {
            let alignment = of_copies(count);
            // The start of the first and the end of another are alike only for all that is known.
            let unknown = |other: &u32| alignment.may_be_alike(at(0, 0), at(*other, 19), 4);
            assert_eq!((1..count).filter(unknown).count(), left_out, "of {count}");
            assert!(!alignment.may_be_alike(at(0, 0), at(0, 19), 4));
        }
        let none = Alignment::default();
        assert!(!none.may_be_alike(at(0, 0), at(33, 0), 4));
    }
}
