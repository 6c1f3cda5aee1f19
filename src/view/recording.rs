//! A rollout as a Rerun recording: what the robot sees, where in the graph it is, what it plans and
//! how sure it is.

mod labels;
mod layout;
mod map;
mod panels;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use ::rerun::{AsComponents, RecordingStream, RecordingStreamBuilder};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use self::map::Map;
use super::{ViewError, file};
use crate::graph::{NodeId, TopologicalGraph};
use crate::model::ActionDistribution;
use crate::task::Automaton;
use crate::trajectory::{ActionSpace, CameraSpec, Image, Observation};

const APPLICATION: &str = "catena";
const JPEG_QUALITY: u8 = 92;

/// What stays the same during a rollout.
#[derive(Clone, Copy, Debug)]
pub struct RolloutScene<'a> {
    /// What the viewer calls the recording, such as the composition's name.
    pub title: &'a str,
    /// The merged graph that the plan is made in.
    pub graph: &'a TopologicalGraph,
    /// The subgoals in the order in which they are due.
    pub automaton: &'a Automaton,
    /// What the heads of the policy stand for.
    pub action_space: &'a ActionSpace,
    /// The cameras of the robot.
    pub cameras: &'a [CameraSpec],
    /// The route that was planned before the first step; gives the graph its layout. May be empty.
    pub route: &'a [NodeId],
}

/// What is to be seen of one time step.
#[derive(Clone, Copy, Debug)]
pub struct StepView<'a> {
    /// Number of the step, from 0.
    pub step: u32,
    /// Seconds since the start of the rollout.
    pub time_secs: f64,
    /// What the robot sees now.
    pub observation: &'a Observation,
    /// How the goal state looked when it was demonstrated.
    pub goal: Option<&'a Observation>,
    /// The goal state as a node of the graph.
    pub goal_node: Option<NodeId>,
    /// The node that the robot is at or nearest to; none when it is lost.
    pub current: Option<NodeId>,
    /// The planned path from here to the final state; empty when there is none.
    pub path: &'a [NodeId],
    /// How many subgoals are reached.
    pub stage: usize,
    /// What the policy gave.
    pub actions: Option<&'a ActionDistribution>,
    /// The action that was taken, by name.
    pub chosen: Option<&'a str>,
    /// Cost of the planned path, in steps.
    pub cost_to_go_steps: Option<f64>,
}

/// How an event is coloured in the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventLevel {
    /// For the record.
    Info,
    /// A subgoal was reached.
    Success,
    /// The robot is lost, or the plan was given up.
    Warning,
    /// A shortcut, or the end without success.
    Error,
}

/// A recording in the making. It is written beside its place and takes its name in
/// [`finish`](Self::finish); dropped before, it leaves no file of that name.
pub struct RolloutRecording<'a> {
    path: PathBuf,
    scene: RolloutScene<'a>,
    stream: RecordingStream,
    map: Map,
    goal: Option<Observation>,
    /// The last text of each panel, so that only changes are written.
    texts: BTreeMap<&'static str, String>,
}

impl<'a> RolloutRecording<'a> {
    /// Starts a recording: layout of the viewer, graph, and the names of everything.
    ///
    /// # Errors
    /// [`ViewError::FileUnwritable`] when the folder cannot be made, [`ViewError::RecordingFailed`]
    /// when Rerun cannot write.
    pub fn create(path: &Path, scene: RolloutScene<'a>) -> Result<Self, ViewError> {
        file::create_folder(path)?;
        let failed = |entity: &str, reason: String| ViewError::RecordingFailed {
            path: path.to_path_buf(),
            entity: entity.to_owned(),
            reason,
        };
        // Without `enabled` the environment could switch the recording off.
        let stream = RecordingStreamBuilder::new(APPLICATION)
            .recording_name(scene.title)
            .enabled(true)
            .with_blueprint(layout::blueprint(&scene))
            .save(file::unfinished(path))
            .map_err(|e| failed("the start", e.to_string()))?;
        // When the file was written says nothing of the rollout.
        stream.set_log_time_enabled(false);
        stream.set_log_tick_enabled(false);
        let recording = Self {
            path: path.to_path_buf(),
            scene,
            stream,
            map: Map::new(&scene),
            goal: None,
            texts: BTreeMap::new(),
        };
        for (entity, archetype) in recording.map.still_life(scene.graph) {
            recording
                .stream
                .log_static(entity.as_str(), archetype.as_ref())
                .map_err(|e| failed(&entity, e.to_string()))?;
        }
        for (entity, style) in panels::styles() {
            recording
                .stream
                .log_static(entity, &style)
                .map_err(|e| failed(entity, e.to_string()))?;
        }
        Ok(recording)
    }

    /// Adds a step.
    ///
    /// # Errors
    /// [`ViewError::RecordingFailed`] when Rerun refuses it.
    ///
    /// # Panics
    /// If the step names a node that is not in the graph.
    pub fn log_step(&mut self, view: &StepView<'_>) -> Result<(), ViewError> {
        let scene = self.scene;
        self.set_time(view.step, view.time_secs);
        self.log_images("live", view.observation)?;
        if let Some(goal) = view.goal.filter(|goal| self.goal.as_ref() != Some(*goal)) {
            self.log_images("goal", goal)?;
            self.goal = Some(goal.clone());
        }
        for (entity, archetype) in self.map.step(scene.graph, view) {
            self.log(entity, archetype.as_ref())?;
        }
        self.log_text("plan", panels::plan(&scene, view))?;
        if let Some(actions) = view.actions {
            let text = panels::actions(scene.action_space, actions, view.chosen);
            self.log_text("policy/actions", text)?;
            for (name, probability) in panels::probabilities(scene.action_space, actions) {
                self.log_number(&format!("policy/probability/{name}"), probability)?;
            }
            self.log_number("monitor/entropy", f64::from(actions.entropy()))?;
        }
        if let Some(cost) = view.cost_to_go_steps.filter(|cost| cost.is_finite()) {
            self.log_number("progress/cost_to_go", cost)?;
        }
        self.log_number("progress/stage", view.stage as f64)
    }

    /// Adds a line to the log of events.
    ///
    /// # Errors
    /// [`ViewError::RecordingFailed`] when Rerun refuses it.
    pub fn log_event(
        &self,
        step: u32,
        time_secs: f64,
        level: EventLevel,
        text: &str,
    ) -> Result<(), ViewError> {
        self.set_time(step, time_secs);
        self.log("events", &panels::event(level, text))
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// [`ViewError::RecordingFailed`] when the last data cannot be written,
    /// [`ViewError::FileUnwritable`] when the file cannot be renamed.
    pub fn finish(self) -> Result<(), ViewError> {
        self.stream
            .flush_blocking()
            .map_err(|e| self.failed("the end", e.to_string()))?;
        // Closes the file: its index is written last.
        self.stream.disconnect();
        file::finish(&self.path)
    }

    fn set_time(&self, step: u32, time_secs: f64) {
        self.stream.set_time_sequence("step", i64::from(step));
        self.stream.set_duration_secs("time", time_secs);
    }

    fn log_images(&self, folder: &str, observation: &Observation) -> Result<(), ViewError> {
        for camera in self.scene.cameras {
            let Ok(image) = observation.image(&camera.name) else {
                continue;
            };
            let entity = format!("{folder}/{}", camera.name);
            let jpeg = jpeg(image).map_err(|reason| self.failed(&entity, reason))?;
            let image = ::rerun::EncodedImage::from_file_contents(jpeg);
            self.log(&entity, &image)?;
        }
        Ok(())
    }

    fn log_number(&self, entity: &str, value: f64) -> Result<(), ViewError> {
        self.log(entity, &::rerun::Scalars::single(value))
    }

    fn log_text(&mut self, panel: &'static str, text: String) -> Result<(), ViewError> {
        if self.texts.get(panel) == Some(&text) {
            return Ok(());
        }
        self.log(panel, &::rerun::TextDocument::from_markdown(text.as_str()))?;
        self.texts.insert(panel, text);
        Ok(())
    }

    fn log(&self, entity: &str, what: &dyn AsComponents) -> Result<(), ViewError> {
        self.stream
            .log(entity, what)
            .map_err(|e| self.failed(entity, e.to_string()))
    }

    fn failed(&self, entity: &str, reason: String) -> ViewError {
        ViewError::RecordingFailed {
            path: self.path.clone(),
            entity: entity.to_owned(),
            reason,
        }
    }
}

impl fmt::Debug for RolloutRecording<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RolloutRecording")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

fn jpeg(image: &Image) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode(
            image.rgb(),
            image.width(),
            image.height(),
            ExtendedColorType::Rgb8,
        )
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}
