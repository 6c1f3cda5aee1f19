//! Regions as written: `{of: trash, demonstration: trash_01000032, steps: 30..40}`.

use std::ops::RangeInclusive;

use super::reader::Reader;
use super::source::{Located, Origin};
use super::yaml::Node;
use crate::task::Region;

const KEYS: &[&str] = &[
    "name",
    "of",
    "demonstration",
    "steps",
    "after",
    "before",
    "within_steps",
];

/// Most steps of a demonstration that can be named.
const MAX_STEP: u32 = 1_000_000;
/// Widest that a region grows; `d_max` bounds what edges there are.
const MAX_WITHIN: u32 = 100;

/// A region as written, with the places of its parts.
#[derive(Clone, Debug)]
pub struct RegionSpec {
    /// What it is called.
    pub name: Option<Located<String>>,
    /// The task.
    pub task: Located<String>,
    /// The one demonstration.
    pub demonstration: Option<Located<String>>,
    /// Steps, the last one included.
    pub steps: Option<Located<RangeInclusive<u32>>>,
    /// A subgoal that holds.
    pub after: Option<Located<String>>,
    /// A subgoal that does not hold yet.
    pub before: Option<Located<String>>,
    /// How far states of other demonstrations may be.
    pub within_steps: u32,
    pub(super) origin: Option<Origin>,
}

impl RegionSpec {
    /// Without the places.
    #[must_use]
    pub fn region(&self) -> Region {
        let value = |part: &Option<Located<String>>| part.as_ref().map(|p| p.value.clone());
        Region {
            name: value(&self.name),
            task: self.task.value.clone(),
            demonstration: value(&self.demonstration),
            steps: self.steps.as_ref().map(|s| s.value.clone()),
            after: value(&self.after),
            before: value(&self.before),
            within_steps: self.within_steps,
        }
    }

    fn read(node: &Node, what: &str, is_named: bool, reader: &mut Reader<'_>) -> Option<Self> {
        let fields = reader.fields(node, what, KEYS)?;
        let help = "say which task's states: '{of: sock, after: drawer_open}'";
        let task = reader
            .required(&fields, "of", help)
            .and_then(|n| reader.name(n, "the name of a task"));
        let name = if is_named {
            let help = "name what is reached by passing: 'name: at_the_shelf'";
            reader.required(&fields, "name", help)
        } else {
            fields.value("name")
        };
        let name = name.and_then(|n| reader.name(n, "the name of a region"));
        let mut text = |key: &str, what: &str| {
            let node = fields.value(key)?;
            reader.text(node, what)
        };
        let demonstration = text("demonstration", "the id of a demonstration");
        let after = text("after", "the name of a subgoal");
        let before = text("before", "the name of a subgoal");
        let steps = fields.value("steps").and_then(|n| read_steps(n, reader));
        let within_steps = fields
            .value("within_steps")
            .and_then(|n| reader.integer(n, "within_steps", &(1..=MAX_WITHIN)));
        if is_named && name.is_none() {
            return None;
        }
        Some(Self {
            name,
            task: task?,
            demonstration,
            steps,
            after,
            before,
            within_steps: within_steps.unwrap_or(0),
            origin: Some(reader.origin(&node.span)),
        })
    }
}

impl From<Region> for RegionSpec {
    /// A region that was made in Rust.
    fn from(region: Region) -> Self {
        Self {
            name: region.name.map(Located::from),
            task: region.task.into(),
            demonstration: region.demonstration.map(Located::from),
            steps: region.steps.map(Located::from),
            after: region.after.map(Located::from),
            before: region.before.map(Located::from),
            within_steps: region.within_steps,
            origin: None,
        }
    }
}

/// A list of regions; those of `via` need names.
pub(super) fn read_regions(
    node: &Node,
    key: &str,
    is_named: bool,
    reader: &mut Reader<'_>,
) -> Vec<RegionSpec> {
    let what = format!("a region of '{key}'");
    let items = reader.list(node, key).unwrap_or_default();
    items
        .iter()
        .filter_map(|item| RegionSpec::read(item, &what, is_named, reader))
        .collect()
}

/// `30`, `30..40`, `30..` or `..40`, the last step included.
fn read_steps(node: &Node, reader: &mut Reader<'_>) -> Option<Located<RangeInclusive<u32>>> {
    const HELP: &str = "write 'steps: 30..40' for steps 30 to 40, 30.. or ..40 for one bound, or 30 for one \
                        step";
    if node.as_number_text().is_some() {
        let step = reader.integer(node, "steps", &(0..=MAX_STEP))?;
        return Some(reader.located(node, step..=step));
    }
    let Some(text) = node.as_text() else {
        reader.misfit(node, "steps", "a range of steps", HELP);
        return None;
    };
    let bound = |text: &str, open: u32| match text.trim() {
        "" => Some(open),
        digits => digits.parse::<u32>().ok().filter(|step| *step <= MAX_STEP),
    };
    let range = text
        .split_once("..")
        .filter(|(a, b)| !(a.is_empty() && b.is_empty()));
    let range = range.and_then(|(a, b)| Some((bound(a, 0)?, bound(b, u32::MAX)?)));
    let Some((first, last)) = range else {
        reader.ambiguous(node, &format!("'{text}' is no range of steps"), HELP);
        return None;
    };
    if first > last {
        reader.ambiguous(
            node,
            &format!("the steps {text} end before they begin"),
            HELP,
        );
        return None;
    }
    Some(reader.located(node, first..=last))
}
