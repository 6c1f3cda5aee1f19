//! A planner that a test can check by hand.

use std::sync::Arc;

use super::{FinalChoice, Planner, PlannerOptions};
use crate::graph::TopologicalGraph;
use crate::graph::fakes::{add_demonstration, task};
use crate::task::Automaton;

/// A planner for a corridor in which three demonstrations reach a subgoal every 8 steps, and end at the last.
pub(crate) fn corridor(subgoals: &[&str]) -> Planner {
    let walk = task("walk", subgoals);
    let reached: Vec<usize> = (1..=subgoals.len()).map(|number| 8 * number).collect();
    let mut graph = TopologicalGraph::new(3, 5);
    for aside in 0..3 {
        let place = |x: usize| vec![x as f32, 0.1 * aside as f32, 0.0];
        let places: Vec<Vec<f32>> = (0..=8 * subgoals.len()).map(place).collect();
        add_demonstration(&mut graph, &walk, &aside.to_string(), &places, &reached);
    }
    Planner::new(
        Arc::new(graph),
        &Automaton::in_order(&[walk]),
        &FinalChoice::Cheapest,
        PlannerOptions::default(),
    )
    .expect("the corridor has a composition")
}
