//! Names above the map, on as many lines as they need so that none covers another.
//!
//! The viewer writes names in its own size, however wide the map is; so they are placed for a window of
//! a usual width.

use crate::view::layout::GraphLayout;

/// How wide the map is on the screen, in points.
const SCREEN_WIDTH: f32 = 880.0;
/// From the rows of the map up to the lowest line, and from line to line.
const LOWEST: f32 = 34.0;
const LINE: f32 = 30.0;
/// From the highest line up to the names of the tasks, and from those to the edge.
const TASKS: f32 = 37.0;
const EDGE: f32 = 14.0;
/// Width of a letter, and what the viewer leaves free on both sides of a name.
const LETTER: f32 = 6.5;
const PADDING: f32 = 24.0;

/// Where the names stand, in the units of the map.
pub(super) struct Labels {
    /// Units of the map in a point of the screen.
    unit: f32,
    /// Of each block the heights of its subgoals' names.
    subgoals: Vec<Vec<f32>>,
    /// The height of the tasks' names.
    pub(super) tasks_y: f32,
}

impl Labels {
    /// Places the names of a map that is so wide.
    pub(super) fn new(layout: &GraphLayout, width: f32) -> Self {
        let unit = width / SCREEN_WIDTH;
        let mut names: Vec<(usize, f32, &str)> = Vec::new();
        for (index, block) in layout.blocks.iter().enumerate() {
            let columns = &block.columns;
            names.extend(columns.iter().map(|c| (index, c.x, c.subgoal.as_str())));
        }
        let lines = lines(names.iter().map(|(_, x, name)| (x / unit, *name)));
        let y = |line: usize| -(LOWEST + LINE * line as f32) * unit;
        let mut subgoals = vec![Vec::new(); layout.blocks.len()];
        for ((block, ..), line) in names.iter().zip(&lines) {
            subgoals[*block].push(y(*line));
        }
        let highest = lines.iter().copied().max().unwrap_or(0);
        Self {
            unit,
            subgoals,
            tasks_y: y(highest) - TASKS * unit,
        }
    }

    /// The heights of the names of a block's subgoals, in the order of its columns.
    pub(super) fn subgoals_y(&self, block: usize) -> &[f32] {
        &self.subgoals[block]
    }

    /// Two corners between which the map and all names have room.
    pub(super) fn corners(&self, layout: &GraphLayout) -> [[f32; 2]; 2] {
        let half = |name: &str| width(name) * self.unit / 2.0;
        let lefts = layout.blocks.iter().map(|b| b.x - half(&b.task));
        let rights = layout.blocks.iter().map(|b| b.x + b.width);
        [
            [lefts.fold(0.0, f32::min), self.tasks_y - EDGE * self.unit],
            [
                rights.fold(0.0, f32::max) + half("final state"),
                layout.bottom,
            ],
        ]
    }
}

/// The line of each name, 0 the lowest, given the middle of each in points from left to right.
fn lines<'a>(names: impl Iterator<Item = (f32, &'a str)>) -> Vec<usize> {
    let mut ends: Vec<f32> = Vec::new();
    names
        .map(|(middle, name)| {
            let [from, to] = [-0.5, 0.5].map(|side| middle + side * width(name));
            let line = ends.iter().position(|end| *end <= from);
            let line = line.unwrap_or_else(|| {
                ends.push(to);
                ends.len() - 1
            });
            ends[line] = to;
            line
        })
        .collect()
}

/// How wide the viewer writes a name, in points.
fn width(name: &str) -> f32 {
    name.chars().count() as f32 * LETTER + PADDING
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_would_cover_each_other_stand_on_lines_of_their_own() {
        let names = [
            (0.0, "drawer_open"),
            (75.0, "sock_grasped"),
            (180.0, "sock_in_box"),
            (190.0, "x"),
            (195.0, "y"),
        ];
        assert_eq!(lines(names.into_iter()), [0, 1, 0, 1, 2]);
    }
}
