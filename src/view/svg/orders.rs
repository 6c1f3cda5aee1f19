//! The orders of tasks that a composition allows, drawn as states and arrows.

use std::collections::BTreeMap;

use super::arrows::{self, Arrow};
use super::canvas::Canvas;
use crate::task::OrderAutomaton;
use crate::view::palette::{INK, Rgb};

/// Left edge of the first state.
pub(super) const LEFT: f32 = 60.0;
/// Between two states.
pub(super) const LAYER: f32 = 170.0;
/// Between two rows of states.
pub(super) const ROW: f32 = 92.0;
const PALE: Rgb = Rgb(0xb8, 0xbe, 0xc9);

/// Where the states of an automaton of orders stand.
pub(super) struct Shape {
    places: Vec<[f32; 2]>,
    layer_of: Vec<usize>,
    pub(super) layers: usize,
    /// The height in rows.
    pub(super) rows: f32,
}

impl Shape {
    /// A state stands as far to the right as the longest way to it is long.
    pub(super) fn new(orders: &OrderAutomaton) -> Self {
        let count = orders.last_state() + 1;
        let mut layer_of = vec![0_usize; count];
        for _ in 0..count {
            for t in orders.transitions() {
                layer_of[t.to] = layer_of[t.to].max(layer_of[t.from] + 1);
            }
        }
        let layers = layer_of.iter().max().copied().unwrap_or(0);
        let size = |layer: usize| layer_of.iter().filter(|l| **l == layer).count();
        let widest = (0..=layers).map(size).max().unwrap_or(1) as f32;
        // What bends around others needs room too.
        let bends = bends(orders, &layer_of).into_iter().fold(0.0, f32::max);
        let rows = widest + bends / ROW;
        let mut seen = vec![0_usize; layers + 1];
        let places = layer_of
            .iter()
            .map(|layer| {
                let above = seen[*layer] as f32 - (size(*layer) as f32 - 1.0) / 2.0;
                seen[*layer] += 1;
                let middle = 110.0 + rows * ROW / 2.0 + bends / 4.0;
                [LEFT + *layer as f32 * LAYER, middle + above * ROW]
            })
            .collect();
        Self {
            places,
            layer_of,
            layers,
            rows,
        }
    }

    pub(super) fn paint(
        &self,
        canvas: &mut Canvas,
        orders: &OrderAutomaton,
        way: &[usize],
        tasks: &BTreeMap<&str, Rgb>,
    ) {
        let transitions = orders.transitions();
        let arrows = self.arrows(orders, way, tasks);
        for is_planned in [false, true] {
            for arrow in arrows.iter().filter(|a| a.is_planned == is_planned) {
                arrow.paint(canvas);
            }
        }
        arrows::label(canvas, &arrows);
        let passed = |state: usize| {
            way.iter()
                .any(|i| transitions[*i].from == state || transitions[*i].to == state)
        };
        for (state, [x, y]) in self.places.iter().enumerate() {
            let colour = if passed(state) { INK } else { PALE };
            let radius = if state == orders.last_state() {
                9.0
            } else {
                6.0
            };
            canvas.circle([*x, *y], radius, colour);
        }
    }

    /// An arrow for each transition, in their order.
    fn arrows<'a>(
        &self,
        orders: &'a OrderAutomaton,
        way: &[usize],
        tasks: &BTreeMap<&str, Rgb>,
    ) -> Vec<Arrow<'a>> {
        let bends = bends(orders, &self.layer_of);
        let transitions = orders.transitions().iter().zip(bends).enumerate();
        transitions
            .map(|(i, (transition, bend))| {
                let task = transition.task.as_deref();
                let is_planned = way.contains(&i);
                let colour = match task.and_then(|t| tasks.get(t)) {
                    Some(colour) if is_planned => *colour,
                    Some(colour) => colour.mixed(Rgb(255, 255, 255), 0.55),
                    None => PALE,
                };
                Arrow {
                    from: self.places[transition.from],
                    to: self.places[transition.to],
                    bend,
                    task,
                    is_planned,
                    colour,
                }
            })
            .collect()
    }
}

/// How far each transition bends upwards: around the states that it leads past, and beside those that join
/// the same states.
fn bends(orders: &OrderAutomaton, layer_of: &[usize]) -> Vec<f32> {
    let mut beside: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    orders
        .transitions()
        .iter()
        .map(|t| {
            let before = beside.entry((t.from, t.to)).or_insert(0);
            let span = layer_of[t.to].saturating_sub(layer_of[t.from]).max(1);
            let bend = 62.0 * (span - 1) as f32 + 46.0 * *before as f32;
            *before += 1;
            bend
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Order;

    #[test]
    fn arrows_bend_around_what_they_leave_out_and_beside_each_other() {
        let [a, b, c] = ["a", "b", "c"].map(|name| Order::Task(name.to_owned()));
        let order = Order::Choice(vec![Order::InOrder(vec![a, b]), c.clone(), c]);
        let orders = OrderAutomaton::new(&order).expect("it is small");
        let shape = Shape::new(&orders);
        assert_eq!((shape.layers, shape.layer_of.len()), (2, 3));
        let bent = bends(&orders, &shape.layer_of);
        let named = |name: &str| {
            let arrows = orders.transitions().iter().zip(&bent);
            arrows
                .filter(|(t, _)| t.task.as_deref() == Some(name))
                .map(|(_, b)| *b)
                .collect::<Vec<_>>()
        };
        assert_eq!((named("a"), named("b")), (vec![0.0], vec![0.0]));
        let [first, second] = named("c")[..] else {
            panic!("two ways by c")
        };
        assert!(0.0 < first && first < second);
    }
}
