//! Plans, audits, and answers when there is no plan, in the corridor.

use std::sync::Arc;

use super::corridor::{automaton, learned, merged, node_at, tasks};
use crate::graph::fakes::{add_demonstration, task};
use crate::graph::{EdgeKind, PruneOptions, TopologicalGraph, prune};
use crate::planner::{
    EdgeChoice, FinalChoice, Gap, Layout, Planner, PlannerError, PlannerOptions, Search,
    SuspectEdge, audit, suspects,
};
use crate::task::Automaton;

fn planner(graph: &Arc<TopologicalGraph>, options: PlannerOptions) -> Planner {
    let choice = FinalChoice::Cheapest;
    Planner::new(graph.clone(), &automaton(), &choice, options).expect("the corridor fits")
}

fn all_edges() -> PlannerOptions {
    PlannerOptions {
        edges: EdgeChoice::All,
        ..PlannerOptions::default()
    }
}

/// The corridor with a false edge from the start of `a` to its end.
fn with_wormhole() -> Arc<TopologicalGraph> {
    let mut graph = merged();
    let (from, to) = (node_at(&graph, "a0", 1), node_at(&graph, "a1", 19));
    graph.add_edge(from, to, learned(EdgeKind::Learned, 2, 0.97));
    Arc::new(graph)
}

#[test]
fn plan_walks_both_tasks_in_order() {
    let graph = Arc::new(merged());
    let plan = planner(&graph, PlannerOptions::default())
        .plan_from_start()
        .expect("a way");
    let audit = audit(&graph, &automaton(), &plan.route);
    assert!(audit.is_clean() && audit.reached.len() == 4);
    assert_eq!(
        (plan.stages.first(), plan.stages.last()),
        (Some(&0), Some(&4))
    );
    assert!((36..=40).contains(&plan.steps), "{}", plan.steps);
}

#[test]
fn what_lies_behind_an_edge_of_several_steps_is_reached_so_much_later() {
    let order = [task("walk", &["there"]), task("rest", &["done"])];
    let mut graph = TopologicalGraph::new(1, 5);
    let [walk, rest] = [("w0", 0.0), ("r0", 4.0)].map(|(id, start)| {
        let task = &order[usize::from(id == "r0")];
        add_demonstration(
            &mut graph,
            task,
            id,
            &[vec![start], vec![start + 1.0]],
            &[1],
        )
    });
    let seam = learned(EdgeKind::CrossTask, 3, 0.9);
    graph.add_edge(walk[1], rest[0], seam);
    let automaton = Automaton::in_order(&order);
    let options = PlannerOptions::default();
    let planner = Planner::new(Arc::new(graph), &automaton, &FinalChoice::Cheapest, options);
    let planner = planner.expect("both tasks are there");
    let plan = planner.plan_from_start().expect("the seam leads over");
    assert_eq!(plan.route, [walk[0], walk[1], rest[0], rest[1]]);
    assert_eq!(
        (&plan.arrival_steps[..], plan.steps),
        (&[0, 1, 4, 5][..], 5)
    );
}

#[test]
fn wormhole_is_a_shortcut_that_only_the_unconstrained_plan_takes() {
    let graph = with_wormhole();
    let paper = planner(&graph, PlannerOptions::paper());
    let plan = paper.plan_from_start().expect("a way");
    let found = paper.audit(&plan);
    assert_eq!(found.shortcuts.len(), 1);
    let shortcut = &found.shortcuts[0];
    assert_eq!(shortcut.skipped, vec![tasks()[0].subgoals[0].clone()]);
    assert_eq!(shortcut.edge.kind, Some(EdgeKind::Learned));
    assert_eq!(
        (
            shortcut.edge.from_state.as_str(),
            shortcut.edge.to_state.as_str()
        ),
        ("a0:1", "a1:19")
    );
    assert!((shortcut.edge.connected_probability - 0.97).abs() < 1e-5);
    assert!(
        found
            .to_string()
            .contains("skips first by the learned edge a0:1 -> a1:19")
    );

    let ordered = planner(&graph, all_edges());
    let plan = ordered.plan_from_start().expect("a way");
    assert!(ordered.audit(&plan).is_clean());
}

#[test]
fn an_edge_without_support_is_planned_only_where_that_is_allowed() {
    let graph = with_wormhole();
    let alone = (node_at(&graph, "a0", 1), node_at(&graph, "a1", 19));
    let takes_it = |min_support| {
        let options = PlannerOptions {
            predicted_edges: PruneOptions {
                min_support,
                ..PruneOptions::default()
            },
            ..PlannerOptions::paper()
        };
        let planner = planner(&graph, options);
        let plan = planner.plan_from(alone.0).expect("a way");
        assert_eq!(planner.may_use(alone.0, alone.1), plan.route[1] == alone.1);
        plan.route[1] == alone.1
    };
    assert!(takes_it(0));
    assert!(!takes_it(1));
}

#[test]
fn a_seam_that_the_options_leave_out_is_named() {
    let options = PlannerOptions {
        predicted_edges: PruneOptions {
            min_probability: 0.99,
            ..PruneOptions::default()
        },
        ..PlannerOptions::default()
    };
    let why = planner(&Arc::new(merged()), options)
        .plan_from_start()
        .unwrap_err();
    assert_eq!(why.cut_off, tasks()[1].subgoals);
    assert!(
        why.to_string().contains("predicted_edges leaves it out"),
        "{why}"
    );
}

#[test]
fn edges_that_claim_to_gain_much_are_suspects() {
    let graph = with_wormhole();
    let found = suspects(&graph, &tasks(), 10.0);
    assert_eq!(found.len(), 1, "{found:?}");
    let wormhole = &found[0];
    assert_eq!(wormhole.edge.from_state, "a0:1");
    assert_eq!((wormhole.edge.steps, wormhole.progress_steps), (2, 18.0));
    assert_eq!(wormhole.skipped, vec![tasks()[0].subgoals[0].clone()]);
    let all = suspects(&graph, &tasks(), -100.0);
    let gains: Vec<f32> = all.iter().map(SuspectEdge::gain_steps).collect();
    assert!(gains.is_sorted_by(|a, b| a >= b), "the largest gain first");
    let predicted = graph.edges().filter(|e| e.2.kind != EdgeKind::Temporal);
    assert_eq!(all.len(), predicted.count());
}

#[test]
fn forward_leap_within_a_stage_is_not_planned() {
    let mut graph = merged();
    let (from, to) = (node_at(&graph, "a0", 9), node_at(&graph, "a0", 18));
    graph.add_edge(from, to, learned(EdgeKind::Learned, 1, 1.0));
    let graph = Arc::new(graph);
    let leaps = |forward_leap_steps| {
        let options = PlannerOptions {
            forward_leap_steps,
            ..all_edges()
        };
        let plan = planner(&graph, options).plan_from(from).expect("a way");
        plan.route[1] == to
    };
    assert!(leaps(None));
    assert!(!leaps(Some(3)));
}

#[test]
fn missing_seam_is_explained_by_its_nearest_miss() {
    let cut = prune(
        &merged(),
        &PruneOptions {
            min_probability: 0.99,
            ..PruneOptions::default()
        },
    );
    let unseamed = Arc::new(cut.clone());
    let why = planner(&unseamed, PlannerOptions::default())
        .plan_from_start()
        .unwrap_err();
    assert_eq!(why.reachable_stage, 2);
    assert_eq!(why.cut_off, tasks()[1].subgoals);
    let Some(Gap::Latents { from, to, .. }) = why.gap else {
        panic!("{:?}", why.gap)
    };
    assert_eq!((unseamed.node(from).step, unseamed.node(to).step), (19, 0));

    let mut weak = cut;
    let (from, to) = (node_at(&weak, "a1", 18), node_at(&weak, "b1", 0));
    let (last, first) = (node_at(&weak, "a1", 19), node_at(&weak, "b2", 0));
    weak.add_edge(from, to, learned(EdgeKind::CrossTask, 2, 0.9));
    weak.add_edge(last, first, learned(EdgeKind::CrossTask, 1, 0.3));
    let argmax = PlannerOptions {
        cost: crate::planner::EdgeCost::Argmax,
        ..PlannerOptions::default()
    };
    let why = planner(&Arc::new(weak), argmax)
        .plan_from_start()
        .unwrap_err();
    let Some(
        gap @ Gap::Edge {
            connected_probability,
            ..
        },
    ) = &why.gap
    else {
        panic!("{why}")
    };
    assert_eq!(gap.ends(), (last, first));
    assert!((connected_probability - 0.3).abs() < 1e-6);
    let text = why.to_string();
    assert!(
        text.contains("b.first") && text.contains("a1:19 of task a to b2:0"),
        "{text}"
    );
}

#[test]
fn repeated_task_is_walked_twice() {
    let mut graph = merged();
    let seam = (node_at(&graph, "b0", 19), node_at(&graph, "a2", 0));
    graph.add_edge(seam.0, seam.1, learned(EdgeKind::CrossTask, 1, 0.9));
    let [a, b] = tasks();
    let automaton = Automaton::in_order(&[a.clone(), b, a]);
    let options = PlannerOptions::default();
    let planner = Planner::new(Arc::new(graph), &automaton, &FinalChoice::Cheapest, options)
        .expect("the corridor fits");
    let plan = planner.plan_from_start().expect("a way");
    assert_eq!(plan.stages.last(), Some(&6));
    let audit = planner.audit(&plan);
    assert!(audit.is_clean() && audit.reached.len() == 6, "{audit}");
}

#[test]
fn final_state_is_the_one_that_was_chosen() {
    let graph = Arc::new(merged());
    let with = |choice: &FinalChoice| {
        Planner::new(
            graph.clone(),
            &automaton(),
            choice,
            PlannerOptions::default(),
        )
    };
    let wanted = node_at(&graph, "b1", 19);
    let planner = with(&FinalChoice::Demonstration("b1".to_owned())).expect("it is there");
    assert_eq!(planner.final_states(), vec![wanted]);
    assert_eq!(
        planner.plan_from_start().expect("a way").route.last(),
        Some(&wanted)
    );
    assert_eq!(
        with(&FinalChoice::Nearest)
            .expect("a way")
            .final_states()
            .len(),
        1
    );
    assert_eq!(
        with(&FinalChoice::Cheapest)
            .expect("a way")
            .final_states()
            .len(),
        3
    );
    let error = with(&FinalChoice::Demonstration("a1".to_owned())).unwrap_err();
    assert!(error.to_string().contains("b0, b1, b2"), "{error}");
}

#[test]
fn compositions_that_do_not_fit_the_graph_are_refused() {
    let graph = Arc::new(merged());
    let refused = |automaton: &Automaton| {
        Planner::new(
            graph.clone(),
            automaton,
            &FinalChoice::Cheapest,
            PlannerOptions::default(),
        )
        .unwrap_err()
    };
    assert_eq!(refused(&Automaton::in_order(&[])), PlannerError::NoTask);
    let stranger = crate::graph::fakes::task("c", &["done"]);
    assert!(matches!(
        refused(&Automaton::in_order(&[stranger])),
        PlannerError::UnknownTask { task, .. } if task == "c"
    ));
    let demanding = crate::graph::fakes::task("b", &["first", "second", "third"]);
    assert!(matches!(
        refused(&Automaton::in_order(&[demanding])),
        PlannerError::NoFinalState {
            ends: 3,
            subgoals: 3,
            ..
        }
    ));
    let empty = Arc::new(TopologicalGraph::new(1, 5));
    let error = Planner::new(empty, &automaton(), &FinalChoice::Cheapest, all_edges());
    assert_eq!(error.unwrap_err(), PlannerError::NoStates);
}

#[test]
fn what_a_graph_reaches_beyond_its_task_is_no_subgoal_of_the_next() {
    let [_, b] = tasks();
    let shorter = crate::graph::fakes::task("a", &["first"]);
    let automaton = Automaton::in_order(&[shorter, b]);
    for search in [Search::InOrder, Search::Unconstrained] {
        let layout = Layout::new(&merged(), &automaton, search).expect("the corridor has both");
        let last = |occurrence| {
            let places = layout.places().iter();
            let own = places.filter(|place| place.occurrence == occurrence);
            own.map(|place| place.stage).max()
        };
        assert_eq!((last(0), last(1)), (Some(1), Some(3)));
    }
}

#[test]
fn failed_edge_is_avoided_until_it_recovers() {
    let graph = Arc::new(merged());
    let mut planner = planner(&graph, PlannerOptions::default());
    let before = planner.plan_from_start().expect("a way");
    let seam = before
        .route
        .windows(2)
        .find(|w| graph.node(w[0]).task != graph.node(w[1]).task)
        .map(|w| (w[0], w[1]))
        .expect("the plan crosses the seam");
    planner.penalise(Some(seam.0), seam.1, 50.0);
    let around = planner.plan_from_start().expect("a way");
    assert!(!around.route.windows(2).any(|w| (w[0], w[1]) == seam));
    for _ in 0..100 {
        planner.recover(0.9);
    }
    assert_eq!(planner.plan_from_start().expect("a way"), before);
    assert_eq!(planner.options().search, Search::InOrder);
}
