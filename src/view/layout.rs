//! Where the nodes of a merged graph stand: a block a task from left to right, a row a demonstration,
//! and along a row the progress through the task, so that the same subgoal of all demonstrations
//! stands in one column.

mod columns;

use std::collections::BTreeMap;

pub(super) use self::columns::Column;
use self::columns::{anchors, columns, interpolate, median_length};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};

/// The width at which the name of a task and its steps can be read.
const LEAST_BLOCK_WIDTH: f32 = 250.0;
/// Most by which the control points of a curve over blocks stand above its ends. The curve rises three
/// quarters of that, for which the head of a picture has room.
const MOST_LIFT: f32 = 130.0;

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
    /// Steps from the start to the end of the block: the sum of what its stretches take in the median.
    pub(super) steps: f32,
    /// Median number of steps of the demonstrations.
    pub(super) median_steps: f32,
}

/// One demonstration: its nodes in order of time.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) y: f32,
    pub(super) nodes: Vec<NodeId>,
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

/// The width of a frame in which each task of a graph can be read.
pub(super) fn least_width(graph: &TopologicalGraph, gap: f32) -> f32 {
    let tasks = graph.tasks().len();
    tasks as f32 * LEAST_BLOCK_WIDTH + tasks.saturating_sub(1) as f32 * gap
}

/// Whether two nodes are joined by an edge from one task to another, or to the start of the same one.
pub(super) fn is_cross_task(graph: &TopologicalGraph, from: NodeId, to: NodeId) -> bool {
    graph
        .edge(from, to)
        .is_some_and(|edge| edge.kind == EdgeKind::CrossTask)
}

impl GraphLayout {
    /// Lays a graph out. Tasks stand in the order in which the route passes them, then in that of the
    /// graph; demonstrations that the route uses stand next to each other in the middle.
    pub(super) fn new(graph: &TopologicalGraph, route: &[NodeId], frame: Frame) -> Self {
        let mut blocks = blocks(graph, route);
        let steps: f32 = blocks.iter().map(|b| b.steps.max(1.0)).sum();
        let gaps = frame.gap * blocks.len().saturating_sub(1) as f32;
        // However narrow the frame is, time runs to the right.
        let room = (frame.width - gaps).max(blocks.len() as f32);
        let a_step = room / steps.max(1.0);
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

    /// Whether a cross-task edge leads to a block further to the left, or back to the start of the same one,
    /// whose task is then done again.
    pub(super) fn leads_back(&self, from: NodeId, to: NodeId) -> bool {
        let place = |node: NodeId| (self.block_of[node.index()], self.at(node)[0]);
        place(to) < place(from)
    }

    /// Whether a step of a route follows a [`curve`](Self::curve): it changes the task, or begins it again.
    pub(super) fn is_curved(&self, graph: &TopologicalGraph, from: NodeId, to: NodeId) -> bool {
        self.block_of[from.index()] != self.block_of[to.index()] || is_cross_task(graph, from, to)
    }

    /// The four control points of a cubic curve between tasks: level with the rows where it leaves and
    /// arrives, over the blocks between, and below everything when it leads back.
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
        let lift = if blocks > 1 {
            (0.1 * reach).min(MOST_LIFT)
        } else {
            0.0
        };
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
            let median_steps = median_length(graph, &rows);
            Block {
                task,
                x: 0.0,
                width: 0.0,
                rows,
                columns,
                steps,
                median_steps,
            }
        })
        .collect()
}
