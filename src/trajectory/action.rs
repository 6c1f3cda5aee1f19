use std::fmt;

use serde::{Deserialize, Serialize};

use super::{ActionDimension, TrajectoryError};

/// What a robot did in one time step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// One of the motion primitives of the action space, by index.
    Primitive(usize),
    /// One value for each dimension of a continuous action space, in the robot's own units.
    Continuous(Vec<f32>),
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primitive(index) => write!(f, "primitive {index}"),
            Self::Continuous(values) => write!(f, "{values:?}"),
        }
    }
}

/// Which actions a robot can take (Fu & Finn, section III-A).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum ActionSpace {
    /// A finite list of motion primitives.
    Primitives {
        /// Their names; an action is an index into this list.
        names: Vec<String>,
    },
    /// Continuous values, each cut into bins: what a policy can be trained on.
    Binned {
        /// The dimensions, in the order of the values of an action.
        dimensions: Vec<ActionDimension>,
    },
    /// Continuous values as recorded, not cut into bins yet.
    Continuous {
        /// Names of the dimensions.
        names: Vec<String>,
    },
}

/// The word that says the other direction; the word itself where it says none.
fn opposite_word(word: &str) -> &str {
    const PAIRS: [(&str, &str); 3] = [("up", "down"), ("left", "right"), ("forward", "backward")];
    let other = |(a, b): &(&'static str, &'static str)| match word {
        _ if word == *a => Some(*b),
        _ if word == *b => Some(*a),
        _ => None,
    };
    PAIRS.iter().find_map(other).unwrap_or(word)
}

/// The word for the same on the other side; the word itself where it says no side.
fn other_side(word: &str) -> &str {
    match word {
        "left" => "right",
        "right" => "left",
        word => word,
    }
}

/// Where among names the one is in which each of the words that `_` joins is another.
fn named_otherwise(names: &[String], name: &str, other: fn(&str) -> &str) -> Option<usize> {
    let words: Vec<&str> = name.split('_').map(other).collect();
    let wanted = words.join("_");
    names.iter().position(|n| *n == wanted)
}

impl ActionSpace {
    /// For each primitive the one that undoes it, by its name: `up` and `down`, `left` and `right`,
    /// `forward` and `backward`, as one of the words that `_` joins. Empty for continuous actions.
    #[must_use]
    pub fn opposites(&self) -> Vec<Option<usize>> {
        let Self::Primitives { names } = self else {
            return Vec::new();
        };
        let opposite = |name: &String| {
            let other = named_otherwise(names, name, opposite_word);
            other.filter(|other| names[*other] != *name)
        };
        names.iter().map(opposite).collect()
    }

    /// For each primitive the one that does the same on the other side, by its name: `left` and `right` as one
    /// of the words that `_` joins; a primitive without these words is its own. None for continuous actions, and
    /// where one of the two sides is missing.
    #[must_use]
    pub fn mirrored(&self) -> Option<Vec<usize>> {
        let Self::Primitives { names } = self else {
            return None;
        };
        let other = |name: &String| named_otherwise(names, name, other_side);
        names.iter().map(other).collect()
    }

    /// For each primitive of another part the one of the base that moves the hand the same way, by its name:
    /// `end_effector_forward` and `base_forward`, `end_effector_left` and `base_turn_left`. Empty for
    /// continuous actions.
    #[must_use]
    pub fn by_base(&self) -> Vec<Option<usize>> {
        const DIRECTIONS: [&str; 4] = ["forward", "backward", "left", "right"];
        let Self::Primitives { names } = self else {
            return Vec::new();
        };
        let is_of_base = |name: &str| name.split('_').next() == Some("base");
        let direction = |name: &str| {
            let word = name.rsplit('_').next().unwrap_or_default();
            DIRECTIONS.iter().position(|direction| *direction == word)
        };
        let of_base = |name: &String| {
            let wanted = direction(name).filter(|_| !is_of_base(name))?;
            let same = |other: &String| is_of_base(other) && direction(other) == Some(wanted);
            names.iter().position(same)
        };
        names.iter().map(of_base).collect()
    }

    /// The primitive that ends an episode, by its name `terminate`; none where the robot has no such.
    #[must_use]
    pub fn terminate(&self) -> Option<Action> {
        let Self::Primitives { names } = self else {
            return None;
        };
        let index = names.iter().position(|name| name == "terminate")?;
        Some(Action::Primitive(index))
    }

    /// How many values an action has; one for a primitive, its index.
    #[must_use]
    pub fn dimension_count(&self) -> usize {
        match self {
            Self::Primitives { .. } => 1,
            Self::Binned { dimensions } => dimensions.len(),
            Self::Continuous { names } => names.len(),
        }
    }

    /// How many classes each head of a policy has: one head for primitives, one a dimension for
    /// binned actions, none for a space that is not binned yet.
    #[must_use]
    pub fn head_sizes(&self) -> Vec<usize> {
        match self {
            Self::Primitives { names } => vec![names.len()],
            Self::Binned { dimensions } => dimensions.iter().map(|d| d.bins).collect(),
            Self::Continuous { .. } => Vec::new(),
        }
    }

    /// The class of each head that stands for `action`; values beyond a dimension's range fall into
    /// its outermost bin.
    ///
    /// # Errors
    /// [`TrajectoryError::ActionOutsideSpace`] when the kind or length differs, an index is too
    /// large, a value is not finite, or the space is not binned.
    pub fn classes(&self, action: &Action) -> Result<Vec<usize>, TrajectoryError> {
        let misfit = |reason: String| TrajectoryError::ActionOutsideSpace {
            action: action.to_string(),
            space: self.to_string(),
            reason,
        };
        match (self, action) {
            (Self::Primitives { names }, Action::Primitive(index)) if *index < names.len() => {
                Ok(vec![*index])
            }
            (Self::Primitives { names }, Action::Primitive(index)) => Err(misfit(format!(
                "its index {index} is not below {}; give the space that it was recorded with",
                names.len()
            ))),
            (Self::Binned { dimensions }, Action::Continuous(values)) => {
                if values.len() != dimensions.len() {
                    return Err(misfit(format!(
                        "{} values for {} dimensions",
                        values.len(),
                        dimensions.len()
                    )));
                }
                if let Some(bad) = values.iter().find(|v| !v.is_finite()) {
                    return Err(misfit(format!("{bad} is not finite")));
                }
                Ok(dimensions
                    .iter()
                    .zip(values)
                    .map(|(d, v)| d.bin(*v))
                    .collect())
            }
            (Self::Continuous { .. }, _) => Err(misfit("the space is not binned".to_owned())),
            _ => Err(misfit("the kinds differ".to_owned())),
        }
    }

    /// The action that the classes of all heads stand for; a bin stands for its centre.
    ///
    /// # Errors
    /// [`TrajectoryError::ActionOutsideSpace`] when the number of classes or one of them does not
    /// fit, or the space is not binned.
    pub fn action(&self, classes: &[usize]) -> Result<Action, TrajectoryError> {
        let sizes = self.head_sizes();
        if sizes.is_empty()
            || classes.len() != sizes.len()
            || classes.iter().zip(&sizes).any(|(c, s)| c >= s)
        {
            return Err(TrajectoryError::ActionOutsideSpace {
                action: format!("classes {classes:?}"),
                space: self.to_string(),
                reason: format!("the heads have {sizes:?} classes"),
            });
        }
        Ok(match self {
            Self::Binned { dimensions } => Action::Continuous(
                dimensions
                    .iter()
                    .zip(classes)
                    .map(|(d, c)| d.centre(*c))
                    .collect(),
            ),
            _ => Action::Primitive(classes[0]),
        })
    }

    /// A printable name of an action: the primitive's name, or the values.
    #[must_use]
    pub fn name(&self, action: &Action) -> String {
        match (self, action) {
            (Self::Primitives { names }, Action::Primitive(i)) if *i < names.len() => {
                names[*i].clone()
            }
            _ => action.to_string(),
        }
    }
}

impl fmt::Display for ActionSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primitives { names } => write!(f, "{} primitives", names.len()),
            Self::Binned { dimensions } => write!(f, "{} binned dimensions", dimensions.len()),
            Self::Continuous { names } => write!(f, "{} continuous dimensions", names.len()),
        }
    }
}
