use std::sync::Arc;

use super::belief::Belief;
use super::evidence::{likelihood, support};
use super::grips::Grips;
use super::groups::Groups;
use super::motion::Motion;
use super::outset::Outset;
use super::stage_sense::StageSense;
use super::stages::{StageView, Stages};
use super::{FilterOptions, Layout, LiveDistances, PlaceId, StageChange};
use crate::graph::{NodeId, StageClassifier, StageEvidence};
use crate::model::{GraspSight, most_probable};

/// Where in the composition the robot is believed to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Localisation {
    /// The most probable state of the current stage, or of any where that stage is out of question.
    pub node: NodeId,
    /// At which of the composition's tasks, from 0.
    pub occurrence: usize,
    /// How many subgoals are taken to be reached.
    pub stage: usize,
    /// Time of the most probable state in the composition, in the median time of the demonstrations.
    pub time_steps: f32,
    /// Probability of each stage, summing to 1.
    pub stage_probabilities: Vec<f64>,
    /// Entropy of the belief over places in nats: 0 for certainty.
    pub entropy_nats: f64,
    /// Mean probability (0..=1), by belief, that what the robot sees is connected to where it is
    /// believed to be.
    pub fit: f64,
    /// Whether the fit has been low for several steps.
    pub is_lost: bool,
    /// What became of the stage in this step.
    pub change: Option<StageChange>,
}

/// Follows a robot along a composition: a belief over places, moved on at each step and weighed by how
/// near each place seems.
///
/// A single look-alike frame moves little of it, since the robot cannot have been anywhere near that
/// state before. Stages advance and fall back by votes. The same input gives the same belief.
///
/// In large compositions only the most probable places and those that distances are known of have a share
/// of their own, see [`FilterOptions::exact_places`]: a step then takes a time that depends on how many
/// distances there are, not on the size of the graph.
#[derive(Clone, Debug)]
pub struct StageFilter {
    layout: Layout,
    options: FilterOptions,
    groups: Groups,
    motion: Motion,
    belief: Belief,
    /// The belief before, whose memory the next one takes.
    spare: Belief,
    stages: Stages,
    unfit_steps: u32,
    sense: Option<StageSense>,
    grips: Option<Grips>,
    outset: Outset,
    /// Steps left in which the stage of a robot that may start anywhere is told by what is seen.
    placing_steps: u32,
}

/// Probability of a stage at which a robot that may start anywhere is taken to be there.
const PLACED: f64 = 0.5;
/// Steps after which it is taken to be at the most probable stage, however improbable.
const PLACING_STEPS: u32 = 5;
/// Share of the largest belief below which a place does not count.
const RULED_OUT: f64 = 0.02;
/// Probability below which the current stage is out of question.
const POSSIBLE: f64 = 0.02;
/// Most places that keep a share of their own from one step to the next in a large composition.
const KEPT_PLACES: usize = 1024;

impl StageFilter {
    /// A filter that believes the robot near the start of the first task. Options that are out of their ranges are not
    /// refused here: with them it may be left without a belief, or panic.
    #[must_use]
    pub fn new(layout: Layout, options: FilterOptions) -> Self {
        Self::beginning(layout, options, Outset::Beginning)
    }

    /// A filter that believes the robot to be where it is said to start.
    pub(super) fn beginning(layout: Layout, options: FilterOptions, outset: Outset) -> Self {
        let groups = Groups::new(&layout);
        let is_exact = layout.places().len() <= options.exact_places;
        let motion = Motion::new(&layout, &groups, &options, is_exact);
        let belief = Belief::new(&groups, layout.places().len());
        let stages = Stages::new(layout.stage_count(), layout.starts_of_tasks());
        let mut filter = Self {
            layout,
            options,
            groups,
            motion,
            spare: belief.clone(),
            belief,
            stages,
            unfit_steps: 0,
            sense: None,
            grips: None,
            outset,
            placing_steps: 0,
        };
        filter.reset();
        filter
    }

    /// Weighs places by what a classifier of the same graph makes of the robot's latent, too, where
    /// [`look`](Self::look) is given one.
    ///
    /// # Panics
    /// If the classifier is of a graph with fewer nodes.
    #[must_use]
    pub fn with_classifier(mut self, classifier: Arc<StageClassifier>) -> Self {
        self.sense = Some(StageSense::new(classifier, &self.layout));
        self
    }

    /// Knows at which states of demonstrations the gripper is closed: weighs places by what is seen of it, where
    /// [`look`](Self::look) is told. In a stage in which it is closed at most states it holds something, and an empty
    /// one speaks against what it lets go of, as does one that holds another thing than `thing_of` its states, where
    /// that is known.
    #[must_use]
    pub fn with_grasps(
        mut self,
        is_closed: impl Fn(NodeId) -> bool,
        thing_of: impl Fn(NodeId) -> Option<usize>,
    ) -> Self {
        let (grips, loads) = Grips::new(&self.layout, is_closed, thing_of);
        self.stages.know_loads(loads);
        self.grips = Some(grips);
        self
    }

    /// Back to the beginning of the composition, for a new episode.
    pub fn reset(&mut self) {
        self.belief.clear(&self.groups);
        self.belief.list_all(&self.groups);
        let first_stage = self.layout.first_stage();
        for (id, place) in (0..).map(PlaceId).zip(self.layout.places()) {
            let mass = self.outset.mass(place, first_stage) + self.options.restart;
            self.belief.add(id, mass);
        }
        for (id, weight) in self.outset.named() {
            self.belief.add(*id, *weight);
        }
        self.belief.weigh(|_| 1.0, |_| 1.0);
        self.forget_the_least();
        self.stages.begin(self.outset.stage(first_stage));
        self.placing_steps = match self.outset {
            Outset::Anywhere => PLACING_STEPS,
            _ => 0,
        };
        self.unfit_steps = 0;
    }

    /// Takes a robot that may start anywhere to be at the stage that what it sees tells.
    fn place(&mut self, stage_probabilities: &[f64]) {
        let stage = most_probable(stage_probabilities);
        self.placing_steps -= 1;
        if stage_probabilities[stage] >= PLACED || self.placing_steps == 0 {
            self.stages.accept(stage);
            self.placing_steps = 0;
        }
    }

    /// Whether every place has a share of its own.
    fn is_exact(&self) -> bool {
        self.layout.places().len() <= self.options.exact_places
    }

    fn forget_the_least(&mut self) {
        if !self.is_exact() {
            self.belief.keep(&self.groups, KEPT_PLACES);
        }
    }

    /// The graph along the composition.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The nodes whose distances the filter wants: all that have a place.
    #[must_use]
    pub fn candidates(&self) -> Vec<NodeId> {
        let mut nodes: Vec<NodeId> = self.layout.places().iter().map(|p| p.node).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// How many subgoals are taken to be reached.
    #[must_use]
    pub fn stage(&self) -> usize {
        self.stages.now
    }

    /// The belief that the robot is at a place, 0..=1; over all places it sums to 1.
    ///
    /// # Panics
    /// If the place is not in the layout.
    #[must_use]
    pub fn probability(&self, place: PlaceId) -> f64 {
        self.belief.of(&self.groups, place)
    }

    /// The most probable places of the current stage with their shares of the belief in all of them, the
    /// most probable one first: at most `count`, and none that is more than fifty times less probable than
    /// the first. None where the belief rules that stage out, as on the step that finds an earlier one overlooked.
    #[must_use]
    pub fn most_probable_places(&self, count: usize) -> Vec<(PlaceId, f64)> {
        let of_stage = |(id, _): &(PlaceId, f64)| self.layout.place(*id).stage == self.stages.now;
        let possible = self.belief.listed().filter(|(_, mass)| *mass > 0.0);
        let mut places: Vec<(PlaceId, f64)> = possible.filter(of_stage).collect();
        let order =
            |a: &(PlaceId, f64), b: &(PlaceId, f64)| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0));
        if places.len() > count {
            places.select_nth_unstable_by(count, order);
            places.truncate(count);
        }
        places.sort_unstable_by(order);
        let least = places.first().map_or(0.0, |(_, mass)| mass * RULED_OUT);
        places.retain(|(_, mass)| *mass >= least);
        let total: f64 = places.iter().map(|(_, mass)| mass).sum();
        for (_, mass) in &mut places {
            *mass /= total;
        }
        places
    }

    /// Takes the robot to be at a stage, whatever the votes say.
    ///
    /// # Panics
    /// If the composition has no such stage.
    pub fn set_stage(&mut self, stage: usize) {
        assert!(
            stage < self.layout.stage_count(),
            "stage {stage} of {}",
            self.layout.stage_count()
        );
        self.stages.accept(stage);
    }

    /// One step on: the robot acted, and now sees something at these distances, which are those of the states of the
    /// layout's graph.
    pub fn update(&mut self, distances: &LiveDistances) -> Localisation {
        self.update_with(distances, None, None)
    }

    /// The same with the latent of what it sees, for the classifier, if there is one, and what it sees of its
    /// gripper, if it does.
    ///
    /// # Panics
    /// If the latent is not of the length of the graph's.
    pub fn look(
        &mut self,
        distances: &LiveDistances,
        latent: &[f32],
        grasp: Option<GraspSight>,
    ) -> Localisation {
        let evidence = self.sense.as_ref().map(|s| s.look(latent));
        self.update_with(distances, evidence.as_ref(), grasp)
    }

    fn update_with(
        &mut self,
        distances: &LiveDistances,
        evidence: Option<&StageEvidence>,
        grasp: Option<GraspSight>,
    ) -> Localisation {
        self.predict(distances);
        self.weigh(distances, evidence, grasp);
        self.forget_the_least();
        let stage_probabilities = self.stage_probabilities();
        let reached = self.reached_probabilities();
        let fit = self.fit(distances);
        let sensed = evidence.zip(self.sense.as_ref());
        let sensed = |of_class: fn(&StageEvidence, usize) -> f64| {
            sensed.map(|(evidence, sense)| sense.of_stages(|class| of_class(evidence, class)))
        };
        let full_handed = |sensed: Vec<f64>| match grasp {
            Some(sight) => self.stages.weighed(sensed, sight),
            None => sensed,
        };
        let strict = sensed(StageEvidence::support).map(full_handed);
        let lenient = sensed(StageEvidence::lenient_support).map(full_handed);
        if let Some(sight) = grasp {
            self.stages.note_grasp(sight);
        }
        let view = StageView {
            probabilities: &stage_probabilities,
            reached: &reached,
            support: &support(&reached, strict.as_deref(), fit),
            lenient: &support(&reached, lenient.as_deref(), fit),
            sensed: strict.as_deref(),
        };
        // What is seen is like nothing that is believed: a belief that only drifts on decides little.
        let is_unfit = fit < self.options.lost_probability;
        let change = if is_unfit {
            self.stages.vote_unfit(&self.options, &view)
        } else if self.placing_steps > 0 {
            self.place(&stage_probabilities);
            None
        } else {
            self.stages.vote(&self.options, &view)
        };
        match change {
            Some(StageChange::Dropped { to }) => self.spread_over(to),
            Some(StageChange::Advanced { to } | StageChange::Taken { to })
                if stage_probabilities[to] < POSSIBLE =>
            {
                self.spread_over(to);
            }
            _ => {}
        }
        self.unfit_steps = if is_unfit { self.unfit_steps + 1 } else { 0 };
        self.localise(fit, stage_probabilities, change)
    }

    /// The earliest stage that the robot may have fallen back to.
    fn lowest_stage(&self) -> usize {
        self.stages.now.saturating_sub(self.options.regress_stages)
    }

    fn is_lost(&self) -> bool {
        self.unfit_steps > 0 && self.unfit_steps >= self.options.lost_patience
    }

    /// The belief before this step's distances are looked at. Places that they are known of are listed.
    fn predict(&mut self, distances: &LiveDistances) {
        let (is_exact, is_lost) = (self.is_exact(), self.is_lost());
        let groups = &self.groups;
        let next = &mut self.spare;
        next.clear(groups);
        if is_exact {
            next.list_all(groups);
        } else {
            for node in distances.nodes() {
                for place in self.layout.places_of(*node) {
                    next.list(groups, place);
                }
            }
        }
        if is_lost {
            // A belief that moved on without evidence would lead a lost robot through the task with closed eyes.
            next.add_evenly(
                groups,
                &groups.all_of(self.stages.now, self.options.restart),
            );
            next.sort();
        } else {
            let motion = &self.motion;
            motion.predict(&self.layout, groups, &self.options, &self.belief, next);
        }
        std::mem::swap(&mut self.belief, &mut self.spare);
    }

    /// Believes any state of a stage to be as likely as any other.
    fn spread_over(&mut self, stage: usize) {
        let groups = &self.groups;
        self.belief.clear(groups);
        self.belief.list_all(groups);
        let of_stage = groups.all_of(stage, self.options.restart);
        self.belief.add_evenly(groups, &of_stage);
        self.belief.weigh(|_| 1.0, |_| 1.0);
        self.forget_the_least();
    }

    /// Weighs the belief by how near each place seems, and by the stage that the classifier sees.
    fn weigh(
        &mut self,
        distances: &LiveDistances,
        evidence: Option<&StageEvidence>,
        grasp: Option<GraspSight>,
    ) {
        let lowest = self.lowest_stage();
        let is_empty = |stage| grasp.is_some_and(|sight| self.stages.is_ruled_out(stage, sight));
        let mut is_out: Vec<bool> = (0..self.layout.stage_count())
            .map(|stage| stage < lowest || is_empty(stage))
            .collect();
        if is_out.iter().all(|is_out| *is_out) {
            // Where something is held in all of them, an empty gripper tells nothing of the stage.
            is_out[lowest..].fill(false);
        }
        let (layout, groups, options) = (&self.layout, &self.groups, &self.options);
        let unknown = likelihood(options, None, None);
        let grips = self.grips.as_ref().zip(grasp);
        let grip = grips.map(|(grips, sight)| grips.likelihoods(options, sight));
        let sensed = evidence.zip(self.sense.as_ref());
        let weights = sensed.map(|(evidence, sense)| sense.weights(options, evidence));
        let stages: Vec<f64> = (0..layout.stage_count())
            .map(|stage| match &weights {
                _ if is_out[stage] => 0.0,
                None => unknown,
                Some(weights) => unknown * weights.of_stage(stage),
            })
            .collect();
        self.belief.weigh(
            |id| {
                let place = layout.place(id);
                if is_out[place.stage] {
                    return 0.0;
                }
                let near = match (distances.to(place.node), distances.from(place.node)) {
                    (None, None) => unknown,
                    (to, from) => likelihood(options, to, from),
                };
                let grip = grip.as_ref().map_or(1.0, |likelihood| likelihood(id));
                near * grip * weights.as_ref().map_or(1.0, |w| w.of_state(place.node))
            },
            |group| stages[groups.stages[group]],
        );
    }

    /// The most probable place of the current stage; of all stages where that one is out of question.
    fn best_place(&self, stage_probabilities: &[f64]) -> PlaceId {
        let is_possible = stage_probabilities[self.stages.now] >= POSSIBLE;
        let mut best: Option<(PlaceId, f64)> = None;
        for (id, mass) in self.belief.listed() {
            let counts = !is_possible || self.layout.place(id).stage == self.stages.now;
            if counts && best.is_none_or(|(_, b)| mass > b) {
                best = Some((id, mass));
            }
        }
        // No place of the stage has a share of its own: any of them is as good as another.
        let first = || {
            let places = self.layout.places().iter();
            let at = places.take_while(|p| p.stage != self.stages.now).count();
            PlaceId(at.min(self.layout.places().len() - 1) as u32)
        };
        best.map_or_else(first, |(id, _)| id)
    }

    fn stage_probabilities(&self) -> Vec<f64> {
        let mut probabilities = vec![0.0; self.layout.stage_count()];
        for (id, mass) in self.belief.listed() {
            probabilities[self.layout.place(id).stage] += mass;
        }
        for (group, mass) in self.belief.rest() {
            probabilities[self.groups.stages[group]] += mass;
        }
        probabilities
    }

    /// For each stage, the share of its probability at places that lie behind its last subgoal in the same
    /// task. At the start of a later task a robot may be without having done the one before.
    fn reached_probabilities(&self) -> Vec<f64> {
        let mut probabilities = vec![0.0; self.layout.stage_count()];
        for (id, mass) in self.belief.listed() {
            if !self.layout.is_at_start(id) {
                probabilities[self.layout.place(id).stage] += mass;
            }
        }
        probabilities
    }

    /// Mean probability, by belief, that what is seen is connected to where the robot is believed to be.
    fn fit(&self, distances: &LiveDistances) -> f64 {
        let connected = |node| f64::from(distances.connected_probability(node).unwrap_or(0.0));
        self.belief
            .listed()
            .map(|(id, mass)| mass * connected(self.layout.place(id).node))
            .sum()
    }

    fn localise(
        &self,
        fit: f64,
        stage_probabilities: Vec<f64>,
        change: Option<StageChange>,
    ) -> Localisation {
        let best = self.layout.place(self.best_place(&stage_probabilities));
        Localisation {
            node: best.node,
            occurrence: best.occurrence,
            stage: self.stages.now,
            time_steps: best.time_steps,
            stage_probabilities,
            entropy_nats: self.belief.entropy(),
            fit,
            is_lost: self.is_lost(),
            change,
        }
    }
}
