//! An automaton as a picture: the orders that are allowed above, the stages of the one that is planned below.

use std::collections::BTreeMap;
use std::path::Path;

use super::canvas::{Canvas, Type, text_width};
use super::orders::{self, LEFT, Shape};
use crate::planner::{Explanation, PlanPart};
use crate::task::OrderAutomaton;
use crate::view::palette::{self, GREY, INK, Rgb, STAR};
use crate::view::{ViewError, file};
use crate::wording::{counted, counted_or_many};

const LEAST_WIDTH: f32 = 900.0;
/// Between two stages, if the names there are not too long for it.
const LEAST_STAGE: f32 = 190.0;
/// Names are not set smaller than this.
const LEAST_SIZE: f32 = 8.0;
/// What names leave free between two stages.
const BESIDE_NAMES: f32 = 34.0;
const STAGES_A_LINE: usize = 6;
const LINE: f32 = 150.0;
/// Orders with more transitions are not drawn: nobody could follow them.
const MOST_TRANSITIONS: usize = 80;

/// A picture of a composition's automaton as SVG text: which orders of tasks are allowed, the chosen one in
/// bold, and below its stages, each with the part of the plan that ends it.
///
/// All of `orders` is drawn; counted are those of its orders that the explanation says are open, as in its words. Orders of
/// more than 80 transitions are not drawn, only counted.
#[must_use]
pub fn automaton_svg(orders: &OrderAutomaton, explanation: &Explanation, title: &str) -> String {
    let tasks = task_colours(orders, explanation);
    let shape = Shape::new(orders);
    let is_drawn = orders.transitions().len() <= MOST_TRANSITIONS;
    let columns = explanation.parts.len().clamp(1, STAGES_A_LINE) as f32;
    let stage = stage_width(explanation);
    let mut width = LEAST_WIDTH.max(2.0 * LEFT + columns * stage);
    let mut top = 130.0;
    if is_drawn {
        width = width.max(2.0 * LEFT + shape.layers as f32 * orders::LAYER);
        top += shape.rows.max(1.0) * orders::ROW + 30.0;
    }
    let lines = explanation.parts.len().div_ceil(STAGES_A_LINE).max(1) as f32;
    let mut canvas = Canvas::new(width, top + 70.0 + (lines - 1.0) * LINE + 70.0);
    head(&mut canvas, orders, explanation, title, is_drawn);
    if is_drawn {
        let chosen = explanation.orders.listed.iter().find(|o| o.is_chosen);
        let way = chosen
            .and_then(|o| orders.way(&o.tasks))
            .unwrap_or_default();
        shape.paint(&mut canvas, orders, &way, &tasks);
    }
    stages(&mut canvas, explanation, &tasks, top, stage);
    canvas.finish()
}

/// Writes [`automaton_svg`] to a file, which is there as a whole or not at all.
///
/// # Errors
/// [`ViewError::FileUnwritable`] when the folder or the file cannot be written.
pub fn write_automaton_svg(
    path: &Path,
    orders: &OrderAutomaton,
    explanation: &Explanation,
    title: &str,
) -> Result<(), ViewError> {
    file::write(path, automaton_svg(orders, explanation, title).as_bytes())
}

/// A colour for each task; those of the plan first, as in the picture of the graph.
fn task_colours<'a>(
    orders: &'a OrderAutomaton,
    explanation: &'a Explanation,
) -> BTreeMap<&'a str, Rgb> {
    let planned = explanation.stages.iter().map(|s| s.task.as_str());
    let all = orders
        .transitions()
        .iter()
        .filter_map(|t| t.task.as_deref());
    let mut colours = BTreeMap::new();
    for task in planned.chain(all) {
        let next = palette::task(colours.len());
        colours.entry(task).or_insert(next);
    }
    colours
}

fn head(
    canvas: &mut Canvas,
    orders: &OrderAutomaton,
    explanation: &Explanation,
    title: &str,
    is_drawn: bool,
) {
    let set = |size: f32, weight: u32, colour: Rgb| Type {
        size,
        weight,
        colour,
        anchor: "start",
    };
    canvas.text(LEFT - 28.0, 42.0, set(24.0, 700, INK), title);
    let open = explanation.orders.order_count;
    let steps: u32 = explanation.parts.iter().map(|p| p.steps).sum();
    let cost: f64 = explanation.parts.iter().map(|p| p.cost).sum();
    let line = format!(
        "{}   \u{b7}   {}   \u{b7}   plan: {}, cost {cost:.1}, holds with probability {:.3}",
        counted_or_many(open, "order"),
        counted(explanation.stages.len(), "subgoal"),
        counted(steps as usize, "step"),
        explanation.odds.probability
    );
    canvas.text(LEFT - 28.0, 66.0, set(14.0, 400, GREY), &line);
    let note = if is_drawn {
        note(orders, open)
    } else {
        "too many orders to be drawn"
    };
    canvas.text(LEFT - 28.0, 98.0, set(13.0, 600, INK), note);
}

/// What is said of the orders that are drawn. `open` is how many of them are; none where they are too many to be counted.
fn note(orders: &OrderAutomaton, open: Option<u64>) -> &'static str {
    let all = orders.order_count(None);
    if all != open {
        "the orders that are allowed, also those that end with another task than the final state's; the planned one in bold"
    } else if all.is_none() && orders.last_tasks().len() > 1 {
        // Whether all of them are open is not known.
        "the orders that are allowed, whichever task they end with; the planned one in bold"
    } else {
        "the orders that are allowed, the planned one in bold"
    }
}

/// The stages of the plan in lines, each with the part of the plan that leads out of it.
fn stages(
    canvas: &mut Canvas,
    explanation: &Explanation,
    tasks: &BTreeMap<&str, Rgb>,
    top: f32,
    width: f32,
) {
    let set = Type {
        size: 13.0,
        weight: 600,
        colour: INK,
        anchor: "start",
    };
    canvas.text(
        LEFT - 28.0,
        top,
        set,
        "the stages of the plan, and what leads to each subgoal",
    );
    let to_subgoals = explanation
        .parts
        .iter()
        .filter(|p| p.subgoal.is_some())
        .count();
    // A plan that is not searched in order has no parts to subgoals; it begins where none is reached.
    let first = if to_subgoals == 0 {
        0
    } else {
        explanation.stages.len() - to_subgoals
    };
    for (i, part) in explanation.parts.iter().enumerate() {
        let line = top + 70.0 + (i / STAGES_A_LINE) as f32 * LINE;
        let x = LEFT + (i % STAGES_A_LINE) as f32 * width;
        let colour = tasks.get(part.task.as_str()).copied().unwrap_or(INK);
        canvas.push(format_args!(
            "<path d=\"M{x:.1} {line:.1}h{width:.1}\" stroke=\"{}\" stroke-width=\"4\"/>",
            colour.hex()
        ));
        caption(canvas, part, [x + width / 2.0, line], width, colour);
        stage_circle(canvas, [x, line], first + i);
        let is_last = i + 1 == explanation.parts.len();
        let end = [x + width, line];
        if is_last {
            canvas.star(end, 13.0, STAR);
        } else if (i + 1) % STAGES_A_LINE == 0 {
            stage_circle(canvas, end, first + i + 1);
        }
    }
}

fn stage_circle(canvas: &mut Canvas, at: [f32; 2], stage: usize) {
    canvas.circle(at, 13.0, INK);
    let set = Type {
        size: 12.0,
        weight: 700,
        colour: INK,
        anchor: "middle",
    };
    canvas.text(at[0], at[1] + 4.3, set, &stage.to_string());
}

/// How far stages stand apart, so that the names between two of them do not touch those next to them.
fn stage_width(explanation: &Explanation) -> f32 {
    let parts = explanation.parts.iter();
    let names = parts.flat_map(|part| [aim(part), part.task.as_str()]);
    let longest = names.map(|name| text_width(name, LEAST_SIZE));
    longest.fold(LEAST_STAGE, |width, length| {
        width.max(length + BESIDE_NAMES)
    })
}

/// What a part of the plan leads to.
fn aim(part: &PlanPart) -> &str {
    part.subgoal.as_deref().unwrap_or("final state")
}

/// The subgoal above a part of the plan, its steps, cost and probability below.
fn caption(canvas: &mut Canvas, part: &PlanPart, [x, y]: [f32; 2], width: f32, colour: Rgb) {
    let fit = |name: &str, room: f32| room / text_width(name, 1.0).max(1.0);
    let name = aim(part);
    let set = Type {
        size: fit(name, width - BESIDE_NAMES).clamp(LEAST_SIZE, 13.5),
        weight: 700,
        colour: colour.mixed(INK, 0.25),
        anchor: "middle",
    };
    canvas.text(x, y - 24.0, set, name);
    let small = Type {
        size: 11.5,
        anchor: "middle",
        ..Type::default()
    };
    let task = Type {
        size: fit(&part.task, width - 8.0).clamp(LEAST_SIZE, small.size),
        ..small
    };
    canvas.text(x, y - 10.0, task, &part.task);
    let numbers = format!(
        "{}, cost {:.1}",
        counted(part.steps as usize, "step"),
        part.cost
    );
    canvas.text(x, y + 19.0, small, &numbers);
    let predicted = match part.predicted_edges {
        0 => "demonstrated edges only".to_owned(),
        edges => format!(
            "{}, P {:.3}",
            counted(edges, "predicted edge"),
            part.probability
        ),
    };
    canvas.text(x, y + 34.0, small, &predicted);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::{OrderExplained, OrdersExplained, PlanOdds, StageExplained};
    use crate::task::Order;

    fn task(name: &str) -> Order {
        Order::Task(name.to_owned())
    }

    /// A plan that does these tasks, a subgoal and a step each.
    fn explained(tasks: &[&str]) -> Explanation {
        let stage = |(stage, task): (usize, &&str)| StageExplained {
            stage,
            occurrence: stage,
            task: (*task).to_owned(),
            subgoal: format!("{task}_done"),
            demonstrations: 1,
        };
        let part = |task: &&str| PlanPart {
            task: (*task).to_owned(),
            subgoal: Some(format!("{task}_done")),
            from: String::new(),
            to: String::new(),
            steps: 1,
            cost: 1.0,
            probability: 0.5,
            predicted_edges: 1,
        };
        Explanation {
            stages: tasks.iter().enumerate().map(stage).collect(),
            orders: OrdersExplained {
                order_count: Some(2),
                planned: 1,
                connected: 1,
                listed: vec![OrderExplained {
                    tasks: tasks.iter().map(|t| (*t).to_owned()).collect(),
                    cost: Some(1.0),
                    steps: Some(1),
                    left_out: 0,
                    is_chosen: true,
                }],
            },
            parts: tasks.iter().map(part).collect(),
            odds: PlanOdds {
                probability: 0.25,
                predicted_edges: Vec::new(),
                assumption: String::new(),
            },
            ends: Vec::new(),
        }
    }

    #[test]
    fn the_planned_order_is_bold_and_its_stages_are_named() {
        let order = Order::AnyOrder(vec![task("sock"), task("trash")]);
        let orders = OrderAutomaton::new(&order).expect("it is small");
        let drawn = automaton_svg(&orders, &explained(&["trash", "sock"]), "both");
        let bold = drawn.matches("stroke-width=\"4\"").count();
        // Two arrows among the orders, two parts of the plan.
        assert_eq!(
            (bold, drawn.matches("stroke-width=\"1.6\"").count()),
            (4, 2)
        );
        for text in [
            "trash_done",
            "sock_done",
            "2 orders",
            "holds with probability 0.250",
        ] {
            assert!(drawn.contains(text), "{text} is missing");
        }
        assert_eq!(drawn.matches("<polygon").count(), 1, "one star at the end");
    }

    #[test]
    fn a_plan_without_parts_begins_at_the_first_stage() {
        let order = Order::InOrder(vec![task("sock"), task("trash")]);
        let orders = OrderAutomaton::new(&order).expect("it is small");
        let mut plan = explained(&["sock", "trash"]);
        plan.parts.truncate(1);
        plan.parts[0].subgoal = None;
        let drawn = automaton_svg(&orders, &plan, "both");
        assert!(drawn.contains(">0</text>") && !drawn.contains(">2</text>"));
    }

    #[test]
    fn long_names_move_the_stages_apart() {
        let order = Order::InOrder(vec![task("sock"), task("trash")]);
        let orders = OrderAutomaton::new(&order).expect("it is small");
        let short = explained(&["sock", "trash"]);
        assert_eq!(stage_width(&short), LEAST_STAGE);
        let mut long = short;
        let name = "n".repeat(60);
        long.parts[1].subgoal = Some(name.clone());
        let width = stage_width(&long);
        assert!(text_width(&name, LEAST_SIZE) < width);
        let drawn = automaton_svg(&orders, &long, "long");
        assert_eq!(drawn.matches(&format!("h{width:.1}\"")).count(), 2);
        assert!(drawn.contains(&name));
    }

    #[test]
    fn optional_parts_may_be_left_out() {
        let order = Order::InOrder(vec![Order::Optional(Box::new(task("a"))), task("b")]);
        let orders = OrderAutomaton::new(&order).expect("it is small");
        let drawn = automaton_svg(&orders, &explained(&["a", "b"]), "a and b");
        assert!(drawn.contains("left out") && drawn.contains("stroke-dasharray"));
    }

    #[test]
    fn orders_that_end_as_the_plan_must_not_are_drawn_and_not_counted() {
        let parts = ["sock", "trash", "wine"].map(task);
        let orders = OrderAutomaton::new(&Order::AnyOrder(parts.to_vec())).expect("it is small");
        let mut plan = explained(&["sock", "trash", "wine"]);
        let all = "end with another task";
        for (open, is_all) in [(orders.order_count(None), true), (Some(2), false)] {
            plan.orders.order_count = open;
            let drawn = automaton_svg(&orders, &plan, "three");
            let told = if is_all { ">6 orders" } else { ">2 orders" };
            assert!(drawn.contains(told), "{told} is missing");
            assert_eq!(drawn.contains(all), !is_all);
        }
    }

    #[test]
    fn orders_that_cannot_be_counted_are_drawn_whichever_task_they_end_with() {
        let either = || Order::Choice(vec![task("a"), task("b")]);
        let repeated = |times, part| Order::Repeat(times, Box::new(part));
        // Which order it is depends on all of its last 13 tasks.
        let parts = [
            repeated(12, Order::Optional(Box::new(either()))),
            task("a"),
            repeated(13, either()),
        ];
        let mut plan = explained(&["a", "b"]);
        plan.orders.order_count = None;
        for (behind, is_told) in [(None, true), (Some(task("c")), false)] {
            let parts = parts.iter().cloned().chain(behind).collect();
            let orders = OrderAutomaton::new(&Order::InOrder(parts)).expect("it is small");
            assert_eq!(orders.order_count(None), None);
            let drawn = automaton_svg(&orders, &plan, "many");
            assert!(drawn.contains("the orders that are allowed"));
            assert_eq!(drawn.contains("whichever task they end with"), is_told);
        }
    }

    #[test]
    fn too_many_orders_are_counted_only() {
        let many = (0..6).map(|i| task(&i.to_string())).collect();
        let orders = OrderAutomaton::new(&Order::AnyOrder(many)).expect("it is not too large");
        let tasks: Vec<String> = (0..6).map(|i| i.to_string()).collect();
        let names: Vec<&str> = tasks.iter().map(String::as_str).collect();
        let mut plan = explained(&names);
        plan.orders.order_count = Some(720);
        let drawn = automaton_svg(&orders, &plan, "many");
        assert!(drawn.contains("too many orders to be drawn") && drawn.contains("720 orders"));
        let bold = drawn.matches("stroke-width=\"4\"").count();
        assert_eq!(bold, 6, "the stages of the plan are drawn all the same");
    }
}
