use std::fmt;

use serde::{Deserialize, Serialize};

use crate::trajectory::{Action, ActionSpace};

/// What a gripper is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripperEvent {
    /// From open to closed.
    Close,
    /// From closed to open.
    Open,
}

impl fmt::Display for GripperEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Close => "close",
            Self::Open => "open",
        })
    }
}

/// Which actions close and open the gripper: it depends on the robot's action space, so it is data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripperSignal {
    /// Two motion primitives, by name.
    Primitives {
        /// The one that closes.
        close: String,
        /// The one that opens.
        open: String,
    },
    /// A dimension of continuous actions.
    Dimension {
        /// Its name.
        name: String,
        /// The value between closed and open, in the dimension's own unit.
        threshold: f32,
        /// Whether values below the threshold mean closed; otherwise those above it do.
        closed_below: bool,
    },
}

impl Default for GripperSignal {
    /// The primitives `gripper_close` and `gripper_open`.
    fn default() -> Self {
        Self::Primitives {
            close: "gripper_close".to_owned(),
            open: "gripper_open".to_owned(),
        }
    }
}

impl fmt::Display for GripperSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primitives { close, open } => write!(f, "the primitives '{close}' and '{open}'"),
            Self::Dimension {
                name,
                threshold,
                closed_below,
            } => {
                let side = if *closed_below { "below" } else { "above" };
                write!(f, "dimension '{name}' (closed {side} {threshold})")
            }
        }
    }
}

impl GripperSignal {
    /// All changes of what the gripper is told, each with the step whose action tells it.
    ///
    /// Telling it the same again is no event. A primitive that comes first is one; the first value of
    /// a dimension is not, since it only says how the gripper starts. None when the action space lacks
    /// what the signal is read off.
    #[must_use]
    pub fn events<'a>(
        &self,
        space: &ActionSpace,
        actions: impl IntoIterator<Item = &'a Action>,
    ) -> Option<Vec<(usize, GripperEvent)>> {
        let reader = self.reader(space)?;
        let mut now = None;
        let mut events = Vec::new();
        for (step, action) in actions.into_iter().enumerate() {
            let Some(told) = reader.told(action) else {
                continue;
            };
            let is_start = now.is_none() && matches!(reader, Reader::Value { .. });
            if now != Some(told) && !is_start {
                events.push((step, told));
            }
            now = Some(told);
        }
        Some(events)
    }

    /// The primitives that close and open the gripper, as classes; none where that is read off a value.
    #[must_use]
    pub fn classes(&self, space: &ActionSpace) -> Vec<usize> {
        match self.reader(space) {
            Some(Reader::Index { close, open }) => vec![close, open],
            Some(Reader::Value { .. }) | None => Vec::new(),
        }
    }

    fn reader(&self, space: &ActionSpace) -> Option<Reader> {
        match self {
            Self::Primitives { close, open } => {
                let ActionSpace::Primitives { names } = space else {
                    return None;
                };
                let index = |name: &String| names.iter().position(|n| n == name);
                Some(Reader::Index {
                    close: index(close)?,
                    open: index(open)?,
                })
            }
            Self::Dimension {
                name,
                threshold,
                closed_below,
            } => {
                let place = match space {
                    ActionSpace::Primitives { .. } => None,
                    ActionSpace::Binned { dimensions } => {
                        dimensions.iter().position(|d| &d.name == name)
                    }
                    ActionSpace::Continuous { names } => names.iter().position(|n| n == name),
                }?;
                Some(Reader::Value {
                    place,
                    threshold: *threshold,
                    closed_below: *closed_below,
                })
            }
        }
    }
}

/// A signal with its names looked up in an action space.
enum Reader {
    Index {
        close: usize,
        open: usize,
    },
    Value {
        place: usize,
        threshold: f32,
        closed_below: bool,
    },
}

impl Reader {
    /// What an action tells the gripper; nothing where it says nothing of it.
    fn told(&self, action: &Action) -> Option<GripperEvent> {
        match (self, action) {
            (Self::Index { close, .. }, Action::Primitive(i)) if i == close => {
                Some(GripperEvent::Close)
            }
            (Self::Index { open, .. }, Action::Primitive(i)) if i == open => {
                Some(GripperEvent::Open)
            }
            (
                Self::Value {
                    place,
                    threshold,
                    closed_below,
                },
                Action::Continuous(values),
            ) => {
                let value = values.get(*place).filter(|v| v.is_finite())?;
                Some(if (value < threshold) == *closed_below {
                    GripperEvent::Close
                } else {
                    GripperEvent::Open
                })
            }
            _ => None,
        }
    }
}
