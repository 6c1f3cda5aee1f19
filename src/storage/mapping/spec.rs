//! A mapping file as written.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_yaml::Spanned;

use crate::trajectory::{Binning, Decoding, DimensionBinning, Spacing};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MappingSpec {
    pub recordings: Spanned<OneOrMany>,
    pub task: Option<Spanned<String>>,
    #[serde(default)]
    pub topics: TopicsSpec,
    pub rate_hz: Option<Spanned<f64>>,
    pub every: Option<Spanned<usize>>,
    pub image_size: Option<Spanned<Size>>,
    pub image_sizes: Option<BTreeMap<String, Spanned<Size>>>,
    #[serde(default)]
    pub actions: ActionsSpec,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TopicsSpec {
    /// Topics, or features of a LeRobot dataset, by the name of the camera.
    pub cameras: Option<BTreeMap<String, Spanned<String>>>,
    pub action: Option<Spanned<String>>,
    pub task: Option<Spanned<String>>,
    pub subgoal: Option<Spanned<String>>,
}

/// Rows and columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::storage) struct Size {
    pub height: u32,
    pub width: u32,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActionsSpec {
    pub names: Option<Spanned<Vec<String>>>,
    pub keep: Option<Spanned<Vec<String>>>,
    pub combine: Option<Spanned<Combine>>,
    pub bins: Option<Spanned<usize>>,
    pub spacing: Option<Spanned<Spacing>>,
    pub decoding: Option<Spanned<Decoding>>,
    #[serde(default)]
    pub dimensions: BTreeMap<String, Spanned<DimensionSpec>>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DimensionSpec {
    pub bins: Option<usize>,
    pub spacing: Option<Spacing>,
    pub decoding: Option<Decoding>,
    pub low: Option<f32>,
    pub high: Option<f32>,
    pub combine: Option<Combine>,
}

/// What several actions of one step become.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::storage) enum Combine {
    /// The last one: for targets, such as positions of joints.
    #[default]
    Last,
    First,
    /// Their sum: for ways to go, such as changes of a pose.
    Sum,
    /// Their mean: for velocities.
    Mean,
}

impl ActionsSpec {
    /// What the dimension of this name becomes where several actions make one.
    pub fn combine(&self, dimension: &str) -> Combine {
        let own = self.dimensions.get(dimension);
        let own = own.and_then(|d| d.value.combine);
        own.or(said(self.combine.as_ref())).unwrap_or_default()
    }

    /// The first key that says how continuous values are put together or cut, with its place.
    pub fn of_values(&self) -> Option<(&'static str, Spanned<()>)> {
        let combine = self.combine.as_ref().map(|s| ("combine", place(s)));
        let bins = self.bins.as_ref().map(|s| ("bins", place(s)));
        let spacing = self.spacing.as_ref().map(|s| ("spacing", place(s)));
        let decoding = self.decoding.as_ref().map(|s| ("decoding", place(s)));
        let dimensions = self.dimensions.values().next();
        let dimensions = dimensions.map(|s| ("dimensions", place(s)));
        let all = [combine, bins, spacing, decoding, dimensions];
        all.into_iter().flatten().next()
    }

    pub fn binning(&self, bins: usize) -> Binning {
        let default = DimensionBinning {
            bins: said(self.bins.as_ref()).unwrap_or(bins),
            spacing: said(self.spacing.as_ref()).unwrap_or_default(),
            low: None,
            high: None,
            decoding: said(self.decoding.as_ref()).unwrap_or_default(),
        };
        let own = |spec: &DimensionSpec| DimensionBinning {
            bins: spec.bins.unwrap_or(default.bins),
            spacing: spec.spacing.unwrap_or(default.spacing),
            low: spec.low,
            high: spec.high,
            decoding: spec.decoding.unwrap_or(default.decoding),
        };
        let dimensions = self.dimensions.iter();
        Binning {
            dimensions: dimensions
                .map(|(name, spec)| (name.clone(), own(&spec.value)))
                .collect(),
            default,
        }
    }
}

/// What a key says, if it is given.
fn said<T: Copy>(key: Option<&Spanned<T>>) -> Option<T> {
    key.map(|key| key.value)
}

/// Where a value stands.
fn place<T>(value: &Spanned<T>) -> Spanned<()> {
    Spanned::new((), value.referenced, value.defined)
}

/// One text or a list of them.
#[derive(Clone, Debug)]
pub(super) struct OneOrMany(pub Vec<String>);

impl<'de> Deserialize<'de> for OneOrMany {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Paths;

        impl<'de> Visitor<'de> for Paths {
            type Value = OneOrMany;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a path or a list of paths")
            }

            fn visit_str<E>(self, path: &str) -> Result<Self::Value, E> {
                Ok(OneOrMany(vec![path.to_owned()]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut paths = Vec::new();
                while let Some(path) = list.next_element()? {
                    paths.push(path);
                }
                Ok(OneOrMany(paths))
            }
        }

        deserializer.deserialize_any(Paths)
    }
}
