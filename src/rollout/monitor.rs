use std::sync::Arc;

use super::nearby::Nearby;
use super::running::Watch;
use super::{Event, RolloutError, RolloutModel, RolloutOptions};
use crate::graph::NodeId;
use crate::model::{GraspSight, Latents, ModelError, Projections};
use crate::planner::{LiveDistances, Localisation, Planner, StageChange, StageFilter};
use crate::task::Subgoal;
use crate::trajectory::{Observation, State};

/// Watches a robot along a composition, from images alone, whoever drives it: says which subgoals it
/// reached, and flags a shortcut.
///
/// [`Rollout`](super::Rollout) has one for the robot that it drives.
#[derive(Clone)]
pub struct Monitor<'a> {
    model: RolloutModel<'a>,
    filter: StageFilter,
    projections: Arc<Projections>,
    candidates: Vec<NodeId>,
    nearby: Option<Arc<Nearby>>,
    subgoals: Vec<Subgoal>,
    near_probability: f32,
    history: Vec<Arc<Observation>>,
    step: usize,
    /// Steps for which the robot has been lost.
    lost_steps: u32,
}

/// A robot is said to be lost once it was for so many steps in a row: nearly all runs that succeed have shorter spells,
/// where the robot stands as no demonstration did.
const TOLD_LOST_STEPS: u32 = 6;

/// What a monitor made of one observation.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The latent of the current state: one row.
    pub latent: Latents,
    /// Predicted steps between the current state and those of the graph.
    pub distances: LiveDistances,
    /// What is seen of the gripper, by a model that has a sense of grasps.
    pub grasp: Option<GraspSight>,
    /// Where the robot is believed to be.
    pub localisation: Localisation,
    /// What happened.
    pub events: Vec<Event>,
    /// Time from images to the latent, in milliseconds.
    pub encode_ms: f64,
    /// Time for distances and filter, in milliseconds.
    pub localise_ms: f64,
}

impl<'a> Monitor<'a> {
    /// A monitor for the composition of a planner. Of the options it takes what concerns localisation.
    ///
    /// # Errors
    /// [`RolloutError::Graph`] when the graph has another `d_max` or latents of another length than the
    /// model, [`RolloutError::Model`] when a network gives no answer, [`RolloutError::Planner`] when the
    /// stages of the graph's states cannot be learnt.
    pub fn new(
        model: RolloutModel<'a>,
        planner: &Planner,
        options: &RolloutOptions,
    ) -> Result<Self, RolloutError> {
        planner.graph().ensure_fits(
            "the graph of the composition",
            model.traversability.d_max(),
            model.encoder.spec().latent_dim,
        )?;
        let latents = planner.graph().latents();
        let projections = model
            .traversability
            .project(latents)
            .map_err(|source| RolloutError::Model { step: 0, source })?;
        let mut filter = planner.stage_filter(options.filter.clone());
        if options.filter.classifier_weight > 0.0 {
            filter = filter.with_classifier(planner.stage_classifier()?);
        }
        let book = model.landmarks;
        if let Some((book, sense)) = book.and_then(|book| Some((book, book.grasp.as_ref()?))) {
            let graph = planner.graph();
            let is_closed = |node| {
                let node = graph.node(node);
                book.is_closed(&node.trajectory, node.step)
            };
            filter = filter.with_grasps(is_closed, |node| sense.thing_of(&graph.node(node).task));
        }
        let candidates = filter.candidates();
        let nearby = options
            .nearest_states
            .map(|count| Nearby::new(model.traversability, &projections, &candidates, count))
            .transpose()
            .map(|nearby| nearby.map(Arc::new))
            .map_err(|source| RolloutError::Model { step: 0, source })?;
        Ok(Self {
            model,
            filter,
            projections: Arc::new(projections),
            candidates,
            nearby,
            subgoals: planner.automaton().subgoals().to_vec(),
            near_probability: options.near_probability,
            history: Vec::new(),
            step: 0,
            lost_steps: 0,
        })
    }

    /// Forgets all that it saw, for a new episode.
    pub fn reset(&mut self) {
        self.filter.reset();
        self.history.clear();
        self.step = 0;
        self.lost_steps = 0;
    }

    /// The belief and the stage.
    #[must_use]
    pub fn filter(&self) -> &StageFilter {
        &self.filter
    }

    /// Takes the robot to be at a stage from now on, as after a shortcut that is to be left as it is.
    ///
    /// # Panics
    /// If the composition has no such stage.
    pub fn accept_stage(&mut self, stage: usize) {
        self.filter.set_stage(stage);
    }

    /// The next observation, one time step after the last one.
    ///
    /// # Errors
    /// [`RolloutError::Model`] when a network gives no answer, or a latent that holds NaN or infinity.
    pub fn look(&mut self, observation: Arc<Observation>) -> Result<Sight, RolloutError> {
        let step = self.step;
        let failed = |source| RolloutError::Model { step, source };
        let mut watch = Watch::start();
        let stack = self.model.encoder.spec().stack;
        self.history.push(observation);
        let excess = self.history.len().saturating_sub(stack.max(1));
        self.history.drain(..excess);
        let state = State::from_history(&self.history, stack);
        let latent = self.model.encoder.encode(&[state]).map_err(failed)?;
        ensure_finite(&latent).map_err(failed)?;
        let encode_ms = watch.lap_ms();
        let current = self.model.traversability.project(&latent).map_err(failed)?;
        let proposed = self
            .nearby
            .as_ref()
            .map(|nearby| nearby.propose(&current, &self.filter));
        let distances = LiveDistances::query(
            self.model.traversability,
            &self.projections,
            &current,
            proposed.as_ref().unwrap_or(&self.candidates),
            self.near_probability,
        )
        .map_err(failed)?;
        let sense = self.model.landmarks.and_then(|book| book.grasp.as_ref());
        let grasp = sense.and_then(|sense| sense.look(self.history.last()?));
        let before = self.filter.stage();
        let localisation = self.filter.look(&distances, latent.row(0), grasp);
        let mut events = Vec::new();
        events.extend(self.note_lost(localisation.is_lost));
        events.extend(self.events(before, &localisation, grasp));
        self.step += 1;
        Ok(Sight {
            latent,
            distances,
            grasp,
            localisation,
            events,
            encode_ms,
            localise_ms: watch.lap_ms(),
        })
    }

    /// Counts the steps for which the robot is lost; that it is, or no longer is, where that is worth a word.
    fn note_lost(&mut self, is_lost: bool) -> Option<Event> {
        let (step, before) = (self.step, self.lost_steps);
        self.lost_steps = if is_lost { before + 1 } else { 0 };
        if self.lost_steps == TOLD_LOST_STEPS {
            return Some(Event::Lost { step });
        }
        (before >= TOLD_LOST_STEPS && !is_lost).then_some(Event::Found { step })
    }

    /// What the filter noticed, in words; the stage was `before`.
    fn events(
        &self,
        before: usize,
        localisation: &Localisation,
        grasp: Option<GraspSight>,
    ) -> Vec<Event> {
        let step = self.step;
        let mut events = Vec::new();
        let confidence = |stage: usize| {
            let beyond: f64 = localisation.stage_probabilities[stage..].iter().sum();
            beyond as f32
        };
        let subgoals = &self.subgoals;
        let due_at = |stages: &[usize]| stages.iter().map(|s| subgoals[*s].clone()).collect();
        match &localisation.change {
            None => {}
            Some(StageChange::Advanced { to }) => {
                let reached = (before + 1..=*to).zip(&subgoals[before..]);
                events.extend(reached.map(|(stage, subgoal)| Event::SubgoalReached {
                    step,
                    stage,
                    subgoal: subgoal.clone(),
                    confidence: confidence(stage),
                }));
            }
            // The belief does not know of it yet.
            Some(StageChange::Taken { to }) => events.push(Event::SubgoalReached {
                step,
                stage: *to,
                subgoal: subgoals[to - 1].clone(),
                confidence: grasp.map_or_else(|| confidence(*to), |sight| sight.held as f32),
            }),
            Some(StageChange::Regressed { to } | StageChange::Dropped { to }) => {
                events.push(Event::SetBack {
                    step,
                    stage: *to,
                    subgoal: subgoals[*to].clone(),
                });
            }
            Some(StageChange::Shortcut { to, skipped }) => events.push(Event::Shortcut {
                step,
                subgoal: subgoals[to - 1].clone(),
                skipped: due_at(skipped),
                confidence: confidence(*to),
            }),
            Some(StageChange::Ahead { to, skipped }) => events.push(Event::HeadingAhead {
                step,
                subgoal: subgoals[*to].clone(),
                skipped: due_at(skipped),
                confidence: confidence(*to),
            }),
        }
        events
    }
}

/// A latent that is no number is near nothing: the robot would be lost without anybody knowing why.
fn ensure_finite(latent: &Latents) -> Result<(), ModelError> {
    let values = latent.values();
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(place) => Err(ModelError::NotFinite {
            what: "the latent of the current state".to_owned(),
            place,
            value: values[place].to_string(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::graph::TopologicalGraph;
    use crate::graph::fakes::{BrokenEncoder, Oracle, PixelEncoder, add_demonstration, task};
    use crate::model::{
        ActionDistribution, GRASP_CELLS, GraspSense, Landmark, LandmarkBook, LocalPolicy,
    };
    use crate::planner::{FilterOptions, FinalChoice, PlannerOptions};
    use crate::task::Automaton;
    use crate::trajectory::{Image, RobotGeometry};

    /// Somebody else drives.
    struct Nobody;

    impl LocalPolicy for Nobody {
        fn act(&self, _: &[f32], _: &[f32]) -> Result<ActionDistribution, ModelError> {
            unreachable!("a monitor does not act")
        }
    }

    /// A planner for a corridor in which three demonstrations reach subgoals at 8, 16 and 24.
    fn corridor() -> Planner {
        let walk = task("walk", &["first", "second", "third"]);
        let mut graph = TopologicalGraph::new(3, 5);
        for aside in 0..3 {
            let place = |x: u8| vec![f32::from(x), 0.1 * aside as f32, 0.0];
            let places: Vec<Vec<f32>> = (0..25).map(place).collect();
            add_demonstration(&mut graph, &walk, &aside.to_string(), &places, &[8, 16, 24]);
        }
        Planner::new(
            Arc::new(graph),
            &Automaton::in_order(&[walk]),
            &FinalChoice::Cheapest,
            PlannerOptions::default(),
        )
        .expect("the corridor has a composition")
    }

    fn ahead(d_max: usize) -> Oracle {
        Oracle::new(d_max, |a, b| {
            let ahead = (b[0] - a[0]).round();
            (ahead >= 0.0).then_some(ahead as u32)
        })
    }

    fn seen_at(x: u8) -> Arc<Observation> {
        let image = Image::new(1, 1, vec![x, 0, 0]).expect("one pixel");
        Arc::new(Observation::new([("eye".to_owned(), image)]))
    }

    /// What a monitor says of a robot that is seen at these positions of the corridor.
    fn told(positions: impl IntoIterator<Item = u8>) -> Vec<Event> {
        told_with(&RolloutOptions::default(), positions)
    }

    fn told_with(options: &RolloutOptions, positions: impl IntoIterator<Item = u8>) -> Vec<Event> {
        let planner = corridor();
        let oracle = ahead(5);
        let model = RolloutModel {
            encoder: &PixelEncoder::new(5),
            traversability: &oracle,
            policy: &Nobody,
            landmarks: None,
        };
        let options = RolloutOptions {
            near_probability: 0.0,
            ..options.clone()
        };
        let mut monitor =
            Monitor::new(model, &planner, &options).expect("the graph is of the oracle");
        let mut events = Vec::new();
        for x in positions {
            let sight = monitor.look(seen_at(x));
            events.extend(sight.expect("the oracle knows all").events);
        }
        events
    }

    #[test]
    fn a_graph_of_another_d_max_is_refused_with_both() {
        let model = RolloutModel {
            encoder: &PixelEncoder::new(7),
            traversability: &ahead(7),
            policy: &Nobody,
            landmarks: None,
        };
        let refused = Monitor::new(model, &corridor(), &RolloutOptions::default()).err();
        let error = refused.expect("the graph has a d_max of 5").to_string();
        assert!(error.contains("d_max 5, expected 7"), "{error}");
    }

    #[test]
    fn a_latent_that_is_no_number_is_an_error_at_its_step() {
        let encoder = BrokenEncoder::new(5, [2, 0]);
        let model = RolloutModel {
            encoder: &encoder,
            traversability: &ahead(5),
            policy: &Nobody,
            landmarks: None,
        };
        let options = RolloutOptions::default();
        let mut monitor = Monitor::new(model, &corridor(), &options).expect("the graph fits");
        for x in 0..2 {
            monitor.look(seen_at(x)).expect("the encoder works here");
        }
        let error = monitor.look(seen_at(2)).unwrap_err().to_string();
        for part in ["step 2", "value 1", "NaN", "train or export it again"] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_walk_reaches_every_subgoal_in_order() {
        let reached: Vec<String> = told((0..25).chain([24; 4]))
            .into_iter()
            .map(|event| match event {
                Event::SubgoalReached { subgoal, .. } => subgoal.name,
                other => other.to_string(),
            })
            .collect();
        assert_eq!(reached, ["first", "second", "third"]);
    }

    #[test]
    fn a_robot_that_is_lost_for_long_is_said_to_be_and_to_be_found_again() {
        let of_spell = |steps: usize| {
            let walk = (0..5).chain(std::iter::repeat_n(90, steps)).chain(5..9);
            let told = told(walk).into_iter();
            told.filter(|event| matches!(event, Event::Lost { .. } | Event::Found { .. }))
                .map(|event| event.to_string())
                .collect::<Vec<_>>()
        };
        let patience = FilterOptions::default().lost_patience as usize;
        let long = patience - 1 + TOLD_LOST_STEPS as usize;
        assert!(of_spell(long - 1).is_empty());
        let said = of_spell(long);
        assert_eq!(said.len(), 2, "{said:?}");
        assert_eq!(said[0], format!("step {}: lost", 5 + long - 1));
        assert_eq!(said[1], format!("step {}: found again", 5 + long));
    }

    /// A gripper that closes at the first subgoal and opens at the second; it looks green when it is open and blue
    /// when it holds something.
    fn book_of_corridor() -> LandmarkBook {
        let landmark = |closes| Landmark {
            closes,
            height_m: 0.1,
            height_spread_m: 0.0,
            tilt_rad: 0.0,
            approach: [1.0, 0.0, 0.0],
            clearance_m: 0.06,
            reach_m: [[0.3, 0.6], [-0.2, 0.2]],
            error_pixels: 2.0,
        };
        let cells = (GRASP_CELLS[0] * GRASP_CELLS[1]) as usize;
        let events = |aside: i32| (aside.to_string(), vec![(8, 0), (16, 1)]);
        LandmarkBook {
            robot: RobotGeometry::locobot(),
            views: Vec::new(),
            landmarks: vec![landmark(true), landmark(false)],
            events: (0..3).map(events).collect(),
            actions: BTreeMap::new(),
            grasp: Some(GraspSense {
                camera: "eye".to_owned(),
                region: [0.0, 0.0, 1.0, 1.0],
                mean: vec![0.0; 3 * cells],
                weights: [[0.0, 1.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]]
                    .map(|of_colours| of_colours.repeat(cells))
                    .to_vec(),
                intercepts: vec![0.0, 100.0, 0.0],
                things: Vec::new(),
            }),
        }
    }

    #[test]
    fn what_is_seen_to_be_taken_is_as_sure_as_the_sight_of_it() {
        let (planner, oracle, book) = (corridor(), ahead(5), book_of_corridor());
        let model = RolloutModel {
            encoder: &PixelEncoder::new(5),
            traversability: &oracle,
            policy: &Nobody,
            landmarks: Some(&book),
        };
        let options = RolloutOptions {
            near_probability: 0.0,
            filter: FilterOptions {
                classifier_weight: 0.0,
                ..FilterOptions::default()
            },
            ..RolloutOptions::default()
        };
        let mut monitor = Monitor::new(model, &planner, &options).expect("the graph fits");
        // Too far from the first subgoal to be believed there.
        let mut told_of = |gripper: [u8; 2]| {
            let image = Image::new(1, 1, vec![2, gripper[0], gripper[1]]).expect("one pixel");
            let seen = Arc::new(Observation::new([("eye".to_owned(), image)]));
            let looks = (0..4).map(|_| monitor.look(Arc::clone(&seen)).expect("it is known"));
            looks.flat_map(|sight| sight.events).collect::<Vec<_>>()
        };
        assert_eq!(told_of([255, 0]), []);
        let events = told_of([0, 255]);
        let [
            Event::SubgoalReached {
                subgoal,
                confidence,
                ..
            },
        ] = &events[..]
        else {
            panic!("{events:?}")
        };
        assert_eq!(subgoal.name, "first");
        assert!(*confidence > 0.99, "{confidence}");
    }

    #[test]
    fn asking_the_nearest_states_only_tells_the_same() {
        let walk = |nearest_states| -> Vec<(usize, String)> {
            let options = RolloutOptions {
                nearest_states,
                ..RolloutOptions::default()
            };
            told_with(&options, (0..25).chain([24; 4]))
                .into_iter()
                .map(|event| match event {
                    Event::SubgoalReached { step, subgoal, .. } => (step, subgoal.name),
                    other => panic!("{other}"),
                })
                .collect()
        };
        assert_eq!(walk(Some(20)), walk(None));
        assert_eq!(walk(None).len(), 3);
    }

    #[test]
    fn a_robot_beyond_what_it_never_reached_is_flagged_once() {
        // Along a line a linear classifier tells the middle of three stages from the others at no place.
        let options = RolloutOptions {
            filter: FilterOptions {
                classifier_weight: 0.0,
                ..FilterOptions::default()
            },
            ..RolloutOptions::default()
        };
        let events = told_with(&options, (0..4).chain(18..22).chain([22; 12]));
        let flagged: Vec<(&str, Vec<&str>)> = events
            .iter()
            .filter_map(|event| match event {
                Event::Shortcut {
                    subgoal, skipped, ..
                } => {
                    let names = skipped.iter().map(|s| s.name.as_str());
                    Some((subgoal.name.as_str(), names.collect()))
                }
                _ => None,
            })
            .collect();
        assert_eq!(flagged, [("second", vec!["first"])], "{events:?}");
    }
}
