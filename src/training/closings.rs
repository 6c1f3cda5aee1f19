//! Which states show a gripper that closed on nothing, and which one that holds what it should.

use std::collections::BTreeMap;
use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::missed_grasps::{Outcome, closings};
use super::{Dataset, ImitationConfig, StateRef};

/// States after a closing that are compared; later ones look less and less alike.
const COMPARED_STEPS: usize = 3;

/// Consecutive states of one trajectory.
pub type Steps = (u32, Range<u32>);

/// Closings that missed and closings that held, of the same task and on the way to the same subgoal.
///
/// The two look alike but for what is between the fingers, and no single action leads from one to the
/// other: after a miss the gripper must be opened, brought to the thing and closed again.
#[derive(Clone, Debug, Default)]
pub struct Closings {
    groups: Vec<Group>,
}

#[derive(Clone, Debug, Default)]
struct Group {
    missed: Vec<Steps>,
    held: Vec<Steps>,
}

impl Closings {
    /// Finds them in some trajectories, from actions and markers.
    pub fn find(data: &Dataset, trajectories: &[u32], config: &ImitationConfig) -> Self {
        let mut groups: BTreeMap<(usize, usize), Group> = BTreeMap::new();
        for trajectory in trajectories {
            let markers = data.marker_steps(*trajectory);
            for closing in closings(data.gripper_events(*trajectory), markers, config) {
                let first = closing.closed + 1;
                let shut = closing.opened.map_or(data.steps(*trajectory), |o| o + 1);
                let end = shut.min(first + COMPARED_STEPS);
                let subgoal = markers.partition_point(|step| *step <= closing.closed);
                let group = groups.entry((data.set_of(*trajectory), subgoal));
                let Group { missed, held } = group.or_default();
                let found = match closing.outcome {
                    Outcome::Missed => missed,
                    Outcome::Held => held,
                    Outcome::Unknown => continue,
                };
                if first < end {
                    found.push((*trajectory, first as u32..end as u32));
                }
            }
        }
        let groups = groups
            .into_values()
            .filter(|g| !g.missed.is_empty() && !g.held.is_empty())
            .collect();
        Self { groups }
    }

    /// Every state after a missed closing with every one after a closing that held.
    pub fn pairs(&self) -> impl Iterator<Item = (StateRef, StateRef)> {
        self.groups.iter().flat_map(|group| {
            let held = || group.held.iter().flat_map(states);
            let missed = group.missed.iter().flat_map(states);
            missed.flat_map(move |from| held().map(move |to| (from, to)))
        })
    }

    /// States after a missed closing and states after one that held, each missed one as likely.
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Option<(Steps, Steps)> {
        let total: usize = self.groups.iter().map(|g| g.missed.len()).sum();
        let mut place = rng.random_range(0..total.max(1));
        for group in &self.groups {
            if let Some(missed) = group.missed.get(place) {
                let held = &group.held[rng.random_range(0..group.held.len())];
                return Some((missed.clone(), held.clone()));
            }
            place -= group.missed.len();
        }
        None
    }
}

fn states((trajectory, steps): &Steps) -> impl Iterator<Item = StateRef> + use<> {
    let trajectory = *trajectory;
    steps.clone().map(move |step| StateRef { trajectory, step })
}

#[cfg(test)]
#[cfg(feature = "simulator")]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::simulator::{Bedroom, BedroomConfig, BedroomTask, Habits, demonstrate_on};
    use crate::trajectory::DemonstrationSet;

    #[test]
    fn a_missed_can_is_paired_with_one_that_is_held() {
        let task = BedroomTask::Trash;
        let habits = Habits {
            missed_grasp: 1.0,
            slip: 0.0,
            ..Habits::default()
        };
        let shown: Vec<_> = (1..=2)
            .map(|seed| {
                let mut room = Bedroom::new(BedroomConfig::paper(task));
                room.arrange(seed);
                let shown = demonstrate_on(&mut room, task, habits, seed).unwrap();
                shown.trajectory
            })
            .collect();
        let data = Dataset::new(&[DemonstrationSet::new("trash", shown).unwrap()]).unwrap();
        let config = crate::training::Preset::Bedroom.config().imitation;
        let found = Closings::find(&data, &[0, 1], &config);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..20 {
            let ((missed, empty), (held, holding)) = found.draw(&mut rng).unwrap();
            let [first, grasped] = [missed, held].map(|t| data.marker_steps(t)[0] as u32);
            assert!(empty.end <= first, "before the can is grasped");
            assert!((grasped..grasped + 4).contains(&(holding.end - 1)));
        }
        let (missed, held) = found.pairs().next().expect("the loop above drew one");
        let grasped = |at: StateRef| at.step as usize + 1 >= data.marker_steps(at.trajectory)[0];
        assert!(!grasped(missed) && grasped(held));
        assert!(
            Closings::find(&data, &[0, 1], &ImitationConfig::default())
                .draw(&mut rng)
                .is_none()
        );
    }
}
