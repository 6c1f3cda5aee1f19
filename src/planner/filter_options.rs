use serde::{Deserialize, Serialize};

/// Least share of a belief, and least likelihood. What fits nothing is weighed by these, raised to the powers, at the
/// least: were they smaller, that might be rounded to 0, and no belief be left.
const LEAST: f64 = 1e-9;
/// The greatest power.
const MOST_POWER: f64 = 10.0;

/// How the robot is followed along a composition. All numbers are finite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterOptions {
    /// Weight of staying at a state for a step; the three weights are relative to each other, none of them negative
    /// and not all 0.
    pub stay: f64,
    /// Weight of going on to the next state of the same demonstration.
    pub advance: f64,
    /// Weight of going on by two states.
    pub hurry: f64,
    /// Probability (0..=1) of a jump to any state at about the same time of the composition; with `restart` at most 1.
    pub jump: f64,
    /// Probability (1e-9..=1) of being anywhere at all, whatever was known: how fast an error is forgotten. With 1 here
    /// and 0 for `jump` nothing is remembered.
    pub restart: f64,
    /// Power (0..=10) that likelihoods are raised to; 0 leaves them out.
    pub evidence_weight: f64,
    /// Least likelihood of a state (1e-9..=1), so that one wrong prediction rules nothing out.
    pub floor: f64,
    /// Power (0..=10) that the probabilities of the stage classifier are raised to; 0 leaves it out.
    pub classifier_weight: f64,
    /// Least probability (1e-9..=1) that the classifier is taken to give a stage.
    pub classifier_floor: f64,
    /// Power (0..=10) that the likelihood of what is seen of the gripper is raised to, by a model that has a sense of
    /// grasps; 0 leaves it out.
    pub grasp_weight: f64,
    /// Probability (above 0, at most 1) that later stages must have together for a vote to go on.
    pub advance_mass: f64,
    /// Votes in a row until the stage advances.
    pub advance_votes: u32,
    /// Votes in a row until the stage advances while what is seen fits badly with where the robot is believed to be:
    /// an arm that carries a thing as no demonstration did is seen to hold it all the same. `None`: never.
    pub advance_votes_unfit: Option<u32>,
    /// Probability (above 0, at most 1) that earlier stages must have together for a vote to fall back.
    pub regress_mass: f64,
    /// Votes in a row until the stage falls back (what was held has slipped); `None`: never.
    pub regress_votes: Option<u32>,
    /// Whether the stage falls back as soon as a gripper that should hold something is seen to be empty, by a model
    /// that has a sense of grasps: to where it is to be grasped, be that more than `regress_stages` ago.
    pub regress_when_empty: bool,
    /// Whether the stage advances as soon as a gripper that was open is seen to hold what the next stage should, by a
    /// model that has a sense of grasps: a thing that is held oddly looks like nothing that was demonstrated.
    pub advance_when_held: bool,
    /// By how many subgoals the stage may fall back at once. What the robot holds it can lose, which
    /// undoes one subgoal; what it put away before stays there, however much the room looks as it did.
    pub regress_stages: usize,
    /// The robot is lost when the states where it is believed to be are connected to what it sees
    /// with less than this probability (0..=1) ...
    pub lost_probability: f64,
    /// ... for so many steps in a row.
    pub lost_patience: u32,
    /// Compositions of at most so many places have a share of the belief for each of them. In larger
    /// ones the most probable places and those that distances are known of have one, and what is left
    /// is kept by time and stage, so that a step costs the same however large the graph is.
    pub exact_places: usize,
}

impl Default for FilterOptions {
    fn default() -> Self {
        Self {
            stay: 0.25,
            advance: 0.6,
            hurry: 0.15,
            jump: 0.05,
            restart: 1e-4,
            evidence_weight: 1.5,
            floor: 1e-3,
            classifier_weight: 0.5,
            classifier_floor: 0.02,
            grasp_weight: 0.5,
            advance_mass: 0.6,
            advance_votes: 2,
            advance_votes_unfit: Some(3),
            regress_mass: 0.85,
            regress_votes: Some(4),
            regress_when_empty: true,
            advance_when_held: true,
            regress_stages: 1,
            lost_probability: 0.2,
            lost_patience: 4,
            exact_places: 16_384,
        }
    }
}

impl FilterOptions {
    /// The first option that is out of its range, if one is: its name, what it is, and what it must be.
    pub(crate) fn out_of_range(&self) -> Option<(&'static str, f64, &'static str)> {
        let weight = (0.0..=f64::MAX, "0 or more, and finite");
        let weights = (f64::MIN_POSITIVE..=f64::MAX, "above 0, and finite");
        let share = (0.0..=1.0, "from 0 to 1");
        let least = (LEAST..=1.0, "from 1e-9 to 1");
        let power = (0.0..=MOST_POWER, "from 0 to 10");
        let mass = (f64::MIN_POSITIVE..=1.0, "above 0, and at most 1");
        let all_weights = self.stay + self.advance + self.hurry;
        let options = [
            ("stay", self.stay, &weight),
            ("advance", self.advance, &weight),
            ("hurry", self.hurry, &weight),
            ("stay + advance + hurry", all_weights, &weights),
            ("jump", self.jump, &share),
            ("restart", self.restart, &least),
            ("jump + restart", self.jump + self.restart, &share),
            ("evidence_weight", self.evidence_weight, &power),
            ("floor", self.floor, &least),
            ("classifier_weight", self.classifier_weight, &power),
            ("classifier_floor", self.classifier_floor, &least),
            ("grasp_weight", self.grasp_weight, &power),
            ("advance_mass", self.advance_mass, &mass),
            ("regress_mass", self.regress_mass, &mass),
            ("lost_probability", self.lost_probability, &share),
        ];
        let out = options
            .into_iter()
            .find(|(_, value, range)| !range.0.contains(value));
        out.map(|(option, value, range)| (option, value, range.1))
    }
}
