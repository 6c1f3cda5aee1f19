use std::collections::HashMap;

use super::{OrderAutomaton, OrderTransition};

/// Most sets of states that are looked at to count orders; one of eight parts in any order has 256.
const MOST_SETS: usize = 4096;

/// How many orders lead on from states at which the automaton may be; whether all may be over there counts, too.
type Counted = HashMap<(Vec<usize>, bool), u64>;

/// A walk through the orders that an automaton allows, each of them once however many ways it can be come
/// by: it holds the tasks that are done and all states at which the automaton may be then, and does not
/// go where no order ends that is looked for.
pub(super) struct OrderWalk<'a> {
    automaton: &'a OrderAutomaton,
    /// The task that orders are to end with, if it matters.
    last: Option<&'a str>,
    /// Most orders that are looked for.
    count: usize,
    /// For each state, whether all may be over there: nothing lies ahead but what can be left out.
    is_over: Vec<bool>,
    /// For each state, whether doing more tasks leads to an order that is looked for.
    leads_on: Vec<bool>,
    done: Vec<&'a str>,
    found: Vec<Vec<String>>,
}

/// What may come next: a task with the states that it leads to, or, without one, the end.
type Next<'a> = (Option<&'a str>, Vec<usize>);

impl<'a> OrderWalk<'a> {
    pub(super) fn new(automaton: &'a OrderAutomaton, last: Option<&'a str>, count: usize) -> Self {
        let states = automaton.last_state() + 1;
        let mut walk = Self {
            automaton,
            last,
            count,
            is_over: vec![false; states],
            leads_on: vec![false; states],
            done: Vec::new(),
            found: Vec::new(),
        };
        walk.is_over[automaton.last_state()] = true;
        spread(automaton, &mut walk.is_over, |t| t.task.is_none());
        for transition in automaton.transitions() {
            if walk.may_be_last(transition) {
                walk.leads_on[transition.from] = true;
            }
        }
        spread(automaton, &mut walk.leads_on, |_| true);
        walk
    }

    /// The orders, in the order in which the ways through the automaton come by them.
    pub(super) fn orders(mut self) -> Vec<Vec<String>> {
        self.go_on(&[0]);
        self.found
    }

    /// How many orders of tasks there are, each counted once and that of none not at all; none where that would take long or there are more than a `u64` holds.
    pub(super) fn count(mut self) -> Option<u64> {
        self.count_from(vec![0], &mut Counted::new())
    }

    fn count_from(&mut self, mut reached: Vec<usize>, counted: &mut Counted) -> Option<u64> {
        reached.sort_unstable();
        reached.dedup();
        let here = (reached, self.may_end());
        if let Some(count) = counted.get(&here) {
            return Some(*count);
        }
        let mut count = 0_u64;
        for next in self.ahead_of(&here.0) {
            let (Some(task), states) = next else {
                count = count.checked_add(u64::from(!self.done.is_empty()))?;
                continue;
            };
            self.done.push(task);
            let below = self.count_from(states, counted);
            self.done.pop();
            count = count.checked_add(below?)?;
        }
        if counted.len() == MOST_SETS {
            return None;
        }
        counted.insert(here, count);
        Some(count)
    }

    /// Whether what is done may be an order that is looked for.
    fn may_end(&self) -> bool {
        self.last.is_none() || self.done.last().copied() == self.last
    }

    /// Whether an order that is looked for may end with a transition.
    fn may_be_last(&self, transition: &OrderTransition) -> bool {
        let task = transition.task.as_deref();
        let is_wanted = |task: &str| self.last.is_none_or(|last| last == task);
        task.is_some_and(is_wanted) && self.is_over[transition.to]
    }

    fn go_on(&mut self, reached: &[usize]) {
        for next in self.ahead_of(reached) {
            if self.found.len() >= self.count {
                return;
            }
            if let (Some(task), states) = next {
                self.done.push(task);
                self.go_on(&states);
                self.done.pop();
            } else {
                let order = self.done.iter().map(|task| (*task).to_owned());
                self.found.push(order.collect());
            }
        }
    }

    /// What may come next at any of some states, each task once, where a way through them meets it first.
    fn ahead_of(&self, reached: &[usize]) -> Vec<Next<'a>> {
        let mut next: Vec<Next<'a>> = Vec::new();
        let may_end = self.may_end();
        for state in self.with_skips(reached) {
            if state == self.automaton.last_state() && may_end {
                next.push((None, Vec::new()));
            }
            for transition in self.automaton.leaving(state) {
                let is_open = self.leads_on[transition.to] || self.may_be_last(transition);
                let Some(task) = transition.task.as_deref().filter(|_| is_open) else {
                    continue;
                };
                let known = next.iter_mut().find(|(known, _)| *known == Some(task));
                match known {
                    Some((_, states)) => states.push(transition.to),
                    None => next.push((Some(task), vec![transition.to])),
                }
            }
        }
        next
    }

    /// Some states and those that leaving optional parts out leads to from them, each once, in the order in
    /// which ways that follow one transition after the other come by them.
    fn with_skips(&self, reached: &[usize]) -> Vec<usize> {
        let mut is_met = vec![false; self.is_over.len()];
        let mut met = Vec::new();
        let mut ahead: Vec<usize> = reached.iter().rev().copied().collect();
        while let Some(state) = ahead.pop() {
            if is_met[state] {
                continue;
            }
            is_met[state] = true;
            met.push(state);
            let begun = ahead.len();
            let skips = self.automaton.leaving(state);
            ahead.extend(skips.filter(|t| t.task.is_none()).map(|t| t.to));
            ahead[begun..].reverse();
        }
        met
    }
}

/// Adds the states from which some of the transitions lead to states that are marked.
fn spread(
    automaton: &OrderAutomaton,
    is_marked: &mut [bool],
    is_passed: impl Fn(&OrderTransition) -> bool,
) {
    let mut has_grown = true;
    while has_grown {
        has_grown = false;
        // Most transitions lead to a later state.
        for transition in automaton.transitions().iter().rev() {
            if is_passed(transition) && is_marked[transition.to] && !is_marked[transition.from] {
                is_marked[transition.from] = true;
                has_grown = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Order;

    fn task(name: &str) -> Order {
        Order::Task(name.to_owned())
    }

    fn optional(part: Order) -> Order {
        Order::Optional(Box::new(part))
    }

    fn repeated(times: u32, part: Order) -> Order {
        Order::Repeat(times, Box::new(part))
    }

    fn either() -> Order {
        Order::Choice(vec![task("a"), task("b")])
    }

    #[test]
    fn orders_are_counted_once_however_many_ways_come_by_them() {
        let any = |names: &[&str]| Order::AnyOrder(names.iter().map(|name| task(name)).collect());
        for order in [
            task("a"),
            Order::Choice(vec![task("a"), task("a")]),
            any(&["a", "a", "b"]),
            repeated(5, optional(task("a"))),
            Order::InOrder(vec![optional(task("a")), either(), optional(task("a"))]),
            Order::AnyOrder(vec![optional(either()), repeated(2, either()), task("c")]),
        ] {
            let automaton = OrderAutomaton::new(&order).expect("it is small");
            for last in [None, Some("a"), Some("b"), Some("d")] {
                let listed = automaton.orders_ending_with(last, usize::MAX);
                let of_tasks = listed.iter().filter(|tasks| !tasks.is_empty()).count();
                assert_eq!(
                    automaton.order_count(last),
                    Some(of_tasks as u64),
                    "{order}, {last:?}"
                );
            }
        }
        let automaton = OrderAutomaton::new(&any(&["a", "b", "c", "d", "e", "f", "g", "h"]));
        let automaton = automaton.expect("it is small");
        assert_eq!(automaton.order_count(None), Some(40_320));
        assert_eq!(automaton.order_count(Some("a")), Some(5_040));
    }

    #[test]
    fn a_count_that_takes_long_is_not_made() {
        // Which order it is depends on all of its last 21 tasks.
        let order = Order::InOrder(vec![
            repeated(20, optional(either())),
            task("a"),
            repeated(20, either()),
        ]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        assert_eq!(automaton.order_count(None), None);
        assert!(automaton.way_count() > 1 << 20);
    }

    #[test]
    fn more_orders_than_a_number_holds_are_not_told_as_a_number() {
        let count = |times: u32| {
            let automaton = OrderAutomaton::new(&repeated(times, either()));
            automaton.expect("it is small").order_count(None)
        };
        assert_eq!(count(63), Some(1 << 63));
        assert_eq!(count(64), None);
    }
}
