use thiserror::Error;

use crate::environment::EnvironmentError;
use crate::graph::GraphError;
use crate::model::ModelError;
use crate::planner::PlannerError;

/// Why a measurement could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// A recording of another robot than the simulated one, or of another action space.
    #[error(
        "the recording '{recording}' cannot be replayed: its actions are not the bedroom's primitives"
    )]
    ActionsOfAnotherRobot {
        /// The recording.
        recording: String,
    },
    /// A recording of a task that the bedroom does not know.
    #[error("the recording '{recording}' cannot be replayed: the bedroom has no task '{task}'")]
    TaskOfAnotherWorld {
        /// The recording.
        recording: String,
        /// Its task.
        task: String,
    },
    /// A recording that does not say which episode it is of.
    #[error("the recording '{recording}' cannot be replayed: its metadata has no seed")]
    SeedMissing {
        /// The recording.
        recording: String,
    },
    /// The recorded pictures are of other cameras than the bedroom's, or of another size.
    #[error(
        "the recording '{recording}' cannot be replayed: at step {step} camera '{camera}' is {found} in the recording \
         and {expected} in the bedroom; give it as it was recorded, neither converted to another size nor read through \
         a mapping file with 'image_size', 'image_sizes' or 'cameras', or record it again"
    )]
    CameraDiffers {
        /// The recording.
        recording: String,
        /// The first step at which they differ.
        step: usize,
        /// The camera, by the name that it has where it is.
        camera: String,
        /// Its size in the recording (rows x columns), or `missing`.
        found: String,
        /// Its size in the bedroom, or `missing`.
        expected: String,
    },
    /// The simulator shows something else than what was recorded.
    #[error(
        "the recording '{recording}' is not of this bedroom: at step {step} the replayed pictures differ from the \
         recorded ones by {difference:.1} of 255 levels on average; record it again with this version"
    )]
    ReplayDiffers {
        /// The recording.
        recording: String,
        /// The first step at which they differ.
        step: usize,
        /// Mean difference of the channels of all pixels, in levels of 0..=255.
        difference: f64,
    },
    /// A run is to go on from where a recorded one never came.
    #[error(
        "'{recording}' cannot be gone on from: by the simulator's truth it never reached {missing} in order"
    )]
    NeverReached {
        /// The recording.
        recording: String,
        /// The subgoals that it lacks, separated by commas.
        missing: String,
    },
    /// A replayed action was refused.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// States without a replay.
    #[error("the graph has a state of '{demonstration}', of which there is no replay")]
    NotReplayed {
        /// The demonstration.
        demonstration: String,
    },
    /// A graph could not be built or merged.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The model gives no answer.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The composition does not fit the graph.
    #[error(transparent)]
    Planner(#[from] PlannerError),
}
