use std::collections::BTreeSet;
use std::sync::Arc;

use super::{FilterOptions, Layout, PlaceId};
use crate::graph::{NodeId, StageClassifier, StageEvidence};

/// A classifier, with the classes that the places of each stage of a layout have.
#[derive(Clone, Debug)]
pub(super) struct StageSense {
    classifier: Arc<StageClassifier>,
    of_stage: Vec<Vec<usize>>,
    /// The same of places that are not at the start of a later task.
    reached: Vec<Vec<usize>>,
}

impl StageSense {
    pub(super) fn new(classifier: Arc<StageClassifier>, layout: &Layout) -> Self {
        let mut of_stage = vec![BTreeSet::new(); layout.stage_count()];
        let mut reached = of_stage.clone();
        for (id, place) in (0..).map(PlaceId).zip(layout.places()) {
            let class = classifier.class_of(place.node);
            of_stage[place.stage].insert(class);
            if !layout.is_at_start(id) {
                reached[place.stage].insert(class);
            }
        }
        let lists = |sets: Vec<BTreeSet<usize>>| -> Vec<Vec<usize>> {
            sets.into_iter().map(|s| s.into_iter().collect()).collect()
        };
        Self {
            classifier,
            of_stage: lists(of_stage),
            reached: lists(reached),
        }
    }

    pub(super) fn look(&self, latent: &[f32]) -> StageEvidence {
        self.classifier.look(latent)
    }

    /// What states are weighed by in this step.
    pub(super) fn weights(&self, options: &FilterOptions, evidence: &StageEvidence) -> Weights<'_> {
        let weight = |class: usize| {
            let support = evidence.support(class);
            (options.classifier_floor + support).powf(options.classifier_weight)
        };
        Weights {
            sense: self,
            of_class: (0..self.classifier.classes().len()).map(weight).collect(),
        }
    }

    /// What speaks for each stage to be reached, 0..=1, by what is said of a class.
    pub(super) fn of_stages(&self, of_class: impl Fn(usize) -> f64) -> Vec<f64> {
        let of_stage = |classes: &Vec<usize>| classes.iter().map(|class| of_class(*class)).sum();
        self.reached.iter().map(of_stage).collect()
    }
}

/// What a classifier's word is worth in one step.
pub(super) struct Weights<'a> {
    sense: &'a StageSense,
    of_class: Vec<f64>,
}

impl Weights<'_> {
    pub(super) fn of_state(&self, node: NodeId) -> f64 {
        self.of_class[self.sense.classifier.class_of(node)]
    }

    /// That of the places of a stage together.
    pub(super) fn of_stage(&self, stage: usize) -> f64 {
        let classes = &self.sense.of_stage[stage];
        let sum: f64 = classes.iter().map(|class| self.of_class[*class]).sum();
        sum / classes.len().max(1) as f64
    }
}
