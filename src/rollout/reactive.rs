use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;

use super::reflex::Reflex;
use super::running::Watch;
use super::{Episode, EpisodeEnd, RolloutError, RolloutOptions, StepTimes};
use crate::environment::Environment;
use crate::model::{ActionDistribution, Latents, ReactivePolicy};
use crate::trajectory::{Action, ActionSpace, Observation, State};

/// Runs a policy that acts on what it saw last and on a picture of the goal, without graph or plan: the
/// baselines of Fu & Finn, section IV-A.
///
/// It has the help that our closed loop has and needs no graph for: an action after which nothing moved is not
/// tried again until something does ([`RolloutOptions::still_levels`], [`RolloutOptions::least_substitute`]).
/// `terminate` is such an action: choosing it ends nothing, as in our loop.
pub struct ReactiveRollout<'a> {
    policy: &'a (dyn ReactivePolicy + Sync),
    goal: Vec<f32>,
    options: RolloutOptions,
}

/// Everything about one time step of a [`ReactiveRollout`], before its action is carried out.
#[derive(Clone, Debug)]
pub struct ReactiveStep {
    /// From 0.
    pub step: usize,
    /// What the cameras show.
    pub observation: Arc<Observation>,
    /// What the policy would do.
    pub distribution: ActionDistribution,
    /// What is done.
    pub action: Action,
    /// What it cost; localising and planning take no time.
    pub times: StepTimes,
}

/// Is told of every step of a [`ReactiveRollout`].
pub trait ReactiveObserver {
    /// Called once a step, before the action is carried out.
    fn on_step(&mut self, step: &ReactiveStep);
}

/// An observer that does not look.
impl ReactiveObserver for () {
    fn on_step(&mut self, _step: &ReactiveStep) {}
}

/// What changes during an episode.
struct Seen {
    frames: VecDeque<Arc<Observation>>,
    /// The latents of the last states, oldest first; as many as the policy acts on.
    latents: VecDeque<Vec<f32>>,
}

impl<'a> ReactiveRollout<'a> {
    /// A policy on its way to a goal: a state at the end of a demonstration of the task. Of the options only
    /// `max_steps`, `still_levels`, `still_share` and `least_substitute` matter.
    ///
    /// # Errors
    /// [`RolloutError::Model`] when the goal has other images than the policy's cameras.
    pub fn new(
        policy: &'a (dyn ReactivePolicy + Sync),
        goal: &State,
        options: RolloutOptions,
    ) -> Result<Self, RolloutError> {
        let encoded = policy.encode(std::slice::from_ref(goal));
        let goal = encoded.map_err(|source| RolloutError::Model { step: 0, source })?;
        Ok(Self {
            policy,
            goal: goal.row(0).to_vec(),
            options,
        })
    }

    /// One episode from a reset of the environment until `done` says so of the environment, asked before
    /// each step, or the steps are used up. What a policy of this kind knows of the task's stages is nothing, so
    /// the episode's `stage` is 0 and it has no events.
    ///
    /// # Errors
    /// [`RolloutError`] when the robot or the policy fails, or they do not belong together.
    pub fn run<E: Environment + ?Sized>(
        &self,
        environment: &mut E,
        seed: u64,
        observer: &mut dyn ReactiveObserver,
        mut done: impl FnMut(&E) -> bool,
    ) -> Result<Episode, RolloutError> {
        let space = &self.policy.spec().action_space;
        RolloutError::unless_same_actions(&environment.action_space(), space)?;
        let failed = |step| move |source| RolloutError::Environment { step, source };
        let mut newest = Arc::new(environment.reset(seed).map_err(failed(0))?);
        let mut seen = Seen {
            frames: VecDeque::new(),
            latents: VecDeque::new(),
        };
        let mut reflex = Reflex::new(space);
        let mut times = Vec::new();
        let end = loop {
            let step = times.len();
            if done(environment) {
                break EpisodeEnd::Finished;
            }
            if step >= self.options.max_steps {
                break EpisodeEnd::OutOfSteps;
            }
            let (record, classes) = self.decide(step, &newest, &mut seen, &reflex)?;
            observer.on_step(&record);
            let after = environment.step(&record.action).map_err(failed(step))?;
            reflex.note(&classes, &newest, &after, self.options.stillness());
            times.push(record.times);
            newest = Arc::new(after);
        };
        Ok(Episode {
            steps: times.len(),
            end,
            stage: 0,
            events: Vec::new(),
            lost_steps: 0,
            times,
        })
    }

    fn decide(
        &self,
        step: usize,
        newest: &Arc<Observation>,
        seen: &mut Seen,
        reflex: &Reflex,
    ) -> Result<(ReactiveStep, Vec<usize>), RolloutError> {
        let spec = self.policy.spec();
        let failed = |source| RolloutError::Model { step, source };
        let mut watch = Watch::start();
        let state = seen.state(newest, spec.stack);
        let latent = self.policy.encode(&[state]).map_err(failed)?;
        let encode_ms = watch.lap_ms();
        let history = seen.history(latent.row(0), spec.history);
        let distribution = self.policy.act(&history, &self.goal).map_err(failed)?;
        let classes = reflex.choose(&distribution, self.options.least_substitute);
        let action = match &spec.action_space {
            ActionSpace::Binned { .. } => spec.action_space.decoded_action(&distribution.heads),
            space => space.action(&classes),
        };
        let action = action.map_err(|source| RolloutError::Action { step, source })?;
        let times = StepTimes {
            encode_ms,
            act_ms: watch.lap_ms(),
            ..StepTimes::default()
        };
        let record = ReactiveStep {
            step,
            observation: Arc::clone(newest),
            distribution,
            action,
            times,
        };
        Ok((record, classes))
    }
}

impl fmt::Debug for ReactiveRollout<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReactiveRollout")
            .field("spec", self.policy.spec())
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

impl Seen {
    fn state(&mut self, newest: &Arc<Observation>, stack: usize) -> State {
        self.frames.push_back(Arc::clone(newest));
        while self.frames.len() > stack {
            self.frames.pop_front();
        }
        State::from_history(self.frames.make_contiguous(), stack)
    }

    /// The last `length` latents; before the start the first one is repeated.
    fn history(&mut self, latent: &[f32], length: usize) -> Latents {
        self.latents.push_back(latent.to_vec());
        while self.latents.len() > length {
            self.latents.pop_front();
        }
        let mut history = Latents::new(latent.len());
        let missing = length - self.latents.len();
        for place in 0..length {
            history.push(&self.latents[place.saturating_sub(missing)]);
        }
        history
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::environment::EnvironmentError;
    use crate::model::{BaselineMethod, BaselineSpec, ModelError};
    use crate::trajectory::{CameraSpec, Image};

    fn space() -> ActionSpace {
        ActionSpace::Primitives {
            names: vec!["up".to_owned(), "down".to_owned()],
        }
    }

    fn grey(level: u8) -> Observation {
        let image = Image::new(1, 1, vec![level; 3]).expect("3 bytes");
        Observation::new([("head".to_owned(), image)])
    }

    /// Shows its height as brightness; nothing goes above `ceiling`.
    struct Lift {
        level: u8,
        ceiling: u8,
    }

    impl Environment for Lift {
        fn cameras(&self) -> Vec<CameraSpec> {
            grey(0).cameras()
        }

        fn action_space(&self) -> ActionSpace {
            space()
        }

        fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError> {
            self.level = seed as u8;
            Ok(grey(self.level))
        }

        fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
            self.level = match action {
                Action::Primitive(0) => (self.level + 10).min(self.ceiling),
                _ => self.level - 10,
            };
            Ok(grey(self.level))
        }
    }

    /// Goes up while the goal is brighter, and keeps what histories it was given.
    struct Climber {
        spec: BaselineSpec,
        histories: Mutex<Vec<Vec<f32>>>,
    }

    impl ReactivePolicy for Climber {
        fn spec(&self) -> &BaselineSpec {
            &self.spec
        }

        fn encode(&self, states: &[State]) -> Result<Latents, ModelError> {
            let mut latents = Latents::new(1);
            for state in states {
                let image = state.newest().image("head").expect("one camera");
                latents.push(&[f32::from(image.rgb()[0])]);
            }
            Ok(latents)
        }

        fn act(&self, history: &Latents, goal: &[f32]) -> Result<ActionDistribution, ModelError> {
            let mut histories = self.histories.lock().expect("one thread");
            histories.push(history.values().to_vec());
            let up = if history.row(history.len() - 1)[0] < goal[0] {
                0.7
            } else {
                0.3
            };
            Ok(ActionDistribution {
                heads: vec![vec![up, 1.0 - up]],
            })
        }
    }

    fn climber() -> Climber {
        Climber {
            spec: BaselineSpec {
                method: BaselineMethod::BcRnn,
                cameras: grey(0).cameras(),
                stack: 2,
                action_space: space(),
                history: 3,
                latent_dim: 1,
                frozen: None,
            },
            histories: Mutex::default(),
        }
    }

    fn goal(level: u8) -> State {
        State::from_history(&[Arc::new(grey(level))], 2)
    }

    fn options(max_steps: usize) -> RolloutOptions {
        RolloutOptions {
            max_steps,
            ..RolloutOptions::default()
        }
    }

    #[test]
    fn the_history_begins_with_the_first_state_repeated_and_moves_on() {
        let policy = climber();
        let rollout = ReactiveRollout::new(&policy, &goal(200), options(4)).expect("a goal");
        let mut lift = Lift {
            level: 0,
            ceiling: 255,
        };
        let episode = rollout
            .run(&mut lift, 50, &mut (), |_| false)
            .expect("it runs");
        assert_eq!((episode.steps, &episode.end), (4, &EpisodeEnd::OutOfSteps));
        assert_eq!(episode.times.len(), 4);
        let histories = policy.histories.lock().expect("one thread");
        let expected: [&[f32]; 4] = [
            &[50.0, 50.0, 50.0],
            &[50.0, 50.0, 60.0],
            &[50.0, 60.0, 70.0],
            &[60.0, 70.0, 80.0],
        ];
        assert_eq!(*histories, expected);
    }

    #[test]
    fn it_ends_as_soon_as_it_is_said_to_be_done() {
        let policy = climber();
        let rollout = ReactiveRollout::new(&policy, &goal(200), options(50)).expect("a goal");
        let mut lift = Lift {
            level: 0,
            ceiling: 255,
        };
        let done = |lift: &Lift| lift.level >= 80;
        let episode = rollout.run(&mut lift, 50, &mut (), done).expect("it runs");
        assert_eq!((episode.steps, episode.end), (3, EpisodeEnd::Finished));
    }

    #[test]
    fn what_had_no_effect_gives_way_as_in_our_own_loop() {
        struct Actions(Vec<Action>);
        impl ReactiveObserver for Actions {
            fn on_step(&mut self, step: &ReactiveStep) {
                assert_eq!(step.distribution.heads[0][0], 0.7);
                self.0.push(step.action.clone());
            }
        }
        let policy = climber();
        let rollout = ReactiveRollout::new(&policy, &goal(200), options(4)).expect("a goal");
        let mut lift = Lift {
            level: 0,
            ceiling: 60,
        };
        let mut actions = Actions(Vec::new());
        rollout
            .run(&mut lift, 50, &mut actions, |_| false)
            .expect("it runs");
        let classes = [0, 0, 1, 0].map(Action::Primitive);
        assert_eq!(actions.0, classes);
    }

    #[test]
    fn a_robot_with_other_actions_is_refused() {
        let mut policy = climber();
        let ActionSpace::Primitives { names } = &mut policy.spec.action_space else {
            unreachable!("a lift has primitives")
        };
        names.reverse();
        let rollout = ReactiveRollout::new(&policy, &goal(200), options(4)).expect("a goal");
        let mut lift = Lift {
            level: 0,
            ceiling: 60,
        };
        let refused = rollout.run(&mut lift, 50, &mut (), |_| false);
        let Err(RolloutError::ActionSpaceDiffers { robot, model }) = refused else {
            panic!("it runs")
        };
        assert_ne!(robot, model, "as many primitives, in another order");
    }
}
