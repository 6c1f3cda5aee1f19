use std::collections::BTreeSet;
use std::sync::Arc;

use super::{FilterOptions, Layout, Place, PlaceId};
use crate::graph::{StageClassifier, StageEvidence};

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

    /// What a place is weighed by.
    pub(super) fn weight_of_place(
        &self,
        options: &FilterOptions,
        evidence: &StageEvidence,
        place: &Place,
    ) -> f64 {
        weight(options, evidence, self.classifier.class_of(place.node))
    }

    /// What places of a stage are weighed by together.
    pub(super) fn weight_of_stage(
        &self,
        options: &FilterOptions,
        evidence: &StageEvidence,
        stage: usize,
    ) -> f64 {
        let classes = &self.of_stage[stage];
        let weights = classes.iter().map(|c| weight(options, evidence, *c));
        weights.sum::<f64>() / classes.len().max(1) as f64
    }

    /// What speaks for a stage to be reached, 0..=1.
    pub(super) fn support(&self, evidence: &StageEvidence, stage: usize) -> f64 {
        let classes = self.reached[stage].iter();
        classes.map(|class| evidence.support(*class)).sum()
    }
}

fn weight(options: &FilterOptions, evidence: &StageEvidence, class: usize) -> f64 {
    (options.classifier_floor + evidence.support(class)).powf(options.classifier_weight)
}
