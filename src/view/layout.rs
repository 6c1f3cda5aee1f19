//! Where the nodes of a merged graph stand: a block a task from left to right, a row a demonstration,
//! and along a row the progress through the task, so that the same subgoal of all demonstrations
//! stands in one column.

use std::collections::BTreeMap;

use crate::graph::{NodeId, TopologicalGraph};

/// The blocks, and the place of every node.
#[derive(Debug)]
pub(super) struct GraphLayout {
    pub(super) blocks: Vec<Block>,
    /// `[x, y]` of each node, in the units of the frame, `y` downwards.
    pub(super) positions: Vec<[f32; 2]>,
    /// Index into `blocks` of each node.
    pub(super) block_of: Vec<usize>,
    /// The lower edge of the rows.
    pub(super) bottom: f32,
}

/// The demonstrations of one task.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) task: String,
    pub(super) x: f32,
    pub(super) width: f32,
    pub(super) rows: Vec<Row>,
    pub(super) columns: Vec<Column>,
    /// Median number of steps of the demonstrations.
    pub(super) steps: f32,
}

/// One demonstration: its nodes in order of time.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) y: f32,
    pub(super) nodes: Vec<NodeId>,
}

/// Where all demonstrations of a task reach a subgoal.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) subgoal: String,
    /// Steps from the start of the task, in the median.
    pub(super) steps: f32,
    pub(super) x: f32,
}

/// Into what the blocks are to fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) left: f32,
    pub(super) top: f32,
    pub(super) width: f32,
    pub(super) gap: f32,
    pub(super) row_height: f32,
}

impl GraphLayout {
    /// Lays a graph out. Tasks stand in the order in which the route passes them, then in that of the
    /// graph; demonstrations that the route uses stand next to each other in the middle.
    pub(super) fn new(graph: &TopologicalGraph, route: &[NodeId], frame: Frame) -> Self {
        let mut blocks = blocks(graph, route);
        let steps: f32 = blocks.iter().map(|b| b.steps.max(1.0)).sum();
        let gaps = frame.gap * blocks.len().saturating_sub(1) as f32;
        let a_step = (frame.width - gaps) / steps.max(1.0);
        let tallest = blocks.iter().map(|b| b.rows.len()).max().unwrap_or(0);
        let mut positions = vec![[0.0; 2]; graph.node_count()];
        let mut block_of = vec![0; graph.node_count()];
        let mut x = frame.left;
        for (index, block) in blocks.iter_mut().enumerate() {
            block.x = x;
            block.width = block.steps.max(1.0) * a_step;
            x += block.width + frame.gap;
            for column in &mut block.columns {
                column.x = block.x + column.steps * a_step;
            }
            let first = frame.top + (tallest - block.rows.len()) as f32 * frame.row_height / 2.0;
            for (i, row) in block.rows.iter_mut().enumerate() {
                row.y = first + (i as f32 + 0.5) * frame.row_height;
                let anchors = anchors(graph, row, &block.columns, block.steps);
                for id in &row.nodes {
                    let steps = interpolate(&anchors, graph.node(*id).step as f32);
                    positions[id.index()] = [block.x + steps * a_step, row.y];
                    block_of[id.index()] = index;
                }
            }
        }
        Self {
            blocks,
            positions,
            block_of,
            bottom: frame.top + tallest as f32 * frame.row_height,
        }
    }

    /// The place of a node.
    pub(super) fn at(&self, node: NodeId) -> [f32; 2] {
        self.positions[node.index()]
    }

    /// Whether an edge leads to a block further to the left.
    pub(super) fn leads_back(&self, from: NodeId, to: NodeId) -> bool {
        self.block_of[to.index()] < self.block_of[from.index()]
    }

    /// The four control points of a cubic curve from one block to another: level with the rows where
    /// it leaves and arrives, over the blocks between, and below everything when it leads back.
    pub(super) fn curve(&self, from: NodeId, to: NodeId) -> [[f32; 2]; 4] {
        let ([x0, y0], [x1, y1]) = (self.at(from), self.at(to));
        let reach = (x1 - x0).abs();
        if self.leads_back(from, to) {
            let fan = 45.0 * (1.0 - (y0 + y1) / (2.0 * self.bottom.max(1.0)));
            // A cubic goes three quarters of the way to its control points.
            let depth = (self.bottom + 22.0 + fan - 0.125 * (y0 + y1)) / 0.75;
            let pull = 0.1 * reach;
            return [[x0, y0], [x0 - pull, depth], [x1 + pull, depth], [x1, y1]];
        }
        let blocks = self.block_of[to.index()] - self.block_of[from.index()];
        let lift = if blocks > 1 { 0.1 * reach } else { 0.0 };
        let pull = 0.5 * reach;
        [
            [x0, y0],
            [x0 + pull, y0 - lift],
            [x1 - pull, y1 - lift],
            [x1, y1],
        ]
    }
}

/// Tasks and demonstrations in order, with their subgoals' columns in steps, not yet placed.
fn blocks(graph: &TopologicalGraph, route: &[NodeId]) -> Vec<Block> {
    let mut tasks: Vec<(String, Vec<Row>)> = Vec::new();
    let mut row_of: BTreeMap<(&str, &str), (usize, usize)> = BTreeMap::new();
    let on_route = route.iter().map(|id| (*id, graph.node(*id)));
    for (id, node) in on_route.clone().chain(graph.nodes()) {
        let task = tasks
            .iter()
            .position(|(t, _)| *t == node.task)
            .unwrap_or_else(|| {
                tasks.push((node.task.clone(), Vec::new()));
                tasks.len() - 1
            });
        let rows = &mut tasks[task].1;
        let (_, row) = *row_of
            .entry((&node.task, &node.trajectory))
            .or_insert_with(|| {
                rows.push(Row {
                    y: 0.0,
                    nodes: Vec::new(),
                });
                (task, rows.len() - 1)
            });
        rows[row].nodes.push(id);
    }
    tasks
        .into_iter()
        .map(|(task, mut rows)| {
            for row in &mut rows {
                row.nodes
                    .sort_unstable_by_key(|id| (graph.node(*id).step, *id));
                row.nodes.dedup();
            }
            let used = on_route
                .clone()
                .filter(|(_, node)| node.task == task)
                .map(|(_, node)| node.trajectory.as_str())
                .collect::<std::collections::BTreeSet<_>>()
                .len();
            // The rows of the route came first: bring them to the middle.
            let above = (rows.len() - used) / 2;
            rows[..used + above].rotate_right(above);
            let (columns, steps) = columns(graph, &task, &rows);
            Block {
                task,
                x: 0.0,
                width: 0.0,
                rows,
                columns,
                steps,
            }
        })
        .collect()
}

/// The subgoals of a task in the order in which they are reached, each after the median number of
/// steps since the one before, and the steps of the whole task.
fn columns(graph: &TopologicalGraph, task: &str, rows: &[Row]) -> (Vec<Column>, f32) {
    let mut order: BTreeMap<&str, (u32, u32)> = BTreeMap::new();
    for id in rows.iter().flat_map(|row| &row.nodes) {
        let node = graph.node(*id);
        for subgoal in node.reached.iter().filter(|s| s.task == task) {
            let (sum, count) = order.entry(&subgoal.name).or_default();
            *sum += node.step;
            *count += 1;
        }
    }
    let mut names: Vec<&str> = order.keys().copied().collect();
    names.sort_by_key(|name| order[name].0 * 1000 / order[name].1.max(1));
    let mut steps = 0.0;
    let mut columns: Vec<Column> = Vec::new();
    for name in names {
        let before = columns.last().map(|c: &Column| c.subgoal.clone());
        let since = rows.iter().filter_map(|row| {
            let start = match &before {
                Some(before) => reached_at(graph, row, before)?,
                None => first_step(graph, row),
            };
            Some(reached_at(graph, row, name)? - start)
        });
        steps += median(since).max(0.0);
        columns.push(Column {
            subgoal: name.to_owned(),
            steps,
            x: 0.0,
        });
    }
    let last = columns.last().map(|c| c.subgoal.clone());
    let rest = rows.iter().filter_map(|row| {
        let start = match &last {
            Some(last) => reached_at(graph, row, last)?,
            None => first_step(graph, row),
        };
        Some(last_step(graph, row) - start)
    });
    (columns, steps + median(rest).max(0.0))
}

/// Pairs of a demonstration's step and the task's steps that stand for the same progress.
fn anchors(graph: &TopologicalGraph, row: &Row, columns: &[Column], steps: f32) -> Vec<[f32; 2]> {
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

fn interpolate(anchors: &[[f32; 2]], step: f32) -> f32 {
    let after = anchors
        .partition_point(|a| a[0] < step)
        .clamp(1, anchors.len().max(2) - 1);
    match (anchors.get(after - 1), anchors.get(after)) {
        (Some([s0, x0]), Some([s1, x1])) => x0 + (x1 - x0) * (step - s0) / (s1 - s0),
        (Some([_, x]), None) => *x,
        _ => 0.0,
    }
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
