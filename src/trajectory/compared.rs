//! Two action spaces side by side: what they differ in, and whether actions mean the same in both.

use super::ActionSpace;

/// Two spaces in words that differ, with no more detail than that takes.
pub(crate) fn told_apart(one: &ActionSpace, other: &ActionSpace) -> (String, String) {
    let ways: [fn(&ActionSpace) -> String; 4] = [
        ActionSpace::to_string,
        ActionSpace::with_names,
        with_bins,
        |space: &ActionSpace| format!("{space:?}"),
    ];
    let mut printed = ways.iter().map(|way| (way(one), way(other)));
    let differing = printed.find(|(a, b)| a != b);
    differing.unwrap_or_else(|| (one.to_string(), other.to_string()))
}

fn with_bins(space: &ActionSpace) -> String {
    let ActionSpace::Binned { dimensions } = space else {
        return space.with_names();
    };
    let cut: Vec<String> = dimensions
        .iter()
        .map(|d| format!("{} in {} bins from {} to {}", d.name, d.bins, d.low, d.high))
        .collect();
    format!("{space} ({})", cut.join(", "))
}

/// Whether a name is what a primitive or a dimension is called where a recording does not name it.
fn is_unnamed(name: &str, place: usize) -> bool {
    let number = name
        .strip_prefix("primitive_")
        .or_else(|| name.strip_prefix("action_"));
    number.is_some_and(|number| number == place.to_string())
}

impl ActionSpace {
    /// What the primitives or the dimensions are called, in order.
    fn names(&self) -> Vec<&str> {
        match self {
            Self::Primitives { names } | Self::Continuous { names } => {
                names.iter().map(String::as_str).collect()
            }
            Self::Binned { dimensions } => dimensions.iter().map(|d| d.name.as_str()).collect(),
        }
    }

    /// The space in words, with all its names.
    pub(crate) fn with_names(&self) -> String {
        format!("{self} ({})", self.names().join(", "))
    }

    /// Whether actions that were recorded in another space mean the same in this one: both are primitives or
    /// neither is, and no name stands for another one, or in another place. What a recording does not name is
    /// known by its place alone. A recording that does not declare its primitives shows only those up to the
    /// last one that was used, so there can be fewer of them.
    pub(crate) fn takes_actions_of(&self, recorded: &Self) -> bool {
        let (own, names) = (self.names(), recorded.names());
        let counts_fit = match (self, recorded) {
            (Self::Primitives { .. }, Self::Primitives { .. }) => names.len() <= own.len(),
            (Self::Primitives { .. }, _) | (_, Self::Primitives { .. }) => false,
            _ => names.len() == own.len(),
        };
        let fits = |(place, (name, own_name)): (usize, (&&str, &&str))| {
            let is_elsewhere = own.contains(name);
            name == own_name
                || is_unnamed(name, place)
                || (is_unnamed(own_name, place) && !is_elsewhere)
        };
        counts_fit && names.iter().zip(&own).enumerate().all(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::ActionDimension;

    fn primitives(names: &[&str]) -> ActionSpace {
        let names = names.iter().map(|n| (*n).to_owned()).collect();
        ActionSpace::Primitives { names }
    }

    fn continuous(names: &[&str]) -> ActionSpace {
        let names = names.iter().map(|n| (*n).to_owned()).collect();
        ActionSpace::Continuous { names }
    }

    fn binned(names: &[&str], bins: usize) -> ActionSpace {
        let dimension = |name: &&str| ActionDimension::uniform(*name, -1.0, 1.0, bins);
        ActionSpace::Binned {
            dimensions: names.iter().map(dimension).collect(),
        }
    }

    #[test]
    fn spaces_are_told_apart_with_no_more_detail_than_that_takes() {
        let told = |one: &ActionSpace, other: &ActionSpace| {
            let (one, other) = told_apart(one, other);
            format!("{one} / {other}")
        };
        assert_eq!(
            told(&primitives(&["up"]), &primitives(&["up", "down"])),
            "1 primitives / 2 primitives"
        );
        assert_eq!(
            told(&continuous(&["x", "y"]), &continuous(&["y", "x"])),
            "2 continuous dimensions (x, y) / 2 continuous dimensions (y, x)"
        );
        assert_eq!(
            told(&binned(&["x"], 3), &binned(&["x"], 5)),
            "1 binned dimensions (x in 3 bins from -1 to 1) / 1 binned dimensions (x in 5 bins from -1 to 1)"
        );
    }

    #[test]
    fn names_in_another_place_do_not_mean_the_same() {
        let model = binned(&["x", "y", "gripper"], 3);
        assert!(model.takes_actions_of(&continuous(&["x", "y", "gripper"])));
        assert!(model.takes_actions_of(&model));
        for other in [
            &["y", "x", "gripper"][..],
            &["x", "y", "finger"],
            &["x", "y"],
            &["x", "y", "gripper", "z"],
            &["action_0", "x", "gripper"],
            &["action_2", "y", "gripper"],
        ] {
            assert!(!model.takes_actions_of(&continuous(other)), "{other:?}");
        }
        assert!(!model.takes_actions_of(&primitives(&["x", "y", "gripper"])));
        assert!(!primitives(&["x"]).takes_actions_of(&continuous(&["x"])));
    }

    #[test]
    fn what_is_not_named_is_known_by_its_place() {
        let unnamed = ["action_0", "action_1", "action_2"];
        let model = binned(&["x", "y", "gripper"], 3);
        assert!(model.takes_actions_of(&continuous(&unnamed)));
        assert!(binned(&unnamed, 3).takes_actions_of(&continuous(&["x", "y", "gripper"])));
        let model = primitives(&["ahead", "left", "right"]);
        assert!(model.takes_actions_of(&primitives(&["ahead", "primitive_1", "right"])));
        assert!(model.takes_actions_of(&primitives(&["ahead", "left"])));
        assert!(!model.takes_actions_of(&primitives(&["ahead", "primitive_1", "left"])));
        let partly = primitives(&["ahead", "left", "primitive_2"]);
        assert!(partly.takes_actions_of(&model));
        assert!(!partly.takes_actions_of(&primitives(&["ahead", "primitive_1", "left"])));
    }
}
