//! Whether the chances of an operator's habits are some.

use thiserror::Error;

use super::Habits;

/// A habit that is no chance.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the operator's `{key}` is {value}, which is no chance: choose a number within 0..=1")]
pub struct HabitsError {
    /// The field of [`Habits`].
    pub key: &'static str,
    /// What it was to be.
    pub value: f64,
}

impl Habits {
    /// Whether each chance is a number from 0 to 1.
    ///
    /// # Errors
    /// [`HabitsError`] for the first that is not.
    pub fn check(&self) -> Result<(), HabitsError> {
        for (key, value) in self.chances() {
            // Contains no value that is not a number.
            if !(0.0..=1.0).contains(&value) {
                return Err(HabitsError { key, value });
            }
        }
        Ok(())
    }

    fn chances(&self) -> [(&'static str, f64); 7] {
        [
            ("overshoot", self.overshoot),
            ("hesitation", self.hesitation),
            ("missed_grasp", self.missed_grasp),
            ("missed_from_above", self.missed_from_above),
            ("late_notice", self.late_notice),
            ("slip", self.slip),
            ("slip_again", self.slip_again),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::EnvironmentError;
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Operator, demonstrate_on};

    type Field = fn(&mut Habits) -> &mut f64;

    const NEVER: Habits = Habits {
        overshoot: 0.0,
        hesitation: 0.0,
        missed_grasp: 0.0,
        missed_from_above: 0.0,
        late_notice: 0.0,
        slip: 0.0,
        slip_again: 0.0,
        practice: None,
    };

    #[test]
    fn each_chance_is_a_number_from_0_to_1() {
        assert_eq!(Habits::default().check(), Ok(()));
        assert_eq!(NEVER.check(), Ok(()));
        let fields: [(&str, Field); 7] = [
            ("overshoot", |habits| &mut habits.overshoot),
            ("hesitation", |habits| &mut habits.hesitation),
            ("missed_grasp", |habits| &mut habits.missed_grasp),
            ("missed_from_above", |habits| &mut habits.missed_from_above),
            ("late_notice", |habits| &mut habits.late_notice),
            ("slip", |habits| &mut habits.slip),
            ("slip_again", |habits| &mut habits.slip_again),
        ];
        for (key, field) in fields {
            let with = |value: f64| {
                let mut habits = NEVER;
                *field(&mut habits) = value;
                habits.check().map_err(|fault| fault.key)
            };
            assert_eq!(with(1.0), Ok(()), "{key}");
            for value in [-0.1, 1.1, f64::INFINITY, f64::NAN] {
                assert_eq!(with(value), Err(key), "{value}");
            }
        }
    }

    #[test]
    fn a_demonstration_with_what_is_no_chance_is_refused() {
        let task = BedroomTask::Wine;
        let habits = Habits { slip: 2.0, ..NEVER };
        let mut room = Bedroom::new(BedroomConfig::paper(task));
        let refused = demonstrate_on(&mut room, task, habits, 1).expect_err("no chance");
        assert!(
            matches!(refused, EnvironmentError::ActionRefused { .. }),
            "{refused:?}"
        );
        assert_eq!(
            refused.to_string(),
            "the robot cannot do a demonstration of wine: the operator's `slip` is 2, which is no chance: choose a \
             number within 0..=1"
        );
    }

    #[test]
    #[should_panic(expected = "`slip_again` is NaN")]
    fn an_operator_with_what_is_no_chance_is_none() {
        let task = BedroomTask::Wine;
        let habits = Habits {
            slip_again: f64::NAN,
            ..NEVER
        };
        let room = Bedroom::new(BedroomConfig::paper(task));
        let _ = Operator::new(task, &room.insight(), habits, 1);
    }
}
