use std::collections::BTreeMap;

use super::belief::Belief;
use super::groups::Groups;
use super::{FilterOptions, Layout, PlaceId};

/// Share of a jump that goes to the bucket of time before, the same, and the ones after.
const JUMP: [(isize, f64); 4] = [(-1, 0.15), (0, 0.35), (1, 0.35), (2, 0.15)];
/// How far into the next task the robot may be when it has left a task's end.
const SEAM_STEPS: f32 = 4.0;
/// Share of the going on from a demonstration's end that leads into the next task.
const SEAM_SHARE: f64 = 0.5;

/// How the robot may have moved since the last step.
///
/// Mostly along the demonstration that it was in; at times to another state at about the same time of
/// the composition, which is also how it gets from one task into the next; seldom to anywhere.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    is_start: Vec<bool>,
    /// For each occurrence of a task, the places at which it begins.
    starts: Vec<Starts>,
    /// For each group, where its places lead; empty where every place is listed.
    flows: Vec<Flow>,
}

#[derive(Clone, Debug, Default)]
struct Starts {
    count: u32,
    /// How many are in which group.
    by_group: BTreeMap<usize, u32>,
}

/// Where the places of a group lead, evenly weighed: shares of what goes along.
#[derive(Clone, Debug, Default)]
struct Flow {
    to: BTreeMap<usize, f64>,
    /// Into which occurrences of tasks.
    entering: BTreeMap<usize, f64>,
}

impl Motion {
    pub(super) fn new(
        layout: &Layout,
        groups: &Groups,
        options: &FilterOptions,
        is_exact: bool,
    ) -> Self {
        let occurrences = layout.places().last().map_or(0, |p| p.occurrence + 1);
        let mut begins = vec![f32::INFINITY; occurrences];
        for place in layout.places() {
            begins[place.occurrence] = begins[place.occurrence].min(place.time_steps);
        }
        let mut motion = Self {
            is_start: vec![false; layout.places().len()],
            starts: vec![Starts::default(); occurrences],
            flows: Vec::new(),
        };
        for (id, place) in (0..).map(PlaceId).zip(layout.places()) {
            if place.time_steps <= begins[place.occurrence] + SEAM_STEPS {
                motion.is_start[id.index()] = true;
                let starts = &mut motion.starts[place.occurrence];
                starts.count += 1;
                *starts.by_group.entry(groups.of(id)).or_default() += 1;
            }
        }
        if !is_exact {
            motion.flows = motion.flows(layout, groups, options);
        }
        motion
    }

    fn flows(&self, layout: &Layout, groups: &Groups, options: &FilterOptions) -> Vec<Flow> {
        let mut flows = vec![Flow::default(); groups.len()];
        for place in (0..layout.places().len() as u32).map(PlaceId) {
            let group = groups.of(place);
            let share = 1.0 / f64::from(groups.sizes[group]);
            let step = self.step(layout, options, place);
            let flow = &mut flows[group];
            for (to, weight) in step.moves {
                *flow.to.entry(groups.of(to)).or_default() += share * weight;
            }
            if let Some((occurrence, weight)) = step.entering {
                *flow.entering.entry(occurrence).or_default() += share * weight;
            }
        }
        flows
    }

    /// Where a place leads in a step along the demonstration.
    fn step(&self, layout: &Layout, options: &FilterOptions, here: PlaceId) -> Step {
        let sum = options.stay + options.advance + options.hurry;
        let one = layout.successor(here).unwrap_or(here);
        let two = layout.successor(one).unwrap_or(one);
        let (mut advance, mut hurry) = (options.advance, options.hurry);
        let next = layout.place(here).occurrence + 1;
        let mut entering = None;
        if one == here && next < self.starts.len() {
            entering = Some((next, SEAM_SHARE * (advance + hurry) / sum));
            advance -= SEAM_SHARE * advance;
            hurry -= SEAM_SHARE * hurry;
        }
        Step {
            moves: [
                (here, options.stay / sum),
                (one, advance / sum),
                (two, hurry / sum),
            ],
            entering,
        }
    }

    /// The belief one step later, into `next`, in which places that are to have a share of their own
    /// are listed already; it still sums to 1.
    pub(super) fn predict(
        &self,
        layout: &Layout,
        groups: &Groups,
        options: &FilterOptions,
        belief: &Belief,
        next: &mut Belief,
    ) {
        let along = (1.0 - options.jump - options.restart).max(0.0);
        let mut entering = vec![0.0; self.starts.len()];
        for (here, mass) in belief.listed() {
            let step = self.step(layout, options, here);
            for (to, weight) in step.moves {
                next.list(groups, to);
                next.add(to, along * mass * weight);
            }
            if let Some((occurrence, weight)) = step.entering {
                entering[occurrence] += along * mass * weight;
            }
        }
        let everywhere = options.restart / layout.places().len() as f64;
        let mut a_place = vec![everywhere; groups.len()];
        for (group, mass) in belief.rest() {
            for (to, share) in &self.flows[group].to {
                a_place[*to] += along * mass * share / f64::from(groups.sizes[*to]);
            }
            for (occurrence, share) in &self.flows[group].entering {
                entering[*occurrence] += along * mass * share;
            }
        }
        let jumped = jump(groups, belief);
        for (mass, bucket) in a_place.iter_mut().zip(&groups.buckets) {
            let bucket = *bucket as usize;
            *mass += options.jump * jumped[bucket] / f64::from(groups.bucket_sizes[bucket]);
        }
        next.add_evenly(groups, &a_place);
        self.enter(layout, groups, &entering, next);
        next.sort();
    }

    /// Adds what enters each occurrence of a task, evenly over its starts.
    fn enter(&self, layout: &Layout, groups: &Groups, entering: &[f64], next: &mut Belief) {
        let a_start: Vec<f64> = entering
            .iter()
            .zip(&self.starts)
            .map(|(mass, starts)| mass / f64::from(starts.count.max(1)))
            .collect();
        let mut listed: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        let starts: Vec<(PlaceId, usize)> = next
            .listed()
            .filter(|(place, _)| self.is_start[place.index()])
            .map(|(place, _)| (place, layout.place(place).occurrence))
            .filter(|(_, occurrence)| a_start[*occurrence] > 0.0)
            .collect();
        for (place, occurrence) in starts {
            next.add(place, a_start[occurrence]);
            *listed.entry((occurrence, groups.of(place))).or_default() += 1;
        }
        for (occurrence, mass) in a_start.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
            for (group, count) in &self.starts[occurrence].by_group {
                let others = count - listed.get(&(occurrence, *group)).unwrap_or(&0);
                next.add_rest(*group, mass * f64::from(others));
            }
        }
    }
}

/// Moves along a demonstration with their probabilities, and what enters the next task.
struct Step {
    moves: [(PlaceId, f64); 3],
    entering: Option<(usize, f64)>,
}

/// The belief by bucket of time after a jump.
fn jump(groups: &Groups, belief: &Belief) -> Vec<f64> {
    let mut masses = vec![0.0; groups.bucket_sizes.len()];
    let listed = belief.listed().map(|(p, mass)| (groups.of(p), mass));
    for (group, mass) in listed.chain(belief.rest()) {
        masses[groups.buckets[group] as usize] += mass;
    }
    let mut jumped = vec![0.0; masses.len()];
    for (bucket, mass) in masses.iter().enumerate() {
        for (by, share) in JUMP {
            let to = bucket
                .checked_add_signed(by)
                .filter(|to| groups.bucket_sizes.get(*to).is_some_and(|s| *s > 0))
                .unwrap_or(bucket);
            jumped[to] += mass * share;
        }
    }
    jumped
}
