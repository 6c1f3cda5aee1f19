use super::arguments::{Arguments, GraphLocaliseArguments};
use super::demonstrations::{in_model_space, read_demonstrations, read_options, warn_of_own};
use super::error::CliError;
use super::loaded::Loaded;
use crate::composer::load_task_named;
use crate::experiment::LocalisationScore;
use crate::rollout::Monitor;
use crate::storage::Recordings;
use crate::task::locate_subgoals;

/// `catena graph localise`: follows recordings that are not in a task's graph along it.
pub(super) fn localise(
    localise_arguments: &GraphLocaliseArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let name_or_path = localise_arguments.task.to_string_lossy();
    let task = load_task_named(&name_or_path, &arguments.root)?;
    let loaded = Loaded::load(&name_or_path, arguments)?;
    let demos = std::slice::from_ref(&localise_arguments.demos);
    let recordings = Recordings::open(demos, &read_options(&localise_arguments.read))?;
    warn_of_own(&recordings, &task.graph);
    let (set, _) = read_demonstrations(&recordings, &task.task.name)?;
    let set = in_model_space(&set, &loaded.model)?;
    let recordings = set
        .trajectories()
        .iter()
        .map(|t| Ok((t.clone(), locate_subgoals(&task.rules, t)?)))
        .collect::<Result<Vec<_>, CliError>>()?;
    let planner = loaded.own_planner()?;
    let options = loaded.rollout_options(localise_arguments.nearest_states);
    let mut monitor = Monitor::new(loaded.rollout_model(), &planner, &options)?;
    let score = LocalisationScore::new(&mut monitor, &recordings, loaded.graph.d_max())?;
    if localise_arguments.json {
        println!("{}", serde_json::to_string_pretty(&score)?);
    } else {
        print!("{score}");
    }
    Ok(())
}
