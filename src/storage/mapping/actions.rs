//! What becomes of the actions of a recording: names, dimensions that are kept, several in one.

use std::path::Path;

use super::{Combine, Mapping, StorageError, suggestion};
use crate::trajectory::{Action, ActionSpace};

/// How the actions of a recording become those of a trajectory.
#[derive(Clone, Debug)]
pub(in crate::storage) struct ActionShape {
    /// The space of the trajectory's actions.
    pub space: ActionSpace,
    /// Which values are kept, in order, and what several of them become; none for motion primitives.
    kept: Vec<(usize, Combine)>,
}

impl ActionShape {
    /// All dimensions, and of several actions the last.
    pub fn whole(space: &ActionSpace) -> Self {
        let dimensions = match space {
            ActionSpace::Primitives { .. } => 0,
            ActionSpace::Continuous { names } => names.len(),
            ActionSpace::Binned { dimensions } => dimensions.len(),
        };
        Self {
            space: space.clone(),
            kept: (0..dimensions).map(|i| (i, Combine::Last)).collect(),
        }
    }

    /// The one action that successive actions of one step become.
    ///
    /// Motion primitives cannot be put together; there is one of them a step.
    pub fn combined(&self, actions: &[Action]) -> Option<Action> {
        let last = actions.last()?;
        if self.kept.is_empty() {
            return Some(last.clone());
        }
        let mut combined = Vec::with_capacity(self.kept.len());
        for (place, combine) in &self.kept {
            let mut values = actions.iter().filter_map(|action| match action {
                Action::Continuous(values) => values.get(*place).copied(),
                Action::Primitive(_) => None,
            });
            combined.push(match combine {
                Combine::Last => values.next_back()?,
                Combine::First => values.next()?,
                Combine::Sum => values.sum(),
                Combine::Mean => values.sum::<f32>() / actions.len() as f32,
            });
        }
        Some(Action::Continuous(combined))
    }
}

/// What a mapping makes of the actions of a recording.
pub(super) fn shape(
    mapping: &Mapping,
    recording: &Path,
    space: &ActionSpace,
) -> Result<ActionShape, StorageError> {
    let spec = &mapping.spec.actions;
    let ActionSpace::Continuous { names } = space else {
        let are = format!("the actions of {} are {space}", recording.display());
        if let Some(list) = spec.names.as_ref().or(spec.keep.as_ref()) {
            let help = "Their names are known: leave 'names' and 'keep' out";
            return Err(mapping.fault(list, are, help));
        }
        if let Some((key, place)) = spec.of_values() {
            let message = format!("{are}, to which '{key}' does not apply");
            let help = format!(
                "Only values that are not in bins yet are put together and cut: leave '{key}' out"
            );
            return Err(mapping.fault(&place, message, help));
        }
        return Ok(ActionShape::whole(space));
    };
    let mut names = names.clone();
    if let Some(own) = &spec.names {
        if own.value.len() != names.len() {
            let message = format!(
                "names lists {} dimensions, the actions of {} have {} values",
                own.value.len(),
                recording.display(),
                names.len()
            );
            let help = "Name all values in order; 'keep' says which of them are used";
            return Err(mapping.fault(own, message, help));
        }
        names.clone_from(&own.value);
    }
    let place = |name: &String| names.iter().position(|n| n == name);
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let unknown = |name: &str| {
        let message = format!(
            "the actions of {} have no dimension '{name}'",
            recording.display()
        );
        (message, suggestion("dimension", name, &known))
    };
    if let Some((name, dimension)) = spec.dimensions.iter().find(|(n, _)| place(n).is_none()) {
        let (message, help) = unknown(name);
        return Err(mapping.fault(dimension, message, help));
    }
    let kept = match &spec.keep {
        None => names.clone(),
        Some(keep) => {
            if let Some(name) = keep.value.iter().find(|n| place(n).is_none()) {
                let (message, help) = unknown(name);
                return Err(mapping.fault(keep, message, help));
            }
            keep.value.clone()
        }
    };
    let dropped = spec.dimensions.iter().find(|(n, _)| !kept.contains(n));
    if let Some((name, dimension)) = dropped {
        let message = format!("'{name}' is described, but 'keep' leaves it out");
        let help = "Remove its description, or keep it";
        return Err(mapping.fault(dimension, message, help));
    }
    Ok(ActionShape {
        kept: kept
            .iter()
            .filter_map(|name| Some((place(name)?, spec.combine(name))))
            .collect(),
        space: ActionSpace::Continuous { names: kept },
    })
}
