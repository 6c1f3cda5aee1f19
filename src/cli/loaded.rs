//! Compositions as commands load them.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, OnceLock};

use super::arguments::{Arguments, EngineArgument};
use super::error::CliError;
use super::progress::{self, show_progress};
use super::worlds::{BEDROOM, composed};
use crate::composer::{Composition, EnvironmentConfig, ResolvedTask};
use crate::graph::TopologicalGraph;
use crate::inference::EngineChoice;
use crate::loading::{LoadedComposition, merge_options};
use crate::planner::{Plan, Planner, PlannerOptions, Terms};
use crate::rollout::{RolloutModel, RolloutOptions};
use crate::simulator::{BedroomConfig, Level};
use crate::storage::sha256_file;

impl From<EngineArgument> for EngineChoice {
    fn from(argument: EngineArgument) -> Self {
        match argument {
            EngineArgument::Auto => Self::Auto,
            EngineArgument::Native => Self::Native,
            EngineArgument::Embedded => Self::Tract,
        }
    }
}

/// A loaded composition, and what only commands ask of it.
pub(super) struct Loaded(LoadedComposition);

impl Deref for Loaded {
    type Target = LoadedComposition;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Loaded {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Loaded {
    /// Reads a composition or a task, and loads it as [`LoadedComposition::load`] does, with a progress bar.
    pub(super) fn load(name_or_path: &str, arguments: &Arguments) -> Result<Self, CliError> {
        Self::of(composed(name_or_path, &arguments.root)?, arguments)
    }

    /// The same for a composition that was read already.
    pub(super) fn of(composition: Composition, arguments: &Arguments) -> Result<Self, CliError> {
        // A bedroom that cannot be is told after folders that are missing, and before anything is loaded.
        composition.check_files()?;
        if is_bedroom(&composition) {
            bedroom(&composition)?;
        }
        let (engine, options) = (arguments.engine.into(), merge_options());
        // There is none before merging begins.
        let bar = OnceLock::new();
        let show = |p| show_progress(bar.get_or_init(|| progress::bar("merging", 0)), p);
        let loaded = LoadedComposition::load_with(composition, engine, &options, &show);
        if let Some(bar) = bar.get() {
            bar.finish_and_clear();
        }
        Ok(Self(loaded?))
    }

    /// A planner of the composition on another graph of its tasks, whose states are numbered otherwise:
    /// nothing is avoided, and nothing left out.
    pub(super) fn planner_on(
        &self,
        graph: Arc<TopologicalGraph>,
        options: PlannerOptions,
    ) -> Result<Planner, CliError> {
        Ok(Planner::new(
            graph,
            &self.composition.automaton,
            self.terms_without_regions(),
            options,
        )?)
    }

    fn terms_without_regions(&self) -> Terms {
        Terms {
            avoid: Vec::new(),
            unplaced: Vec::new(),
            ..self.composition.terms()
        }
    }

    /// What the paper would plan, which knows nothing of what is to be avoided, to be audited; none where
    /// it finds no way.
    pub(super) fn paper_plan(&self) -> Result<Option<(Planner, Plan)>, CliError> {
        let planner = Planner::new(
            Arc::clone(&self.graph),
            &self.composition.automaton,
            self.terms_without_regions(),
            PlannerOptions::paper(),
        )?;
        let plan = planner.plan_from_start().ok();
        Ok(plan.map(|plan| (planner, plan)))
    }

    pub(super) fn rollout_model(&self) -> RolloutModel<'_> {
        RolloutModel {
            encoder: &self.model,
            traversability: &self.model,
            policy: &self.model,
            landmarks: self.model.landmarks(),
        }
    }

    /// How the composition is run; `nearest_states` is what was given by `--nearest-states`.
    pub(super) fn rollout_options(&self, nearest_states: Option<usize>) -> RolloutOptions {
        RolloutOptions {
            nearest_states,
            max_steps: self.composition.limits.steps as usize,
            on_shortcut: self.composition.on_shortcut,
            ..RolloutOptions::default()
        }
    }

    /// The bedroom that the composition starts in.
    pub(super) fn bedroom(&self) -> Result<BedroomConfig, CliError> {
        bedroom(&self.composition)
    }
}

/// Digests of the graphs of a composition's tasks, each as `task:digest`.
pub(super) fn graph_digests(composition: &Composition) -> Result<Vec<String>, CliError> {
    let all = digests_by_task(composition)?.into_iter();
    let written = all.map(|(task, digest)| format!("{task}:{digest}"));
    Ok(written.collect())
}

/// The same digests with the tasks' names.
pub(super) fn digests_by_task(
    composition: &Composition,
) -> Result<Vec<(String, String)>, CliError> {
    let digest = |task: &ResolvedTask| {
        let digest = sha256_file(&task.graph.join("manifest.json"))?;
        Ok((task.task.name.clone(), digest))
    };
    composition.all_tasks().map(digest).collect()
}

/// Whether a composition's world is the simulated bedroom; robots of one's own may have another, or none.
fn is_bedroom(composition: &Composition) -> bool {
    let world = composition.environment.as_ref();
    world.is_some_and(|world| world.kind.value == BEDROOM.name)
}

/// The bedroom that a composition starts in.
pub(super) fn bedroom(composition: &Composition) -> Result<BedroomConfig, CliError> {
    Ok(world(composition)?.settings_as()?)
}

/// The same at another level than it names, at which also is what it does not say of the variation.
pub(super) fn bedroom_at(
    composition: &Composition,
    level: Level,
) -> Result<BedroomConfig, CliError> {
    let mut world = world(composition)?.clone();
    let level = serde_json::to_value(level)?;
    world.settings.insert("level".to_owned(), level);
    Ok(world.settings_as()?)
}

/// What a composition says of the bedroom.
fn world(composition: &Composition) -> Result<&EnvironmentConfig, CliError> {
    match &composition.environment {
        Some(world) if world.kind.value == BEDROOM.name => Ok(world),
        Some(other) => Err(other.unknown(&[BEDROOM.name]).into()),
        None => Err(CliError::NoWorld {
            composition: composition.name.clone(),
        }),
    }
}

/// Tells what may not be meant as it is written, though it works.
pub(super) fn tell_warnings(composition: &Composition) {
    for warning in &composition.warnings {
        let help = warning.help.as_ref();
        let help = help.map_or_else(String::new, |help| format!(" ({help})"));
        eprintln!("warning: {}{help}", warning.line());
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::composer::{FoundBy, TaskSpec};

    fn composition_in(world: Option<EnvironmentConfig>) -> Composition {
        let task = TaskSpec::new("cup", "graphs/cup")
            .subgoal("cup_in_sink", FoundBy::End)
            .resolve(Path::new(""))
            .expect("a sound task");
        let builder = Composition::builder("one").model("m").task(task);
        let builder = match world {
            Some(world) => builder.environment(world),
            None => builder,
        };
        builder.build().expect("a sound composition")
    }

    #[test]
    fn what_is_not_said_of_a_bedroom_is_as_at_the_level_that_is_asked_for() {
        let settings = serde_json::json!({"start": "wine", "variation": {"light": 0.1}});
        let serde_json::Value::Object(settings) = settings else {
            panic!("a map")
        };
        let composition = composition_in(Some(EnvironmentConfig::new("bedroom", settings)));
        let headings = |config: BedroomConfig| {
            let variation = config.variation.expect("it is given");
            (variation.light, variation.start_heading_deg)
        };
        let own = bedroom(&composition).expect("it is possible");
        assert_eq!(headings(own), (0.1, 15.0));
        let hard = bedroom_at(&composition, Level::Hard).expect("it is possible");
        assert_eq!((hard.level, headings(hard)), (Level::Hard, (0.1, 30.0)));
    }

    #[test]
    fn a_world_that_is_not_known_is_refused_with_the_nearest_one() {
        let named = EnvironmentConfig::new("bedrom", serde_json::Map::new());
        let error = bedroom(&composition_in(Some(named))).expect_err("there is none");
        let told = error.report();
        assert!(told.contains("the world 'bedrom' is not known"), "{told}");
        assert!(told.contains("did you mean 'bedroom'?"), "{told}");
        let error = bedroom(&composition_in(None)).expect_err("there is none");
        assert!(error.to_string().starts_with("'one' names no world; write"));
    }
}
