use super::*;

/// A step in which all that is believed is seen.
fn plainly(believed: &[f64]) -> StageView<'_> {
    StageView {
        probabilities: believed,
        reached: believed,
        support: believed,
        lenient: believed,
        sensed: None,
    }
}

/// A step of a robot that is believed at stage 0 while so much speaks for stage 3.
fn step(stages: &mut Stages, support: f64) -> Option<StageChange> {
    let believed = [1.0, 0.0, 0.0, 0.0];
    let view = StageView {
        probabilities: &believed,
        reached: &believed,
        support: &[0.0, 0.0, 0.0, support],
        lenient: &[0.0, 0.0, 0.0, support],
        sensed: None,
    };
    stages.vote(&FilterOptions::default(), &view)
}

/// A gripper that is seen open or, where it is not, to hold a thing.
fn sight(open: f64, thing: usize) -> GraspSight {
    GraspSight {
        open,
        empty: 0.0,
        held: 1.0 - open,
        thing,
    }
}

#[test]
fn a_shortcut_takes_as_long_as_it_is_doubtful_and_is_said_once() {
    let steps = |support: f64| {
        let mut stages = Stages::new(4, &[]);
        (1..=50).find(|_| step(&mut stages, support).is_some())
    };
    assert_eq!(steps(0.9), Some(2));
    assert_eq!(steps(0.625), Some(4));
    assert_eq!(steps(0.5), None);
    let mut stages = Stages::new(4, &[]);
    let said: Vec<StageChange> = (0..20).filter_map(|_| step(&mut stages, 0.9)).collect();
    let skipped = vec![0, 1];
    assert_eq!(said, [StageChange::Shortcut { to: 3, skipped }]);
    assert_eq!(stages.now, 0);
}

#[test]
fn a_stage_that_is_all_but_certain_is_reached_though_little_fits() {
    let steps = |reached: f64, options: &FilterOptions| {
        let mut stages = Stages::new(3, &[]);
        let view = [1.0 - reached, reached, 0.0];
        let view = plainly(&view);
        (1..=20).find(|_| stages.vote_unfit(options, &view).is_some())
    };
    let options = FilterOptions::default();
    assert_eq!(steps(0.95, &options), Some(3));
    assert_eq!(steps(0.8, &options), None);
    let never = FilterOptions {
        advance_votes_unfit: None,
        ..options
    };
    assert_eq!(steps(0.95, &never), None);
}

#[test]
fn a_robot_that_came_by_the_start_of_a_task_may_be_less_familiar() {
    let steps = |passes: usize| {
        let mut stages = Stages::new(4, &[2]);
        let at = |stage: usize, support: &[f64; 4], stages: &mut Stages| {
            let mut believed = [0.0; 4];
            believed[stage] = 1.0;
            // At stage 2 the robot is at the start of a later task and has reached nothing.
            let reached = if stage == 2 { [0.0; 4] } else { believed };
            let view = StageView {
                probabilities: &believed,
                reached: &reached,
                support: &[0.0; 4],
                lenient: support,
                sensed: None,
            };
            stages.vote(&FilterOptions::default(), &view)
        };
        for _ in 0..passes {
            at(2, &[0.0; 4], &mut stages);
        }
        let mut seen = (1..=20).map(|_| at(3, &[0.0, 0.0, 0.0, 0.9], &mut stages));
        seen.position(|change| matches!(change, Some(StageChange::Shortcut { to: 3, .. })))
    };
    assert_eq!(steps(9), Some(1));
    assert_eq!(steps(0), None);
}

#[test]
fn what_was_believed_and_never_seen_is_due_once_a_later_task_is_seen() {
    let run = |seen_before: f64, starts: &[usize], accept: bool| {
        let mut stages = Stages::new(5, starts);
        if accept {
            stages.accept(1);
        }
        let believe = |stage: usize, sensed: f64, stages: &mut Stages| {
            let (mut believed, mut seen) = ([0.0; 5], [0.0; 5]);
            (believed[stage], seen[stage]) = (1.0, sensed);
            let view = StageView {
                probabilities: &believed,
                reached: &believed,
                support: &seen,
                lenient: &seen,
                sensed: Some(&seen),
            };
            stages.vote(&FilterOptions::default(), &view)
        };
        for _ in 0..5 {
            believe(1, seen_before, &mut stages);
        }
        for _ in 0..5 {
            believe(2, 0.0, &mut stages);
        }
        let said = (0..9).filter_map(|_| believe(3, 0.9, &mut stages));
        (said.collect::<Vec<_>>(), stages.now)
    };
    let advanced = StageChange::Advanced { to: 3 };
    let skipped = vec![0];
    let overlooked = StageChange::Shortcut { to: 3, skipped };
    assert_eq!(run(0.9, &[2], false), (vec![advanced.clone()], 3));
    assert_eq!(
        run(0.1, &[2], false),
        (vec![advanced.clone(), overlooked], 0)
    );
    assert_eq!(
        run(0.1, &[], false),
        (vec![advanced.clone()], 3),
        "the same task"
    );
    assert_eq!(
        run(0.1, &[2], true),
        (vec![advanced], 3),
        "taken as reached"
    );
}

#[test]
fn what_an_empty_gripper_let_go_of_is_due_once_a_later_task_is_seen() {
    let options = FilterOptions {
        regress_when_empty: false,
        ..FilterOptions::default()
    };
    let run = |seen: [GraspSight; 2]| {
        let mut stages = Stages::new(4, &[2]);
        let (nothing, something) = (Load::Nothing, Load::Something);
        stages.know_loads(vec![nothing, something, nothing, something]);
        stages.accept(1);
        let believe = |stage: usize, stages: &mut Stages| {
            let mut believed = [0.0; 4];
            believed[stage] = 1.0;
            let view = plainly(&believed);
            stages.vote(&options, &view)
        };
        for sight in seen {
            for _ in 0..3 {
                stages.note_grasp(sight);
                believe(1, &mut stages);
            }
        }
        for _ in 0..3 {
            believe(2, &mut stages);
        }
        (0..9)
            .filter_map(|_| believe(3, &mut stages))
            .collect::<Vec<_>>()
    };
    let sight = |open, empty, held| GraspSight {
        open,
        empty,
        held,
        thing: 0,
    };
    let (empty, held) = (sight(0.0, 0.95, 0.05), sight(0.0, 0.1, 0.9));
    let unsure = sight(0.1, 0.6, 0.3);
    let advanced = StageChange::Advanced { to: 3 };
    let skipped = vec![1];
    let hollow = StageChange::Shortcut { to: 3, skipped };
    assert_eq!(run([held, empty]), [advanced.clone(), hollow]);
    let advanced = [advanced];
    assert_eq!(run([empty, held]), advanced);
    assert_eq!(run([held, unsure]), advanced);
}

#[test]
fn a_stage_begins_when_what_it_holds_is_seen_to_be_taken() {
    let run = |seen: &[(GraspSight, usize)], options: &FilterOptions| {
        let mut stages = Stages::new(3, &[]);
        stages.know_loads(vec![Load::Nothing, Load::Thing(1), Load::Nothing]);
        stages.accept(0);
        let looks = seen.iter().flat_map(|(sight, times)| vec![*sight; *times]);
        let changes = looks.filter_map(|sight| {
            stages.note_grasp(sight);
            // What is seen is like nothing that is believed.
            stages.vote_unfit(options, &plainly(&[1.0, 0.0, 0.0]))
        });
        changes.collect::<Vec<_>>()
    };
    let sight = |open: f64, held: f64, thing| GraspSight {
        open,
        empty: 1.0 - open - held,
        held,
        thing,
    };
    let (open, mine) = (sight(1.0, 0.0, 0), sight(0.0, 0.95, 1));
    let options = FilterOptions::default();
    let taken = [StageChange::Taken { to: 1 }];
    assert_eq!(run(&[(open, 2), (mine, 4)], &options), taken);
    assert_eq!(
        run(&[(open, 2), (mine, 1), (open, 3)], &options),
        [],
        "once"
    );
    assert_eq!(run(&[(mine, 9)], &options), [], "held from before");
    let other = sight(0.0, 0.95, 0);
    assert_eq!(run(&[(open, 2), (other, 9)], &options), [], "another thing");
    let unsure = sight(0.0, 0.6, 1);
    assert_eq!(run(&[(open, 2), (unsure, 9)], &options), []);
    let never = FilterOptions {
        advance_when_held: false,
        ..options
    };
    assert_eq!(run(&[(open, 2), (mine, 9)], &never), []);
}

#[test]
fn a_thing_of_another_task_in_the_gripper_speaks_against_what_is_held_and_put_away_later() {
    let run = |seen: &[GraspSight], loads: [Load; 3]| {
        let mut stages = Stages::new(3, &[]);
        stages.know_loads(loads.to_vec());
        stages.accept(0);
        for sight in seen {
            stages.note_grasp(*sight);
        }
        let last = seen.last().copied().expect("something is seen");
        stages.weighed(vec![1.0; 3], last)
    };
    let loads = [Load::Nothing, Load::Thing(1), Load::Nothing];
    let (mine, other, open) = (sight(0.0, 1), sight(0.0, 0), sight(1.0, 0));
    assert_eq!(run(&[mine, mine], loads), [1.0, 1.0, 1.0]);
    assert_eq!(run(&[other, other], loads), [1.0, 0.0, 0.0]);
    assert_eq!(run(&[other, other, open], loads), [1.0, 1.0, 0.0]);
    assert_eq!(
        run(&[other, open], loads),
        [1.0, 1.0, 1.0],
        "seen once only"
    );
    assert_eq!(run(&[other, other, mine, mine], loads), [1.0, 1.0, 1.0]);
    let empty = GraspSight {
        empty: 1.0,
        held: 0.0,
        ..sight(0.0, 0)
    };
    assert_eq!(
        run(&[mine, mine, empty, empty, open], loads),
        [1.0, 1.0, 0.0]
    );
    let unknown = [Load::Nothing, Load::Something, Load::Nothing];
    assert_eq!(run(&[other, other], unknown), [1.0, 1.0, 1.0]);
    assert_eq!(run(&[empty, empty, open], unknown), [1.0, 1.0, 0.0]);
}

#[test]
fn what_flickers_is_no_shortcut() {
    let mut stages = Stages::new(4, &[]);
    for i in 0..50 {
        let support = if i % 2 == 0 { 0.9 } else { 0.0 };
        assert_eq!(step(&mut stages, support), None);
    }
}

#[test]
fn an_empty_gripper_falls_back_at_once_and_its_stage_is_out_of_question_until_it_holds_something() {
    let sight = |empty: f64| GraspSight {
        open: 0.0,
        empty,
        held: 1.0 - empty,
        thing: 0,
    };
    let (empty, held) = (sight(0.95), sight(0.05));
    let believed = [0.0, 1.0, 0.0];
    let view = plainly(&believed);
    let run = |options: &FilterOptions| {
        let mut stages = Stages::new(3, &[]);
        stages.know_loads(vec![Load::Nothing, Load::Something, Load::Nothing]);
        stages.accept(1);
        let mut look = |sight| {
            stages.note_grasp(sight);
            stages.vote(options, &view)
        };
        let changes = [held, empty, empty].map(&mut look);
        (changes, stages)
    };
    let options = FilterOptions::default();
    let (changes, mut stages) = run(&options);
    assert_eq!(changes, [None, None, Some(StageChange::Dropped { to: 0 })]);
    assert!(stages.is_ruled_out(1, empty) && !stages.is_ruled_out(2, empty));
    assert!(!stages.is_ruled_out(1, held), "it seems to hold something");
    stages.note_grasp(held);
    stages.note_grasp(held);
    assert!(!stages.is_ruled_out(1, empty), "it held something since");
    let never = FilterOptions {
        regress_when_empty: false,
        ..options
    };
    assert_eq!(run(&never).0, [None, None, None]);
}

#[test]
fn an_empty_gripper_falls_back_over_all_stages_in_which_the_thing_is_held() {
    let empty = GraspSight {
        open: 0.0,
        empty: 0.95,
        held: 0.05,
        thing: 0,
    };
    let mut stages = Stages::new(4, &[]);
    let held = Load::Thing(0);
    stages.know_loads(vec![Load::Nothing, held, held, Load::Nothing]);
    stages.accept(2);
    let view = [0.0, 0.0, 1.0, 0.0];
    let changes = [empty, empty].map(|sight| {
        stages.note_grasp(sight);
        stages.vote(&FilterOptions::default(), &plainly(&view))
    });
    assert_eq!(changes, [None, Some(StageChange::Dropped { to: 0 })]);
    assert_eq!([1, 2].map(|s| stages.is_ruled_out(s, empty)), [true; 2]);
}

#[test]
fn what_an_episode_showed_is_forgotten_before_the_next() {
    let run = |first_episode_sees: f64| {
        let mut stages = Stages::new(4, &[2]);
        let believe = |stage: usize, sensed: [f64; 4], stages: &mut Stages| {
            let mut believed = [0.0; 4];
            believed[stage] = 1.0;
            let view = StageView {
                sensed: Some(&sensed),
                ..plainly(&believed)
            };
            stages.vote(&FilterOptions::default(), &view)
        };
        believe(0, [1.0, first_episode_sees, 0.0, 0.0], &mut stages);
        assert_eq!(stages.now, 0);
        stages.begin(0);
        for stage in [1, 1, 2, 2] {
            believe(stage, [0.0; 4], &mut stages);
        }
        let at_the_last = |_| believe(3, [0.0, 0.0, 0.0, 1.0], &mut stages);
        (0..9).filter_map(at_the_last).collect::<Vec<_>>()
    };
    let skipped = vec![0];
    let overlooked = StageChange::Shortcut { to: 3, skipped };
    assert_eq!(run(1.0).last(), Some(&overlooked));
    assert_eq!(run(1.0), run(0.0));
}

#[test]
fn what_is_put_away_counts_as_seen_where_it_is_let_go_though_little_fits() {
    let (open, mine, other) = (sight(1.0, 0), sight(0.0, 0), sight(0.0, 1));
    // What is seen before, and how sure it is in the step in which the gripper opens, and in the next, that the stage
    // after is reached. None of these fits; then the robot is at the start of the next task, which does.
    let run = |before: &[GraspSight], reached: [f64; 2]| {
        let mut stages = Stages::new(4, &[2]);
        stages.know_loads(vec![
            Load::Nothing,
            Load::Thing(0),
            Load::Nothing,
            Load::Thing(1),
        ]);
        stages.accept(1);
        let options = FilterOptions::default();
        let mut changes = Vec::new();
        for sight in before {
            stages.note_grasp(*sight);
            changes.extend(stages.vote(&options, &plainly(&[0.0, 1.0, 0.0, 0.0])));
        }
        for reached in reached {
            stages.note_grasp(open);
            let view = [0.0, 1.0 - reached, reached, 0.0];
            changes.extend(stages.vote_unfit(&options, &plainly(&view)));
        }
        for _ in 0..4 {
            stages.note_grasp(open);
            let view = StageView {
                reached: &[0.0; 4],
                ..plainly(&[0.0, 0.0, 1.0, 0.0])
            };
            changes.extend(stages.vote(&options, &view));
        }
        changes
    };
    let advanced = [StageChange::Advanced { to: 2 }];
    let skipped = vec![1];
    let ahead = [StageChange::Ahead { to: 2, skipped }];
    assert_eq!(run(&[mine, mine], [1.0, 1.0]), advanced);
    assert_eq!(run(&[mine, mine], [0.95, 0.0]), advanced);
    assert_eq!(run(&[mine, mine], [0.8, 0.8]), ahead, "unsure");
    assert_eq!(run(&[mine, mine], [0.0, 1.0]), ahead, "let go before");
    assert_eq!(run(&[other, other], [1.0, 1.0]), ahead, "another thing");
    assert_eq!(run(&[open, open], [1.0, 1.0]), ahead, "nothing");
}

#[test]
fn a_gripper_that_did_not_shut_to_take_a_thing_puts_none_away() {
    let (open, first, second) = (sight(1.0, 0), sight(0.0, 0), sight(0.0, 1));
    let run = |on_the_way: &[GraspSight], accept: bool| {
        let mut stages = Stages::new(6, &[3]);
        let (one, two) = (Load::Thing(0), Load::Thing(1));
        let nothing = Load::Nothing;
        stages.know_loads(vec![nothing, nothing, one, nothing, two, nothing]);
        stages.accept(0);
        let options = FilterOptions {
            advance_when_held: false,
            ..FilterOptions::default()
        };
        let mut changes = Vec::new();
        let mut see = |stages: &mut Stages, stage: usize, sight: GraspSight| {
            let mut believed = [0.0; 6];
            believed[stage] = 1.0;
            stages.note_grasp(sight);
            changes.extend(stages.vote(&options, &plainly(&believed)));
        };
        // It shuts on a handle, which looks like a thing that is held.
        let pulls = [(0, open), (0, first), (0, first), (1, first), (1, first)];
        for (stage, sight) in pulls {
            see(&mut stages, stage, sight);
        }
        for sight in on_the_way {
            see(&mut stages, 1, *sight);
        }
        for (stage, sight) in [(2, first), (2, first), (2, first), (3, open), (3, open)] {
            see(&mut stages, stage, sight);
        }
        if accept {
            stages.accept(3);
        }
        for _ in 0..4 {
            see(&mut stages, 4, second);
        }
        changes.split_off(3)
    };
    let advanced = StageChange::Advanced { to: 4 };
    let skipped = vec![1, 2];
    let shortcut = StageChange::Shortcut { to: 4, skipped };
    assert_eq!(run(&[], false), [advanced.clone(), shortcut]);
    let advanced = [advanced];
    assert_eq!(run(&[open, first], false), advanced, "it opened and shut");
    assert_eq!(run(&[], true), advanced, "taken as reached");
}
