use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Action, ActionSpace, TrajectoryError};

/// Where the edges of a dimension's bins lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// Equal widths between the lowest and the highest value.
    #[default]
    Uniform,
    /// Equal numbers of recorded values, so that bins are narrow where the robot moves most.
    Quantiles,
}

/// Which value a policy's answer for a dimension becomes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decoding {
    /// What the most probable bin stands for.
    #[default]
    Centre,
    /// The mean of what all bins stand for, weighed by their probabilities.
    Expectation,
}

impl Decoding {
    // serde passes a reference.
    #[allow(clippy::trivially_copy_pass_by_ref)]
    fn is_centre(&self) -> bool {
        *self == Self::Centre
    }
}

/// How one dimension of continuous actions is cut into bins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DimensionBinning {
    /// How many bins, at least 1; quantiles of few different values make fewer.
    pub bins: usize,
    /// Where their edges lie.
    pub spacing: Spacing,
    /// Lower edge of the first bin; the lowest recorded value if it is not given.
    pub low: Option<f32>,
    /// Upper edge of the last bin; the highest recorded value if it is not given.
    pub high: Option<f32>,
    /// What a policy's answer becomes.
    pub decoding: Decoding,
}

impl DimensionBinning {
    /// Equal bins over the recorded range, each standing for its middle.
    #[must_use]
    pub fn uniform(bins: usize) -> Self {
        Self {
            bins,
            spacing: Spacing::Uniform,
            low: None,
            high: None,
            decoding: Decoding::Centre,
        }
    }

    /// Both ends of the range over recorded values, which are finite and sorted.
    fn range(&self, sorted: &[f32]) -> (f32, f32) {
        let low = self.low.or(sorted.first().copied());
        let high = self.high.or(sorted.last().copied());
        (low.unwrap_or(0.0), high.unwrap_or(0.0))
    }

    /// Refuses a range that ends before it begins.
    fn check(&self, dimension: &str, sorted: &[f32]) -> Result<(), TrajectoryError> {
        let (low, high) = self.range(sorted);
        match (sorted.first(), sorted.last()) {
            (Some(least), Some(greatest)) if high < low => Err(TrajectoryError::EmptyRange {
                dimension: dimension.to_owned(),
                low,
                high,
                least: *least,
                greatest: *greatest,
            }),
            _ => Ok(()),
        }
    }
}

/// How continuous actions are cut into bins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Binning {
    /// For all dimensions but those below.
    pub default: DimensionBinning,
    /// For some dimensions, by name.
    pub dimensions: BTreeMap<String, DimensionBinning>,
}

impl Binning {
    /// The same number of equal bins for every dimension.
    #[must_use]
    pub fn uniform(bins: usize) -> Self {
        Self {
            default: DimensionBinning::uniform(bins),
            dimensions: BTreeMap::new(),
        }
    }

    /// Whether a range is given for any dimension, beyond which values could lie.
    pub(crate) fn has_range(&self) -> bool {
        let mut all = self.dimensions.values().chain([&self.default]);
        all.any(|dimension| dimension.low.is_some() || dimension.high.is_some())
    }

    /// How the dimension of this name is cut.
    #[must_use]
    pub fn of(&self, dimension: &str) -> &DimensionBinning {
        self.dimensions.get(dimension).unwrap_or(&self.default)
    }
}

/// One dimension of a binned action space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionDimension {
    /// What the dimension moves, such as `x` or `gripper`.
    pub name: String,
    /// Lower edge of the first bin.
    pub low: f32,
    /// Upper edge of the last bin.
    pub high: f32,
    /// Number of bins, at least 1.
    pub bins: usize,
    /// The edges of all bins, one more than there are bins, rising; none where bins are equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<f32>,
    /// What each bin stands for: the median of what was recorded in it; none where that is its middle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub centres: Vec<f32>,
    /// What a policy's answer becomes.
    #[serde(default, skip_serializing_if = "Decoding::is_centre")]
    pub decoding: Decoding,
}

impl ActionDimension {
    /// Equal bins between `low` and `high`, each standing for its middle.
    #[must_use]
    pub fn uniform(name: impl Into<String>, low: f32, high: f32, bins: usize) -> Self {
        Self {
            name: name.into(),
            low,
            high,
            bins,
            edges: Vec::new(),
            centres: Vec::new(),
            decoding: Decoding::Centre,
        }
    }

    /// Cuts the recorded values of a dimension, which are finite and sorted.
    fn cut(name: &str, sorted: &[f32], binning: &DimensionBinning) -> Self {
        let (low, high) = binning.range(sorted);
        let mut dimension = Self::uniform(name, low, high.max(low), binning.bins.max(1));
        dimension.decoding = binning.decoding;
        if binning.spacing == Spacing::Quantiles {
            dimension.cut_by_quantiles(sorted);
        }
        dimension
    }

    fn cut_by_quantiles(&mut self, sorted: &[f32]) {
        let mut edges = vec![self.low];
        // Whether the newest bin begins with a value that is frequent enough to take it for itself.
        let mut is_full = false;
        for i in 1..self.bins {
            let Some(cut) = sorted.get(i * sorted.len() / self.bins) else {
                break;
            };
            let newest = edges[edges.len() - 1];
            // Many equal values would give bins that nothing can fall into.
            if *cut <= newest {
                is_full = true;
                continue;
            }
            if *cut > self.high {
                break;
            }
            if is_full {
                edges.extend(next_above(sorted, newest).filter(|next| next < cut));
                is_full = false;
            }
            edges.push(*cut);
        }
        if is_full {
            let next = next_above(sorted, edges[edges.len() - 1]);
            edges.extend(next.filter(|next| *next <= self.high));
        }
        self.bins = edges.len();
        edges.push(self.high);
        self.edges = edges;
        let mut members = vec![Vec::new(); self.bins];
        for value in sorted {
            members[self.bin(*value)].push(*value);
        }
        // In order, since the values were.
        self.centres = members
            .iter()
            .enumerate()
            .map(|(bin, values)| {
                let middle = values.get(values.len() / 2).copied();
                middle.map_or_else(|| self.middle(bin), |v| v.clamp(self.low, self.high))
            })
            .collect();
    }

    /// The bin that a value falls into; values beyond the range fall into the outermost bins.
    pub(super) fn bin(&self, value: f32) -> usize {
        if let [_, inner @ .., _] = self.edges.as_slice() {
            let bin = inner.partition_point(|edge| *edge <= value);
            return bin.min(self.bins.saturating_sub(1));
        }
        let width = (self.high - self.low) / self.bins as f32;
        if width <= 0.0 {
            return 0;
        }
        (((value - self.low) / width).floor().max(0.0) as usize).min(self.bins - 1)
    }

    /// What a bin stands for.
    #[must_use]
    pub fn centre(&self, bin: usize) -> f32 {
        let recorded = self.centres.get(bin).copied();
        recorded.unwrap_or_else(|| self.middle(bin))
    }

    fn middle(&self, bin: usize) -> f32 {
        match self.edges.get(bin..bin + 2) {
            Some([low, high]) => low + (high - low) * 0.5,
            _ => self.low + (self.high - self.low) * (bin as f32 + 0.5) / self.bins as f32,
        }
    }

    /// The value that the probabilities of the bins mean by this dimension's [`Decoding`].
    fn decoded(&self, probabilities: &[f32], decoding: Decoding) -> f32 {
        match decoding {
            Decoding::Centre => self.centre(most_probable(probabilities)),
            Decoding::Expectation => {
                let total: f32 = probabilities.iter().sum();
                let weighed = probabilities.iter().enumerate();
                weighed.map(|(bin, p)| p * self.centre(bin)).sum::<f32>() / total
            }
        }
    }
}

/// The least of sorted values that is greater than this one.
fn next_above(sorted: &[f32], value: f32) -> Option<f32> {
    let above = sorted.partition_point(|v| *v <= value);
    sorted.get(above).copied()
}

/// The most probable class; the lowest index wins a tie.
fn most_probable(probabilities: &[f32]) -> usize {
    let mut best = 0;
    for (class, p) in probabilities.iter().enumerate() {
        if *p > probabilities[best] {
            best = class;
        }
    }
    best
}

impl ActionSpace {
    /// The same space with `bins` equal bins over the range of each dimension of `actions`; spaces
    /// that have classes already stay as they are.
    #[must_use]
    pub fn binned<'a>(&self, actions: impl Iterator<Item = &'a Action>, bins: usize) -> Self {
        match self {
            Self::Continuous { names } => {
                let columns = sorted_columns(names.len(), actions);
                cut_all(names, &columns, &Binning::uniform(bins))
            }
            _ => self.clone(),
        }
    }

    /// The same space cut into bins as `binning` says, by what was recorded in `actions`; spaces that
    /// have classes already stay as they are.
    ///
    /// # Errors
    /// [`TrajectoryError::UnknownDimension`] when `binning` names a dimension that there is not,
    /// [`TrajectoryError::EmptyRange`] when a range of which it gives one end lies below all recorded values, or above.
    pub fn binned_by<'a>(
        &self,
        actions: impl Iterator<Item = &'a Action>,
        binning: &Binning,
    ) -> Result<Self, TrajectoryError> {
        let Self::Continuous { names } = self else {
            return Ok(self.clone());
        };
        if let Some(unknown) = binning.dimensions.keys().find(|k| !names.contains(k)) {
            return Err(TrajectoryError::UnknownDimension {
                found: unknown.clone(),
                known: names.join(", "),
            });
        }
        let columns = sorted_columns(names.len(), actions);
        for (name, sorted) in names.iter().zip(&columns) {
            binning.of(name).check(name, sorted)?;
        }
        Ok(cut_all(names, &columns, binning))
    }

    /// The action that a policy's probabilities mean, one list a head: of motion primitives the most
    /// probable one, of binned dimensions what the [`Decoding`] of each says.
    ///
    /// # Errors
    /// [`TrajectoryError::ActionOutsideSpace`] when the number of heads, the length of one or its sum
    /// does not fit, or the space is not binned.
    ///
    /// ```
    /// use catena::trajectory::{Action, ActionDimension, ActionSpace, Decoding};
    ///
    /// let mut x = ActionDimension::uniform("x", 0.0, 1.0, 2);
    /// let space = |x: &ActionDimension| ActionSpace::Binned { dimensions: vec![x.clone()] };
    /// let heads = [vec![0.8, 0.2]];
    /// assert_eq!(space(&x).decoded_action(&heads)?, Action::Continuous(vec![0.25]));
    /// x.decoding = Decoding::Expectation;
    /// let Action::Continuous(values) = space(&x).decoded_action(&heads)? else { unreachable!() };
    /// assert!((values[0] - 0.35).abs() < 1e-6);
    /// # Ok::<(), catena::trajectory::TrajectoryError>(())
    /// ```
    pub fn decoded_action(&self, probabilities: &[Vec<f32>]) -> Result<Action, TrajectoryError> {
        self.decoded(probabilities, |d| d.decoding)
    }

    /// The action that is expected of a policy's probabilities, whatever [`Decoding`] the dimensions
    /// have: the mean of what their bins stand for. Of motion primitives the most probable one.
    ///
    /// # Errors
    /// Those of [`decoded_action`](Self::decoded_action).
    pub fn expected_action(&self, probabilities: &[Vec<f32>]) -> Result<Action, TrajectoryError> {
        self.decoded(probabilities, |_| Decoding::Expectation)
    }

    fn decoded(
        &self,
        probabilities: &[Vec<f32>],
        decoding: impl Fn(&ActionDimension) -> Decoding,
    ) -> Result<Action, TrajectoryError> {
        let (sizes, found) = (
            self.head_sizes(),
            probabilities.iter().map(Vec::len).collect::<Vec<_>>(),
        );
        let is_weight = |p: &f32| p.is_finite() && *p >= 0.0;
        let has_sum = |head: &Vec<f32>| head.iter().all(is_weight) && head.iter().any(|p| *p > 0.0);
        if sizes.is_empty() || sizes != found || !probabilities.iter().all(has_sum) {
            return Err(TrajectoryError::ActionOutsideSpace {
                action: format!("probabilities of {found:?} classes"),
                space: self.to_string(),
                reason: format!(
                    "the heads have {sizes:?} classes, each with a probability of at least 0 and one above"
                ),
            });
        }
        Ok(match self {
            Self::Binned { dimensions } => Action::Continuous(
                dimensions
                    .iter()
                    .zip(probabilities)
                    .map(|(d, p)| d.decoded(p, decoding(d)))
                    .collect(),
            ),
            _ => Action::Primitive(most_probable(&probabilities[0])),
        })
    }
}

/// The recorded values of each dimension, sorted; what is not finite is passed over.
fn sorted_columns<'a>(
    dimensions: usize,
    actions: impl Iterator<Item = &'a Action>,
) -> Vec<Vec<f32>> {
    let mut columns = vec![Vec::new(); dimensions];
    for action in actions {
        if let Action::Continuous(values) = action {
            for (column, value) in columns.iter_mut().zip(values) {
                if value.is_finite() {
                    column.push(*value);
                }
            }
        }
    }
    for column in &mut columns {
        column.sort_by(f32::total_cmp);
    }
    columns
}

fn cut_all(names: &[String], columns: &[Vec<f32>], binning: &Binning) -> ActionSpace {
    let dimensions = names
        .iter()
        .zip(columns)
        .map(|(name, sorted)| ActionDimension::cut(name, sorted, binning.of(name)))
        .collect();
    ActionSpace::Binned { dimensions }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actions(values: &[f32]) -> Vec<Action> {
        values
            .iter()
            .map(|v| Action::Continuous(vec![*v]))
            .collect()
    }

    fn space(values: &[f32], binning: DimensionBinning) -> ActionDimension {
        let names = vec!["x".to_owned()];
        let binning = Binning {
            default: binning,
            dimensions: BTreeMap::new(),
        };
        let space = ActionSpace::Continuous { names };
        match space.binned_by(actions(values).iter(), &binning).unwrap() {
            ActionSpace::Binned { dimensions } => dimensions[0].clone(),
            other => panic!("{other}"),
        }
    }

    fn quantiles(bins: usize) -> DimensionBinning {
        DimensionBinning {
            spacing: Spacing::Quantiles,
            ..DimensionBinning::uniform(bins)
        }
    }

    #[test]
    fn quantiles_hold_equal_numbers_and_stand_for_their_medians() {
        let values: Vec<f32> = (0..100).map(|i| (i as f32 / 10.0).exp()).collect();
        let x = space(&values, quantiles(4));
        assert_eq!((x.bins, x.edges.len(), x.centres.len()), (4, 5, 4));
        for bin in 0..4 {
            let held = values.iter().filter(|v| x.bin(**v) == bin).count();
            assert_eq!(held, 25, "bin {bin} of {x:?}");
        }
        // The last bin reaches from 1,808 to 19,930; its middle would be far from most of it.
        assert!((x.centre(3) - values[87]).abs() < 1.0, "{x:?}");
        assert_eq!((x.bin(-5.0), x.bin(1e9)), (0, 3));
    }

    #[test]
    fn few_different_values_make_few_quantiles() {
        let gripper = space(&[0.0, 0.0, 0.0, 1.0, 0.0, 1.0], quantiles(21));
        assert_eq!(gripper.bins, 2);
        assert_eq!((gripper.bin(0.0), gripper.bin(1.0)), (0, 1));
        assert_eq!((gripper.centre(0), gripper.centre(1)), (0.0, 1.0));
        let still = space(&[0.5; 9], quantiles(5));
        assert_eq!((still.bins, still.centre(0)), (1, 0.5));
        let none = space(&[], quantiles(5));
        assert_eq!((none.bins, none.centre(0)), (1, 0.0));
    }

    #[test]
    fn a_frequent_value_takes_one_bin_and_not_what_lies_beside_it() {
        // A turn that is seldom made, to either side.
        let mut values = vec![-0.2; 3];
        values.extend([0.0; 94]);
        values.extend([0.1, 0.2, 0.3]);
        let yaw = space(&values, quantiles(21));
        assert_eq!(yaw.bins, 3, "{yaw:?}");
        assert_eq!([0, 1, 2].map(|bin| yaw.centre(bin)), [-0.2, 0.0, 0.2]);
        let mut values = vec![0.0; 9];
        values.push(1.0);
        let gripper = space(&values, quantiles(5));
        assert_eq!(gripper.bins, 2, "{gripper:?}");
        assert_eq!((gripper.centre(0), gripper.centre(1)), (0.0, 1.0));
        let mut values = vec![0.0; 6];
        values.extend([0.1, 0.2, 0.3, 0.4]);
        let x = space(&values, quantiles(4));
        assert_eq!(x.bins, 3, "{x:?}");
        assert_eq!((x.bin(0.0), x.bin(0.1), x.bin(0.4)), (0, 1, 2));
    }

    #[test]
    fn a_given_range_goes_before_the_recorded_one() {
        let binning = DimensionBinning {
            low: Some(-1.0),
            high: Some(1.0),
            ..DimensionBinning::uniform(4)
        };
        let x = space(&[0.1, 0.2, 7.0], binning);
        assert_eq!((x.low, x.high), (-1.0, 1.0));
        assert_eq!(x.bin(7.0), 3);
        assert_eq!(x.centre(3), 0.75);
    }

    #[test]
    fn a_range_that_ends_before_it_begins_is_refused_with_its_dimension() {
        let told = |values: &[f32], low, high| {
            let space = ActionSpace::Continuous {
                names: vec!["x".to_owned()],
            };
            let mut binning = Binning::uniform(4);
            binning.default.low = low;
            binning.default.high = high;
            let cut = space.binned_by(actions(values).iter(), &binning);
            cut.err().map(|e| e.to_string())
        };
        let values = [2.0, f32::NAN, 3.0];
        assert_eq!(
            told(&values, None, Some(1.0)).as_deref(),
            Some(
                "the range of 'x' is empty: 2 to 1, while its values are from 2 to 3. Give a range that they lie in, or \
                 both of its ends"
            )
        );
        let above = told(&values, Some(4.0), None).unwrap();
        assert!(above.contains("'x' is empty: 4 to 3,"), "{above}");
        for (low, high) in [
            (None, None),
            (None, Some(2.0)),
            (Some(3.0), None),
            (Some(-1.0), Some(1.0)),
        ] {
            assert_eq!(told(&values, low, high), None, "{low:?} {high:?}");
        }
        assert_eq!(told(&[], None, Some(-1.0)), None, "nothing is recorded");
    }

    #[test]
    fn every_recorded_value_is_decoded_near_itself() {
        let values: Vec<f32> = (0..1000)
            .map(|i| ((i * 37) % 1000) as f32 / 500.0 - 1.0)
            .collect();
        for binning in [DimensionBinning::uniform(50), quantiles(50)] {
            let x = space(&values, binning);
            for value in &values {
                assert!((x.centre(x.bin(*value)) - value).abs() <= 0.041, "{value}");
            }
        }
    }

    #[test]
    fn a_misspelled_dimension_is_refused_with_the_right_names() {
        let names = vec!["x".to_owned(), "gripper".to_owned()];
        let mut binning = Binning::uniform(3);
        let two = DimensionBinning::uniform(2);
        binning.dimensions.insert("griper".to_owned(), two.clone());
        let space = ActionSpace::Continuous { names };
        let error = space.binned_by(std::iter::empty(), &binning).unwrap_err();
        let error = error.to_string();
        assert!(
            error.contains("griper") && error.contains("x, gripper"),
            "{error}"
        );
        binning.dimensions = [("gripper".to_owned(), two)].into();
        let both = [
            Action::Continuous(vec![0.0, 0.0]),
            Action::Continuous(vec![1.0, 1.0]),
        ];
        let cut = space.binned_by(both.iter(), &binning).unwrap();
        assert_eq!(cut.head_sizes(), [3, 2]);
    }

    #[test]
    fn old_manifests_read_and_equal_bins_write_as_before() {
        let old = r#"{"name":"x","low":0.0,"high":1.0,"bins":3}"#;
        let x: ActionDimension = serde_json::from_str(old).unwrap();
        assert_eq!(x, ActionDimension::uniform("x", 0.0, 1.0, 3));
        assert_eq!(serde_json::to_string(&x).unwrap(), old);
    }

    #[test]
    fn expectation_lies_between_the_bins() {
        let mut x = ActionDimension::uniform("x", 0.0, 4.0, 4);
        let space = |x: &ActionDimension| ActionSpace::Binned {
            dimensions: vec![x.clone()],
        };
        let heads = [vec![0.0, 1.0, 1.0, 0.0]];
        let expected = Action::Continuous(vec![2.0]);
        assert_eq!(space(&x).expected_action(&heads).unwrap(), expected);
        assert_eq!(
            space(&x).decoded_action(&heads).unwrap(),
            Action::Continuous(vec![1.5])
        );
        x.decoding = Decoding::Expectation;
        assert_eq!(space(&x).decoded_action(&heads).unwrap(), expected);
        for wrong in [
            vec![],
            vec![vec![1.0; 3]],
            vec![vec![0.0; 4]],
            vec![vec![f32::NAN; 4]],
        ] {
            assert!(space(&x).decoded_action(&wrong).is_err(), "{wrong:?}");
        }
        let primitives = ActionSpace::Primitives {
            names: vec!["a".to_owned(), "b".to_owned()],
        };
        let b = primitives.expected_action(&[vec![0.4, 0.6]]).unwrap();
        assert_eq!(b, Action::Primitive(1));
    }
}
