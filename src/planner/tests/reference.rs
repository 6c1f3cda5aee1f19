//! Shortest paths found in ways that anybody can check: petgraph on the whole product of graph and
//! stages with the current state inserted in both directions, and all simple paths of a graph.

use std::collections::HashMap;

use petgraph::algo::dijkstra;
use petgraph::graph::{DiGraph, NodeIndex};
use proptest::prelude::*;
use rand::Rng;

use super::worlds::{World, free_options, random_world, somewhere};
use crate::graph::{Edge, EdgeKind, NodeId};
use crate::planner::{EdgeChoice, FinalChoice, PlainSearch, Planner, PlannerOptions, Search};
use crate::task::Transition;

const TOLERANCE: f64 = 1e-9;

impl World {
    /// Which occurrences a node's task has, and the stage of the node at each.
    fn stages(&self, node: NodeId) -> Vec<(usize, usize)> {
        let node = self.graph.node(node);
        let mut before = 0;
        let mut stages = Vec::new();
        for (occurrence, task) in self.automaton.tasks().iter().enumerate() {
            if *task == node.task {
                stages.push((occurrence, before + node.progress as usize));
            }
            let all = self
                .automaton
                .subgoals()
                .iter()
                .filter(|s| s.task == *task)
                .count();
            before += all / self.automaton.tasks().iter().filter(|t| *t == task).count();
        }
        stages
    }

    /// The stage after entering a node at a stage, by replaying its subgoals one by one, each once.
    fn replay(&self, mut stage: usize, node: NodeId) -> usize {
        let subgoals = self.automaton.subgoals();
        let mut reached = self.graph.node(node).reached.clone();
        loop {
            let due = subgoals.get(stage);
            let Some(at) = due.and_then(|d| reached.iter().position(|s| s == d)) else {
                return stage;
            };
            reached.remove(at);
            stage += 1;
        }
    }

    fn is_final(&self, node: NodeId, occurrence: usize, stage: usize) -> bool {
        let tasks = self.automaton.tasks();
        self.graph.node(node).is_end
            && occurrence + 1 == tasks.len()
            && self.automaton.is_accepting(stage)
    }

    /// Whether a plan that holds `here = (occurrence, stage)` may enter a node at `there`, from where the
    /// robot is or by an edge from another node. What crosses from a task into itself is another round.
    fn may_go(
        &self,
        here: (usize, usize),
        to: NodeId,
        there: (usize, usize),
        by: Option<(NodeId, &Edge)>,
    ) -> bool {
        let order = match by {
            None => true,
            Some((from, edge)) => {
                let is_same_task = self.graph.node(from).task == self.graph.node(to).task;
                match edge.kind {
                    EdgeKind::Temporal => there.0 == here.0,
                    EdgeKind::Learned if is_same_task => there.0 == here.0,
                    EdgeKind::Learned | EdgeKind::CrossTask => there.0 == here.0 + 1,
                }
            }
        };
        order && there.1 >= here.1 && (here.1..=self.replay(here.1, to)).contains(&there.1)
    }

    /// The least cost from the current state to a final state: Dijkstra on the whole product with the
    /// current state inserted in both directions.
    fn petgraph_cost(&self, options: &PlannerOptions) -> Option<f64> {
        let mut product = DiGraph::<(), f64>::new();
        let mut places: HashMap<(NodeId, usize), NodeIndex> = HashMap::new();
        let nodes: Vec<NodeId> = self.graph.nodes().map(|(id, _)| id).collect();
        for &node in &nodes {
            for (occurrence, _) in self.stages(node) {
                places.insert((node, occurrence), product.add_node(()));
            }
        }
        for (a, b, edge) in self.graph.edges().filter(|(_, _, e)| uses(options, e)) {
            let Some(price) = options.cost.price_edge(edge) else {
                continue;
            };
            for here in self.stages(a) {
                for there in self.stages(b) {
                    if self.may_go(here, b, there, Some((a, edge))) {
                        let ends = (places[&(a, here.0)], places[&(b, there.0)]);
                        product.add_edge(ends.0, ends.1, price.cost);
                    }
                }
            }
        }
        let current = product.add_node(());
        for &node in &nodes {
            for there in self.stages(node) {
                let place = places[&(node, there.0)];
                let price = |row: Option<&[f32]>| row.and_then(|r| options.cost.price(r));
                if let Some(price) = price(self.distances.to(node))
                    && self.may_go((0, self.stage), node, there, None)
                {
                    product.add_edge(current, place, price.cost);
                }
                if let Some(price) = price(self.distances.from(node)) {
                    product.add_edge(place, current, price.cost);
                }
            }
        }
        let costs = dijkstra(&product, current, None, |e| *e.weight());
        nodes
            .iter()
            .flat_map(|n| self.stages(*n).into_iter().map(move |s| (*n, s)))
            .filter(|(n, (o, k))| self.is_final(*n, *o, *k))
            .filter_map(|(n, (o, _))| costs.get(&places[&(n, o)]).copied())
            .min_by(f64::total_cmp)
    }

    /// The least cost of all simple paths from a node whose subgoals, replayed, come in order.
    fn brute_force_cost(&self, options: &PlannerOptions, start: NodeId) -> Option<f64> {
        let (occurrence, stage) = *self.stages(start).first()?;
        let mut walk = Walk {
            world: self,
            options,
            on_path: vec![start],
            best: None,
        };
        walk.go_on(start, (occurrence, stage), 0.0);
        walk.best
    }
}

struct Walk<'a> {
    world: &'a World,
    options: &'a PlannerOptions,
    on_path: Vec<NodeId>,
    best: Option<f64>,
}

impl Walk<'_> {
    fn go_on(&mut self, node: NodeId, (occurrence, stage): (usize, usize), cost: f64) {
        if self.best.is_some_and(|b| b <= cost) {
            return;
        }
        if self.world.is_final(node, occurrence, stage) {
            self.best = Some(cost);
            return;
        }
        let graph = self.world.graph.clone();
        for (to, edge) in graph
            .edges_from(node)
            .filter(|(_, e)| uses(self.options, e))
        {
            let Some(price) = self.options.cost.price_edge(edge) else {
                continue;
            };
            if self.on_path.contains(&to) {
                continue;
            }
            // Without repeated tasks a node's stage is its own; what is replayed must agree with it.
            let Some(&(next, expected)) = self.world.stages(to).first() else {
                continue;
            };
            let replayed = graph.node(to).reached.iter().fold(stage, |s, subgoal| {
                match self.world.automaton.transition(s, subgoal) {
                    Transition::Advance(next) => next,
                    _ => s,
                }
            });
            // No plan goes back to an earlier task, even where no subgoal lies between.
            if replayed == expected && next >= occurrence {
                self.on_path.push(to);
                self.go_on(to, (next, replayed), cost + price.cost);
                self.on_path.pop();
            }
        }
    }
}

fn uses(options: &PlannerOptions, edge: &Edge) -> bool {
    options.edges == EdgeChoice::All || edge.kind != EdgeKind::Learned
}

fn planner(world: &World, options: &PlannerOptions) -> Option<Planner> {
    let choice = FinalChoice::Cheapest;
    Planner::new(
        world.graph.clone(),
        &world.automaton,
        &choice,
        options.clone(),
    )
    .ok()
}

fn close(a: Option<f64>, b: Option<f64>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() < TOLERANCE,
        (None, None) => true,
        _ => false,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn step_cost_equals_dijkstra_with_the_state_inserted(seed: u64, repeat: bool) {
        let mut world = random_world(seed, repeat);
        let options = free_options(&mut world.rng, Search::InOrder);
        let reference = world.petgraph_cost(&options);
        match planner(&world, &options) {
            None => prop_assert_eq!(reference, None),
            Some(planner) => {
                let localisation = somewhere(world.stage, planner.layout().stage_count());
                let goal = planner.next_goal(&localisation, &world.distances);
                prop_assert!(close(goal.as_ref().ok().map(|g| g.cost), reference));
                let plain = PlainSearch::new(&planner).cost(&localisation, &world.distances);
                prop_assert!(close(plain, reference));
                if let Err(why) = goal {
                    prop_assert!(!why.advice.is_empty());
                }
                if let Ok(plan) = planner.plan_from_start() {
                    let audit = planner.audit(&plan);
                    prop_assert!(audit.is_clean(), "{audit}");
                }
            }
        }
    }

    #[test]
    fn plans_equal_the_best_of_all_simple_paths(seed: u64) {
        let mut world = random_world(seed, false);
        let options = free_options(&mut world.rng, Search::InOrder);
        let Some(planner) = planner(&world, &options) else { return Ok(()) };
        let start = NodeId(world.rng.random_range(0..world.graph.node_count() as u32));
        let plan = planner.plan_from(start);
        let found = plan.as_ref().ok().map(|p| p.cost);
        prop_assert!(close(found, world.brute_force_cost(&options, start)));
        if let Ok(plan) = plan {
            let audit = planner.audit(&plan);
            prop_assert!(audit.is_clean(), "{audit}");
            prop_assert!(plan.stages.is_sorted());
        }
    }

    #[test]
    fn unconstrained_plans_equal_dijkstra_on_the_plain_graph(seed: u64) {
        let mut world = random_world(seed, false);
        let options = free_options(&mut world.rng, Search::Unconstrained);
        let Some(planner) = planner(&world, &options) else { return Ok(()) };
        let mut plain = world.graph.as_petgraph().filter_map(
            |_, _| Some(()),
            |_, e| uses(&options, e).then(|| options.cost.price_edge(e).map(|p| p.cost)).flatten(),
        );
        let current = plain.add_node(());
        for (id, _) in world.graph.nodes() {
            if let Some(price) = world.distances.to(id).and_then(|r| options.cost.price(r)) {
                plain.add_edge(current, NodeIndex::new(id.index()), price.cost);
            }
        }
        let costs = dijkstra(&plain, current, None, |e| *e.weight());
        let finals = planner.final_states();
        let reference = finals
            .iter()
            .filter_map(|f| costs.get(&NodeIndex::new(f.index())).copied())
            .min_by(f64::total_cmp);
        let localisation = somewhere(world.stage, planner.layout().stage_count());
        let goal = planner.next_goal(&localisation, &world.distances).ok();
        if reference.is_some() {
            prop_assert!(close(goal.map(|g| g.cost), reference));
        }
    }

    #[test]
    fn repaired_costs_equal_fresh_ones_to_the_bit(seed: u64, repeat: bool) {
        let mut world = random_world(seed, repeat);
        let options = free_options(&mut world.rng, Search::InOrder);
        let Some(mut planner) = planner(&world, &options) else { return Ok(()) };
        let nodes = world.graph.node_count() as u32;
        for _ in 0..4 {
            let to = NodeId(world.rng.random_range(0..nodes));
            let from = NodeId(world.rng.random_range(0..nodes));
            match world.rng.random_range(0..3) {
                0 => planner.recover(world.rng.random_range(0.0..1.0)),
                1 => planner.penalise(None, to, world.rng.random_range(0.0..9.0)),
                _ => planner.penalise(Some(from), to, world.rng.random_range(0.0..9.0)),
            };
            let fresh = planner.searched_anew();
            for place in planner.all_places() {
                prop_assert_eq!(planner.costs().cost(place), fresh.cost(place));
            }
        }
    }
}
