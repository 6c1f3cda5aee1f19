use std::fmt::Write;

use super::MARGIN;
use super::canvas::{Canvas, Type, text_width};
use crate::graph::{EdgeKind, TopologicalGraph};
use crate::view::layout::GraphLayout;
use crate::view::palette::{self, GREY, INK};
use crate::wording::counted;

/// The tasks' names above their blocks.
pub(super) fn blocks(canvas: &mut Canvas, graph: &TopologicalGraph, layout: &GraphLayout) {
    for (index, block) in layout.blocks.iter().enumerate() {
        let name = Type {
            size: 19.0,
            weight: 700,
            colour: palette::task(index),
            anchor: "start",
        };
        canvas.text(block.x - 12.0, 104.0, name, &block.task);
        let states: usize = block.rows.iter().map(|row| row.nodes.len()).sum();
        let ends = graph
            .nodes()
            .filter(|(_, n)| n.is_end && n.task == block.task)
            .count();
        let mut counts = format!(
            "{}, median {:.0} steps",
            counted(block.rows.len(), "demonstration"),
            block.median_steps
        );
        if ends != block.rows.len() {
            let _ = write!(counts, ", {}", counted(ends, "end state"));
        }
        let counts = if text_width(&counts, 12.5) > block.width {
            counted(states, "state")
        } else {
            counts
        };
        let set = Type {
            size: 12.5,
            ..Type::default()
        };
        canvas.text(block.x - 12.0, 122.0, set, &counts);
    }
}

/// The title and the counts of the whole graph.
pub(super) fn title(canvas: &mut Canvas, graph: &TopologicalGraph, title: &str) {
    let set = Type {
        size: 24.0,
        weight: 700,
        colour: INK,
        anchor: "start",
    };
    canvas.text(MARGIN - 12.0, 42.0, set, title);
    let count = |kind| graph.edges().filter(|(.., e)| e.kind == kind).count();
    let counts = format!(
        "{}   ·   {}   ·   {} within a task   ·   {}",
        counted(graph.node_count(), "state"),
        counted(count(EdgeKind::Temporal), "temporal edge"),
        counted(count(EdgeKind::Learned), "learned edge"),
        counted(count(EdgeKind::CrossTask), "cross-task edge"),
    );
    let set = Type {
        size: 14.0,
        colour: GREY,
        ..Type::default()
    };
    canvas.text(MARGIN - 12.0, 66.0, set, &counts);
}
