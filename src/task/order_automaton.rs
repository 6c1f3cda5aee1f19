use std::collections::BTreeSet;

use thiserror::Error;

use super::Order;
use super::order_walk::OrderWalk;

/// A step of an [`OrderAutomaton`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OrderTransition {
    /// The state that it leaves.
    pub from: usize,
    /// The state that it leads to.
    pub to: usize,
    /// The task that is done on the way; `None` where an optional part is left out.
    pub task: Option<String>,
}

/// All orders that an [`Order`] allows, as an automaton without loops: each way from state 0 to the last
/// state is one, read off its transitions.
///
/// ```
/// use catena::task::{Order, OrderAutomaton};
///
/// let task = |name: &str| Order::Task(name.to_owned());
/// let order = Order::InOrder(vec![
///     task("sock"),
///     Order::AnyOrder(vec![task("trash"), task("wine")]),
/// ]);
/// let automaton = OrderAutomaton::new(&order)?;
/// assert_eq!(
///     automaton.orders(8),
///     [["sock", "trash", "wine"], ["sock", "wine", "trash"]]
/// );
/// # Ok::<(), catena::task::OrderTooLarge>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OrderAutomaton {
    transitions: Vec<OrderTransition>,
    states: usize,
}

/// An order that allows too many ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "the order has more than {} transitions: 'any_order' of n parts has n * 2^(n - 1) times theirs",
    OrderAutomaton::MOST_TRANSITIONS
)]
pub struct OrderTooLarge;

impl OrderAutomaton {
    /// Most transitions of an automaton: [`Order::AnyOrder`] of eight tasks has 1,024.
    pub const MOST_TRANSITIONS: usize = 2048;

    /// The automaton of an order.
    ///
    /// # Errors
    /// [`OrderTooLarge`] when it would have more than [`MOST_TRANSITIONS`](Self::MOST_TRANSITIONS).
    pub fn new(order: &Order) -> Result<Self, OrderTooLarge> {
        let mut automaton = Self {
            transitions: Vec::new(),
            states: 1,
        };
        let end = automaton.add(order, 0)?;
        automaton.rename_last(end);
        Ok(automaton)
    }

    /// Adds the ways through an order that begin at a state; returns the state where they end.
    fn add(&mut self, order: &Order, from: usize) -> Result<usize, OrderTooLarge> {
        match order {
            Order::Task(task) => {
                let to = self.state();
                self.transition(from, to, Some(task.clone()))?;
                Ok(to)
            }
            Order::Repeat(0, _) => self.add(&Order::InOrder(Vec::new()), from),
            Order::InOrder(parts) | Order::AnyOrder(parts) if parts.is_empty() => {
                let to = self.state();
                self.transition(from, to, None)?;
                Ok(to)
            }
            Order::InOrder(parts) => parts.iter().try_fold(from, |at, part| self.add(part, at)),
            Order::Choice(parts) => {
                let to = self.state();
                for part in parts {
                    let end = self.add(part, from)?;
                    self.join(end, to);
                }
                Ok(to)
            }
            Order::Optional(part) => {
                let to = self.add(part, from)?;
                self.transition(from, to, None)?;
                Ok(to)
            }
            Order::AnyOrder(parts) => self.add_any_order(parts, from),
            Order::Repeat(times, part) => (0..*times).try_fold(from, |at, _| self.add(part, at)),
        }
    }

    /// A state for each set of parts that are done.
    fn add_any_order(&mut self, parts: &[Order], from: usize) -> Result<usize, OrderTooLarge> {
        if parts.len() >= usize::BITS as usize || 1 << parts.len() > Self::MOST_TRANSITIONS {
            return Err(OrderTooLarge);
        }
        let sets = 1_usize << parts.len();
        let states: Vec<usize> = (0..sets)
            .map(|set| if set == 0 { from } else { self.state() })
            .collect();
        for set in 0..sets {
            for (i, part) in parts.iter().enumerate().filter(|(i, _)| set >> i & 1 == 0) {
                let end = self.add(part, states[set])?;
                self.join(end, states[set | 1 << i]);
            }
        }
        Ok(states[sets - 1])
    }

    fn state(&mut self) -> usize {
        self.states += 1;
        self.states - 1
    }

    fn transition(
        &mut self,
        from: usize,
        to: usize,
        task: Option<String>,
    ) -> Result<(), OrderTooLarge> {
        if self.transitions.len() == Self::MOST_TRANSITIONS {
            return Err(OrderTooLarge);
        }
        self.transitions.push(OrderTransition { from, to, task });
        Ok(())
    }

    /// Makes two states one; nothing leaves the first one yet.
    fn join(&mut self, end: usize, into: usize) {
        for transition in self.transitions.iter_mut().filter(|t| t.to == end) {
            transition.to = into;
        }
    }

    /// Numbers the states that are left as they are met on the ways, the last one last.
    fn rename_last(&mut self, end: usize) {
        let used: BTreeSet<usize> = self
            .transitions
            .iter()
            .flat_map(|t| [t.from, t.to])
            .filter(|state| *state != end && *state != 0)
            .collect();
        let number = |state: usize| match state {
            0 => 0,
            state if state == end => used.len() + 1,
            state => 1 + used.range(..state).count(),
        };
        for transition in &mut self.transitions {
            transition.from = number(transition.from);
            transition.to = number(transition.to);
        }
        self.transitions.sort_by(|a, b| {
            let key = |t: &OrderTransition| (t.from, t.task.is_none(), t.to);
            key(a).cmp(&key(b))
        });
        self.states = used.len() + 2;
    }

    /// The transitions, those of a state together.
    #[must_use]
    pub fn transitions(&self) -> &[OrderTransition] {
        &self.transitions
    }

    /// The transitions that leave a state.
    pub(super) fn leaving(&self, state: usize) -> impl Iterator<Item = &OrderTransition> {
        let first = self.transitions.partition_point(|t| t.from < state);
        let rest = self.transitions[first..].iter();
        rest.take_while(move |t| t.from == state)
    }

    /// The state at which everything is done.
    #[must_use]
    pub fn last_state(&self) -> usize {
        self.states - 1
    }

    /// Pairs of tasks of which the second may come right after the first.
    #[must_use]
    pub fn follows(&self) -> BTreeSet<(&str, &str)> {
        let mut pairs = BTreeSet::new();
        for first in &self.transitions {
            let Some(task) = &first.task else { continue };
            for (state, _) in self.skipped_to(first.to) {
                let next = self.leaving(state).filter_map(|t| t.task.as_deref());
                pairs.extend(next.map(|next| (task.as_str(), next)));
            }
        }
        pairs
    }

    /// The tasks that may be the first one.
    #[must_use]
    pub fn first_tasks(&self) -> BTreeSet<&str> {
        let states = self.skipped_to(0).into_iter();
        let first = states.flat_map(|(state, _)| self.leaving(state));
        first.filter_map(|t| t.task.as_deref()).collect()
    }

    /// The least and the greatest sum of what its tasks weigh, over all ways through it.
    #[must_use]
    pub fn least_and_most(&self, weight: impl Fn(&str) -> usize) -> (usize, usize) {
        let mut sums: Vec<Option<(usize, usize)>> = vec![None; self.states];
        self.sums_from(0, &weight, &mut sums)
    }

    fn sums_from(
        &self,
        state: usize,
        weight: &impl Fn(&str) -> usize,
        memo: &mut [Option<(usize, usize)>],
    ) -> (usize, usize) {
        if let Some(known) = memo[state] {
            return known;
        }
        let mut sums: Option<(usize, usize)> = None;
        for transition in self.transitions.iter().filter(|t| t.from == state) {
            let here = transition.task.as_deref().map_or(0, weight);
            let (least, most) = self.sums_from(transition.to, weight, memo);
            let (least, most) = (here + least, here + most);
            sums = Some(sums.map_or((least, most), |(l, m)| (l.min(least), m.max(most))));
        }
        let sums = sums.unwrap_or((0, 0));
        memo[state] = Some(sums);
        sums
    }

    /// The tasks that may be the last one.
    #[must_use]
    pub fn last_tasks(&self) -> BTreeSet<&str> {
        let ends = |state| {
            let skipped = self.skipped_to(state);
            skipped.iter().any(|(state, _)| *state == self.last_state())
        };
        let last = self.transitions.iter().filter(|t| ends(t.to));
        last.filter_map(|t| t.task.as_deref()).collect()
    }

    /// How many ways lead through it: orders, each counted as often as it can be come by.
    #[must_use]
    pub fn way_count(&self) -> u64 {
        let mut memo = vec![None; self.states];
        self.ways_from(0, &mut memo)
    }

    fn ways_from(&self, state: usize, memo: &mut [Option<u64>]) -> u64 {
        if state == self.last_state() {
            return 1;
        }
        if let Some(known) = memo[state] {
            return known;
        }
        let leaving = self.transitions.iter().filter(|t| t.from == state);
        let ways = leaving.fold(0_u64, |sum, t| {
            sum.saturating_add(self.ways_from(t.to, memo))
        });
        memo[state] = Some(ways);
        ways
    }

    /// How many orders of tasks it allows, each counted once, of those whose last task is the one given; without one of
    /// all but that of no task, which is no plan. `None` where there are more than a `u64` holds, or where the same orders
    /// can be come by in so many ways that counting them takes long: there are [`way_count`](Self::way_count) at most.
    #[must_use]
    pub fn order_count(&self, last: Option<&str>) -> Option<u64> {
        OrderWalk::new(self, last, usize::MAX).count()
    }

    /// The orders of tasks that it allows, each once, at most `count` of them.
    #[must_use]
    pub fn orders(&self, count: usize) -> Vec<Vec<String>> {
        OrderWalk::new(self, None, count).orders()
    }

    /// Those of its orders whose last task is the one given, at most `count` of them; without one, all
    /// orders, also that of no task.
    #[must_use]
    pub fn orders_ending_with(&self, last: Option<&str>, count: usize) -> Vec<Vec<String>> {
        OrderWalk::new(self, last, count).orders()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(name: &str) -> Order {
        Order::Task(name.to_owned())
    }

    fn orders(order: &Order) -> Vec<String> {
        let automaton = OrderAutomaton::new(order).expect("it is small");
        let orders = automaton.orders(100);
        orders.iter().map(|order| order.join(" ")).collect()
    }

    #[test]
    fn containers_nest() {
        let order = Order::InOrder(vec![
            Order::Choice(vec![task("a"), Order::InOrder(vec![task("b"), task("c")])]),
            Order::Optional(Box::new(task("d"))),
            task("e"),
        ]);
        assert_eq!(orders(&order), ["a d e", "a e", "b c d e", "b c e"]);
    }

    #[test]
    fn any_order_gives_all_permutations_and_keeps_parts_together() {
        let parts = vec![
            task("a"),
            Order::InOrder(vec![task("b"), task("c")]),
            task("d"),
        ];
        let mut found = orders(&Order::AnyOrder(parts));
        found.sort();
        assert_eq!(
            found,
            [
                "a b c d", "a d b c", "b c a d", "b c d a", "d a b c", "d b c a"
            ]
        );
    }

    #[test]
    fn tasks_that_may_follow_each_other_are_known_also_over_what_is_left_out() {
        let order = Order::InOrder(vec![
            task("a"),
            Order::Optional(Box::new(task("b"))),
            task("c"),
        ]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let follows: Vec<_> = automaton.follows().into_iter().collect();
        assert_eq!(follows, [("a", "b"), ("a", "c"), ("b", "c")]);
    }

    #[test]
    fn last_tasks_and_ways_are_counted() {
        let order = Order::InOrder(vec![
            Order::AnyOrder(vec![task("a"), task("b"), task("c")]),
            Order::Optional(Box::new(task("d"))),
        ]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let last: Vec<_> = automaton.last_tasks().into_iter().collect();
        assert_eq!(last, ["a", "b", "c", "d"]);
        assert_eq!(automaton.way_count(), 12);
        assert_eq!(automaton.orders(100).len(), 12);
    }

    #[test]
    fn what_is_repeated_is_done_so_often_and_weighs_so_much() {
        let order = Order::InOrder(vec![
            Order::Repeat(2, Box::new(Order::Choice(vec![task("a"), task("bb")]))),
            task("a"),
        ]);
        assert_eq!(orders(&order), ["a a a", "a bb a", "bb a a", "bb bb a"]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        assert_eq!(automaton.least_and_most(str::len), (3, 5));
        let named = |names: [&str; 3]| names.map(str::to_owned);
        let way = automaton
            .way(&named(["bb", "a", "a"]))
            .expect("it is allowed");
        let tasks: Vec<_> = way
            .iter()
            .map(|i| automaton.transitions()[*i].task.as_deref())
            .collect();
        assert_eq!(tasks, [Some("bb"), Some("a"), Some("a")]);
        assert_eq!(automaton.way(&named(["a", "a", "bb"])), None);
        let first: Vec<_> = automaton.first_tasks().into_iter().collect();
        assert_eq!(first, ["a", "bb"]);
        assert!(automaton.follows().contains(&("a", "a")));
        assert_eq!(
            order.to_string(),
            "in order\n  2 times\n    one of\n      a\n      bb\n  a"
        );
        let many = Order::Repeat(3000, Box::new(task("a")));
        assert_eq!(OrderAutomaton::new(&many), Err(OrderTooLarge));
    }

    #[test]
    fn any_order_of_too_many_parts_is_refused() {
        let parts = |count: usize| (0..count).map(|i| task(&i.to_string())).collect();
        assert!(OrderAutomaton::new(&Order::AnyOrder(parts(8))).is_ok());
        for count in [9, 12, 70] {
            let refused = OrderAutomaton::new(&Order::AnyOrder(parts(count)));
            assert_eq!(refused, Err(OrderTooLarge));
        }
    }

    #[test]
    fn what_is_optional_alone_may_be_nothing() {
        let order = Order::Optional(Box::new(task("a")));
        assert_eq!(orders(&order), ["a", ""]);
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        assert_eq!(automaton.skipped_to(0), [(0, 0), (1, 1)]);
        // Nothing is no order that could be planned.
        assert_eq!(automaton.order_count(None), Some(1));
        let nothing = OrderAutomaton::new(&Order::InOrder(Vec::new())).expect("it is small");
        assert_eq!(nothing.order_count(None), Some(0));
    }

    #[test]
    fn orders_that_many_ways_come_by_are_given_once_and_at_once() {
        let order = Order::Repeat(60, Box::new(Order::Optional(Box::new(task("a")))));
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        assert_eq!(automaton.way_count(), 1 << 60);
        let lengths: Vec<usize> = automaton.orders(100).iter().map(Vec::len).collect();
        assert_eq!(lengths, (0..=60).rev().collect::<Vec<_>>());
        let both = Order::AnyOrder(vec![
            Order::Optional(Box::new(task("a"))),
            Order::Optional(Box::new(task("b"))),
        ]);
        assert_eq!(orders(&both), ["a b", "a", "b a", "b", ""]);
    }

    #[test]
    fn orders_that_end_with_a_task_are_found_behind_many_that_do_not() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let order = Order::AnyOrder(names.map(task).to_vec());
        let automaton = OrderAutomaton::new(&order).expect("it is small");
        let ending = automaton.orders_ending_with(Some("a"), 64);
        assert_eq!(ending.len(), 64);
        let ends_well = |order: &Vec<String>| order.len() == 8 && order[7] == "a";
        assert!(ending.iter().all(ends_well));
        assert_eq!(ending[0].join(" "), "b c d e f g h a");
        assert!(automaton.orders_ending_with(Some("i"), 64).is_empty());
        let optional = Order::InOrder(vec![
            Order::Choice(vec![task("a"), task("b")]),
            Order::Optional(Box::new(task("a"))),
            Order::Optional(Box::new(task("c"))),
        ]);
        let automaton = OrderAutomaton::new(&optional).expect("it is small");
        assert_eq!(
            automaton.orders_ending_with(Some("a"), 64),
            [vec!["a", "a"], vec!["a"], vec!["b", "a"]]
        );
    }
}
