//! What an order leaves out: the optional parts that its automaton passes by.

use std::collections::{BTreeMap, BTreeSet};

use super::OrderAutomaton;

impl OrderAutomaton {
    /// Whether it has parts that may be left out.
    #[must_use]
    pub fn has_optional_parts(&self) -> bool {
        self.transitions().iter().any(|t| t.task.is_none())
    }

    /// The fewest optional parts that are left out where these tasks are done in this order; `None` where
    /// it does not allow that.
    #[must_use]
    pub fn left_out(&self, tasks: &[String]) -> Option<usize> {
        let way = self.way(tasks)?;
        let skips = |i: &&usize| self.transitions()[**i].task.is_none();
        Some(way.iter().filter(skips).count())
    }

    /// The transitions, as indices, of a way on which these tasks are done in this order, of several one that
    /// leaves the fewest optional parts out; `None` where it does not allow that.
    #[must_use]
    pub fn way(&self, tasks: &[String]) -> Option<Vec<usize>> {
        // Parts left out, tasks done, the state, and the transition that led there: those with the fewest parts
        // left out come first.
        let mut ahead = BTreeSet::from([(0_usize, 0_usize, 0_usize, None)]);
        let mut come_by = BTreeMap::new();
        while let Some((left_out, done, state, by)) = ahead.pop_first() {
            if come_by.contains_key(&(done, state)) {
                continue;
            }
            come_by.insert((done, state), by);
            if state == self.last_state() && done == tasks.len() {
                return Some(self.traced_back(&come_by, (done, state)));
            }
            let first = self.transitions().partition_point(|t| t.from < state);
            for (i, transition) in (first..).zip(self.leaving(state)) {
                match &transition.task {
                    None => {
                        ahead.insert((left_out + 1, done, transition.to, Some(i)));
                    }
                    Some(task) if tasks.get(done) == Some(task) => {
                        ahead.insert((left_out, done + 1, transition.to, Some(i)));
                    }
                    Some(_) => {}
                }
            }
        }
        None
    }

    /// The transitions that led to a state at which so many tasks are done.
    fn traced_back(
        &self,
        come_by: &BTreeMap<(usize, usize), Option<usize>>,
        (mut done, mut state): (usize, usize),
    ) -> Vec<usize> {
        let mut way = Vec::new();
        while let Some(Some(i)) = come_by.get(&(done, state)) {
            way.push(*i);
            let transition = &self.transitions()[*i];
            done -= usize::from(transition.task.is_some());
            state = transition.from;
        }
        way.reverse();
        way
    }

    /// The states that can be reached from one by leaving optional parts out, each with how many that
    /// takes at least; the state itself with none.
    #[must_use]
    pub fn skipped_to(&self, state: usize) -> Vec<(usize, usize)> {
        let mut reached = vec![(state, 0)];
        let mut at = 0;
        while let Some((here, skips)) = reached.get(at).copied() {
            for transition in self.leaving(here).filter(|t| t.task.is_none()) {
                if reached.iter().all(|(state, _)| *state != transition.to) {
                    reached.push((transition.to, skips + 1));
                }
            }
            at += 1;
        }
        reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Order;

    fn task(name: &str) -> Order {
        Order::Task(name.to_owned())
    }

    #[test]
    fn what_an_order_leaves_out_is_counted_on_the_way_that_leaves_out_least() {
        let names = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
        let either = |name: &str| Order::Optional(Box::new(task(name)));
        let order = Order::InOrder(vec![
            task("sock"),
            Order::AnyOrder(vec![task("trash"), either("wine")]),
        ]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        assert!(automaton.has_optional_parts());
        let left_out = |text: &str| automaton.left_out(&names(text));
        assert_eq!(left_out("sock trash wine"), Some(0));
        assert_eq!(left_out("sock trash"), Some(1));
        assert_eq!(left_out("sock wine"), None);
        let seldom = Order::Repeat(100, Box::new(either("a")));
        let automaton = OrderAutomaton::new(&seldom).expect("it is small");
        assert_eq!(automaton.left_out(&names("a a a")), Some(97));
        // Leaving the whole out leaves less out than each time of it.
        let twice = Order::Repeat(2, Box::new(either("b")));
        let order = Order::InOrder(vec![task("a"), Order::Optional(Box::new(twice))]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let way = automaton.way(&names("a")).expect("it is allowed");
        let led_to = |i: &usize| automaton.transitions()[*i].to;
        let led_to: Vec<usize> = way.iter().map(led_to).collect();
        assert_eq!(led_to, [1, automaton.last_state()]);
        assert_eq!(automaton.left_out(&names("a")), Some(1));
        let automaton = OrderAutomaton::new(&Order::AnyOrder(vec![task("a"), task("b")]));
        let automaton = automaton.expect("it is small");
        assert!(!automaton.has_optional_parts());
        assert_eq!(automaton.left_out(&names("b a")), Some(0));
    }
}
