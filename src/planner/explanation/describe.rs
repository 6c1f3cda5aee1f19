use std::fmt;

use super::{EndCandidate, Explanation, OrdersExplained, PlanPart, TaskEnds};
use crate::wording::{counted, number_or_many};

impl fmt::Display for Explanation {
    /// Some dozens of lines, the last one without an end of line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "stages:")?;
        let mut occurrence = None;
        for stage in &self.stages {
            let is_new = occurrence != Some(stage.occurrence);
            let task = if is_new { stage.task.as_str() } else { "" };
            writeln!(
                f,
                "  {:>3}  {task:<12} to {} (in {})",
                stage.stage,
                stage.subgoal,
                counted(stage.demonstrations, "demonstration")
            )?;
            occurrence = Some(stage.occurrence);
        }
        writeln!(f, "  {:>3}  {:<12} all is done", self.stages.len(), "")?;
        write!(f, "{}", self.orders)?;
        writeln!(f, "parts of the plan:")?;
        for part in &self.parts {
            writeln!(f, "  {part}")?;
        }
        let (steps, cost) = self.parts.iter().fold((0, 0.0), |(steps, cost), part| {
            (steps + part.steps, cost + part.cost)
        });
        writeln!(f, "  {:<22} {steps:>4} steps  cost {cost:>7.2}", "in all")?;
        writeln!(
            f,
            "the plan holds with probability {:.3}: {}, if {}",
            self.odds.probability,
            counted(self.odds.predicted_edges.len(), "predicted edge"),
            self.odds.assumption
        )?;
        for edge in &self.odds.predicted_edges {
            writeln!(f, "  {edge}")?;
        }
        for (i, ends) in self.ends.iter().enumerate() {
            write!(f, "{}{ends}", if i > 0 { "\n" } else { "" })?;
        }
        Ok(())
    }
}

impl fmt::Display for OrdersExplained {
    /// Whole lines; none where there is no choice.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.order_count.is_some_and(|count| count < 2) {
            return Ok(());
        }
        writeln!(
            f,
            "orders: {} open, {} planned, {} of them connect{}",
            number_or_many(self.order_count),
            self.planned,
            self.connected,
            if self.planned > self.listed.len() {
                "; the best:"
            } else {
                ":"
            }
        )?;
        for order in &self.listed {
            let mark = if order.is_chosen { '*' } else { ' ' };
            let tasks = order.tasks.join(", ");
            let left_out = match order.left_out {
                0 => String::new(),
                count => format!(", leaves out {}", counted(count, "optional part")),
            };
            match (order.cost, order.steps) {
                (Some(cost), Some(steps)) => {
                    writeln!(
                        f,
                        "  {mark} {tasks}: cost {cost:.2}, {steps} steps{left_out}"
                    )?;
                }
                _ => writeln!(f, "  {mark} {tasks}: does not connect{left_out}")?,
            }
        }
        Ok(())
    }
}

impl fmt::Display for PlanPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.subgoal.as_deref().unwrap_or("final state");
        write!(
            f,
            "{name:<22} {:>4} steps  cost {:>7.2}  P {:.3}  {} -> {}",
            self.steps, self.cost, self.probability, self.from, self.to
        )
    }
}

impl fmt::Display for TaskEnds {
    /// The last line without an end of line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.is_last {
            "may be final and can be got to"
        } else {
            "have an edge into the next task"
        };
        write!(
            f,
            "the end of {}: {} of {} end states {what}",
            self.task, self.leading_on, self.end_states
        )?;
        for candidate in &self.candidates {
            let mark = if candidate.is_chosen { '*' } else { ' ' };
            write!(f, "\n  {mark} {}", Costs(candidate, self.is_last))?;
        }
        write!(f, "\n  chosen: {}", self.reason)?;
        if let Some(nearest) = self.nearest.as_ref().filter(|n| !n.is_chosen) {
            write!(
                f,
                "\n  the nearest end state would be {}",
                Costs(nearest, self.is_last)
            )?;
        }
        Ok(())
    }
}

/// A candidate; of one that is final only what it costs to get there.
struct Costs<'a>(&'a EndCandidate, bool);

impl fmt::Display for Costs<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(candidate, is_last) = self;
        write!(f, "{}: ", candidate.state)?;
        match (is_last, candidate.cost_onward, candidate.total()) {
            (true, ..) => write!(f, "cost {:.2}", candidate.cost_to)?,
            (_, Some(onward), Some(total)) => write!(
                f,
                "{:.2} up to it + {onward:.2} onward = {total:.2}",
                candidate.cost_to
            )?,
            _ => return write!(f, "{:.2} up to it, and no way onward", candidate.cost_to),
        }
        write!(f, ", P {:.3}", candidate.route_probability)
    }
}
