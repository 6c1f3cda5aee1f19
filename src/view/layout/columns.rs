//! The columns of a block: the subgoals of its task in the order in which they are reached, and how many
//! steps they are apart.

use std::collections::BTreeMap;

use super::Row;
use crate::graph::TopologicalGraph;

/// Where the demonstrations of a task reach a subgoal.
#[derive(Debug)]
pub(in crate::view) struct Column {
    pub(in crate::view) subgoal: String,
    /// Steps from the start of the block.
    pub(in crate::view) steps: f32,
    pub(in crate::view) x: f32,
}

impl Column {
    fn new(subgoal: &str, steps: f32) -> Self {
        Self {
            subgoal: subgoal.to_owned(),
            steps,
            x: 0.0,
        }
    }
}

/// A subgoal, and how many demonstrations reach it.
struct Reached<'a> {
    subgoal: &'a str,
    demonstrations: u32,
}

/// What lies between two neighbouring subgoals, before the first one, or after the last one.
struct Stretch<'a> {
    /// The demonstrations that have both of its ends, with their steps there.
    rows: Vec<(&'a Row, [f32; 2])>,
    /// How many steps it takes in the median.
    steps: f32,
}

impl<'a> Stretch<'a> {
    /// Without a subgoal to begin or end at, it begins or ends with the demonstrations.
    fn new(
        graph: &TopologicalGraph,
        rows: &'a [Row],
        from: Option<&str>,
        to: Option<&str>,
    ) -> Self {
        let ends = |row: &'a Row| {
            let start = match from {
                Some(subgoal) => reached_at(graph, row, subgoal)?,
                None => first_step(graph, row),
            };
            let end = match to {
                Some(subgoal) => reached_at(graph, row, subgoal)?,
                None => last_step(graph, row),
            };
            Some((row, [start, end]))
        };
        let rows: Vec<(&'a Row, [f32; 2])> = rows.iter().filter_map(ends).collect();
        let steps = median(rows.iter().map(|(_, [start, end])| end - start)).max(0.0);
        Self { rows, steps }
    }

    /// How far along it the demonstrations are that reach another subgoal on the way, from 0 to 1.
    fn share(&self, graph: &TopologicalGraph, subgoal: &str) -> f32 {
        let shares = self.rows.iter().filter_map(|(row, [start, end])| {
            let step = reached_at(graph, row, subgoal)?;
            Some((step - start) / (end - start).max(1.0))
        });
        median(shares).clamp(0.0, 1.0)
    }
}

/// The subgoals of a task in the order in which they are reached, and the steps of the whole task.
///
/// A subgoal that all demonstrations reach stands as many steps after the one before as that takes in the
/// median. One that only some of them reach, such as a region to be passed, takes its share of the stretch
/// in which it lies: slow demonstrations must not make that longer than it is for all.
pub(super) fn columns(graph: &TopologicalGraph, task: &str, rows: &[Row]) -> (Vec<Column>, f32) {
    let order = in_order(graph, task, rows);
    let all = order.iter().map(|r| r.demonstrations).max().unwrap_or(0);
    let mut columns = Vec::new();
    let mut steps = 0.0_f32;
    let mut before: Option<&str> = None;
    let mut rest = order.as_slice();
    loop {
        let shared = rest.iter().position(|r| r.demonstrations == all);
        let on_the_way = shared.unwrap_or(rest.len());
        let after = rest.get(on_the_way).map(|r| r.subgoal);
        let stretch = Stretch::new(graph, rows, before, after);
        let mut share = 0.0_f32;
        for passed in &rest[..on_the_way] {
            share = share.max(stretch.share(graph, passed.subgoal));
            columns.push(Column::new(passed.subgoal, steps + share * stretch.steps));
        }
        steps += stretch.steps;
        let Some(subgoal) = after else {
            return (columns, steps);
        };
        columns.push(Column::new(subgoal, steps));
        before = after;
        rest = &rest[on_the_way + 1..];
    }
}

/// The subgoals of a task by how many of them hold where they are reached.
fn in_order<'a>(graph: &'a TopologicalGraph, task: &str, rows: &[Row]) -> Vec<Reached<'a>> {
    let mut found: BTreeMap<&'a str, (u32, u32)> = BTreeMap::new();
    for id in rows.iter().flat_map(|row| &row.nodes) {
        let node = graph.node(*id);
        // Of several that are reached at once the last one is as far as the node.
        for (subgoal, later) in node.reached.iter().rev().zip(0..) {
            if subgoal.task == task {
                let (sum, count) = found.entry(&subgoal.name).or_default();
                *sum += node.progress.saturating_sub(later);
                *count += 1;
            }
        }
    }
    let mut order: Vec<(&'a str, (u32, u32))> = found.into_iter().collect();
    order.sort_by_key(|(_, (sum, count))| sum * 1000 / count);
    order
        .into_iter()
        .map(|(subgoal, (_, demonstrations))| Reached {
            subgoal,
            demonstrations,
        })
        .collect()
}

/// Pairs of a demonstration's step and the task's steps that stand for the same progress.
pub(super) fn anchors(
    graph: &TopologicalGraph,
    row: &Row,
    columns: &[Column],
    steps: f32,
) -> Vec<[f32; 2]> {
    let mut anchors = vec![[first_step(graph, row), 0.0]];
    for column in columns {
        if let Some(step) = reached_at(graph, row, &column.subgoal)
            && anchors
                .last()
                .is_some_and(|last| step > last[0] && column.steps >= last[1])
        {
            anchors.push([step, column.steps]);
        }
    }
    if last_step(graph, row) > anchors[anchors.len() - 1][0] {
        anchors.push([last_step(graph, row), steps]);
    }
    anchors
}

pub(super) fn interpolate(anchors: &[[f32; 2]], step: f32) -> f32 {
    let after = anchors
        .partition_point(|a| a[0] < step)
        .clamp(1, anchors.len().max(2) - 1);
    match (anchors.get(after - 1), anchors.get(after)) {
        (Some([s0, x0]), Some([s1, x1])) => x0 + (x1 - x0) * (step - s0) / (s1 - s0),
        (Some([_, x]), None) => *x,
        _ => 0.0,
    }
}

/// How many steps the demonstrations take in the median.
pub(super) fn median_length(graph: &TopologicalGraph, rows: &[Row]) -> f32 {
    median(
        rows.iter()
            .map(|row| last_step(graph, row) - first_step(graph, row)),
    )
}

fn first_step(graph: &TopologicalGraph, row: &Row) -> f32 {
    row.nodes
        .first()
        .map_or(0.0, |id| graph.node(*id).step as f32)
}

fn last_step(graph: &TopologicalGraph, row: &Row) -> f32 {
    row.nodes
        .last()
        .map_or(0.0, |id| graph.node(*id).step as f32)
}

fn reached_at(graph: &TopologicalGraph, row: &Row, subgoal: &str) -> Option<f32> {
    row.nodes
        .iter()
        .map(|id| graph.node(*id))
        .find(|node| node.reached.iter().any(|s| s.name == subgoal))
        .map(|node| node.step as f32)
}

fn median(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
