use std::fmt::Write as _;

use serde::Serialize;

use super::arguments::{Arguments, GraphGapsArguments};
use super::error::CliError;
use super::loaded::Loaded;
use crate::graph::{EdgeKind, NodeId, ScoredPair, SeamReport, TopologicalGraph};
use crate::planner::{NoPath, Plan};

/// Near misses that are listed for each seam.
const LISTED: usize = 3;

/// Where the tasks of a composition do not connect, or barely.
#[derive(Serialize)]
struct GapsReport {
    name: String,
    seams: Vec<SeamGaps>,
    /// Where one more demonstration would help most; none where a composition has one task and a way.
    most_helpful: Option<Wish>,
    /// Why there is no plan, where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    no_plan: Option<String>,
}

/// What lies between two tasks that follow each other.
#[derive(Serialize)]
struct SeamGaps {
    from_task: String,
    to_task: String,
    pairs_scored: u64,
    pairs_connected: usize,
    /// The best pairs that are not called connected, most probable first.
    near_misses: Vec<NearMiss>,
}

/// Two states, by demonstration and step, which is also what their pictures go by.
#[derive(Serialize)]
struct NearMiss {
    from: String,
    to: String,
    connected_probability: f32,
    /// The nearest states of both demonstrations that have pictures in their graph's folder.
    pictures: [Option<String>; 2],
}

/// A demonstration to record.
#[derive(Serialize)]
struct Wish {
    from: String,
    to: String,
    reason: String,
}

/// `catena graph gaps`
pub(super) fn gaps(
    gaps_arguments: &GraphGapsArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let loaded = Loaded::load(&gaps_arguments.file.to_string_lossy(), arguments)?;
    let planner = loaded.own_planner()?;
    let graph = &loaded.graph;
    let (most_helpful, no_plan) = match planner.plan_from_start() {
        Ok(plan) => (weakest_crossing(graph, &plan), None),
        Err(why) => (missing_link(graph, &why), Some(why.to_string())),
    };
    let seams = &loaded.merge_report.seams;
    let report = GapsReport {
        name: loaded.composition.name.clone(),
        seams: seams.iter().map(|s| seam_gaps(&loaded, s)).collect(),
        most_helpful,
        no_plan,
    };
    if gaps_arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", described(&report));
    }
    Ok(())
}

fn seam_gaps(loaded: &Loaded, seam: &SeamReport) -> SeamGaps {
    let near_miss = |pair: &ScoredPair| NearMiss {
        from: loaded.graph.node(pair.from).place(),
        to: loaded.graph.node(pair.to).place(),
        connected_probability: pair.connected_probability,
        pictures: [pair.from, pair.to].map(|node| picture_near(loaded, node)),
    };
    SeamGaps {
        from_task: seam.from_task.clone(),
        to_task: seam.to_task.clone(),
        pairs_scored: seam.pair_count,
        pairs_connected: seam.accepted,
        near_misses: seam
            .near_misses
            .iter()
            .take(LISTED)
            .map(near_miss)
            .collect(),
    }
}

/// The state of the same demonstration that is nearest in time among those with pictures.
fn picture_near(loaded: &Loaded, node: NodeId) -> Option<String> {
    let node = loaded.graph.node(node);
    let steps = loaded.images_of(&node.task)?.steps_of(&node.trajectory);
    let nearest = steps.min_by_key(|step| step.abs_diff(node.step))?;
    Some(format!("{}:{nearest}", node.trajectory))
}

/// The predicted edge that the plan trusts least.
fn weakest_crossing(graph: &TopologicalGraph, plan: &Plan) -> Option<Wish> {
    let crossings = plan.route.windows(2).filter_map(|pair| {
        let edge = graph.edge(pair[0], pair[1])?;
        (edge.kind != EdgeKind::Temporal).then(|| (pair, edge.connected_probability()))
    });
    let (pair, probability) = crossings.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Wish {
        from: graph.node(pair[0]).place(),
        to: graph.node(pair[1]).place(),
        reason: format!("the plan is least sure of this edge, P(connected) {probability:.3}"),
    })
}

/// The break that keeps the composition from being planned.
fn missing_link(graph: &TopologicalGraph, why: &NoPath) -> Option<Wish> {
    let (from, to) = why.gap.as_ref()?.ends();
    Some(Wish {
        from: graph.node(from).place(),
        to: graph.node(to).place(),
        reason: format!("there is no plan: {why}"),
    })
}

fn described(report: &GapsReport) -> String {
    let mut text = String::new();
    for seam in &report.seams {
        let verdict = match seam.pairs_connected {
            0 => "do not connect".to_owned(),
            connected => format!("connect in {connected} of {} pairs", seam.pairs_scored),
        };
        let _ = writeln!(text, "{} -> {}: {verdict}", seam.from_task, seam.to_task);
        for miss in &seam.near_misses {
            let _ = writeln!(
                text,
                "  near miss {} -> {}, P(connected) {:.3}",
                miss.from, miss.to, miss.connected_probability
            );
            if let [Some(from), Some(to)] = &miss.pictures {
                let _ = writeln!(
                    text,
                    "    the nearest states of which the graphs keep pictures: {from} and {to}"
                );
            }
        }
    }
    let _ = match (&report.most_helpful, &report.no_plan) {
        (Some(wish), _) => writeln!(
            text,
            "one more demonstration would help most from {} to {}: {}",
            wish.from, wish.to, wish.reason
        ),
        (None, Some(why)) => writeln!(text, "{}: there is no plan: {why}", report.name),
        (None, None) => writeln!(text, "{}: nothing to bridge", report.name),
    };
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_plan_it_is_not_said_that_nothing_is_to_be_bridged() {
        let told = |no_plan: Option<&str>| {
            described(&GapsReport {
                name: "two".to_owned(),
                seams: Vec::new(),
                most_helpful: None,
                no_plan: no_plan.map(str::to_owned),
            })
        };
        assert_eq!(told(None), "two: nothing to bridge\n");
        let why = "no route to a final state";
        assert_eq!(told(Some(why)), format!("two: there is no plan: {why}\n"));
    }
}
