use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use super::metadata::Metadata;
use super::observation::observation;
use super::reply::{Context, Over, Reply};
use super::{Conversation, Message, Service};
use crate::planner::Localisation;
use crate::rollout::{Controller, Decision, EpisodeEnd};
use crate::trajectory::{ActionSpace, CameraSpec};

/// Answers the observations of a robot with the actions that carry out a composition. Each connection is an
/// episode of its own; model and graph are shared.
pub struct PolicyService<'a> {
    controller: Controller<'a>,
    cameras: Vec<CameraSpec>,
    space: ActionSpace,
    metadata: Vec<u8>,
}

/// What a [`PolicyService`] tells clients of itself, beyond what its controller knows.
#[derive(Clone, Debug, Default)]
pub struct PolicyLabel {
    /// The composition's name.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Digest of the model.
    pub model: String,
    /// Digest of each task's graph.
    pub graphs: Vec<String>,
    /// What runs the networks.
    pub engine: String,
}

impl<'a> PolicyService<'a> {
    /// A service whose connections each get a clone of `controller`, reset.
    #[must_use]
    pub fn new(controller: Controller<'a>, label: &PolicyLabel) -> Self {
        let spec = controller.spec();
        let automaton = controller.planner().automaton();
        let metadata = Metadata {
            server: "catena",
            version: env!("CARGO_PKG_VERSION"),
            composition: &label.name,
            description: &label.description,
            cameras: &spec.cameras,
            action_space: &spec.action_space,
            tasks: automaton.tasks(),
            subgoals: automaton.subgoals(),
            step_limit: controller.options().max_steps,
            model: &label.model,
            graphs: &label.graphs,
            engine: &label.engine,
        };
        Self {
            metadata: super::pack(&metadata),
            cameras: spec.cameras.clone(),
            space: spec.action_space.clone(),
            controller,
        }
    }
}

impl Service for PolicyService<'_> {
    fn metadata(&self) -> Vec<u8> {
        self.metadata.clone()
    }

    fn converse(&self) -> Box<dyn Conversation + Send + '_> {
        let mut controller = self.controller.clone();
        controller.reset(0);
        Box::new(Robot {
            service: self,
            controller,
            end: None,
        })
    }
}

impl fmt::Debug for PolicyService<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PolicyService")
            .field("controller", &self.controller)
            .finish_non_exhaustive()
    }
}

/// A robot that is driven over one connection.
struct Robot<'a> {
    service: &'a PolicyService<'a>,
    controller: Controller<'a>,
    /// How its episode ended, until it is reset.
    end: Option<(EpisodeEnd, Box<Localisation>)>,
}

impl Conversation for Robot<'_> {
    fn answer(&mut self, message: &[u8]) -> Result<Vec<u8>, String> {
        let begun = Instant::now();
        let message = Message::read(message).map_err(|e| e.to_string())?;
        // All that may be wrong with a message is found before anything of it counts.
        let observation = observation(&message, &self.service.cameras)?;
        if let Some(seed) = message.reset()? {
            self.controller.reset(seed);
            self.end = None;
        }
        let mut news = Vec::new();
        if self.end.is_none() {
            let stepping = Instant::now();
            let decision = self.controller.step(Arc::new(observation));
            let step_ms = in_ms(stepping);
            match decision.map_err(|e| e.to_string())? {
                Decision::Act(record) => {
                    let mut reply = self.context().act(&record);
                    reply.server_timing.step_ms = step_ms;
                    return Ok(packed(reply, begun));
                }
                Decision::End {
                    end,
                    events,
                    localisation,
                } => {
                    self.end = Some((end, localisation));
                    news = events;
                }
            }
        }
        let over = self.end.as_ref().map(|(end, localisation)| Over {
            end,
            events: &news,
            localisation,
            step: self.controller.step_count(),
        });
        let over = over.ok_or("an episode neither goes on nor ends")?;
        Ok(packed(self.context().over(&over), begun))
    }
}

impl Robot<'_> {
    fn context(&self) -> Context<'_> {
        let planner = self.controller.planner();
        Context {
            graph: planner.graph(),
            automaton: planner.automaton(),
            space: &self.service.space,
        }
    }
}

fn packed(mut reply: Reply<'_>, begun: Instant) -> Vec<u8> {
    reply.server_timing.infer_ms = in_ms(begun);
    super::pack(&reply)
}

fn in_ms(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}
