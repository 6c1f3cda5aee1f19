//! The action space that a recording of ours declares in its metadata.

use super::MAX_BINS;
use super::episode::{HEADER_RECORD, keys};
use super::scan::Scan;
use crate::trajectory::{ActionDimension, ActionSpace};

/// The space that is declared, if one is, or why it cannot be one.
pub(super) fn declared_space(scan: &Scan) -> Result<Option<ActionSpace>, String> {
    let header = scan.salvage.metadata.get(HEADER_RECORD);
    let text = header.and_then(|header| header.get(keys::ACTION_SPACE));
    let space: Option<ActionSpace> = text.and_then(|text| serde_json::from_str(text).ok());
    if let Some(ActionSpace::Binned { dimensions }) = &space {
        for dimension in dimensions {
            check(dimension).map_err(|what| {
                format!(
                    "the action space that its metadata declares has dimension '{}' with {what}: record it again, or \
                     leave the recording out",
                    dimension.name
                )
            })?;
        }
    }
    Ok(space)
}

/// What of a dimension no value can be cut by.
fn check(dimension: &ActionDimension) -> Result<(), String> {
    let ActionDimension {
        low, high, bins, ..
    } = dimension;
    let (edges, centres) = (&dimension.edges, &dimension.centres);
    let are_finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
    if !(1..=MAX_BINS).contains(bins) {
        return Err(format!("{bins} bins, where 1 to {MAX_BINS} are possible"));
    }
    if !are_finite(&[*low, *high]) || low > high {
        return Err(format!("a range of {low} to {high}"));
    }
    if !edges.is_empty() && edges.len() != bins + 1 {
        return Err(format!("{} edges of {bins} bins", edges.len()));
    }
    if !are_finite(edges) || !edges.is_sorted() {
        return Err("edges that do not rise".to_owned());
    }
    if !centres.is_empty() && centres.len() != *bins {
        return Err(format!("{} centres of {bins} bins", centres.len()));
    }
    if !are_finite(centres) {
        return Err("a centre that is no number".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Action, Binning, DimensionBinning, Spacing};

    fn told(change: impl FnOnce(&mut ActionDimension)) -> Option<String> {
        let mut dimension = ActionDimension::uniform("x", -1.0, 1.0, 2);
        dimension.edges = vec![-1.0, 0.5, 1.0];
        dimension.centres = vec![0.0, 0.75];
        change(&mut dimension);
        check(&dimension).err()
    }

    #[test]
    fn what_cuts_no_value_is_told() {
        assert_eq!(told(|_| ()), None);
        let bins = |bins| told(|d| d.bins = bins).unwrap();
        assert_eq!(bins(0), "0 bins, where 1 to 4096 are possible");
        assert_eq!(
            bins(usize::MAX),
            "18446744073709551615 bins, where 1 to 4096 are possible"
        );
        assert_eq!(bins(3), "3 edges of 3 bins");
        assert_eq!(told(|d| d.low = 2.0).unwrap(), "a range of 2 to 1");
        let infinite = told(|d| d.high = f32::INFINITY).unwrap();
        assert_eq!(infinite, "a range of -1 to inf");
        let edges = told(|d| d.edges[1] = 3.0).unwrap();
        assert_eq!(edges, "edges that do not rise");
        let centres = told(|d| d.centres.clear());
        assert_eq!(centres, None);
        let centres = told(|d| d.centres.push(1.0)).unwrap();
        assert_eq!(centres, "3 centres of 2 bins");
    }

    /// Of values that never change, too.
    #[test]
    fn what_a_training_cuts_can_be_declared() {
        let names = vec!["x".to_owned(), "gripper".to_owned()];
        let space = ActionSpace::Continuous { names };
        let actions: Vec<Action> = (0..20)
            .map(|i| Action::Continuous(vec![i as f32, 0.5]))
            .collect();
        for spacing in [Spacing::Uniform, Spacing::Quantiles] {
            let mut binning = Binning::uniform(5);
            binning.default = DimensionBinning {
                spacing,
                ..DimensionBinning::uniform(5)
            };
            let cut = space.binned_by(actions.iter(), &binning).unwrap();
            let ActionSpace::Binned { dimensions } = &cut else {
                panic!("{cut}");
            };
            for dimension in dimensions {
                assert_eq!(check(dimension), Ok(()), "{dimension:?}");
            }
        }
    }
}
