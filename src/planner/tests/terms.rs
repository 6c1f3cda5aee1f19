//! Where plans start, what they avoid, and what is said of them.

use std::ops::RangeInclusive;
use std::sync::Arc;

use proptest::prelude::*;
use rand::Rng;

use super::corridor::{automaton, learned, merged, node_at, seen_from, tasks};
use super::worlds::{free_options, random_world, somewhere};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph, mark_subgoal, states_in};
use crate::planner::{
    AvoidedRegion, EdgeChoice, Explanation, FilterOptions, FinalChoice, Gap, Plan, Planner,
    PlannerError, PlannerOptions, Search, Start, Terms, settle_order,
};
use crate::task::{Automaton, Order, OrderAutomaton, Region, Subgoal, Task};

fn options() -> PlannerOptions {
    PlannerOptions {
        edges: EdgeChoice::All,
        ..PlannerOptions::default()
    }
}

fn avoiding(states: &[NodeId]) -> Terms {
    Terms {
        avoid: vec![AvoidedRegion {
            name: "the puddle".to_owned(),
            states: states.to_vec(),
        }],
        ..Terms::default()
    }
}

fn starting(start: Start) -> Terms {
    Terms {
        start,
        ..Terms::default()
    }
}

fn corridor_planner(terms: Terms) -> Planner {
    Planner::new(Arc::new(merged()), &automaton(), terms, options())
        .expect("the corridor has both tasks")
}

/// After how many steps each state of a plan is reached, by its edges one after the other.
fn arrivals(planner: &Planner, plan: &Plan) -> Vec<u32> {
    let mut steps = 0;
    let beyond = plan.route.windows(2).map(|pair| {
        let edge = planner.graph().edge(pair[0], pair[1]);
        let price = planner
            .options()
            .cost
            .price_edge(edge.expect("a plan follows edges"));
        steps += price.expect("it is planned").steps;
        steps
    });
    [0].into_iter().chain(beyond).collect()
}

/// All states of a task of the corridor at a step of their demonstrations.
fn across(graph: &TopologicalGraph, task: &str, step: u32) -> Vec<NodeId> {
    let region = Region::of(task).steps(step..=step);
    states_in(graph, &region, &[]).expect("there are three")
}

/// The corridor with edges that lead from an end of each task back to the start of `a`.
fn around() -> Arc<TopologicalGraph> {
    let mut graph = merged();
    let start = node_at(&graph, "a2", 0);
    for demonstration in ["a0", "b0"] {
        let end = node_at(&graph, demonstration, 19);
        graph.add_edge(end, start, learned(EdgeKind::CrossTask, 1, 0.9));
    }
    Arc::new(graph)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// Avoiding states is planning on the graph without them.
    #[test]
    fn avoiding_is_planning_without_the_states(seed: u64) {
        let mut world = random_world(seed, true);
        let options = free_options(&mut world.rng, Search::InOrder);
        let nodes: Vec<NodeId> = world.graph.nodes().map(|(id, _)| id).collect();
        let avoided: Vec<NodeId> =
            nodes.into_iter().filter(|_| world.rng.random_bool(0.15)).collect();
        let mut thinned = TopologicalGraph::new(1, world.graph.d_max());
        for (id, node) in world.graph.nodes() {
            thinned.add_node(node.clone(), world.graph.latents().row(id.index()));
        }
        let is_open = |id: NodeId| !avoided.contains(&id);
        for (from, to, edge) in world.graph.edges().filter(|(a, b, _)| is_open(*a) && is_open(*b)) {
            thinned.add_edge(from, to, edge.clone());
        }
        let plan = |graph: Arc<TopologicalGraph>, terms: Terms| {
            Planner::new(graph, &world.automaton, terms, options.clone()).ok()
        };
        let without = plan(Arc::new(thinned), Terms::default());
        let finals = without.map(|p| (p.final_states(), p));
        let ends_open = finals.as_ref().is_some_and(|(ends, _)| ends.iter().all(|n| is_open(*n)));
        // Where a final state is avoided, the other graph still has it as an end that costs nothing.
        prop_assume!(finals.is_none() || ends_open);
        let with = plan(world.graph.clone(), avoiding(&avoided));
        match (with, finals) {
            (None, None) => {}
            (Some(with), Some((_, without))) => {
                let (a, b) = (with.plan_from_start(), without.plan_from_start());
                prop_assert_eq!(a.as_ref().ok().map(|p| p.cost), b.ok().map(|p| p.cost));
                if let Ok(plan) = a {
                    prop_assert!(plan.route.iter().all(|n| is_open(*n)));
                }
                let localisation = somewhere(world.stage, with.layout().stage_count());
                if let Ok(goal) = with.next_goal(&localisation, &world.distances) {
                    prop_assert!(is_open(goal.node));
                }
            }
            (with, without) => prop_assert!(false, "{} {}", with.is_some(), without.is_some()),
        }
    }

    /// What is said of a plan adds up to the plan.
    #[test]
    fn parts_and_ends_add_up(seed: u64) {
        let mut world = random_world(seed, true);
        let options = free_options(&mut world.rng, Search::InOrder);
        let planner = Planner::new(
            world.graph.clone(), &world.automaton, &FinalChoice::Cheapest, options,
        );
        let Ok(planner) = planner else { return Ok(()) };
        let order = world.automaton.tasks().iter().map(|t| Order::Task(t.clone())).collect();
        let orders = OrderAutomaton::new(&Order::InOrder(order)).expect("it is small");
        let Ok(explained) = Explanation::new(&planner, &orders, &[], None) else {
            prop_assert!(planner.plan_from_start().is_err());
            return Ok(())
        };
        let plan = planner.plan_from_start().expect("it was explained");
        let cost: f64 = explained.parts.iter().map(|p| p.cost).sum();
        let steps: u32 = explained.parts.iter().map(|p| p.steps).sum();
        let holds: f64 = explained.parts.iter().map(|p| p.probability).product();
        prop_assert!((cost - plan.cost).abs() < 1e-6, "{} for {}", cost, plan.cost);
        prop_assert_eq!(steps, plan.steps);
        prop_assert_eq!(&plan.arrival_steps, &arrivals(&planner, &plan));
        prop_assert_eq!(plan.arrival_steps.last(), Some(&plan.steps));
        prop_assert!((holds - explained.odds.probability).abs() < 1e-9);
        for ends in &explained.ends {
            let chosen: Vec<_> = ends.candidates.iter().filter(|c| c.is_chosen).collect();
            prop_assert_eq!(chosen.len(), 1, "{:?}", ends);
            let total = chosen[0].total().expect("the plan leads on");
            prop_assert!((total - plan.cost).abs() < 1e-6, "{:?}", ends);
            for other in &ends.candidates {
                prop_assert!(other.total().is_none_or(|t| t > total - 1e-6), "{:?}", ends);
            }
        }
        prop_assert!(!explained.to_string().is_empty());
    }
}

#[test]
fn no_way_around_what_is_avoided_is_said_with_its_name() {
    let graph = merged();
    let planner = corridor_planner(avoiding(&across(&graph, "a", 12)));
    // An edge of fewer than five steps leads past a single step.
    assert!(planner.plan_from_start().is_ok());
    let region = Region::of("a").steps(10..=15);
    let wall = states_in(&graph, &region, &[]).expect("they are there");
    let why = corridor_planner(avoiding(&wall))
        .plan_from_start()
        .unwrap_err();
    assert_eq!(why.blocked_by, ["the puddle"]);
    assert!(why.to_string().contains("avoided: the puddle"), "{why}");
    let ends: Vec<NodeId> = graph
        .nodes()
        .filter(|(_, n)| n.is_end)
        .map(|(id, _)| id)
        .collect();
    let refused = Planner::new(Arc::new(graph), &automaton(), avoiding(&ends), options());
    assert!(matches!(
        refused,
        Err(PlannerError::FinalStatesAvoided { .. })
    ));
}

#[test]
fn what_is_passed_is_a_subgoal_between_the_others() {
    let mut graph = merged();
    let [a, b] = tasks();
    let window = Subgoal {
        task: "b".to_owned(),
        name: "window".to_owned(),
    };
    let region = Region::of("b").demonstration("b1").steps(2..=4);
    let states = states_in(&graph, &region, &b.subgoals).expect("they are there");
    let beside = mark_subgoal(&mut graph, &window, 0, &states);
    // Before their first subgoal at 8 the two others have eight states each.
    assert_eq!(beside.len(), 16);
    let mut passing = b;
    passing.subgoals.insert(0, window);
    let automaton = Automaton::in_order(&[a, passing]);
    let graph = Arc::new(graph);
    let terms = Terms {
        unplaced: beside.clone(),
        ..Terms::default()
    };
    let planner = Planner::new(graph.clone(), &automaton, terms, options());
    let planner = planner.expect("both tasks are there");
    let plan = planner.plan_from_start().expect("a way leads through b1");
    assert!(
        plan.route.contains(&node_at(&graph, "b1", 2)),
        "{:?}",
        plan.route
    );
    assert!(planner.audit(&plan).is_clean());
    assert!(plan.route.iter().all(|node| !beside.contains(node)));
    // A robot that passes is seen to, though others saw the same without.
    let mut filter = planner.stage_filter(FilterOptions::default());
    let mut stages = Vec::new();
    for x in 0..46 {
        let position = x.min(39) as f32;
        stages.push(filter.update(&seen_from(&graph, position)).stage);
    }
    assert!(stages.is_sorted(), "{stages:?}");
    assert_eq!(
        (stages[21], stages[26], stages[45]),
        (2, 3, 5),
        "{stages:?}"
    );
}

#[test]
fn a_region_that_is_passed_at_once_leaves_the_robot_at_its_start() {
    let mut graph = merged();
    let [mut a, b] = tasks();
    let door = Subgoal {
        task: "a".to_owned(),
        name: "door".to_owned(),
    };
    let region = Region::of("a").demonstration("a1").steps(0..=2);
    let states = states_in(&graph, &region, &a.subgoals).expect("they are there");
    let unplaced = mark_subgoal(&mut graph, &door, 0, &states);
    a.subgoals.insert(0, door);
    let both = [a, b];
    let automaton = Automaton::in_order(&both);
    let graph = Arc::new(graph);
    for start in [Start::Beginning, Start::Anywhere] {
        let terms = Terms {
            unplaced: unplaced.clone(),
            ..starting(start)
        };
        let names = both.each_ref().map(|t| Order::Task(t.name.clone()));
        let orders = OrderAutomaton::new(&Order::InOrder(names.to_vec())).expect("it is small");
        let settled = settle_order(&graph, &orders, &both, None, (&terms, &options()));
        let planner = Planner::new(graph.clone(), &automaton, terms, options());
        let planner = planner.expect("both tasks are there");
        let plan = planner.plan_from_start().expect("the corridor is open");
        assert_eq!(plan.stages[0], 1);
        let settled = settled.expect("both tasks are there").map(|s| s.cost);
        assert!(settled.is_some_and(|cost| (cost - plan.cost).abs() < 1e-6));
    }
    let terms = Terms {
        unplaced,
        ..Terms::default()
    };
    let planner = Planner::new(graph.clone(), &automaton, terms, options());
    let planner = planner.expect("both tasks are there");
    let filter = planner.stage_filter(FilterOptions::default());
    assert_eq!(filter.stage(), 1);
    let places = planner.layout().places_of(node_at(&graph, "a1", 0));
    let begun: f64 = places.map(|place| filter.probability(place)).sum();
    assert!(begun > 0.1, "{begun}");
}

#[test]
fn a_region_at_the_start_of_a_task_is_no_leap_from_the_task_before() {
    let mut graph = merged();
    let [a, mut b] = tasks();
    let door = Subgoal {
        task: "b".to_owned(),
        name: "door".to_owned(),
    };
    let region = Region::of("b").demonstration("b1").steps(0..=2);
    let states = states_in(&graph, &region, &b.subgoals).expect("they are there");
    let terms = Terms {
        unplaced: mark_subgoal(&mut graph, &door, 0, &states),
        ..Terms::default()
    };
    b.subgoals.insert(0, door);
    let both = [a, b];
    let automaton = Automaton::in_order(&both);
    let names = both.each_ref().map(|t| Order::Task(t.name.clone()));
    let orders = OrderAutomaton::new(&Order::InOrder(names.to_vec())).expect("it is small");
    let settled = settle_order(&graph, &orders, &both, None, (&terms, &options()));
    let settled = settled.expect("both tasks are there").expect("a way");
    let planner = Planner::new(Arc::new(graph), &automaton, terms, options());
    let planner = planner.expect("both tasks are there");
    let plan = planner
        .plan_from_start()
        .expect("the seam leads to where b1 begins");
    assert!(plan.route.contains(&node_at(planner.graph(), "b1", 0)));
    assert!((plan.cost - settled.cost).abs() < 1e-6);
}

#[test]
fn a_robot_that_may_start_anywhere_is_taken_to_be_where_it_sees_that_it_is() {
    let planner = corridor_planner(starting(Start::Anywhere));
    let mut filter = planner.stage_filter(FilterOptions::default());
    let mut seen = filter.update(&seen_from(planner.graph(), 12.0));
    for x in [13.0, 14.0, 15.0, 16.0] {
        seen = filter.update(&seen_from(planner.graph(), x));
    }
    assert_eq!((seen.stage, seen.change), (1, None));
    let plan = planner.plan_from_start().expect("the corridor is open");
    assert_eq!(plan.stages[0], 0);
    let beginning = corridor_planner(Terms::default());
    assert!(plan.cost < beginning.plan_from_start().expect("the same").cost);
}

#[test]
fn a_robot_that_goes_on_from_a_stage_is_there_and_nowhere_before() {
    let planner = corridor_planner(starting(Start::Stage(2)));
    let plan = planner.plan_from_start().expect("the corridor is open");
    assert_eq!(plan.stages[0], 2);
    let first = planner.graph().node(plan.route[0]);
    assert_eq!((first.task.as_str(), first.step), ("a", 19));
    assert!(planner.audit(&plan).is_clean());
    let mut filter = planner.stage_filter(FilterOptions::default());
    assert_eq!(filter.stage(), 2);
    let seen = filter.update(&seen_from(planner.graph(), 23.0));
    assert_eq!((seen.stage, seen.change), (2, None));
    assert_eq!(planner.graph().node(seen.node).task, "b");
    let refused = Planner::new(
        planner.graph().clone(),
        &automaton(),
        starting(Start::Stage(5)),
        options(),
    );
    assert!(matches!(
        refused,
        Err(PlannerError::UnknownStage {
            stage: 5,
            subgoals: 4
        })
    ));
}

#[test]
fn a_plan_after_another_task_begins_at_its_end() {
    let [_, b] = tasks();
    let second = Automaton::in_order(&[b]);
    let graph = Arc::new(merged());
    let after = |task: &str| {
        let terms = starting(Start::After(task.to_owned()));
        Planner::new(graph.clone(), &second, terms, options())
    };
    let planner = after("a").expect("both tasks are there");
    let plan = planner.plan_from_start().expect("a seam leads over");
    let [first, next] = [0, 1].map(|i| graph.node(plan.route[i]));
    assert!(
        first.is_end && first.task == "a" && next.task == "b",
        "{first:?} {next:?}"
    );
    assert!(planner.audit(&plan).is_clean());
    assert_eq!(plan.arrival_steps, arrivals(&planner, &plan));
    assert_eq!(plan.arrival_steps.last(), Some(&plan.steps));
    let alone = Planner::new(graph.clone(), &second, &FinalChoice::Cheapest, options());
    let alone = alone
        .expect("b is there")
        .plan_from_start()
        .expect("b is whole");
    assert!(plan.steps > alone.steps - 5 && plan.cost > alone.cost - 5.0);
    // The robot is believed where edges lead from the end of the other task.
    let mut filter = planner.stage_filter(FilterOptions::default());
    let seen = filter.update(&seen_from(&graph, 22.0));
    assert_eq!(graph.node(seen.node).task, "b");
    assert!(matches!(after("c"), Err(PlannerError::UnknownStart { .. })));
}

#[test]
fn the_end_of_a_task_before_the_plan_counts_for_nothing_though_the_task_is_done_again() {
    let graph = around();
    let [a, b] = tasks();
    for order in [[b.clone(), a.clone()], [a, b]] {
        let automaton = Automaton::in_order(&order);
        let terms = starting(Start::After("a".to_owned()));
        let planner = Planner::new(graph.clone(), &automaton, terms, options());
        let planner = planner.expect("both tasks are there");
        let mut plan = planner.plan_from_start().expect("a seam leads over");
        assert!(plan.begins_before && graph.node(plan.route[0]).is_end);
        let audit = planner.audit(&plan);
        assert!(audit.is_clean() && audit.setbacks.is_empty(), "{audit:?}");
        assert_eq!(audit.reached, automaton.subgoals());
        plan.route.truncate(2);
        assert_eq!(planner.audit(&plan).missed, automaton.subgoals());
    }
}

#[test]
fn what_keeps_a_plan_from_beginning_at_the_end_of_a_task_is_said() {
    let [a, b] = tasks();
    let told = |graph: TopologicalGraph, task: &Task, terms: Terms| {
        let automaton = Automaton::in_order(std::slice::from_ref(task));
        let planner = Planner::new(Arc::new(graph), &automaton, terms, options());
        planner
            .expect("both tasks are there")
            .plan_from_start()
            .unwrap_err()
    };
    // All edges from the ends of `a` lead to the first five states of `b`.
    let graph = merged();
    let region = Region::of("b").steps(0..=5);
    let states = states_in(&graph, &region, &[]).expect("they are there");
    let terms = Terms {
        start: Start::After("a".to_owned()),
        ..avoiding(&states)
    };
    let why = told(graph, &b, terms);
    assert_eq!(why.blocked_by, ["the puddle"]);
    assert!(why.to_string().contains("avoided: the puddle"), "{why}");
    // No edge leads back, and then one that leads too far.
    let back = || starting(Start::After("b".to_owned()));
    let why = told(merged(), &a, back());
    assert!(why.gap.is_none() && why.advice.starts_with("No edge"));
    let mut graph = merged();
    let [end, far] = [("b0", 19), ("a0", 8)].map(|(id, step)| node_at(&graph, id, step));
    graph.add_edge(end, far, learned(EdgeKind::CrossTask, 1, 0.9));
    let why = told(graph, &a, back());
    assert_eq!(why.gap.as_ref().map(Gap::ends), Some((end, far)));
    assert!(why.advice.contains("forward_leap_steps"), "{why}");
}

#[test]
fn the_largest_leap_is_as_good_as_any() {
    let planned = |forward_leap_steps| {
        let options = PlannerOptions {
            forward_leap_steps,
            ..options()
        };
        let planner = Planner::new(Arc::new(merged()), &automaton(), Terms::default(), options);
        let planner = planner.expect("the corridor has both tasks");
        planner
            .plan_from_start()
            .expect("a way leads over the seam")
    };
    assert_eq!(planned(Some(u32::MAX)), planned(None));
}

#[test]
fn where_regions_overlap_one_blocks_as_long_as_the_other_is_avoided() {
    let graph = merged();
    let region = |name: &str, steps: RangeInclusive<u32>| AvoidedRegion {
        name: name.to_owned(),
        states: states_in(&graph, &Region::of("a").steps(steps), &[]).expect("they are there"),
    };
    let terms = Terms {
        avoid: vec![region("the puddle", 10..=15), region("the carpet", 8..=17)],
        ..Terms::default()
    };
    let why = corridor_planner(terms).plan_from_start().unwrap_err();
    // Without the carpet the puddle on it is in the way all the same.
    assert_eq!(why.blocked_by, ["the puddle", "the carpet"]);
}

#[test]
fn a_region_in_which_ends_lie_that_could_be_got_to_is_in_the_way() {
    let graph = merged();
    let region = |name: &str, states: &[(&str, u32)]| AvoidedRegion {
        name: name.to_owned(),
        states: states
            .iter()
            .map(|(id, step)| node_at(&graph, id, *step))
            .collect(),
    };
    // Along demonstrations alone: two of three ends lie in the puddle, and the way to the third over the carpet.
    let terms = Terms {
        avoid: vec![
            region("the puddle", &[("a1", 19), ("a2", 19)]),
            region("the carpet", &[("a0", 12)]),
        ],
        ..Terms::default()
    };
    let [a, _] = tasks();
    let automaton = Automaton::in_order(&[a]);
    let along = PlannerOptions::default();
    let planner = Planner::new(Arc::new(graph.clone()), &automaton, terms, along);
    let why = planner
        .expect("an end is left")
        .plan_from_start()
        .unwrap_err();
    assert_eq!(why.blocked_by, ["the puddle", "the carpet"]);
}

#[test]
fn a_task_that_was_done_is_done_again_from_an_edge_that_joins_its_end_to_its_start() {
    let [a, _] = tasks();
    let again = Automaton::in_order(std::slice::from_ref(&a));
    let terms = starting(Start::After("a".to_owned()));
    let mut graph = merged();
    let [end, other, start] =
        [("a0", 19), ("a1", 0), ("a2", 0)].map(|(id, step)| node_at(&graph, id, step));
    graph.add_edge(end, other, learned(EdgeKind::Learned, 1, 0.99));
    let planned = |graph: &TopologicalGraph| {
        let planner = Planner::new(Arc::new(graph.clone()), &again, &terms, options());
        planner.expect("a is there").plan_from_start()
    };
    let orders = OrderAutomaton::new(&Order::Task("a".to_owned())).expect("it is small");
    let settled = |graph: &TopologicalGraph| {
        let tasks = std::slice::from_ref(&a);
        let settled = settle_order(graph, &orders, tasks, None, (&terms, &options()));
        settled.expect("a is there")
    };
    let why = planned(&graph).unwrap_err();
    assert!(why.advice.starts_with("No edge leads from an end"), "{why}");
    assert_eq!(settled(&graph), None);
    graph.add_edge(end, start, learned(EdgeKind::CrossTask, 1, 0.7));
    let plan = planned(&graph).expect("an edge leads to the start");
    assert_eq!(plan.route[..2], [end, start]);
    assert!(plan.begins_before);
    let cost = settled(&graph).map(|settled| settled.cost);
    assert!(cost.is_some_and(|cost| (cost - plan.cost).abs() < 1e-6));
}

#[test]
fn a_plan_that_begins_in_a_second_round_is_judged_by_that_round() {
    let [a, _] = tasks();
    let automaton = Automaton::in_order(&[a.clone(), a]);
    let terms = starting(Start::Stage(3));
    let planner = Planner::new(around(), &automaton, terms, options()).expect("a is there");
    let plan = planner.plan_from_start().expect("the corridor is open");
    assert_eq!((plan.stages[0], plan.stages.last()), (3, Some(&4)));
    let audit = planner.audit(&plan);
    assert!(audit.is_clean(), "{audit:?}");
    assert_eq!(audit.reached, automaton.subgoals());
}

#[test]
fn the_papers_plan_goes_on_in_a_later_round_though_each_task_is_laid_out_once() {
    let [a, b] = tasks();
    for (order, stage) in [
        (vec![a.clone(), a.clone()], 3),
        (vec![a.clone(), b, a.clone()], 5),
    ] {
        let automaton = Automaton::in_order(&order);
        let terms = starting(Start::Stage(stage));
        let planner = Planner::new(around(), &automaton, terms, PlannerOptions::paper());
        let planner = planner.expect("both tasks are there");
        let plan = planner.plan_from_start().expect("the corridor is open");
        let first = planner.graph().node(plan.route[0]);
        assert_eq!((first.task.as_str(), first.step), ("a", 8));
        let audit = planner.audit(&plan);
        assert!(audit.is_clean(), "{audit:?}");
        assert_eq!(audit.reached, automaton.subgoals());
    }
}

#[test]
fn the_papers_plan_begins_at_the_end_of_a_later_round_and_not_within_the_next_task() {
    let [a, b] = tasks();
    // The four subgoals of both rounds are as many as hold where `b` begins.
    let automaton = Automaton::in_order(&[a.clone(), a, b]);
    for options in [PlannerOptions::paper(), options()] {
        let terms = starting(Start::Stage(4));
        let planner = Planner::new(around(), &automaton, terms, options);
        let planner = planner.expect("both tasks are there");
        let plan = planner.plan_from_start().expect("the corridor is open");
        let first = planner.graph().node(plan.route[0]);
        assert_eq!((first.task.as_str(), first.step), ("a", 19));
    }
}

#[test]
fn the_ends_of_a_last_task_are_counted_also_where_each_task_is_laid_out_once() {
    let [a, b] = tasks();
    let rounds = [[a.clone(), b.clone(), a.clone()], [a.clone(), a, b]];
    for (order, last) in rounds.iter().zip(["a", "b"]) {
        let automaton = Automaton::in_order(order);
        let choice = &FinalChoice::Cheapest;
        let planner = Planner::new(around(), &automaton, choice, PlannerOptions::paper());
        let names = automaton.tasks().iter().map(|t| Order::Task(t.clone()));
        let orders = OrderAutomaton::new(&Order::InOrder(names.collect())).expect("it is small");
        let planner = planner.expect("both tasks are there");
        let explained = Explanation::new(&planner, &orders, &[], None).expect("a way leads there");
        let [ends] = &explained.ends[..] else {
            panic!("{:?}", explained.ends)
        };
        assert_eq!((ends.task.as_str(), ends.occurrence), (last, 2));
        assert_eq!((ends.end_states, ends.leading_on), (3, 3));
    }
}

#[test]
fn orders_that_end_with_the_final_task_are_explained_behind_many_that_do_not() {
    let planner = corridor_planner(Terms::default());
    let parts = ["a", "b", "c", "d", "e", "f"].map(|name| Order::Task(name.to_owned()));
    let orders = OrderAutomaton::new(&Order::AnyOrder(parts.to_vec())).expect("it is small");
    let explained = Explanation::new(&planner, &orders, &[], Some("a")).expect("a way");
    let orders = explained.orders;
    // As many as are planned: that of the plan, and others, none of which connects without its tasks.
    assert_eq!((orders.planned, orders.connected), (64, 1));
    let mut others = orders.listed.iter().filter(|order| !order.is_chosen);
    assert!(others.all(|order| order.tasks.last().is_some_and(|task| task == "a")));
}

#[test]
fn orders_that_leave_optional_parts_out_are_marked_in_the_list() {
    let planner = corridor_planner(Terms::default());
    let [a, b] = ["a", "b"].map(|name| Order::Task(name.to_owned()));
    let order = Order::InOrder(vec![Order::Optional(Box::new(a)), b]);
    let orders = OrderAutomaton::new(&order).expect("it is small");
    let explained = Explanation::new(&planner, &orders, &tasks(), None).expect("a way");
    let listed = &explained.orders.listed;
    let left_out = |is_chosen: bool| {
        let mut listed = listed.iter().filter(|order| order.is_chosen == is_chosen);
        listed.next().map(|order| order.left_out)
    };
    assert_eq!((left_out(true), left_out(false)), (Some(0), Some(1)));
    let told = explained.orders.to_string();
    assert_eq!(
        told.matches("leaves out 1 optional part\n").count(),
        1,
        "{told}"
    );
}

#[test]
fn at_any_end_a_robot_has_arrived_where_all_ends_will_do() {
    let arrived = |end: FinalChoice| {
        let planner = corridor_planner(Terms {
            end,
            ..Terms::default()
        });
        let mut localisation = somewhere(4, 5);
        // Believed two steps before the end of its demonstration, it stands where another one ends.
        localisation.node = node_at(planner.graph(), "b0", 17);
        localisation.occurrence = 1;
        let distances = seen_from(planner.graph(), 39.2);
        planner
            .next_goal(&localisation, &distances)
            .expect("a way leads on")
            .has_arrived
    };
    assert!(arrived(FinalChoice::All));
    assert!(!arrived(FinalChoice::Demonstration("b0".to_owned())));
}
