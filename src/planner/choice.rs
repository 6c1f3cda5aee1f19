use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::layout::subgoal_count;
use super::{Layout, PlaceId, PlannerError, Search};
use crate::graph::{NodeId, TopologicalGraph};
use crate::task::Automaton;

/// Which end state of the last task a plan leads to.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FinalChoice {
    /// Whichever is cheapest from where the robot is; may change on the way.
    #[default]
    Cheapest,
    /// The one that is cheapest from the starts of the first task, for the whole run.
    Nearest,
    /// All of them: any is fine, and a robot that seems to be at one has arrived, whichever its plan leads
    /// to.
    All,
    /// The end of the demonstration with this id (Fu & Finn, section III-D).
    Demonstration(String),
}

/// The places at which a plan may end: last states of demonstrations of the last task, with all
/// subgoals reached where the search asks for subgoals.
fn final_places(
    graph: &TopologicalGraph,
    automaton: &Automaton,
    layout: &Layout,
    choice: &FinalChoice,
) -> Result<Vec<PlaceId>, PlannerError> {
    let task = automaton.tasks().last().ok_or(PlannerError::NoTask)?;
    let last = layout
        .places()
        .iter()
        .filter(|p| graph.node(p.node).task == *task);
    let occurrence = last.map(|p| p.occurrence).max().unwrap_or(0);
    let is_accepted =
        |stage| automaton.is_accepting(stage) || layout.search() == Search::Unconstrained;
    let ends: Vec<PlaceId> = (0..layout.places().len() as u32)
        .map(PlaceId)
        .filter(|id| {
            let place = layout.place(*id);
            let node = graph.node(place.node);
            node.is_end && node.task == *task && place.occurrence == occurrence
        })
        .collect();
    let finals: Vec<PlaceId> = ends
        .iter()
        .copied()
        .filter(|id| is_accepted(layout.place(*id).stage))
        .collect();
    if finals.is_empty() {
        return Err(PlannerError::NoFinalState {
            task: task.clone(),
            ends: ends.len(),
            subgoals: subgoal_count(automaton, task),
        });
    }
    match choice {
        FinalChoice::Cheapest | FinalChoice::Nearest | FinalChoice::All => Ok(finals),
        FinalChoice::Demonstration(id) => one_demonstration(graph, layout, task, &finals, id),
    }
}

/// Those of them that are not avoided.
pub(super) fn open_final_places(
    graph: &TopologicalGraph,
    automaton: &Automaton,
    layout: &Layout,
    choice: &FinalChoice,
    avoided: &HashSet<NodeId>,
) -> Result<Vec<PlaceId>, PlannerError> {
    let mut places = final_places(graph, automaton, layout, choice)?;
    places.retain(|place| !avoided.contains(&layout.place(*place).node));
    Ok(places)
}

fn one_demonstration(
    graph: &TopologicalGraph,
    layout: &Layout,
    task: &str,
    finals: &[PlaceId],
    id: &str,
) -> Result<Vec<PlaceId>, PlannerError> {
    let trajectory = |p: &PlaceId| graph.node(layout.place(*p).node).trajectory.as_str();
    let wanted = finals.iter().copied().filter(|p| trajectory(p) == id);
    let wanted: Vec<PlaceId> = wanted.collect();
    if wanted.is_empty() {
        return Err(PlannerError::UnknownDemonstration {
            demonstration: id.to_owned(),
            task: task.to_owned(),
            known: finals.iter().map(trajectory).collect::<Vec<_>>().join(", "),
        });
    }
    Ok(wanted)
}
