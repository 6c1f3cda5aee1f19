//! Options of the planner as written: `planner: paper`, or a map of what is to differ from the default.

use super::reader::Reader;
use super::yaml::{Node, Value};
use crate::graph::PruneOptions;
use crate::planner::{EdgeChoice, EdgeCost, Join, PlannerOptions, Search};

const KEYS: &[&str] = &[
    "search",
    "cost",
    "edges",
    "predicted_edges",
    "join",
    "forward_leap_steps",
    "min_live_probability",
    "lookahead_steps",
];

/// Longest leap or lookahead that is not surely a slip.
const MAX_STEPS: u32 = 1000;

/// Largest cap on the predicted edges of a state; no state has more.
const MAX_OUT_EDGES: u32 = 1_000_000;

pub(super) fn read_planner(node: &Node, reader: &mut Reader<'_>) -> PlannerOptions {
    if !matches!(node.value, Value::Map(_)) && node.as_text().is_some() {
        let choices = [("default", false), ("paper", true)];
        return match reader.choice_or(node, "planner", &choices, &["{edges: all}"]) {
            Some(true) => PlannerOptions::paper(),
            _ => PlannerOptions::default(),
        };
    }
    let mut options = PlannerOptions::default();
    let Some(fields) = reader.fields(node, "planner", KEYS) else {
        return options;
    };
    if let Some(node) = fields.value("search") {
        let choices = [
            ("in_order", Search::InOrder),
            ("unconstrained", Search::Unconstrained),
        ];
        options.search = reader
            .choice(node, "search", &choices)
            .unwrap_or(options.search);
    }
    if let Some(node) = fields.value("cost") {
        options.cost = read_cost(node, reader).unwrap_or(options.cost);
    }
    if let Some(node) = fields.value("edges") {
        let choices = [
            ("temporal_only", EdgeChoice::TemporalOnly),
            ("all", EdgeChoice::All),
        ];
        options.edges = reader
            .choice(node, "edges", &choices)
            .unwrap_or(options.edges);
    }
    if let Some(node) = fields.value("predicted_edges") {
        options.predicted_edges = read_predicted_edges(node, reader);
    }
    if let Some(node) = fields.value("join") {
        let choices = [("cheapest", Join::Cheapest), ("believed", Join::Believed)];
        options.join = reader
            .choice(node, "join", &choices)
            .unwrap_or(options.join);
    }
    if let Some(node) = fields.value("forward_leap_steps") {
        options.forward_leap_steps = if node.as_text() == Some("any") {
            None
        } else {
            reader.integer_or(node, "forward_leap_steps", &(0..=MAX_STEPS), Some("any"))
        };
    }
    if let Some(node) = fields.value("min_live_probability") {
        let probability = reader.number(node, "min_live_probability", &(0.0..=1.0));
        options.min_live_probability =
            probability.map_or(options.min_live_probability, |p| p as f32);
    }
    if let Some(node) = fields.value("lookahead_steps") {
        let steps = reader.integer(node, "lookahead_steps", &(0..=MAX_STEPS));
        options.lookahead_steps = steps.unwrap_or(options.lookahead_steps);
    }
    options
}

/// `all`, or `{min_probability: 0.5, max_out_edges: 8, min_support: 1}` or some of these.
fn read_predicted_edges(node: &Node, reader: &mut Reader<'_>) -> PruneOptions {
    let mut options = PruneOptions::default();
    if !matches!(node.value, Value::Map(_)) && node.as_text().is_some() {
        if node.as_text() != Some("all") {
            reader.ambiguous(
                node,
                "predicted_edges does not say which",
                "write all, or {min_probability: 0.5, max_out_edges: 8, min_support: 1}",
            );
        }
        return options;
    }
    let keys = ["min_probability", "max_out_edges", "min_support"];
    let Some(fields) = reader.fields(node, "predicted_edges", &keys) else {
        return options;
    };
    if let Some(node) = fields.value("min_probability") {
        let probability = reader.number(node, "min_probability", &(0.0..=1.0));
        options.min_probability = probability.map_or(options.min_probability, |p| p as f32);
    }
    if let Some(node) = fields.value("max_out_edges") {
        options.max_out_edges = if node.as_text() == Some("any") {
            None
        } else {
            let cap = reader.integer_or(node, "max_out_edges", &(0..=MAX_OUT_EDGES), Some("any"));
            cap.map(|cap| cap as usize)
        };
    }
    if let Some(node) = fields.value("min_support") {
        let support = reader.integer(node, "min_support", &(0..=2));
        options.min_support = support.unwrap_or(options.min_support);
    }
    options
}

/// `argmax`, `{expected: 60}` or `{risk_averse: 3}`.
fn read_cost(node: &Node, reader: &mut Reader<'_>) -> Option<EdgeCost> {
    const MAX_COST: f64 = 1e6;
    if !matches!(node.value, Value::Map(_)) {
        let maps = ["{expected: 60}", "{risk_averse: 3}"];
        return reader.choice_or(node, "cost", &[("argmax", EdgeCost::Argmax)], &maps);
    }
    let fields = reader.fields(node, "cost", &["expected", "risk_averse"])?;
    match (fields.value("expected"), fields.value("risk_averse")) {
        (Some(steps), None) => {
            let what = "the cost in steps of a pair that is not connected";
            let disconnected_steps = reader.number(steps, what, &(1.0..=MAX_COST))?;
            Some(EdgeCost::Expected { disconnected_steps })
        }
        (None, Some(lambda)) => {
            let what = "the weight of risk";
            let lambda = reader.number(lambda, what, &(0.0..=MAX_COST))?;
            Some(EdgeCost::RiskAverse { lambda })
        }
        _ => {
            reader.ambiguous(
                node,
                "cost must name one way of counting",
                "write argmax, {expected: 60} or {risk_averse: 3}",
            );
            None
        }
    }
}
