use super::MARGIN;
use super::canvas::{Canvas, Type};
use super::edges::Drawn;
use super::route;
use crate::view::palette::{CROSS_TASK, CROSS_TASK_PALE, GREY, INK};
use crate::wording::grouped;

/// What the marks mean, and how many edges are drawn of how many.
pub(super) fn paint(canvas: &mut Canvas, drawn: &Drawn, top: f32, right: f32, has_route: bool) {
    let left = MARGIN - 12.0;
    let y = top + 24.0;
    let set = Type {
        colour: INK,
        ..Type::default()
    };
    canvas.push(format_args!(
        "<path d=\"M{left} {top:.1}H{right}\" stroke=\"#e5e7eb\" stroke-width=\"1\"/>"
    ));

    line(canvas, left, y, "a demonstration, a dot a state");
    canvas.push(format_args!(
        "<g stroke=\"{0}\" stroke-linecap=\"round\"><path d=\"M{1:.1} {2:.1}h0\" \
         stroke-width=\"7\"/><path d=\"M{3:.1} {2:.1}h0\" stroke-width=\"8\"/><path d=\"M{3:.1} \
         {2:.1}h0\" stroke=\"#ffffff\" stroke-width=\"3.6\"/></g>",
        GREY.hex(),
        left + 266.0,
        y,
        left + 414.0,
    ));
    canvas.text(left + 278.0, y + 4.5, set, "subgoal reached");
    canvas.text(left + 426.0, y + 4.5, set, "end state");

    let [shown, all] = drawn.learned;
    let x = left + 520.0;
    canvas.push(format_args!(
        "<path d=\"M{x:.1} {0:.1}l30 -8M{x:.1} {1:.1}l30 8M{x:.1} {y:.1}h30\" stroke=\"{2}\" \
         stroke-width=\"0.8\" stroke-opacity=\"0.5\"/>",
        y + 4.0,
        y - 4.0,
        GREY.hex()
    ));
    canvas.text(
        x + 40.0,
        y + 4.5,
        set,
        &format!("learned edges within a task{}", of(shown, all)),
    );

    cross_task(canvas, drawn, left, y + 32.0);
    if has_route {
        route::sample(canvas, left + 830.0, y + 32.0);
    }
}

fn line(canvas: &mut Canvas, x: f32, y: f32, text: &str) {
    canvas.push(format_args!(
        "<g stroke=\"{}\" stroke-linecap=\"round\"><path d=\"M{x:.1} {y:.1}h30\" \
         stroke-opacity=\"0.55\"/><path d=\"M{:.1} {y:.1}h0m8 0h0m8 0h0m8 0h0\" \
         stroke-width=\"3.4\"/></g>",
        GREY.hex(),
        x + 3.0
    ));
    let set = Type {
        colour: INK,
        ..Type::default()
    };
    canvas.text(x + 40.0, y + 4.5, set, text);
}

fn cross_task(canvas: &mut Canvas, drawn: &Drawn, x: f32, y: f32) {
    let [shown, all] = drawn.cross_task;
    let set = Type {
        colour: INK,
        ..Type::default()
    };
    if all == 0 {
        canvas.text(x, y + 4.5, set, "no cross-task edges");
        return;
    }
    canvas.push(format_args!(
        "<defs><linearGradient id=\"probability\"><stop stop-color=\"{}\"/><stop offset=\"1\" \
         stop-color=\"{}\"/></linearGradient></defs><rect x=\"{:.1}\" y=\"{:.1}\" width=\"90\" \
         height=\"8\" rx=\"4\" fill=\"url(#probability)\"/>",
        CROSS_TASK_PALE.hex(),
        CROSS_TASK.hex(),
        x + 40.0,
        y - 4.0
    ));
    let small = Type {
        size: 12.0,
        ..Type::default()
    };
    let end = Type {
        anchor: "end",
        ..small
    };
    canvas.text(
        x + 34.0,
        y + 4.0,
        end,
        &format!("{:.2}", drawn.probabilities[0]),
    );
    canvas.text(
        x + 136.0,
        y + 4.0,
        small,
        &format!("{:.2}", drawn.probabilities[1]),
    );
    let text = format!(
        "cross-task edges by probability; those that lead back pass below{}",
        of(shown, all)
    );
    canvas.text(x + 176.0, y + 4.5, set, &text);
}

fn of(shown: usize, all: usize) -> String {
    if shown == all {
        return String::new();
    }
    format!(" ({} of {} drawn)", grouped(shown), grouped(all))
}
