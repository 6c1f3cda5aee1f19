use std::sync::Arc;

use super::{Habits, Operator};
use crate::environment::{Environment, EnvironmentError};
use crate::simulator::bedroom::Bedroom;
use crate::simulator::primitive::Primitive;
use crate::simulator::variation::BedroomTask;
use crate::simulator::world::PRIMITIVE_SECS;
use crate::trajectory::{Marker, Step, Trajectory};

/// An operator who is not done by then gives up.
pub const LONGEST_STEPS: usize = 150;
/// Keeps the operator's lots apart from the room's.
const OPERATOR_STREAM: u64 = 0x6f70_6572_6174_6f72;

/// What came of an operator's attempt.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    /// What was seen and done; the last action is `terminate` unless the operator gave up. Markers
    /// are the first steps at which each subgoal of the task holds.
    pub trajectory: Trajectory,
    /// Whether all subgoals were reached in their order, the task is done at the end, and the
    /// operator terminated.
    pub succeeded: bool,
}

/// Starts the episode of `seed` and demonstrates `task` in it. The same arguments give the same
/// trajectory.
///
/// ```
/// use catena::simulator::{Bedroom, BedroomConfig, BedroomTask, demonstrate};
///
/// let task = BedroomTask::Wine;
/// let mut bedroom = Bedroom::new(BedroomConfig::paper(task));
/// let shown = demonstrate(&mut bedroom, task, 1)?;
/// assert!(shown.succeeded);
/// assert_eq!(shown.trajectory.markers.last().unwrap().name, "spill_covered");
/// # Ok::<(), catena::environment::EnvironmentError>(())
/// ```
///
/// # Errors
/// [`EnvironmentError`] when the bedroom fails, which the simulated one does not.
pub fn demonstrate(
    bedroom: &mut Bedroom,
    task: BedroomTask,
    seed: u64,
) -> Result<Demonstration, EnvironmentError> {
    bedroom.arrange(seed);
    demonstrate_on(bedroom, task, Habits::default(), seed)
}

/// Demonstrates `task` from whatever state the bedroom is in.
///
/// # Errors
/// [`EnvironmentError::ActionRefused`] for habits that [`Habits::check`] refuses; others when the bedroom fails, which
/// the simulated one does not.
pub fn demonstrate_on(
    bedroom: &mut Bedroom,
    task: BedroomTask,
    habits: Habits,
    seed: u64,
) -> Result<Demonstration, EnvironmentError> {
    habits
        .check()
        .map_err(|fault| EnvironmentError::ActionRefused {
            action: format!("a demonstration of {}", task.name()),
            reason: fault.to_string(),
        })?;
    let mut operator = Operator::new(task, &bedroom.insight(), habits, seed ^ OPERATOR_STREAM);
    let mut steps: Vec<Step> = Vec::new();
    let mut markers: Vec<Marker> = Vec::new();
    let mut terminated = false;
    while steps.len() < LONGEST_STEPS && !terminated {
        let insight = bedroom.insight();
        for name in task.subgoals() {
            let known = markers.iter().any(|m| m.name == *name);
            if !known && insight.truth.holds(name) == Some(true) {
                markers.push(Marker {
                    step: steps.len(),
                    name: (*name).to_owned(),
                });
            }
        }
        let primitive = operator.next(&insight);
        terminated = primitive == Primitive::Terminate;
        steps.push(Step {
            time_secs: steps.len() as f64 * PRIMITIVE_SECS,
            observation: Arc::new(bedroom.observe()),
            action: primitive.action(),
        });
        bedroom.act(primitive);
    }
    let in_order = markers
        .iter()
        .map(|m| m.name.as_str())
        .eq(task.subgoals().iter().copied());
    Ok(Demonstration {
        succeeded: terminated && in_order && bedroom.truth().is_done(task),
        trajectory: Trajectory {
            id: format!("{}_{seed:06}", task.name()),
            task: task.name().to_owned(),
            action_space: bedroom.action_space(),
            steps,
            markers,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::super::Practice;
    use super::*;
    use crate::simulator::bedroom::BedroomConfig;
    use crate::simulator::truth::Insight;
    use crate::simulator::variation::{Leftovers, Level};
    use crate::simulator::world::Graspable;

    /// Slips and missed grasps make a demonstration longer, and some fail by them; `catena record` leaves
    /// those out.
    fn sure() -> Habits {
        Habits {
            missed_grasp: 0.0,
            missed_from_above: 0.0,
            late_notice: 0.0,
            slip: 0.0,
            ..Habits::default()
        }
    }

    #[test]
    fn a_missed_grasp_is_seen_and_put_right() {
        let misses = Habits {
            missed_grasp: 1.0,
            ..sure()
        };
        for task in [BedroomTask::Trash, BedroomTask::Wine] {
            let mut room = Bedroom::new(BedroomConfig::paper(task));
            let put_right = (0..4).filter(|seed| {
                room.arrange(*seed);
                let shown = demonstrate_on(&mut room, task, misses, *seed);
                let shown = shown.expect("the room does not fail");
                let closings = shown.trajectory.steps.iter();
                let closings = closings.filter(|s| s.action == Primitive::GripperClose.action());
                shown.succeeded && closings.count() >= 2
            });
            assert!(put_right.count() >= 3, "{task:?}");
        }
    }

    #[test]
    fn a_dry_run_goes_through_the_motions_with_an_empty_gripper() {
        let dry = Habits {
            practice: Some(Practice::Dry),
            ..sure()
        };
        for task in BedroomTask::ALL {
            let mut room = Bedroom::new(BedroomConfig::paper(task));
            room.arrange(4);
            let insight = room.insight();
            let mut operator = Operator::new(task, &insight, dry, 4);
            let mut carried_m = 0.0_f32;
            let taken_from = loose_things(&insight);
            for _ in 0..LONGEST_STEPS {
                let before = room.insight();
                let primitive = operator.next(&before);
                room.act(primitive);
                let after = room.insight();
                let holds_loose = after.held.is_some_and(|held| held != Graspable::Drawer);
                assert!(!holds_loose, "{task:?} holds {:?}", after.held);
                if after.gripper_shut && after.held.is_none() {
                    let [x, y] = [0, 1].map(|axis| after.base_m[axis] - before.base_m[axis]);
                    carried_m += x.hypot(y);
                }
                if primitive == Primitive::Terminate {
                    break;
                }
            }
            let insight = room.insight();
            assert!(carried_m > 0.5, "{task:?}: empty over {carried_m} m only");
            assert!(!insight.gripper_shut && !insight.truth.is_done(task));
            for (was, is) in taken_from.iter().zip(loose_things(&insight)) {
                let moved_m = (0..3).map(|axis| (was[axis] - is[axis]).abs());
                assert!(
                    moved_m.fold(0.0, f32::max) < 0.5,
                    "{task:?}: {was:?}, {is:?}"
                );
            }
        }
    }

    #[test]
    fn an_askew_run_takes_things_elsewhere_than_a_demonstration() {
        let askew = Habits {
            practice: Some(Practice::Askew),
            ..sure()
        };
        let task = BedroomTask::Sock;
        let mut room = Bedroom::new(BedroomConfig::paper(task));
        // Where the sock lies before the gripper when it is first held, on each of some seeds.
        let mut held_at = |habits: Habits| -> Vec<f32> {
            let seeds = 0..6;
            let ahead = seeds.filter_map(|seed| {
                room.arrange(seed);
                let mut operator = Operator::new(task, &room.insight(), habits, seed);
                (0..LONGEST_STEPS).find_map(|_| {
                    let insight = room.insight();
                    let is_held = insight.held == Some(Graspable::Sock);
                    room.act(operator.next(&insight));
                    let [x, y, _] = insight.sock_m;
                    is_held.then(|| insight.relative_to_base([x, y])[0] - insight.tool.x_m)
                })
            });
            ahead.collect()
        };
        let spread = |places: &[f32]| {
            let most = places.iter().copied().fold(f32::MIN, f32::max);
            most - places.iter().copied().fold(f32::MAX, f32::min)
        };
        let (usual, odd) = (held_at(sure()), held_at(askew));
        assert!(usual.len() >= 4 && odd.len() >= 4, "{usual:?}, {odd:?}");
        assert!(spread(&odd) > spread(&usual), "{usual:?}, {odd:?}");
    }

    fn loose_things(insight: &Insight) -> [[f32; 3]; 3] {
        [insight.sock_m, insight.can_m, insight.tissue_m]
    }

    #[test]
    fn every_task_is_demonstrated_with_its_subgoals_in_order() {
        for task in BedroomTask::ALL {
            let mut room = Bedroom::new(BedroomConfig::paper(task));
            room.arrange(5);
            let shown = demonstrate_on(&mut room, task, sure(), 5).expect("the room does not fail");
            let names: Vec<_> = shown
                .trajectory
                .markers
                .iter()
                .map(|m| m.name.as_str())
                .collect();
            assert!(shown.succeeded, "{task:?} reached {names:?}");
            assert_eq!(names, task.subgoals());
            assert!((40..=100).contains(&shown.trajectory.steps.len()));
            let last = shown.trajectory.steps.last().map(|s| s.action.clone());
            assert_eq!(last, Some(Primitive::Terminate.action()));
        }
    }

    #[test]
    fn same_seed_gives_the_same_demonstration() {
        let task = BedroomTask::Trash;
        let shown = || {
            let mut room = Bedroom::new(BedroomConfig::paper(task));
            demonstrate(&mut room, task, 11).expect("the room does not fail")
        };
        assert_eq!(shown(), shown());
    }

    #[test]
    fn tasks_chain_in_one_episode() {
        let mut room = Bedroom::new(BedroomConfig::paper(BedroomTask::Sock));
        room.arrange(3);
        for task in BedroomTask::ALL {
            let done = perform(&mut room, task, 3);
            assert!(done, "{task:?} failed after the tasks before it");
        }
        let truth = room.truth();
        assert!(truth.sock_in_box && truth.can_in_bin && truth.spill_covered);
    }

    #[test]
    fn leftovers_of_other_tasks_and_other_looks_do_not_stop_the_operator() {
        for task in BedroomTask::ALL {
            let mut room = Bedroom::new(BedroomConfig {
                level: Level::Hard,
                leftovers: Leftovers::Varied,
                ..BedroomConfig::paper(task)
            });
            let done = (0..4).filter(|seed| {
                room.arrange(*seed);
                perform(&mut room, task, *seed)
            });
            assert!(done.count() >= 3, "{task:?}");
        }
    }

    /// Without pictures, which take most of the time.
    fn perform(room: &mut Bedroom, task: BedroomTask, seed: u64) -> bool {
        let mut operator = Operator::new(task, &room.insight(), sure(), seed);
        for _ in 0..LONGEST_STEPS {
            let primitive = operator.next(&room.insight());
            room.act(primitive);
            if primitive == Primitive::Terminate {
                return room.truth().is_done(task);
            }
        }
        false
    }
}
