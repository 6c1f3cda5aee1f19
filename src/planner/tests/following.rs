//! The filter and the choice of goals, in the corridor.

use std::sync::Arc;

use super::corridor::{automaton, crowded, merged, seen_by, seen_from, true_stage};
use crate::graph::TopologicalGraph;
use crate::model::GraspSight;
use crate::planner::{
    FilterOptions, FinalChoice, GoalBasis, LiveDistances, Localisation, PlaceId, Planner,
    PlannerOptions, StageChange, StageFilter,
};

fn set_up() -> (Arc<TopologicalGraph>, Planner, StageFilter) {
    let graph = Arc::new(merged());
    let options = PlannerOptions::default();
    let planner = Planner::new(graph.clone(), &automaton(), &FinalChoice::Cheapest, options)
        .expect("the corridor has a composition");
    let filter = planner.stage_filter(FilterOptions::default());
    (graph, planner, filter)
}

fn position(graph: &TopologicalGraph, localisation: &Localisation) -> f32 {
    graph.latents().row(localisation.node.index())[0]
}

/// Walks to a position and returns what was believed at each step.
fn walk(
    graph: &Arc<TopologicalGraph>,
    filter: &mut StageFilter,
    positions: impl IntoIterator<Item = f32>,
) -> Vec<Localisation> {
    positions
        .into_iter()
        .map(|x| filter.update(&seen_from(graph, x)))
        .collect()
}

fn steps_to(last: usize) -> impl Iterator<Item = f32> {
    (0..=last).map(|x| x as f32)
}

#[test]
fn walking_robot_is_followed_through_both_tasks() {
    let (graph, _, mut filter) = set_up();
    let mut late = 0;
    for (x, here) in walk(&graph, &mut filter, steps_to(39)).iter().enumerate() {
        let error = (position(&graph, here) - x as f32).abs();
        assert!(
            error <= 1.5,
            "at {x} believed at {}",
            position(&graph, here)
        );
        assert!(
            here.stage <= true_stage(x as f32),
            "at {x} too early in stage {}",
            here.stage
        );
        late = if here.stage < true_stage(x as f32) {
            late + 1
        } else {
            0
        };
        assert!(late <= 2, "at {x} still in stage {}", here.stage);
        assert!(!here.is_lost && !matches!(here.change, Some(StageChange::Shortcut { .. })));
    }
    walk(&graph, &mut filter, [39.0, 39.0]);
    assert_eq!(filter.stage(), 4);
}

#[test]
fn standing_robot_does_not_drift() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(5));
    for here in walk(&graph, &mut filter, [5.0; 30]) {
        assert!((position(&graph, &here) - 5.0).abs() <= 1.0);
        assert_eq!(here.stage, 0);
    }
}

#[test]
fn one_look_alike_frame_moves_nothing() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(5));
    let here = &walk(&graph, &mut filter, [35.0])[0];
    assert!(position(&graph, here) < 10.0, "{}", position(&graph, here));
    assert_eq!(here.stage, 0);
    let here = &walk(&graph, &mut filter, [6.0])[0];
    assert!((position(&graph, here) - 6.0).abs() <= 1.0);
}

#[test]
fn robot_far_from_everything_is_lost_and_found_again() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(5));
    let lost = walk(&graph, &mut filter, [-50.0; 6]);
    assert!(!lost[0].is_lost && lost[5].is_lost, "fit {}", lost[5].fit);
    let found = walk(&graph, &mut filter, [6.0, 7.0, 7.0]);
    assert!(!found[2].is_lost);
    assert!((position(&graph, &found[2]) - 7.0).abs() <= 1.5);
}

#[test]
fn slip_falls_back_to_the_stage_before() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(11));
    assert_eq!(filter.stage(), 1);
    let changes = walk(&graph, &mut filter, [3.0; 20]);
    let fell = changes
        .iter()
        .any(|l| l.change == Some(StageChange::Regressed { to: 0 }));
    assert!(fell, "{:?}", changes.last());
}

#[test]
fn a_room_that_looks_as_at_the_beginning_undoes_one_subgoal_at_most() {
    let fallen_to = |regress_stages| {
        let (graph, planner, _) = set_up();
        let mut filter = planner.stage_filter(FilterOptions {
            regress_stages,
            ..FilterOptions::default()
        });
        walk(&graph, &mut filter, steps_to(31));
        assert_eq!(filter.stage(), 3);
        walk(&graph, &mut filter, [3.0; 20]);
        filter.stage()
    };
    assert_eq!(fallen_to(usize::MAX), 0, "what there is to hold back");
    assert!(fallen_to(1) >= 2);
}

#[test]
fn subgoal_without_the_one_before_is_a_shortcut_and_keeps_the_stage() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(3));
    let mut changes_on = |positions: &[f32]| -> Vec<StageChange> {
        let seen = walk(&graph, &mut filter, positions.iter().copied());
        assert_eq!(filter.stage(), 0);
        seen.into_iter().filter_map(|l| l.change).collect()
    };
    let on_the_way: Vec<f32> = (22..28).chain([27; 12]).map(|x| x as f32).collect();
    let ahead = StageChange::Ahead {
        to: 2,
        skipped: vec![0, 1],
    };
    assert_eq!(changes_on(&on_the_way), [ahead], "nothing is reached yet");
    let shortcut = StageChange::Shortcut {
        to: 3,
        skipped: vec![0, 1],
    };
    let there = [28.0, 29.0, 30.0, 31.0, 31.0, 31.0, 31.0, 31.0];
    assert_eq!(changes_on(&there), [shortcut], "said once");
    filter.set_stage(2);
    assert_eq!(filter.stage(), 2);
}

#[test]
fn a_stage_that_the_belief_rules_out_has_no_probable_places() {
    let (graph, _, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(31));
    assert_eq!(filter.stage(), 3);
    let shares = |filter: &StageFilter| {
        let places = filter.most_probable_places(12);
        places.iter().map(|(_, share)| share).sum::<f64>()
    };
    assert!((shares(&filter) - 1.0).abs() < 1e-9);
    filter.set_stage(0);
    assert!(filter.most_probable_places(12).is_empty());
    walk(&graph, &mut filter, [31.0]);
    assert!((shares(&filter) - 1.0).abs() < 1e-9, "it is possible again");
}

#[test]
fn an_empty_gripper_tells_nothing_where_every_stage_holds_something() {
    let (graph, _, filter) = set_up();
    let mut filter = filter.with_grasps(|_| true, |_| None);
    let empty = GraspSight {
        open: 0.0,
        empty: 1.0,
        held: 0.0,
        thing: 0,
    };
    for x in steps_to(15) {
        let row = [x];
        let here = filter.look(&seen_from(&graph, x), &row, Some(empty));
        let all: f64 = here.stage_probabilities.iter().sum();
        assert!((all - 1.0).abs() < 1e-9, "{all} at {x}");
        assert!((position(&graph, &here) - x).abs() <= 1.5, "at {x}");
    }
}

#[test]
fn a_filter_that_forgets_everything_believes_what_it_sees() {
    let (graph, planner, _) = set_up();
    let mut filter = planner.stage_filter(FilterOptions {
        restart: 1.0,
        ..FilterOptions::default()
    });
    for x in [3.0, 3.0, 14.0, 14.0, 5.0] {
        walk(&graph, &mut filter, [x]);
        let places = (0..filter.layout().places().len() as u32).map(PlaceId);
        let beliefs: Vec<f64> = places.map(|place| filter.probability(place)).collect();
        let least = beliefs.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least >= 0.0, "{least} at {x}");
        assert!((beliefs.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_belief_is_left_also_where_options_are_at_the_ends_of_their_ranges() {
    let (graph, planner, _) = set_up();
    let options = FilterOptions {
        restart: 1e-9,
        evidence_weight: 10.0,
        floor: 1e-9,
        ..FilterOptions::default()
    };
    assert_eq!(options.out_of_range(), None);
    let mut filter = planner.stage_filter(options);
    let nothing = LiveDistances::unknown(graph.node_count(), graph.d_max());
    for step in 0..8 {
        let here = filter.update(&nothing);
        let all: f64 = here.stage_probabilities.iter().sum();
        assert!((all - 1.0).abs() < 1e-9, "{all} at {step}");
        assert_eq!(here.is_lost, step >= 3, "at {step}");
    }
}

#[test]
fn same_frames_give_the_same_belief() {
    let (graph, _, filter) = set_up();
    let run = || {
        let mut filter = filter.clone();
        walk(&graph, &mut filter, steps_to(30));
        let places = 0..filter.layout().places().len() as u32;
        let belief = places.map(|place| filter.probability(PlaceId(place)));
        belief.collect::<Vec<f64>>()
    };
    assert_eq!(run(), run());
}

/// Follows a walk with all places exact and with the most probable ones only, asking for the
/// states within three units of the robot.
fn followed(exact_places: usize) -> Vec<Localisation> {
    let graph = Arc::new(crowded(60));
    let automaton = automaton();
    let options = PlannerOptions::default();
    let planner = Planner::new(graph.clone(), &automaton, &FinalChoice::Cheapest, options)
        .expect("every demonstration ends");
    let mut filter = planner.stage_filter(FilterOptions {
        exact_places,
        ..FilterOptions::default()
    });
    let stands = [12.0; 5];
    // In between it is seen where it cannot be, and then nowhere.
    let strays = [30.0, 13.0, 14.0, -50.0, -50.0, -50.0, -50.0, -50.0, 14.0];
    let walk = (0..=12).map(|x| x as f32).chain(stands).chain(strays);
    walk.chain((15..40).map(|x| x as f32))
        .chain([39.0; 2])
        .map(|x| {
            let near = |at: f32| (at - x).abs() < 3.0;
            filter.update(&seen_by(&graph, x, near))
        })
        .collect()
}

#[test]
fn belief_in_the_most_probable_places_follows_as_well_as_the_exact_one() {
    let (exact, sparse) = (followed(usize::MAX), followed(0));
    for (step, (exact, sparse)) in exact.iter().zip(&sparse).enumerate() {
        assert!(
            (exact.time_steps - sparse.time_steps).abs() <= 2.0,
            "step {step}: {} and {}",
            exact.time_steps,
            sparse.time_steps
        );
        assert_eq!(exact.stage, sparse.stage, "step {step}");
        assert_eq!(exact.is_lost, sparse.is_lost, "step {step}");
        let total: f64 = sparse.stage_probabilities.iter().sum();
        assert!((total - 1.0).abs() < 1e-9, "step {step}: {total}");
        for (a, b) in exact
            .stage_probabilities
            .iter()
            .zip(&sparse.stage_probabilities)
        {
            assert!((a - b).abs() < 0.1, "step {step}: {a} and {b}");
        }
    }
    assert_eq!(exact.last().map(|l| l.stage), Some(4));
}

#[test]
fn closed_loop_with_a_policy_that_takes_one_step_reaches_every_stage() {
    let (graph, planner, mut filter) = set_up();
    let mut x = 0.0_f32;
    let mut stages = Vec::new();
    for _ in 0..60 {
        let distances = seen_from(&graph, x);
        let here = filter.update(&distances);
        let goal = planner
            .next_goal(&here, &distances)
            .expect("a way leads on");
        if stages.last() != Some(&here.stage) {
            stages.push(here.stage);
        }
        if here.stage == 4 {
            break;
        }
        let ahead = graph.latents().row(goal.node.index())[0] - x;
        assert!(
            (-1.0..=4.0).contains(&ahead),
            "at {x}: goal {ahead} ahead, {goal:?}"
        );
        x += ahead.clamp(0.0, 1.0);
    }
    assert_eq!(stages, vec![0, 1, 2, 3, 4]);
}

#[test]
fn goal_lies_ahead_on_the_route_but_not_past_the_due_subgoal() {
    let (graph, planner, mut filter) = set_up();
    let here = walk(&graph, &mut filter, steps_to(3))
        .pop()
        .expect("a step was made");
    let goal = planner
        .next_goal(&here, &seen_from(&graph, 3.0))
        .expect("a way");
    let ahead = graph.latents().row(goal.node.index())[0] - 3.0;
    assert!((2.0..=4.0).contains(&ahead), "{ahead}");
    assert!(goal.route.contains(&goal.node) && goal.basis == GoalBasis::Belief);
    let here = walk(&graph, &mut filter, [4.0, 5.0, 6.0])
        .pop()
        .expect("a step was made");
    let goal = planner
        .next_goal(&here, &seen_from(&graph, 6.0))
        .expect("a way");
    let at = graph.latents().row(goal.node.index())[0];
    assert!(at < 8.5, "the subgoal stands at 8, the goal at {at}");
}

#[test]
fn without_lookahead_the_goal_is_the_state_after_the_believed_one() {
    let graph = Arc::new(merged());
    let options = PlannerOptions {
        lookahead_steps: 0,
        ..PlannerOptions::default()
    };
    let planner = Planner::new(graph.clone(), &automaton(), &FinalChoice::Cheapest, options)
        .expect("the corridor has a composition");
    let mut filter = planner.stage_filter(FilterOptions::default());
    let here = walk(&graph, &mut filter, steps_to(3))
        .pop()
        .expect("a step was made");
    let goal = planner
        .next_goal(&here, &seen_from(&graph, 3.0))
        .expect("a way");
    assert_eq!((goal.route[0], goal.basis), (here.node, GoalBasis::Belief));
    assert_eq!(goal.node, goal.route[1]);
}

#[test]
fn plan_goes_on_by_belief_when_nothing_is_near() {
    let (graph, planner, mut filter) = set_up();
    let here = walk(&graph, &mut filter, steps_to(5))
        .pop()
        .expect("a step was made");
    let nothing = LiveDistances::unknown(graph.node_count(), super::corridor::D_MAX);
    let goal = planner
        .next_goal(&here, &nothing)
        .expect("the belief leads on");
    assert_eq!(goal.basis, GoalBasis::Belief);
    let ahead = graph.latents().row(goal.node.index())[0] - position(&graph, &here);
    assert!((1.0..=3.5).contains(&ahead), "{ahead}");
}

#[test]
fn robot_at_the_final_state_has_arrived() {
    let (graph, planner, mut filter) = set_up();
    walk(&graph, &mut filter, steps_to(39));
    let here = walk(&graph, &mut filter, [39.0, 39.0])
        .pop()
        .expect("a step was made");
    let goal = planner
        .next_goal(&here, &seen_from(&graph, 39.0))
        .expect("a way");
    assert!(goal.has_arrived, "{goal:?}");
    assert!(graph.node(goal.node).is_end);
}
