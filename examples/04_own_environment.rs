//! The closed loop in an environment of your own: a robot on a line of ten cells, whose camera shows
//! the number of its cell as grey, and a model that reads that grey exactly.
//!
//! `cargo run --release --example 04_own_environment`

use std::error::Error;
use std::sync::Arc;

use catena::environment::{Environment, EnvironmentError};
use catena::graph::{BuildOptions, build};
use catena::model::{
    ActionDistribution, Encoder, Latents, LocalPolicy, ModelError, ModelSpec, Projections,
    StepDistributions, Traversability,
};
use catena::planner::{FinalChoice, Planner, PlannerOptions};
use catena::rollout::{EpisodeEnd, Rollout, RolloutModel, RolloutOptions};
use catena::task::{Automaton, Subgoal, Task};
use catena::trajectory::{
    Action, ActionSpace, CameraSpec, DemonstrationSet, Image, Observation, State, Step, Trajectory,
};

struct Line(u8);

impl Line {
    fn see(&self) -> Observation {
        let grey = Image::new(1, 1, vec![20 * self.0; 3]).expect("three bytes");
        Observation::new([("eye".to_owned(), grey)])
    }
}

impl Environment for Line {
    fn cameras(&self) -> Vec<CameraSpec> {
        self.see().cameras()
    }
    fn action_space(&self) -> ActionSpace {
        let names = vec!["left".to_owned(), "right".to_owned()];
        ActionSpace::Primitives { names }
    }
    fn reset(&mut self, _seed: u64) -> Result<Observation, EnvironmentError> {
        self.0 = 0;
        Ok(self.see())
    }
    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        self.0 = if *action == Action::Primitive(1) {
            (self.0 + 1).min(9)
        } else {
            self.0.saturating_sub(1)
        };
        Ok(self.see())
    }
}

/// Implement these three traits over your own networks, or let `catena train` make them.
struct Oracle(ModelSpec);

impl Encoder for Oracle {
    fn spec(&self) -> &ModelSpec {
        &self.0
    }
    fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
        let cell = |s: &State| f32::from(s.newest().image("eye").expect("the eye").rgb()[0]) / 20.0;
        Ok(Latents::from_values(1, states.iter().map(cell).collect()))
    }
}

impl Traversability for Oracle {
    fn d_max(&self) -> usize {
        self.0.d_max
    }
    fn project(&self, latents: &Latents) -> Result<Projections, ModelError> {
        Ok(Projections {
            from: latents.clone(),
            to: latents.clone(),
        })
    }
    fn predict(
        &self,
        from: &Projections,
        to: &Projections,
        pairs: &[(u32, u32)],
    ) -> Result<StepDistributions, ModelError> {
        let mut rows = Vec::new();
        for (a, b) in pairs {
            let steps = to.to.row(*b as usize)[0] - from.from.row(*a as usize)[0];
            let class = (steps.abs().max(1.0) as usize).min(self.0.d_max) - 1;
            rows.extend((0..self.0.d_max).map(|k| if k == class { 0.96 } else { 0.01 }));
        }
        Ok(StepDistributions::new(self.0.d_max, rows))
    }
}

impl LocalPolicy for Oracle {
    fn act(&self, from: &[f32], goal: &[f32]) -> Result<ActionDistribution, ModelError> {
        let right = if goal[0] > from[0] { 0.9 } else { 0.1 };
        Ok(ActionDistribution {
            heads: vec![vec![1.0 - right, right]],
        })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut line = Line(0);
    let (space, cameras) = (line.action_space(), line.cameras());
    let step = |cell| Step {
        time_secs: f64::from(cell),
        observation: Arc::new(Line(cell).see()),
        action: Action::Primitive(1),
    };
    let demonstration = Trajectory {
        id: "walk".into(),
        task: "walk".into(),
        action_space: space.clone(),
        steps: (0..10).map(step).collect(),
        markers: vec![],
    };
    let set = DemonstrationSet::new("walk", vec![demonstration])?;
    let oracle = Oracle(ModelSpec {
        cameras,
        stack: 1,
        action_space: space,
        d_max: 5,
        latent_dim: 1,
    });
    let end = Subgoal {
        task: "walk".into(),
        name: "end".into(),
    };
    let built = build(
        &set,
        &[vec![(end.clone(), 9)]],
        &oracle,
        &oracle,
        &BuildOptions::default(),
        &|_| {},
    )?;
    let automaton = Automaton::in_order(&[Task {
        name: "walk".into(),
        subgoals: vec![end],
    }]);
    let planner = Planner::new(
        Arc::new(built.graph),
        &automaton,
        &FinalChoice::Cheapest,
        PlannerOptions::default(),
    )?;
    let model = RolloutModel {
        encoder: &oracle,
        traversability: &oracle,
        policy: &oracle,
        landmarks: None,
    };
    let episode =
        Rollout::new(model, planner, RolloutOptions::default())?.run(&mut line, 0, &mut ())?;
    episode.events.iter().for_each(|event| println!("{event}"));
    // The smallest number of steps is 1: next to the end and at the end look the same.
    assert!(line.0 >= 8 && episode.end == EpisodeEnd::Finished);
    Ok(())
}
