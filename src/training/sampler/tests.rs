use std::collections::HashMap;

use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::training::synthetic;
use crate::trajectory::{Action, ActionSpace, DemonstrationSet, Marker, Trajectory};

fn data() -> Dataset {
    Dataset::new(&[
        synthetic::demonstrations("a", 3, 20, 1),
        synthetic::demonstrations("b", 2, 9, 2),
    ])
    .unwrap()
}

fn sampler(config: &SamplingConfig) -> Sampler {
    let data = data();
    Sampler::new(
        &data,
        &[0, 1, 2, 3, 4],
        config,
        &ImitationConfig::default(),
        5,
    )
    .unwrap()
}

fn draws(config: &SamplingConfig, count: u64) -> Vec<Draw> {
    let sampler = sampler(config);
    (0..count)
        .map(|step| {
            let mut rng = ChaCha8Rng::seed_from_u64(9);
            rng.set_stream(step);
            sampler.draw(&mut rng)
        })
        .collect()
}

#[test]
fn pairs_are_what_their_kind_says() {
    let config = SamplingConfig {
        look_alike_share: 0.25,
        hard_share: 0.3,
        ..SamplingConfig::default()
    };
    for draw in draws(&config, 20) {
        assert_eq!(draw.states.len(), config.states);
        assert_eq!(draw.far.len(), config.far_pairs);
        assert!(!draw.hard.is_empty());
        for pair in &draw.near {
            let (from, to) = (draw.states[pair.from], draw.states[pair.to]);
            assert_eq!(from.trajectory, to.trajectory);
            assert_eq!((to.step - from.step) as usize, pair.gap_steps);
            assert!(pair.gap_steps < 5);
        }
        for (from, to) in draw.far.iter().chain(&draw.hard) {
            assert!(is_far(draw.states[*from], draw.states[*to], 5));
        }
    }
}

#[test]
fn every_state_and_every_near_pair_of_a_class_is_equally_likely() {
    let mut states: HashMap<StateRef, usize> = HashMap::new();
    let mut neighbours: HashMap<StateRef, usize> = HashMap::new();
    for draw in draws(&SamplingConfig::default(), 1_500) {
        for state in &draw.states {
            *states.entry(*state).or_default() += 1;
        }
        for pair in draw.near.iter().filter(|p| p.gap_steps == 3) {
            *neighbours.entry(draw.states[pair.from]).or_default() += 1;
        }
    }
    assert_eq!(states.len(), 78);
    assert_eq!(neighbours.len(), 3 * 17 + 2 * 6);
    for counts in [states, neighbours] {
        let mean = counts.values().sum::<usize>() as f64 / counts.len() as f64;
        for (state, count) in counts {
            let ratio = count as f64 / mean;
            assert!((0.85..1.15).contains(&ratio), "{state:?} {ratio}");
        }
    }
}

#[test]
fn far_pairs_cover_all_ordered_pairs_of_trajectories_in_proportion() {
    let mut between: HashMap<(u32, u32), f64> = HashMap::new();
    let mut total = 0.0;
    for draw in draws(&SamplingConfig::default(), 300) {
        for (from, to) in draw.far {
            let key = (draw.states[from].trajectory, draw.states[to].trajectory);
            *between.entry(key).or_default() += 1.0;
            total += 1.0;
        }
    }
    // 20 x 9 of the 78 x 78 ordered pairs, less the near ones, which are about 5 in 78.
    let expected = 180.0 / (78.0 * 78.0 - (3.0 * 90.0 + 2.0 * 35.0));
    for key in [(0, 3), (3, 0), (2, 4)] {
        let ratio = between[&key] / total / expected;
        assert!((0.9..1.1).contains(&ratio), "{key:?} {ratio}");
    }
    assert!(
        between.contains_key(&(0, 0)),
        "far apart in time counts too"
    );
}

#[test]
fn aligned_pairs_lead_ahead_in_another_demonstration_and_are_not_called_far() {
    let mut alike = synthetic::demonstrations("a", 1, 20, 1)
        .trajectories()
        .to_vec();
    for copy in 1..4 {
        let mut twin = alike[0].clone();
        twin.id = format!("copy {copy}");
        alike.push(twin);
    }
    let set = DemonstrationSet::new("a", alike).unwrap();
    let data = Dataset::new(&[set]).unwrap();
    let config = SamplingConfig {
        aligned_share: 0.5,
        aligned_policy_share: 0.5,
        ..SamplingConfig::default()
    };
    let sampler = Sampler::new(
        &data,
        &[0, 1, 2, 3],
        &config,
        &ImitationConfig::default(),
        5,
    )
    .unwrap();
    for stream in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        rng.set_stream(stream);
        let draw = sampler.draw(&mut rng);
        assert_eq!(draw.states.len(), config.states);
        assert!(!draw.aligned.is_empty());
        for pair in &draw.aligned {
            let (from, to) = (draw.states[pair.from], draw.states[pair.to]);
            assert_ne!(from.trajectory, to.trajectory);
            assert_eq!((to.step - from.step) as usize, pair.gap_steps);
            assert!((1..5).contains(&pair.gap_steps));
        }
        for (from, to) in &draw.far {
            let (from, to) = (draw.states[*from], draw.states[*to]);
            let is_alike = from.step.abs_diff(to.step) < 5;
            assert!(
                from.trajectory == to.trajectory || !is_alike,
                "copies show the same"
            );
        }
    }
}

#[test]
fn of_more_demonstrations_than_are_compared_none_that_show_the_same_are_called_far() {
    let one = synthetic::demonstrations("a", 1, 20, 1).trajectories()[0].clone();
    let copy = |number: u32| Trajectory {
        id: format!("copy {number}"),
        ..one.clone()
    };
    let set = DemonstrationSet::new("a", (0..100).map(copy).collect()).unwrap();
    let data = Dataset::new(&[set]).unwrap();
    let all: Vec<u32> = (0..100).collect();
    let config = SamplingConfig {
        aligned_share: 0.5,
        ..SamplingConfig::default()
    };
    let sampler = Sampler::new(&data, &all, &config, &ImitationConfig::default(), 5).unwrap();
    let mut of_two = 0;
    for stream in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        rng.set_stream(stream);
        let draw = sampler.draw(&mut rng);
        for (from, to) in &draw.far {
            let (from, to) = (draw.states[*from], draw.states[*to]);
            if from.trajectory != to.trajectory {
                assert!(from.step.abs_diff(to.step) >= 5, "{from:?} {to:?}");
                of_two += 1;
            }
        }
    }
    assert!(of_two > 0, "those that were compared are still told apart");
}

#[test]
fn a_closing_that_missed_is_drawn_beside_one_that_held() {
    let names = ["gripper_close", "gripper_open", "up", "down"];
    let mut shown = synthetic::demonstrations("a", 2, 30, 1)
        .trajectories()
        .to_vec();
    for (trajectory, closed) in shown.iter_mut().zip([[5, 15], [25, 20]]) {
        trajectory.action_space = ActionSpace::Primitives {
            names: names.map(String::from).to_vec(),
        };
        for (index, step) in trajectory.steps.iter_mut().enumerate() {
            let action = if closed.contains(&index) {
                0
            } else if index == 7 {
                1
            } else {
                2
            };
            step.action = Action::Primitive(action);
        }
        trajectory.markers = vec![Marker {
            step: 28,
            name: "lifted".to_owned(),
        }];
    }
    let data = Dataset::new(&[DemonstrationSet::new("a", shown).unwrap()]).unwrap();
    let config = SamplingConfig {
        missed_grasp_share: 0.1,
        ..SamplingConfig::default()
    };
    let imitation = ImitationConfig {
        missed_grasp_steps: 4,
        lead_steps: 2,
    };
    let sampler = Sampler::new(&data, &[0, 1], &config, &imitation, 5).unwrap();
    let draw = sampler.draw(&mut ChaCha8Rng::seed_from_u64(3));
    assert!((config.states - 9..=config.states).contains(&draw.states.len()));
    assert!(!draw.grasps.is_empty());
    let missed = |state: StateRef| state.trajectory == 0 && (6..=7).contains(&state.step);
    for (from, to) in draw.grasps {
        let (from, to) = (draw.states[from], draw.states[to]);
        assert!(missed(from) != missed(to), "{from:?} {to:?}");
    }
}

#[test]
fn the_same_stream_draws_the_same_batch() {
    let config = SamplingConfig::default();
    assert_eq!(draws(&config, 3), draws(&config, 3));
    assert_ne!(draws(&config, 2)[0], draws(&config, 2)[1]);
}

#[test]
fn trajectories_of_one_step_have_no_pairs() {
    let data = Dataset::new(&[synthetic::demonstrations("a", 3, 1, 1)]).unwrap();
    assert!(matches!(
        Sampler::new(
            &data,
            &[0, 1],
            &SamplingConfig::default(),
            &ImitationConfig::default(),
            5
        ),
        Err(TrainingError::NoPairs { .. })
    ));
}
