use serde::{Deserialize, Serialize};

use super::RolloutError;
use super::reflex::Stillness;
use crate::composer::OnShortcut;
use crate::planner::FilterOptions;

/// How a composition is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RolloutOptions {
    /// Time steps after which a run ends.
    pub max_steps: usize,
    /// What to do about a shortcut.
    pub on_shortcut: OnShortcut,
    /// How the robot is followed along the composition.
    pub filter: FilterOptions,
    /// At how many of the most probable states the robot may be for the policy to be averaged over the
    /// goal states that follow from them; 1 takes the most probable one alone, as in the paper.
    pub hypotheses: usize,
    /// At most so many states in each direction are asked how far they are at each step, those that an
    /// embedding holds for nearest, and those where the robot is believed to be; `None` asks all.
    pub nearest_states: Option<usize>,
    /// Least probability (0..=1) that a state is near for distances back from it to be asked for.
    pub near_probability: f32,
    /// Steps without a lower cost-to-go until actions are drawn by their probabilities instead of
    /// taking the most probable one.
    pub doubt_steps: usize,
    /// Steps without a lower cost-to-go until the goal state is made dearer.
    pub patience_steps: usize,
    /// What a goal state that was not reached costs extra, in steps, 0 or more.
    pub penalty_steps: f64,
    /// Share (0..=1) of such an extra that is left after each step.
    pub penalty_keep: f64,
    /// Change of the mean value (0..=255) of a patch of 10x10 pixels that shows that something moved.
    pub still_levels: f32,
    /// Share (0..=1) of the patches of a camera that must change so much. An action after which no camera saw that
    /// is taken to have had no effect, and is not tried again until something moves; to close or open the gripper, one
    /// patch is enough.
    pub still_share: f32,
    /// Least probability (0..=1) of an action that takes the place of one that had no effect. Where
    /// nothing else is so probable, the robot undoes what had no effect, and tries from there.
    pub least_substitute: f32,
    /// Steps without effect, since the cost-to-go last fell, after which the robot undoes the way that led
    /// there and tries again.
    pub blocked_steps: usize,
    /// Whether the gripper is led to where it next closes or opens, where the model's encoder sees that place
    /// ([`LandmarkBook`](crate::model::LandmarkBook)) and the robot begins as in the demonstrations.
    pub approach: bool,
    /// Steps for which the last stage must last until a run that never gets to a final state ends.
    pub settle_steps: usize,
}

impl Default for RolloutOptions {
    fn default() -> Self {
        Self {
            max_steps: 400,
            on_shortcut: OnShortcut::default(),
            filter: FilterOptions::default(),
            hypotheses: 12,
            nearest_states: None,
            near_probability: 0.02,
            doubt_steps: 6,
            patience_steps: 12,
            penalty_steps: 4.0,
            penalty_keep: 0.97,
            still_levels: 4.0,
            still_share: 0.17,
            least_substitute: 0.25,
            blocked_steps: 10,
            approach: true,
            settle_steps: 12,
        }
    }
}

impl RolloutOptions {
    /// Refuses what no run can be made with, also of how the robot is followed.
    ///
    /// # Errors
    /// [`RolloutError::OptionOutOfRange`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), RolloutError> {
        let shares = [
            ("near_probability", f64::from(self.near_probability)),
            ("penalty_keep", self.penalty_keep),
            ("still_share", f64::from(self.still_share)),
            ("least_substitute", f64::from(self.least_substitute)),
        ];
        for (option, value) in shares {
            within(option, value, (0.0..=1.0).contains(&value), "from 0 to 1")?;
        }
        for (option, value) in [
            ("penalty_steps", self.penalty_steps),
            ("still_levels", f64::from(self.still_levels)),
        ] {
            let is_sound = value.is_finite() && value >= 0.0;
            within(option, value, is_sound, "0 or more, and finite")?;
        }
        within(
            "hypotheses",
            self.hypotheses as f64,
            self.hypotheses > 0,
            "1 or more",
        )?;
        match self.filter.out_of_range() {
            None => Ok(()),
            Some((option, value, range)) => Err(RolloutError::OptionOutOfRange {
                option,
                value,
                range,
            }),
        }
    }

    pub(super) fn stillness(&self) -> Stillness {
        Stillness {
            levels: self.still_levels,
            share: self.still_share,
        }
    }
}

fn within(
    option: &'static str,
    value: f64,
    is_sound: bool,
    range: &'static str,
) -> Result<(), RolloutError> {
    if is_sound {
        return Ok(());
    }
    Err(RolloutError::OptionOutOfRange {
        option,
        value,
        range,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_out_of_its_range_is_refused_by_name() {
        RolloutOptions::default().check().expect("the defaults");
        let refused = |change: fn(&mut RolloutOptions)| {
            let mut options = RolloutOptions::default();
            change(&mut options);
            options.check().expect_err("out of range").to_string()
        };
        let error = refused(|o| o.penalty_steps = -1.0);
        assert_eq!(
            error,
            "penalty_steps is -1, but it must be 0 or more, and finite"
        );
        let error = refused(|o| o.penalty_steps = f64::INFINITY);
        assert!(error.contains("penalty_steps is inf"), "{error}");
        let error = refused(|o| o.penalty_keep = f64::NAN);
        assert!(
            error.contains("penalty_keep is NaN, but it must be from 0 to 1"),
            "{error}"
        );
        let error = refused(|o| o.hypotheses = 0);
        assert!(error.contains("hypotheses is 0"), "{error}");
    }

    #[test]
    fn what_no_belief_can_be_kept_with_is_refused_too() {
        let with = |change: fn(&mut FilterOptions)| {
            let mut options = RolloutOptions::default();
            change(&mut options.filter);
            options.check()
        };
        let refused =
            |change: fn(&mut FilterOptions)| with(change).expect_err("out of range").to_string();
        for (error, said) in [
            (refused(|f| f.hurry = -0.5), "hurry is -0.5"),
            (refused(|f| f.stay = f64::INFINITY), "stay is inf"),
            (refused(|f| f.jump = f64::NAN), "jump is NaN"),
            (refused(|f| f.jump = 1.0), "jump + restart is 1.0001"),
            (refused(|f| f.restart = 0.0), "restart is 0"),
            (
                refused(|f| f.evidence_weight = -1.0),
                "evidence_weight is -1",
            ),
            (refused(|f| f.floor = 0.0), "floor is 0"),
            (
                refused(|f| f.classifier_weight = 11.0),
                "classifier_weight is 11",
            ),
            (
                refused(|f| f.classifier_floor = 0.0),
                "classifier_floor is 0",
            ),
            (
                refused(|f| f.grasp_weight = f64::NAN),
                "grasp_weight is NaN",
            ),
            (refused(|f| f.advance_mass = 0.0), "advance_mass is 0"),
            (refused(|f| f.regress_mass = 1.5), "regress_mass is 1.5"),
            (
                refused(|f| f.lost_probability = 2.0),
                "lost_probability is 2",
            ),
        ] {
            assert!(
                error.starts_with(&format!("{said}, but it must be ")),
                "{error}"
            );
        }
        let error = refused(|f| (f.stay, f.advance, f.hurry) = (0.0, 0.0, 0.0));
        assert_eq!(
            error,
            "stay + advance + hurry is 0, but it must be above 0, and finite"
        );
        // What forgets all at each step, and what asks for certainty.
        assert_eq!(with(|f| (f.jump, f.restart) = (0.0, 1.0)), Ok(()));
        assert_eq!(
            with(|f| (f.advance_mass, f.regress_mass) = (1.0, 1.0)),
            Ok(())
        );
    }
}
