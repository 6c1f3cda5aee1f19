//! A merged graph as one picture: a block a task, a line a demonstration, and what joins the tasks.

mod arrows;
mod automaton;
mod bars;
mod canvas;
mod curves;
mod edges;
mod labels;
mod legend;
mod orders;
mod rates;
mod route;
mod spreads;
mod subgoals;
mod times;

use std::path::Path;

pub use automaton::{automaton_svg, write_automaton_svg};
use canvas::Canvas;
pub use curves::{Curve, Panel, curves_svg, write_curves_svg};
pub use rates::{Rate, rates_svg, write_rates_svg};
pub use spreads::{Spread, spreads_svg, write_spreads_svg};
pub use times::{Timing, times_svg, write_times_svg};

use super::layout::{Frame, GraphLayout, least_width};
use super::{ViewError, file};
use crate::graph::{NodeId, TopologicalGraph};

const MARGIN: f32 = 44.0;
const LEAST_WIDTH: f32 = 1400.0;
const GAP: f32 = 150.0;
const MOST_ROW_HEIGHT: f32 = 16.0;
/// Rows are squeezed so that the blocks stay about this high, as long as they can be told apart.
const BLOCK_HEIGHT: f32 = 340.0;
const LEAST_ROW_HEIGHT: f32 = 3.0;
/// Title, counts, and names of the tasks.
const HEAD_HEIGHT: f32 = 150.0;
const LABEL_HEIGHT: f32 = 17.0;
/// Room below the rows for the edges that lead back.
const FOOT_HEIGHT: f32 = 70.0;
const LEGEND_HEIGHT: f32 = 92.0;

/// A picture of a merged graph as SVG text, 1400 units wide or wider.
///
/// Time runs to the right. Each task is a block, each demonstration a line of dots; a dot's place along
/// its line is its progress through the task, so the same subgoal of all demonstrations stands in one
/// column. Arcs join the tasks, the more probable the stronger; edges that lead back to an earlier task,
/// or to the start of the same one, pass below. The route is drawn in bold, with a number where it reaches
/// a subgoal (in every round that a task is done) and a star at its last node, the chosen final state.
/// Where there are too many edges to see, the legend says how many are drawn of how many.
///
/// # Panics
/// If the route names a node that is not in the graph.
#[must_use]
pub fn merged_graph_svg(graph: &TopologicalGraph, route: Option<&[NodeId]>, title: &str) -> String {
    let route = route.unwrap_or_default();
    let width = LEAST_WIDTH.max(2.0 * MARGIN + least_width(graph, GAP));
    let frame = |top, row_height| Frame {
        left: MARGIN,
        top,
        width: width - 2.0 * MARGIN,
        gap: GAP,
        row_height,
    };
    // A first layout tells how many rows and levels of labels there are.
    let draft = GraphLayout::new(graph, route, frame(0.0, 1.0));
    let rows = draft
        .blocks
        .iter()
        .map(|b| b.rows.len())
        .max()
        .unwrap_or(0)
        .max(1) as f32;
    let row_height = (BLOCK_HEIGHT / rows).clamp(LEAST_ROW_HEIGHT, MOST_ROW_HEIGHT);
    let names = subgoals::place(&draft, width);
    let top = HEAD_HEIGHT + subgoals::levels(&names) as f32 * LABEL_HEIGHT;
    let layout = GraphLayout::new(graph, route, frame(top, row_height));
    let bottom = top + rows * row_height;

    let mut canvas = Canvas::new(width, bottom + FOOT_HEIGHT + LEGEND_HEIGHT);
    subgoals::columns(&mut canvas, &layout, &names, top, bottom);
    let drawn = edges::paint(&mut canvas, graph, &layout, row_height);
    route::paint(&mut canvas, graph, &layout, route);
    subgoals::names(&mut canvas, &names, top);
    labels::blocks(&mut canvas, graph, &layout);
    labels::title(&mut canvas, graph, title);
    legend::paint(
        &mut canvas,
        &drawn,
        bottom + FOOT_HEIGHT,
        width - MARGIN + 12.0,
        !route.is_empty(),
    );
    canvas.finish()
}

/// Writes [`merged_graph_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
///
/// # Panics
/// If the route names a node that is not in the graph.
pub fn write_merged_graph_svg(
    path: &Path,
    graph: &TopologicalGraph,
    route: Option<&[NodeId]>,
    title: &str,
) -> Result<(), ViewError> {
    file::write(path, merged_graph_svg(graph, route, title).as_bytes())
}
