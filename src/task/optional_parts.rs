//! What an order leaves out: the optional parts that its automaton passes by.

use std::collections::BTreeSet;

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
        // Parts left out, tasks done, and the state: those with the fewest parts left out come first.
        let mut ahead = BTreeSet::from([(0_usize, 0_usize, 0_usize)]);
        let mut is_met = BTreeSet::new();
        while let Some((left_out, done, state)) = ahead.pop_first() {
            if state == self.last_state() && done == tasks.len() {
                return Some(left_out);
            }
            if !is_met.insert((done, state)) {
                continue;
            }
            for transition in self.leaving(state) {
                match &transition.task {
                    None => {
                        ahead.insert((left_out + 1, done, transition.to));
                    }
                    Some(task) if tasks.get(done) == Some(task) => {
                        ahead.insert((left_out, done + 1, transition.to));
                    }
                    Some(_) => {}
                }
            }
        }
        None
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
        let automaton = OrderAutomaton::new(&Order::AnyOrder(vec![task("a"), task("b")]));
        let automaton = automaton.expect("it is small");
        assert!(!automaton.has_optional_parts());
        assert_eq!(automaton.left_out(&names("b a")), Some(0));
    }
}
