use super::arguments::{Arguments, SimulateArguments};
use super::error::CliError;
use super::loaded::bedroom_at;
use super::serve::{run, server};
use super::worlds::composed;
use crate::environment::{Environment, EnvironmentError};
use crate::experiment::{ScoredBedroom, SubgoalOutcome};
use crate::serve::{EnvironmentService, Simulated};
use crate::simulator::Bedroom;
use crate::trajectory::{Action, ActionSpace, CameraSpec, Observation};

/// `catena simulate`: a bedroom for each client, until the process is asked to end.
pub(super) fn simulate(
    simulate_arguments: &SimulateArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let server = server(simulate_arguments.bind, &simulate_arguments.limits)?;
    let composition = composed(&simulate_arguments.target, &arguments.root)?;
    let bedroom = bedroom_at(&composition, simulate_arguments.level.into())?;
    let judged = composition.demonstrated_automaton();
    let make = || -> Box<dyn Simulated + Send> {
        Box::new(World(ScoredBedroom::new(Bedroom::new(bedroom), &judged)))
    };
    let service = EnvironmentService::new(&composition.name, make);
    run(server, "the simulator", &service)
}

struct World(ScoredBedroom);

impl Environment for World {
    fn cameras(&self) -> Vec<CameraSpec> {
        self.0.cameras()
    }

    fn action_space(&self) -> ActionSpace {
        self.0.action_space()
    }

    fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError> {
        self.0.reset(seed)
    }

    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError> {
        self.0.step(action)
    }
}

impl Simulated for World {
    fn outcomes(&self) -> Vec<(String, String)> {
        let subgoals = self.0.automaton().subgoals().iter();
        subgoals
            .zip(self.0.score().outcomes())
            .map(|(subgoal, outcome)| {
                let word = match outcome {
                    SubgoalOutcome::Reached => "reached",
                    SubgoalOutcome::Skipped => "skipped",
                    SubgoalOutcome::Missed => "missed",
                };
                (
                    format!("{}/{}", subgoal.task, subgoal.name),
                    word.to_owned(),
                )
            })
            .collect()
    }

    fn has_succeeded(&self) -> bool {
        self.0.score().is_success()
    }
}
