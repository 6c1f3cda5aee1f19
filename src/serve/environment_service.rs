use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use super::{ArrayOf, Conversation, Message, Service, pack};
use crate::environment::Environment;
use crate::trajectory::{Action, ActionSpace, CameraSpec, Observation};

/// A simulated robot that knows what really happened, for those who judge a policy.
pub trait Simulated: Environment {
    /// What became of each subgoal so far, in order: its name, and `reached`, `skipped` or `missed`. Clients get those
    /// of a later round of a task under `NAME#2` and so on.
    fn outcomes(&self) -> Vec<(String, String)>;

    /// Whether every subgoal was reached in its order.
    fn has_succeeded(&self) -> bool;
}

/// Answers actions with observations: a simulated robot for programs in other languages. Each connection
/// has a robot of its own.
pub struct EnvironmentService<'a> {
    make: Box<dyn Fn() -> Box<dyn Simulated + Send> + Sync + 'a>,
    metadata: Vec<u8>,
}

#[derive(Serialize)]
struct Metadata<'a> {
    server: &'static str,
    version: &'static str,
    environment: &'a str,
    cameras: &'a [CameraSpec],
    action_space: &'a ActionSpace,
    subgoals: Vec<String>,
}

#[derive(Serialize)]
struct Seen<'a> {
    observation: BTreeMap<&'a str, ArrayOf<'a>>,
    /// Actions since the reset.
    step: usize,
    subgoals: BTreeMap<String, String>,
    success: bool,
    server_timing: Timing,
}

#[derive(Serialize)]
struct Timing {
    step_ms: f64,
}

impl<'a> EnvironmentService<'a> {
    /// A service whose connections each get what `make` makes; `name` is for the metadata.
    #[must_use]
    pub fn new(name: &str, make: impl Fn() -> Box<dyn Simulated + Send> + Sync + 'a) -> Self {
        let first = make();
        let metadata = Metadata {
            server: "catena",
            version: env!("CARGO_PKG_VERSION"),
            environment: name,
            cameras: &first.cameras(),
            action_space: &first.action_space(),
            subgoals: by_round(first.outcomes())
                .into_iter()
                .map(|o| o.0)
                .collect(),
        };
        Self {
            metadata: pack(&metadata),
            make: Box::new(make),
        }
    }
}

impl Service for EnvironmentService<'_> {
    fn metadata(&self) -> Vec<u8> {
        self.metadata.clone()
    }

    fn converse(&self) -> Box<dyn Conversation + Send + '_> {
        Box::new(World {
            robot: (self.make)(),
            step: None,
        })
    }
}

struct World {
    robot: Box<dyn Simulated + Send>,
    /// Actions since the reset; none before the first one.
    step: Option<usize>,
}

impl Conversation for World {
    fn answer(&mut self, message: &[u8]) -> Result<Vec<u8>, String> {
        let begun = Instant::now();
        let message = Message::read(message).map_err(|e| e.to_string())?;
        let observation = if let Some(seed) = message.reset()? {
            let seen = self.robot.reset(seed).map_err(|e| e.to_string())?;
            self.step = Some(0);
            seen
        } else {
            let action = message.get("action").ok_or(
                "neither `reset` nor `action` in the message: send {\"reset\": True, \"seed\": 1} or {\"action\": ...}",
            )?;
            let action = action_of(action, &self.robot.action_space())?;
            let step = self
                .step
                .as_mut()
                .ok_or("the episode has not begun: send {\"reset\": True, \"seed\": 1} first")?;
            let seen = self.robot.step(&action).map_err(|e| e.to_string())?;
            *step += 1;
            seen
        };
        Ok(pack(&Seen {
            observation: arrays(&observation),
            step: self.step.unwrap_or_default(),
            subgoals: by_round(self.robot.outcomes()).into_iter().collect(),
            success: self.robot.has_succeeded(),
            server_timing: Timing {
                step_ms: begun.elapsed().as_secs_f64() * 1e3,
            },
        }))
    }
}

/// Outcomes under names that tell rounds of the same task apart: `trash/can_in_bin`, then `trash/can_in_bin#2`.
fn by_round(outcomes: Vec<(String, String)>) -> Vec<(String, String)> {
    let mut rounds: BTreeMap<String, usize> = BTreeMap::new();
    let named = outcomes.into_iter().map(|(name, outcome)| {
        let round = rounds.entry(name.clone()).or_default();
        *round += 1;
        match *round {
            1 => (name, outcome),
            round => (format!("{name}#{round}"), outcome),
        }
    });
    named.collect()
}

fn arrays(observation: &Observation) -> BTreeMap<&str, ArrayOf<'_>> {
    observation
        .iter()
        .map(|(name, image)| {
            let shape = vec![image.height() as usize, image.width() as usize, 3];
            (name, ArrayOf::Bytes(image.rgb(), shape))
        })
        .collect()
}

/// An action as clients send it: a primitive's index or name, or the values as a list or an array (of any
/// shape: a policy answers with one row).
fn action_of(message: &Message<'_>, space: &ActionSpace) -> Result<Action, String> {
    let refused = || match space {
        ActionSpace::Primitives { names } => format!(
            "`action` is {}: send an index below {} or one of {}",
            message.kind(),
            names.len(),
            names.join(", ")
        ),
        _ => format!(
            "`action` is {}: send {} finite numbers",
            message.kind(),
            space.dimension_count()
        ),
    };
    let values = match message {
        Message::Text(name) => {
            let ActionSpace::Primitives { names } = space else {
                return Err(refused());
            };
            let index = names
                .iter()
                .position(|n| n == name)
                .ok_or_else(|| format!("no primitive '{name}': there are {}", names.join(", ")))?;
            return Ok(Action::Primitive(index));
        }
        Message::Integer(value) => vec![*value as f64],
        Message::Float(value) => vec![*value],
        Message::Array(array) => array.values().ok_or_else(refused)?,
        Message::List(list) => list
            .iter()
            .map(|value| match value {
                Message::Integer(value) => Some(*value as f64),
                Message::Float(value) => Some(*value),
                _ => None,
            })
            .collect::<Option<_>>()
            .ok_or_else(refused)?,
        _ => return Err(refused()),
    };
    // Of what is too large for an action nothing finite is left.
    let is_finite = |value: &f64| (*value as f32).is_finite();
    let is_sound = values.len() == space.dimension_count() && values.iter().all(is_finite);
    match space {
        ActionSpace::Primitives { names } => values
            .first()
            .filter(|v| is_sound && v.fract() == 0.0 && (0.0..names.len() as f64).contains(*v))
            .map(|v| Action::Primitive(*v as usize))
            .ok_or_else(refused),
        _ if is_sound => Ok(Action::Continuous(
            values.iter().map(|v| *v as f32).collect(),
        )),
        _ => Err(refused()),
    }
}
