//! The states of a region, and subgoals that are reached by passing one.

use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use super::{EdgeKind, NodeId, TopologicalGraph};
use crate::task::{Region, Subgoal};

/// Why a region has no states in a graph.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RegionError {
    /// The graph has no such demonstration of the task.
    #[error("the graph has no demonstration '{demonstration}' of task '{task}'; there are {known}")]
    UnknownDemonstration {
        /// What was asked for.
        demonstration: String,
        /// The task.
        task: String,
        /// Those of the task, separated by commas.
        known: String,
    },
    /// Steps after the end of a demonstration, or of all of them.
    #[error("'{demonstration}' has no step {step}: its last one is {last}")]
    StepsBeyondEnd {
        /// The demonstration; the longest one of the task where none is named.
        demonstration: String,
        /// The first step that there is not.
        step: u32,
        /// The last step that there is.
        last: u32,
    },
    /// The task has no such subgoal.
    #[error("task '{task}' has no subgoal '{subgoal}'")]
    UnknownSubgoal {
        /// The task.
        task: String,
        /// What was asked for.
        subgoal: String,
    },
    /// No state is all that is asked for.
    #[error("no state of task '{task}' is in the region '{region}'")]
    Empty {
        /// The task.
        task: String,
        /// The region in words.
        region: String,
    },
}

/// The states of a region, by id; `subgoals` are those of its task, in order, as the graph's
/// [`progress`](super::Node::progress) counts them.
///
/// # Errors
/// [`RegionError`] when a part of it is not in the graph, or there is no state in it.
pub fn states_in(
    graph: &TopologicalGraph,
    region: &Region,
    subgoals: &[Subgoal],
) -> Result<Vec<NodeId>, RegionError> {
    check(graph, region)?;
    let held = |name: &String| {
        let place = subgoals.iter().position(|s| s.name == *name);
        place.ok_or_else(|| RegionError::UnknownSubgoal {
            task: region.task.clone(),
            subgoal: name.clone(),
        })
    };
    let after = region.after.as_ref().map(held).transpose()?;
    let before = region.before.as_ref().map(held).transpose()?;
    let is_between = |progress: usize| {
        after.is_none_or(|place| progress > place) && before.is_none_or(|place| progress <= place)
    };
    let nodes = graph.nodes().filter(|(_, node)| {
        node.task == region.task
            && region
                .demonstration
                .as_ref()
                .is_none_or(|id| *id == node.trajectory)
            && region
                .steps
                .as_ref()
                .is_none_or(|steps| steps.contains(&node.step))
            && is_between(node.progress as usize)
    });
    let mut states: BTreeSet<NodeId> = nodes.map(|(id, _)| id).collect();
    if region.within_steps > 0 {
        let near = alike(graph, &states, region.within_steps);
        states.extend(near.into_iter().filter(|id| {
            let node = graph.node(*id);
            node.task == region.task && is_between(node.progress as usize)
        }));
    }
    if states.is_empty() {
        return Err(RegionError::Empty {
            task: region.task.clone(),
            region: region.to_string(),
        });
    }
    Ok(states.into_iter().collect())
}

/// Whether the graph has the demonstration and the steps that a region names.
fn check(graph: &TopologicalGraph, region: &Region) -> Result<(), RegionError> {
    let mut last_steps: BTreeMap<&str, u32> = BTreeMap::new();
    for (_, node) in graph.nodes().filter(|(_, n)| n.task == region.task) {
        let last = last_steps.entry(&node.trajectory).or_insert(0);
        *last = node.step.max(*last);
    }
    if let Some(id) = &region.demonstration {
        if !last_steps.contains_key(id.as_str()) {
            let known: Vec<&str> = last_steps.into_keys().collect();
            return Err(RegionError::UnknownDemonstration {
                demonstration: id.clone(),
                task: region.task.clone(),
                known: known.join(", "),
            });
        }
        last_steps.retain(|known, _| known == id);
    }
    let longest = last_steps.into_iter().max_by_key(|(_, last)| *last);
    let (Some(steps), Some((demonstration, last))) = (&region.steps, longest) else {
        return Ok(());
    };
    // An open range ends where the demonstration does.
    let furthest = if *steps.end() == u32::MAX {
        *steps.start()
    } else {
        *steps.end()
    };
    if furthest > last {
        return Err(RegionError::StepsBeyondEnd {
            demonstration: demonstration.to_owned(),
            step: (*steps.start()).max(last + 1),
            last,
        });
    }
    Ok(())
}

/// States to which a learned edge of at most so many steps leads from one of these, and from which one leads
/// back to one of these.
fn alike(graph: &TopologicalGraph, states: &BTreeSet<NodeId>, steps: u32) -> BTreeSet<NodeId> {
    let mut left = BTreeSet::new();
    let mut entered = BTreeSet::new();
    let edges = graph.edges();
    for (from, to, _) in edges.filter(|(_, _, e)| e.kind == EdgeKind::Learned && e.steps <= steps) {
        if states.contains(&from) {
            entered.insert(to);
        }
        if states.contains(&to) {
            left.insert(from);
        }
    }
    entered.intersection(&left).copied().collect()
}

/// Makes passing a region a subgoal: in each demonstration its marker stands at the first state of the
/// region at which `at` subgoals of its task hold, and from there on it counts as reached. Where a
/// demonstration does not pass, it is not reached before the next subgoal is, which thus skips it.
///
/// Returns the states between the two subgoals, or before the first one, of demonstrations that do not pass: a
/// robot there cannot be told from one that has passed, so they are best left out
/// ([`Terms::unplaced`](crate::planner::Terms::unplaced)).
///
/// # Panics
/// If a state is not in the graph.
pub fn mark_subgoal(
    graph: &mut TopologicalGraph,
    subgoal: &Subgoal,
    at: usize,
    region: &[NodeId],
) -> Vec<NodeId> {
    let at = at as u32;
    let mut entered: BTreeMap<String, u32> = BTreeMap::new();
    for id in region {
        let node = graph.node(*id);
        if node.task == subgoal.task && node.progress == at {
            let step = entered.entry(node.trajectory.clone()).or_insert(node.step);
            *step = node.step.min(*step);
        }
    }
    let mut beside = Vec::new();
    let nodes = (0..).map(NodeId).zip(graph.nodes_mut());
    for (id, node) in nodes.filter(|(_, n)| n.task == subgoal.task) {
        let step = entered.get(&node.trajectory);
        if step == Some(&node.step) && node.progress == at {
            node.reached.push(subgoal.clone());
        }
        if step.is_none() && node.progress == at {
            beside.push(id);
        }
        let has_passed = node.progress == at && step.is_some_and(|step| *step <= node.step);
        if node.progress > at || has_passed {
            node.progress += 1;
        }
    }
    beside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Edge;
    use crate::graph::fakes::{add_demonstration, task};

    /// Two demonstrations of six steps with subgoals at 2 and 5; the second runs beside the first.
    fn graph() -> TopologicalGraph {
        let walk = task("walk", &["first", "second"]);
        let mut graph = TopologicalGraph::new(1, 5);
        for id in ["w0", "w1"] {
            let places: Vec<Vec<f32>> = (0..6).map(|x| vec![x as f32]).collect();
            add_demonstration(&mut graph, &walk, id, &places, &[2, 5]);
        }
        graph
    }

    fn steps(graph: &TopologicalGraph, region: &Region) -> Result<Vec<String>, RegionError> {
        let subgoals = task("walk", &["first", "second"]).subgoals;
        let states = states_in(graph, region, &subgoals)?;
        Ok(states.iter().map(|id| graph.node(*id).place()).collect())
    }

    #[test]
    fn all_that_is_said_must_hold() {
        let graph = graph();
        let region = Region::of("walk").demonstration("w1").steps(1..=3);
        assert_eq!(steps(&graph, &region).unwrap(), ["w1:1", "w1:2", "w1:3"]);
        assert_eq!(
            steps(&graph, &region.after("first")).unwrap(),
            ["w1:2", "w1:3"]
        );
        let between = Region::of("walk")
            .after("first")
            .before("second")
            .steps(4..=5);
        assert_eq!(steps(&graph, &between).unwrap(), ["w0:4", "w1:4"]);
    }

    #[test]
    fn states_that_are_alike_lie_between_states_of_the_region() {
        let mut graph = graph();
        let alike = Edge::predicted(EdgeKind::Learned, &[0.9, 0.0, 0.0, 0.0, 0.1]);
        graph.add_edge(NodeId(0), NodeId(7), alike.clone());
        graph.add_edge(NodeId(7), NodeId(1), alike.clone());
        graph.add_edge(NodeId(1), NodeId(8), alike);
        let region = Region::of("walk")
            .demonstration("w0")
            .steps(0..=1)
            .within_steps(1);
        assert_eq!(steps(&graph, &region).unwrap(), ["w0:0", "w0:1", "w1:1"]);
    }

    #[test]
    fn what_is_not_there_is_named() {
        let graph = graph();
        let told = |region: &Region| steps(&graph, region).unwrap_err().to_string();
        let region = Region::of("walk").demonstration("w7");
        assert!(
            told(&region).ends_with("there are w0, w1"),
            "{}",
            told(&region)
        );
        let region = Region::of("walk").demonstration("w0").steps(4..=9);
        assert_eq!(told(&region), "'w0' has no step 6: its last one is 5");
        let region = Region::of("walk").after("third");
        assert_eq!(told(&region), "task 'walk' has no subgoal 'third'");
        let region = Region::of("walk").before("first").steps(3..=4);
        assert!(told(&region).starts_with("no state of task 'walk'"));
    }

    #[test]
    fn passing_is_reached_where_a_demonstration_enters() {
        let mut graph = graph();
        let door = Subgoal {
            task: "walk".to_owned(),
            name: "door".to_owned(),
        };
        let beside = mark_subgoal(&mut graph, &door, 1, &[NodeId(3), NodeId(4)]);
        assert_eq!(
            beside,
            [8, 9, 10].map(NodeId),
            "of the one that does not pass"
        );
        let progress: Vec<u32> = graph.nodes().map(|(_, n)| n.progress).collect();
        assert_eq!(progress, [0, 0, 1, 2, 2, 3, 0, 0, 1, 1, 1, 3]);
        assert!(graph.node(NodeId(3)).reaches(std::slice::from_ref(&door)));
        assert!(!graph.node(NodeId(4)).reaches(&[door]));
    }
}
