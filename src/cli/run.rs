use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::json;

use super::arguments::{Arguments, RunArguments};
use super::compose::{PlanReport, describe, plan};
use super::error::CliError;
use super::graph::{PICTURE_EVERY_STEPS, results_folder};
use super::loaded::{Loaded, tell_warnings};
use super::progress;
use super::resume::{self, RECORDING, ResumeReport, stage_named};
use crate::environment::Environment;
use crate::experiment::{EpisodeResult, ResumedBedroom, ScoredBedroom, SubgoalOutcome};
use crate::graph::NodeId;
use crate::planner::Start;
use crate::rollout::{Event, Rollout, RolloutObserver, StepRecord};
use crate::simulator::{Bedroom, PRIMITIVE_SECS};
use crate::storage::{EpisodeWriter, RecordingMetadata, write_file};
use crate::trajectory::{Observation, Step};
use crate::view::{EventLevel, RolloutRecording, RolloutScene, StepView, write_merged_graph_svg};
use crate::wording::counted;

/// `summary.json` of a run.
#[derive(Serialize)]
struct Summary {
    plan: PlanReport,
    seed: u64,
    success: bool,
    subgoals: Vec<SubgoalSummary>,
    result: EpisodeResult,
    events: Vec<Event>,
    /// Median time of a step in milliseconds, the upper one of an even number.
    step_median_ms: f64,
    engine: String,
    model: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    resumed: Option<ResumeReport>,
    files: Vec<PathBuf>,
}

#[derive(Serialize)]
struct SubgoalSummary {
    name: String,
    outcome: SubgoalOutcome,
    step: Option<usize>,
}

/// `catena run`: plans, runs one episode, and leaves recording, pictures and a summary.
pub(super) fn run(run_arguments: &RunArguments, arguments: &Arguments) -> Result<(), CliError> {
    let mut loaded = Loaded::load(&run_arguments.file.to_string_lossy(), arguments)?;
    tell_warnings(&loaded.composition);
    let resumed = run_arguments.resume.as_deref();
    let stage = resumed.map(|name| stage_named(name, &loaded.composition.automaton));
    let stage = stage.transpose()?;
    if let Some(stage) = stage {
        loaded.composition.start = Start::Stage(stage);
    }
    let loaded = loaded;
    let planned = plan(&loaded)?;
    print!("{}", describe(&loaded, &planned));
    let name = &loaded.composition.name;
    let usual = || stage.map_or_else(|| results_folder(name), |s| resume::folder(name, s));
    let out = run_arguments.out.clone().unwrap_or_else(usual);
    let mut room = Room::new(&loaded, run_arguments, stage, &out)?;
    fs::create_dir_all(&out).map_err(CliError::io(&out))?;
    let svg = out.join("merged_graph.svg");
    let title = loaded.composition.name.replace('_', " ");
    write_merged_graph_svg(&svg, &loaded.graph, Some(&planned.plan.route), &title)?;

    let spec = &loaded.model.manifest().spec;
    let scene = RolloutScene {
        title: &title,
        graph: &loaded.graph,
        automaton: &loaded.composition.automaton,
        action_space: &spec.action_space,
        cameras: &spec.cameras,
        route: &planned.plan.route,
    };
    println!("engine: {}", loaded.model.engine().description());
    let mut recorder = Recorder {
        loaded: &loaded,
        scene,
        rerun: RolloutRecording::create(&out.join("rollout.rrd"), scene)?,
        mcap: EpisodeWriter::create(
            &out.join(RECORDING),
            &loaded.composition.name,
            &spec.action_space,
        )?,
        bar: progress::bar("running", u64::from(loaded.composition.limits.steps)),
        failure: None,
    };
    let mut rollout = Rollout::new(
        loaded.rollout_model(),
        planned.planner,
        loaded.rollout_options(None),
    )?;
    if let [done @ .., now] = &room.before[..] {
        rollout.go_on_from(done, &now.observation);
    }
    let seed = room.seed;
    let episode = rollout.run(room.environment.as_mut(), seed, &mut recorder)?;
    let result = EpisodeResult::new(seed, &episode, room.environment.scored().score());
    recorder.finish(&result, seed, room.resumed.as_ref())?;

    let automaton = loaded.composition.demonstrated_automaton();
    let subgoals: Vec<SubgoalSummary> = automaton
        .subgoals()
        .iter()
        .zip(&result.outcomes)
        .zip(&result.first_steps)
        .map(|((subgoal, outcome), step)| SubgoalSummary {
            name: subgoal.name.clone(),
            outcome: *outcome,
            step: *step,
        })
        .collect();
    print_outcome(&subgoals, &result, room.resumed.as_ref());
    let mut times = result.step_times_ms.clone();
    times.sort_by(f64::total_cmp);
    let names = [RECORDING, "rollout.rrd", "merged_graph.svg", "summary.json"];
    let summary = Summary {
        plan: planned.report,
        seed,
        success: result.success,
        subgoals,
        result,
        events: episode.events,
        step_median_ms: times.get(times.len() / 2).copied().unwrap_or(0.0),
        engine: loaded.model.engine().name().to_owned(),
        model: loaded.model.digest(),
        resumed: room.resumed,
        files: names.map(PathBuf::from).to_vec(),
    };
    write_json(&out.join("summary.json"), &summary)?;
    println!("in {}: {}", out.display(), names.join(", "));
    Ok(())
}

/// The world of a run, from its beginning or from where an earlier one had come to.
struct Room {
    environment: Box<dyn Scored>,
    seed: u64,
    resumed: Option<ResumeReport>,
    /// What is done again at every reset, and after it what is seen then.
    before: Vec<Step>,
}

impl Room {
    fn new(
        loaded: &Loaded,
        run_arguments: &RunArguments,
        stage: Option<usize>,
        out: &Path,
    ) -> Result<Self, CliError> {
        if let Some(stage) = stage {
            let (room, report, before) = resume::room(loaded, run_arguments, stage, out)?;
            return Ok(Self {
                seed: room.seed(),
                environment: Box::new(room),
                resumed: Some(report),
                before,
            });
        }
        let bedroom = Bedroom::new(loaded.bedroom()?);
        let automaton = loaded.composition.demonstrated_automaton();
        Ok(Self {
            environment: Box::new(ScoredBedroom::new(bedroom, &automaton)),
            seed: run_arguments.seed,
            resumed: None,
            before: Vec::new(),
        })
    }
}

/// A world that keeps score.
trait Scored: Environment {
    fn scored(&self) -> &ScoredBedroom;
}

impl Scored for ScoredBedroom {
    fn scored(&self) -> &ScoredBedroom {
        self
    }
}

impl Scored for ResumedBedroom {
    fn scored(&self) -> &ScoredBedroom {
        self.room()
    }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value)?;
    write_file(path, |file| file.write_all(text.as_bytes()))?;
    Ok(())
}

fn print_outcome(
    subgoals: &[SubgoalSummary],
    result: &EpisodeResult,
    resumed: Option<&ResumeReport>,
) {
    println!("what really happened, by the simulator:");
    for subgoal in subgoals {
        let outcome = match (subgoal.outcome, subgoal.step) {
            (SubgoalOutcome::Reached, Some(step)) => format!("reached at step {step}"),
            (SubgoalOutcome::Skipped, Some(step)) => format!("SKIPPED, made up for at step {step}"),
            (SubgoalOutcome::Skipped, None) => "SKIPPED".to_owned(),
            _ => "missed".to_owned(),
        };
        println!("  {:<16} {outcome}", subgoal.name);
    }
    let verdict = if result.success {
        "success"
    } else {
        "no success"
    };
    let resumed = resumed.map_or_else(String::new, ToString::to_string);
    println!(
        "{verdict} after {}{resumed} ({})",
        counted(result.steps, "step"),
        result.ended
    );
}

/// Writes each step of a run to Rerun and MCAP, and keeps the first failure to do so.
struct Recorder<'a> {
    loaded: &'a Loaded,
    scene: RolloutScene<'a>,
    rerun: RolloutRecording<'a>,
    mcap: EpisodeWriter,
    bar: ProgressBar,
    failure: Option<CliError>,
}

impl RolloutObserver for Recorder<'_> {
    fn on_step(&mut self, record: &StepRecord) {
        if self.failure.is_none() {
            self.failure = self.write_step(record).err();
        }
        self.bar.set_position(record.step as u64);
        let due = self
            .loaded
            .composition
            .automaton
            .subgoals()
            .get(record.localisation.stage);
        self.bar
            .set_message(due.map_or("done".to_owned(), |s| format!("to {}", s.name)));
        for event in &record.events {
            self.tell(event);
        }
    }

    fn on_end(&mut self, step: usize, observation: &Arc<Observation>, events: &[Event]) {
        for event in events {
            self.tell(event);
        }
        if self.failure.is_none() {
            self.failure = self.write_end(step, observation, events).err();
        }
        self.bar.finish_and_clear();
    }
}

impl Recorder<'_> {
    fn tell(&self, event: &Event) {
        if self.bar.is_hidden() {
            println!("  {event}");
        } else {
            self.bar.println(format!("  {event}"));
        }
    }

    fn write_step(&mut self, record: &StepRecord) -> Result<(), CliError> {
        let space = self.scene.action_space;
        let name = space.name(&record.action);
        let goal = self.goal_observation(record.goal.node);
        let view = StepView {
            step: record.step as u32,
            time_secs: record.step as f64 * PRIMITIVE_SECS,
            observation: &record.observation,
            goal: goal.as_ref(),
            goal_node: Some(record.goal.node),
            current: (!record.localisation.is_lost).then_some(record.localisation.node),
            path: &record.goal.route,
            stage: record.localisation.stage,
            actions: Some(&record.distribution),
            chosen: Some(&name),
            cost_to_go_steps: Some(record.goal.cost),
        };
        self.rerun.log_step(&view)?;
        self.mcap.add_step(&Step {
            time_secs: view.time_secs,
            observation: Arc::clone(&record.observation),
            action: record.action.clone(),
        })?;
        // What is added to the recording has the time of its newest step.
        self.write_events(&record.events, record.step)?;
        let plan = json!({
            "stage": record.localisation.stage,
            "state": self.loaded.graph.node(record.localisation.node).place(),
            "goal": self.loaded.graph.node(record.goal.node).place(),
            "cost": record.goal.cost,
            "entropy_nats": record.localisation.entropy_nats,
            "is_lost": record.localisation.is_lost,
        });
        self.mcap.add_json("/plan", "catena.Plan", &plan)?;
        Ok(())
    }

    fn write_events(&mut self, events: &[Event], step: usize) -> Result<(), CliError> {
        for event in events {
            let level = match event {
                Event::SubgoalReached { .. } | Event::Terminated { .. } => EventLevel::Success,
                Event::Shortcut { .. } => EventLevel::Error,
                Event::Found { .. } => EventLevel::Info,
                _ => EventLevel::Warning,
            };
            let time_secs = step as f64 * PRIMITIVE_SECS;
            self.rerun
                .log_event(step as u32, time_secs, level, &event.to_string())?;
            self.mcap
                .add_json("/event", "catena.Event", &serde_json::to_value(event)?)?;
        }
        Ok(())
    }

    fn write_end(
        &mut self,
        step: usize,
        observation: &Arc<Observation>,
        events: &[Event],
    ) -> Result<(), CliError> {
        if let Some(terminate) = self.scene.action_space.terminate() {
            self.mcap.add_step(&Step {
                time_secs: step as f64 * PRIMITIVE_SECS,
                observation: Arc::clone(observation),
                action: terminate,
            })?;
        }
        self.write_events(events, step)
    }

    /// How the goal state, or the nearest state of its demonstration that was kept as a picture,
    /// looked when it was demonstrated; none where the graph has no pictures.
    fn goal_observation(&self, node: NodeId) -> Option<Observation> {
        let node = self.loaded.graph.node(node);
        let images = self.loaded.images_of(&node.task)?;
        let at = |step: u32, camera: &str| images.image(&node.trajectory, step, camera).ok()?;
        let image = |camera: &str| {
            (0..PICTURE_EVERY_STEPS).find_map(|off| {
                at(node.step.saturating_sub(off), camera).or_else(|| at(node.step + off, camera))
            })
        };
        let images: Vec<_> = self
            .scene
            .cameras
            .iter()
            .filter_map(|c| Some((c.name.clone(), image(&c.name)?)))
            .collect();
        (!images.is_empty()).then(|| Observation::new(images))
    }

    fn finish(
        self,
        result: &EpisodeResult,
        seed: u64,
        resumed: Option<&ResumeReport>,
    ) -> Result<(), CliError> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        self.rerun.finish()?;
        self.mcap.finish(&RecordingMetadata {
            robot: "LoCoBot (simulated)".to_owned(),
            seed: Some(seed),
            success: Some(result.success),
            notes: resumed.and_then(ResumeReport::note).into_iter().collect(),
        })?;
        Ok(())
    }
}
