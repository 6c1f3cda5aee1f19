use super::LABEL_HEIGHT;
use super::canvas::{Canvas, Type, text_width};
use crate::view::layout::{Column, GraphLayout};
use crate::view::palette::{self, INK};

const LABEL_SIZE: f32 = 12.5;
/// From a column's line to its name.
const OFFSET: f32 = 5.0;
/// Between two names that stand at the same height.
const ROOM: f32 = 11.0;
/// Names keep this far from the sides of the picture, for their width is an estimate.
const SIDE: f32 = 8.0;

/// The name of a subgoal at its column.
pub(super) struct Label<'a> {
    subgoal: &'a str,
    /// Index of the column's block.
    block: usize,
    column: f32,
    anchor: &'static str,
    x: f32,
    /// From where to where it reaches, with its column.
    span: [f32; 2],
    /// Its height in lines, 0 next to the rows.
    level: usize,
}

impl<'a> Label<'a> {
    /// To the left of its column, to the right where it would leave the picture, and where it would do so
    /// on either side, at the right edge.
    fn new(block: usize, column: &'a Column, width: f32) -> Self {
        let length = text_width(&column.subgoal, LABEL_SIZE);
        let before = column.x - OFFSET;
        let after = column.x + OFFSET;
        let edge = width - SIDE;
        let (anchor, x, span) = if before - length >= SIDE {
            ("end", before, [before - length, column.x])
        } else if after + length <= edge {
            ("start", after, [column.x, after + length])
        } else {
            ("end", edge, [edge - length, edge])
        };
        Self {
            subgoal: &column.subgoal,
            block,
            column: column.x,
            anchor,
            x,
            span,
            level: 0,
        }
    }
}

/// The names of all subgoals from left to right, one of them higher than those to its right that it would
/// touch.
pub(super) fn place(layout: &GraphLayout, width: f32) -> Vec<Label<'_>> {
    let mut labels: Vec<Label<'_>> = Vec::new();
    for (index, block) in layout.blocks.iter().enumerate() {
        let names = block.columns.iter();
        labels.extend(names.map(|column| Label::new(index, column, width)));
    }
    labels.sort_by(|a, b| a.column.total_cmp(&b.column));
    for i in (0..labels.len()).rev() {
        let end = labels[i].span[1] + ROOM;
        let below = labels[i + 1..].iter().filter(|later| later.span[0] < end);
        labels[i].level = below.map(|later| later.level + 1).max().unwrap_or(0);
    }
    labels
}

/// How many lines the names take.
pub(super) fn levels(labels: &[Label<'_>]) -> usize {
    labels
        .iter()
        .map(|label| label.level + 1)
        .max()
        .unwrap_or(0)
}

/// The blocks' ground, and a thin line where each subgoal is reached.
pub(super) fn columns(
    canvas: &mut Canvas,
    layout: &GraphLayout,
    labels: &[Label<'_>],
    top: f32,
    bottom: f32,
) {
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
        for label in labels.iter().filter(|label| label.block == index) {
            canvas.push(format_args!(
                "<path d=\"M{:.1} {:.1}V{:.1}\" stroke=\"{}\" stroke-width=\"1\" \
                 stroke-opacity=\"0.6\" stroke-dasharray=\"2 3\"/>",
                label.column,
                label_y(top, label.level) - 11.0,
                bottom,
                colour.hex()
            ));
        }
    }
}

/// The names of the subgoals beside their lines.
pub(super) fn names(canvas: &mut Canvas, labels: &[Label<'_>], top: f32) {
    for label in labels {
        let set = Type {
            size: LABEL_SIZE,
            weight: 500,
            colour: palette::task(label.block).mixed(INK, 0.35),
            anchor: label.anchor,
        };
        canvas.text(label.x, label_y(top, label.level), set, label.subgoal);
    }
}

fn label_y(top: f32, level: usize) -> f32 {
    top - 16.0 - level as f32 * LABEL_HEIGHT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::layout::Block;

    const WIDTH: f32 = 1400.0;

    /// Blocks with these subgoals, each with the number of its letters and where its column stands.
    fn layout(blocks: &[&[(usize, f32)]]) -> GraphLayout {
        let column = |(letters, x): &(usize, f32)| Column {
            subgoal: "n".repeat(*letters),
            steps: 0.0,
            x: *x,
        };
        let block = |columns: &&[(usize, f32)]| Block {
            task: String::new(),
            x: 0.0,
            width: 0.0,
            rows: Vec::new(),
            columns: columns.iter().map(column).collect(),
            steps: 0.0,
            median_steps: 0.0,
        };
        GraphLayout {
            blocks: blocks.iter().map(block).collect(),
            positions: Vec::new(),
            block_of: Vec::new(),
            bottom: 0.0,
        }
    }

    #[test]
    fn names_that_have_room_stand_next_to_the_rows_before_their_columns() {
        let layout = layout(&[&[(11, 240.0), (12, 413.0)], &[(11, 1061.0), (10, 1340.0)]]);
        for label in place(&layout, WIDTH) {
            assert_eq!((label.anchor, label.level), ("end", 0), "{}", label.column);
            assert_eq!(label.x, label.column - OFFSET);
        }
    }

    #[test]
    fn names_stay_in_the_picture() {
        let layout = layout(&[&[(58, 60.0), (4, 300.0), (58, 1390.0), (180, 700.0)]]);
        let labels = place(&layout, WIDTH);
        let told: Vec<_> = labels.iter().map(|l| (l.anchor, l.x)).collect();
        let edge = WIDTH - SIDE;
        let beside = [
            ("start", 65.0),
            ("end", 295.0),
            ("end", edge),
            ("end", 1385.0),
        ];
        assert_eq!(told, beside);
        assert!(
            labels
                .iter()
                .all(|l| l.span[0] >= 0.0 && l.span[1] <= WIDTH)
        );
    }

    #[test]
    fn names_of_different_blocks_do_not_cover_each_other_either() {
        let layout = layout(&[
            &[(58, 60.0), (4, 300.0), (4, 600.0)],
            &[(40, 760.0), (4, 1000.0)],
        ]);
        let labels = place(&layout, WIDTH);
        for (i, a) in labels.iter().enumerate() {
            for b in labels[i + 1..].iter().filter(|b| b.level == a.level) {
                assert!(a.span[1] < b.span[0], "{:?} and {:?}", a.span, b.span);
            }
        }
        assert_eq!(levels(&labels), 2);
    }
}
