use std::fmt::Write;

use super::canvas::Canvas;
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::view::layout::GraphLayout;
use crate::view::palette::{self, CROSS_TASK, CROSS_TASK_PALE};
use crate::view::selection::{Ends, most_probable_of_each_pair, of_kind, spread};

/// More learned edges than this are a fog.
const MOST_LEARNED: usize = 1500;
/// More cross-task edges than this cannot be told apart.
const MOST_CROSS_TASK: usize = 500;

/// How many edges were drawn of how many, for the legend.
pub(super) struct Drawn {
    pub(super) learned: [usize; 2],
    pub(super) cross_task: [usize; 2],
    /// Lowest and highest probability of the cross-task edges that were drawn.
    pub(super) probabilities: [f32; 2],
}

/// Paints all edges and the nodes on top of them.
pub(super) fn paint(
    canvas: &mut Canvas,
    graph: &TopologicalGraph,
    layout: &GraphLayout,
    row_height: f32,
) -> Drawn {
    let learned = of_kind(graph, EdgeKind::Learned);
    let cross_task = of_kind(graph, EdgeKind::CrossTask);
    let shown_learned = spread(&learned, MOST_LEARNED);
    let shown_cross_task = most_probable_of_each_pair(layout, &cross_task, MOST_CROSS_TASK);
    let probability =
        |ends: Option<&Ends<'_>>| ends.map_or(0.0, |(.., edge)| edge.connected_probability());
    let probabilities = [
        probability(shown_cross_task.first()),
        probability(shown_cross_task.last()),
    ];

    paint_learned(canvas, layout, &shown_learned);
    paint_cross_task(canvas, layout, &shown_cross_task, probabilities);
    paint_temporal(canvas, layout, &of_kind(graph, EdgeKind::Temporal));
    paint_nodes(canvas, graph, layout, row_height);
    Drawn {
        learned: [shown_learned.len(), learned.len()],
        cross_task: [shown_cross_task.len(), cross_task.len()],
        probabilities,
    }
}

fn paint_learned(canvas: &mut Canvas, layout: &GraphLayout, edges: &[Ends<'_>]) {
    for (index, _) in layout.blocks.iter().enumerate() {
        let mut path = String::new();
        for (from, to, _) in edges
            .iter()
            .filter(|e| layout.block_of[e.0.index()] == index)
        {
            let ([x0, y0], [x1, y1]) = (layout.at(*from), layout.at(*to));
            let _ = write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}");
        }
        canvas.push(format_args!(
            "<path d=\"{path}\" stroke=\"{}\" stroke-width=\"0.6\" stroke-opacity=\"0.22\"/>",
            palette::task(index).hex()
        ));
    }
}

/// Edges that lead back stand back, and lie behind those that lead on.
fn paint_cross_task(
    canvas: &mut Canvas,
    layout: &GraphLayout,
    edges: &[Ends<'_>],
    [lowest, highest]: [f32; 2],
) {
    for (back, most_opaque, thickest) in [(true, 0.3, 0.8), (false, 0.7, 1.3)] {
        canvas.push(format_args!("<g stroke-linecap=\"round\">"));
        let drawn_now = edges.iter().filter(|e| layout.leads_back(e.0, e.1) == back);
        for (from, to, edge) in drawn_now {
            let strength =
                (edge.connected_probability() - lowest) / (highest - lowest).max(f32::EPSILON);
            canvas.push(format_args!(
                "<path d=\"{}\" stroke=\"{}\" stroke-width=\"{:.2}\" stroke-opacity=\"{:.2}\"/>",
                arc(layout, *from, *to),
                CROSS_TASK_PALE.mixed(CROSS_TASK, strength).hex(),
                thickest * (0.6 + 0.4 * strength),
                most_opaque * (0.35 + 0.65 * strength * strength),
            ));
        }
        canvas.push(format_args!("</g>"));
    }
}

/// The path of [`GraphLayout::curve`].
pub(super) fn arc(layout: &GraphLayout, from: NodeId, to: NodeId) -> String {
    let [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = layout.curve(from, to);
    format!("M{x0:.1} {y0:.1}C{x1:.1} {y1:.1} {x2:.1} {y2:.1} {x3:.1} {y3:.1}")
}

fn paint_temporal(canvas: &mut Canvas, layout: &GraphLayout, edges: &[Ends<'_>]) {
    for (index, _) in layout.blocks.iter().enumerate() {
        let mut path = String::new();
        for (from, to, _) in edges
            .iter()
            .filter(|e| layout.block_of[e.0.index()] == index)
        {
            let ([x0, y0], [x1, _]) = (layout.at(*from), layout.at(*to));
            let _ = write!(path, "M{x0:.1} {y0:.1}H{x1:.1}");
        }
        canvas.push(format_args!(
            "<path d=\"{path}\" stroke=\"{}\" stroke-width=\"0.8\" stroke-opacity=\"0.55\"/>",
            palette::task(index).hex()
        ));
    }
}

fn paint_nodes(
    canvas: &mut Canvas,
    graph: &TopologicalGraph,
    layout: &GraphLayout,
    row_height: f32,
) {
    let size = (row_height * 0.42).clamp(1.6, 3.4);
    for (index, block) in layout.blocks.iter().enumerate() {
        let (mut plain, mut reached, mut ends) = (String::new(), String::new(), String::new());
        for id in block.rows.iter().flat_map(|row| &row.nodes) {
            let [x, y] = layout.at(*id);
            let node = graph.node(*id);
            // A line of no length with round ends is a dot.
            let path = match (node.is_end, node.reached.is_empty()) {
                (true, _) => &mut ends,
                (false, false) => &mut reached,
                (false, true) => &mut plain,
            };
            let _ = write!(path, "M{x:.1} {y:.1}h0");
        }
        let colour = palette::task(index);
        let dark = colour.mixed(palette::INK, 0.35);
        canvas.push(format_args!("<g stroke-linecap=\"round\">"));
        for (path, colour, width) in [
            (&plain, colour, size),
            (&reached, dark, size * 1.9),
            (&ends, dark, size * 2.2),
        ] {
            canvas.push(format_args!(
                "<path d=\"{path}\" stroke=\"{}\" stroke-width=\"{width:.1}\"/>",
                colour.hex()
            ));
        }
        // End states are rings.
        canvas.push(format_args!(
            "<path d=\"{ends}\" stroke=\"#ffffff\" stroke-width=\"{size:.1}\"/></g>"
        ));
    }
}
