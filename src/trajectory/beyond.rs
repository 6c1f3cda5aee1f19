//! Recorded values beyond the range that is given for their dimension.

use std::fmt;

use super::{Action, ActionSpace, Binning, DimensionBinning};

/// How many values of a dimension lie beyond the range that a [`Binning`] gives.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ValuesBeyond {
    /// The dimension's name.
    pub(crate) dimension: String,
    low: Option<f32>,
    high: Option<f32>,
    count: usize,
    of: usize,
}

impl Binning {
    /// The dimensions of which values lie beyond a range that is given here; none where actions have classes already.
    pub(crate) fn beyond<'a>(
        &self,
        space: &ActionSpace,
        actions: impl Iterator<Item = &'a Action>,
    ) -> Vec<ValuesBeyond> {
        let ActionSpace::Continuous { names } = space else {
            return Vec::new();
        };
        let of_none = |name: &String| ValuesBeyond::of_none(name, self.of(name));
        let mut all: Vec<ValuesBeyond> = names.iter().map(of_none).collect();
        for action in actions {
            if let Action::Continuous(values) = action {
                for (beyond, value) in all.iter_mut().zip(values) {
                    beyond.take(*value);
                }
            }
        }
        all.retain(|beyond| beyond.count > 0);
        all
    }
}

impl ValuesBeyond {
    /// Before the first value.
    fn of_none(dimension: &str, binning: &DimensionBinning) -> Self {
        Self {
            dimension: dimension.to_owned(),
            low: binning.low,
            high: binning.high,
            count: 0,
            of: 0,
        }
    }

    fn take(&mut self, value: f32) {
        let is_beyond =
            self.low.is_some_and(|low| value < low) || self.high.is_some_and(|high| value > high);
        self.count += usize::from(is_beyond);
        self.of += 1;
    }
}

impl fmt::Display for ValuesBeyond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let low = self.low.map(|low| format!("below {low}"));
        let high = self.high.map(|high| format!("above {high}"));
        let ends: Vec<String> = low.into_iter().chain(high).collect();
        write!(
            f,
            "{} of {} values of '{}' beyond the range that is given ({}), and so in its outermost bins",
            self.count,
            self.of,
            self.dimension,
            ends.join(" or ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_counted_beyond_the_ends_that_are_given() {
        let names = ["x", "y", "gripper"].map(str::to_owned);
        let space = ActionSpace::Continuous {
            names: names.to_vec(),
        };
        let mut binning = Binning::uniform(3);
        let mut give = |name: &str, low, high| {
            let range = DimensionBinning {
                low,
                high,
                ..DimensionBinning::uniform(3)
            };
            binning.dimensions.insert(name.to_owned(), range);
        };
        give("x", Some(-1.0), Some(1.0));
        give("gripper", None, Some(0.5));
        let actions = [
            [-1.5, 9.0, 0.0],
            [-1.0, 9.0, 0.5],
            [1.0, 9.0, 0.6],
            [2.0, 9.0, 0.7],
        ];
        let actions = actions.map(|values| Action::Continuous(values.to_vec()));
        let beyond = binning.beyond(&space, actions.iter());
        let told: Vec<String> = beyond.iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            [
                "2 of 4 values of 'x' beyond the range that is given (below -1 or above 1), and so in its outermost bins",
                "2 of 4 values of 'gripper' beyond the range that is given (above 0.5), and so in its outermost bins",
            ]
        );
        let free = Binning::uniform(3).beyond(&space, actions.iter());
        assert!(free.is_empty(), "{free:?}");
        let cut = space.binned(actions.iter(), 3);
        assert!(binning.beyond(&cut, actions.iter()).is_empty());
    }
}
