use std::fmt::Write;

use super::canvas::{Canvas, Type, text_width};
use super::{LABEL_HEIGHT, MARGIN};
use crate::graph::{EdgeKind, TopologicalGraph};
use crate::view::layout::{Block, GraphLayout};
use crate::view::palette::{self, GREY, INK};
use crate::wording::counted;

const LABEL_SIZE: f32 = 12.5;

/// How many lines the subgoals' labels take, so that none covers another.
pub(super) fn levels(layout: &GraphLayout) -> usize {
    layout
        .blocks
        .iter()
        .flat_map(|block| label_levels(block).into_iter().map(|level| level + 1))
        .max()
        .unwrap_or(0)
}

/// The level of each label, 0 next to the rows. Labels end at their column, so the one further to the
/// right covers the column lines of the others unless it stands lower.
fn label_levels(block: &Block) -> Vec<usize> {
    let mut levels = vec![0; block.columns.len()];
    for i in (0..block.columns.len()).rev() {
        let column = &block.columns[i];
        levels[i] = block.columns[i + 1..]
            .iter()
            .zip(&levels[i + 1..])
            .filter(|(later, _)| later.x - label_length(&later.subgoal) < column.x + 8.0)
            .map(|(_, level)| level + 1)
            .max()
            .unwrap_or(0);
    }
    levels
}

fn label_length(subgoal: &str) -> f32 {
    text_width(subgoal, LABEL_SIZE) + 8.0
}

/// The blocks' ground, and a thin line where each subgoal is reached.
pub(super) fn columns(canvas: &mut Canvas, layout: &GraphLayout, top: f32, bottom: f32) {
    for (index, block) in layout.blocks.iter().enumerate() {
        let colour = palette::task(index);
        canvas.push(format_args!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"10\" fill=\"{}\" \
             fill-opacity=\"0.055\"/>",
            block.x - 12.0,
            top - 8.0,
            block.width + 24.0,
            bottom - top + 16.0,
            colour.hex()
        ));
        for (column, level) in block.columns.iter().zip(label_levels(block)) {
            let y = label_y(top, level);
            canvas.push(format_args!(
                "<path d=\"M{:.1} {:.1}V{:.1}\" stroke=\"{}\" stroke-width=\"1\" \
                 stroke-opacity=\"0.6\" stroke-dasharray=\"2 3\"/>",
                column.x,
                y - 11.0,
                bottom,
                colour.hex()
            ));
        }
    }
}

/// The names of the subgoals, each to the left of its line.
pub(super) fn subgoals(canvas: &mut Canvas, layout: &GraphLayout, top: f32) {
    for (index, block) in layout.blocks.iter().enumerate() {
        for (column, level) in block.columns.iter().zip(label_levels(block)) {
            let set = Type {
                size: LABEL_SIZE,
                weight: 500,
                colour: palette::task(index).mixed(INK, 0.35),
                anchor: "end",
            };
            canvas.text(column.x - 5.0, label_y(top, level), set, &column.subgoal);
        }
    }
}

fn label_y(top: f32, level: usize) -> f32 {
    top - 16.0 - level as f32 * LABEL_HEIGHT
}

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
            block.steps
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
