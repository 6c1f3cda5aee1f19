use super::{Place, PlaceId};

/// What is known of a robot that has seen nothing yet.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Outset {
    /// Near the start of the first task.
    #[default]
    Beginning,
    /// Anywhere in the first task; its stage is told by what is seen.
    Anywhere,
    /// Anywhere at a stage.
    Stage(usize),
    /// At one of these places, by weight, or near the start of the first task.
    Places(Vec<(PlaceId, f64)>),
}

/// How far into the first task the robot may be at the beginning: mean of an exponential.
const START_STEPS: f64 = 4.0;

impl Outset {
    /// How probable a place is, relative to others, besides those that are named; `first_stage` is the one at which
    /// the first task begins.
    pub(super) fn mass(&self, place: &Place, first_stage: usize) -> f64 {
        match self {
            Self::Beginning | Self::Places(_)
                if place.occurrence == 0 && place.stage == first_stage =>
            {
                (-f64::from(place.time_steps) / START_STEPS).exp()
            }
            Self::Anywhere if place.occurrence == 0 => 1.0,
            Self::Stage(stage) if place.stage == *stage => 1.0,
            _ => 0.0,
        }
    }

    /// Places that are named, with what they are more probable.
    pub(super) fn named(&self) -> &[(PlaceId, f64)] {
        match self {
            Self::Places(places) => places,
            _ => &[],
        }
    }

    /// The stage at which the robot is taken to be.
    pub(super) fn stage(&self, first_stage: usize) -> usize {
        match self {
            Self::Stage(stage) => *stage,
            _ => first_stage,
        }
    }
}
