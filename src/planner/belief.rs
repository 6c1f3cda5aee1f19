use super::PlaceId;
use super::groups::Groups;

/// How probable it is that the robot is at each place.
///
/// Listed places have a share of their own; what is left belongs to groups and is spread evenly over
/// those of their places that are not listed. Where all places are listed nothing is left.
#[derive(Clone, Debug)]
pub(super) struct Belief {
    /// By place, 0 where it is not listed.
    masses: Vec<f64>,
    is_listed: Vec<bool>,
    /// In ascending order once [`sort`](Self::sort) was called.
    listed: Vec<PlaceId>,
    /// By group: what its places that are not listed have together, and how many they are.
    rest: Vec<f64>,
    unlisted: Vec<u32>,
}

impl Belief {
    /// No belief at all, and no place listed.
    pub(super) fn new(groups: &Groups, places: usize) -> Self {
        Self {
            masses: vec![0.0; places],
            is_listed: vec![false; places],
            listed: Vec::new(),
            rest: vec![0.0; groups.len()],
            unlisted: groups.sizes.clone(),
        }
    }

    /// As new, in a time that does not depend on the number of places.
    pub(super) fn clear(&mut self, groups: &Groups) {
        for place in self.listed.drain(..) {
            self.masses[place.index()] = 0.0;
            self.is_listed[place.index()] = false;
        }
        self.rest.fill(0.0);
        self.unlisted.copy_from_slice(&groups.sizes);
    }

    /// Gives a place a share of its own, which is 0 for now.
    pub(super) fn list(&mut self, groups: &Groups, place: PlaceId) {
        if !std::mem::replace(&mut self.is_listed[place.index()], true) {
            self.listed.push(place);
            self.unlisted[groups.of(place)] -= 1;
        }
    }

    pub(super) fn list_all(&mut self, groups: &Groups) {
        for place in 0..self.masses.len() as u32 {
            self.list(groups, PlaceId(place));
        }
    }

    pub(super) fn sort(&mut self) {
        if !self.listed.is_sorted() {
            self.listed.sort_unstable();
        }
    }

    /// Adds to the share of a place that is listed.
    pub(super) fn add(&mut self, place: PlaceId, mass: f64) {
        debug_assert!(self.is_listed[place.index()], "the place is not listed");
        self.masses[place.index()] += mass;
    }

    /// Adds to what a group's places that are not listed have together.
    pub(super) fn add_rest(&mut self, group: usize, mass: f64) {
        self.rest[group] += mass;
    }

    /// Adds so much to every place of a group.
    pub(super) fn add_evenly(&mut self, groups: &Groups, a_place: &[f64]) {
        for place in &self.listed {
            self.masses[place.index()] += a_place[groups.of(*place)];
        }
        for ((rest, count), mass) in self.rest.iter_mut().zip(&self.unlisted).zip(a_place) {
            *rest += mass * f64::from(*count);
        }
    }

    /// Weighs the places that are listed, and all others of a group alike, and makes the sum 1.
    pub(super) fn weigh(
        &mut self,
        of_place: impl Fn(PlaceId) -> f64,
        of_others: impl Fn(usize) -> f64,
    ) {
        let mut sum = 0.0;
        for place in &self.listed {
            let mass = &mut self.masses[place.index()];
            *mass *= of_place(*place);
            sum += *mass;
        }
        for (group, rest) in self.rest.iter_mut().enumerate() {
            *rest *= of_others(group);
            sum += *rest;
        }
        for place in &self.listed {
            self.masses[place.index()] /= sum;
        }
        for rest in &mut self.rest {
            *rest /= sum;
        }
    }

    /// Lists no more than the `count` most probable places; the shares of the others go to their groups.
    pub(super) fn keep(&mut self, groups: &Groups, count: usize) {
        if self.listed.len() <= count {
            return;
        }
        let masses = &self.masses;
        self.listed.select_nth_unstable_by(count, |a, b| {
            let by_mass = masses[b.index()].total_cmp(&masses[a.index()]);
            by_mass.then(a.cmp(b))
        });
        for place in self.listed.drain(count..) {
            let group = groups.of(place);
            self.rest[group] += std::mem::take(&mut self.masses[place.index()]);
            self.unlisted[group] += 1;
            self.is_listed[place.index()] = false;
        }
        self.listed.sort_unstable();
    }

    /// The places with a share of their own, and that share.
    pub(super) fn listed(&self) -> impl Iterator<Item = (PlaceId, f64)> {
        self.listed
            .iter()
            .map(|place| (*place, self.masses[place.index()]))
    }

    /// The groups with something left for places that are not listed.
    pub(super) fn rest(&self) -> impl Iterator<Item = (usize, f64)> {
        let rest = self.rest.iter().copied().enumerate();
        rest.filter(|(_, mass)| *mass > 0.0)
    }

    /// The share of a place, listed or not.
    pub(super) fn of(&self, groups: &Groups, place: PlaceId) -> f64 {
        if self.is_listed[place.index()] {
            return self.masses[place.index()];
        }
        let group = groups.of(place);
        self.rest[group] / f64::from(self.unlisted[group])
    }

    /// In nats; 0 for certainty.
    pub(super) fn entropy(&self) -> f64 {
        let single = |mass: f64| if mass > 0.0 { -mass * mass.ln() } else { 0.0 };
        let listed: f64 = self.listed().map(|(_, mass)| single(mass)).sum();
        let rest: f64 = self
            .rest()
            .map(|(group, mass)| single(mass) + mass * f64::from(self.unlisted[group]).ln())
            .sum();
        listed + rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::tests::layout_of_corridor;

    fn beliefs() -> (Groups, Belief) {
        let layout = layout_of_corridor();
        let groups = Groups::new(&layout);
        let belief = Belief::new(&groups, layout.places().len());
        (groups, belief)
    }

    #[test]
    fn what_is_not_listed_has_its_share_of_the_group() {
        let (groups, mut belief) = beliefs();
        let count = belief.masses.len();
        belief.list(&groups, PlaceId(3));
        belief.add_evenly(&groups, &vec![0.5; groups.len()]);
        belief.add(PlaceId(3), 0.25);
        belief.weigh(|_| 1.0, |_| 1.0);
        let all: f64 = (0..count as u32)
            .map(|p| belief.of(&groups, PlaceId(p)))
            .sum();
        assert!((all - 1.0).abs() < 1e-12, "{all}");
        let ratio = belief.of(&groups, PlaceId(3)) / belief.of(&groups, PlaceId(4));
        assert!((ratio - 1.5).abs() < 1e-12, "{ratio}");
    }

    #[test]
    fn unlisting_keeps_the_sum_and_the_most_probable() {
        let (groups, mut belief) = beliefs();
        belief.list_all(&groups);
        for place in 0..belief.masses.len() as u32 {
            belief.add(PlaceId(place), f64::from(place));
        }
        belief.weigh(|_| 1.0, |_| 1.0);
        let before = belief.entropy();
        let last = belief.masses.len() as u32 - 1;
        belief.keep(&groups, 2);
        let kept: Vec<u32> = belief.listed().map(|(place, _)| place.0).collect();
        assert_eq!(kept, [last - 1, last]);
        let rest: f64 = belief.rest().map(|(_, mass)| mass).sum();
        let listed: f64 = belief.listed().map(|(_, mass)| mass).sum();
        assert!((rest + listed - 1.0).abs() < 1e-12);
        assert!(belief.entropy() >= before - 1e-12, "evened out");
    }

    #[test]
    fn a_cleared_belief_is_as_new() {
        let (groups, mut belief) = beliefs();
        let new = format!("{belief:?}");
        belief.list(&groups, PlaceId(1));
        belief.add_evenly(&groups, &vec![1.0; groups.len()]);
        belief.clear(&groups);
        assert_eq!(format!("{belief:?}"), new);
    }
}
