use std::time::Instant;

/// How much of a training is done, by steps and by time.
pub struct Budget {
    steps: u64,
    max_secs: Option<f64>,
    spent_before_secs: f64,
    started: Instant,
}

impl Budget {
    /// A budget of which `spent_before_secs` were used by earlier runs.
    pub fn new(steps: u64, max_minutes: Option<f64>, spent_before_secs: f64) -> Self {
        Self {
            steps,
            max_secs: max_minutes.map(|m| m * 60.0),
            spent_before_secs,
            started: Instant::now(),
        }
    }

    /// Seconds of training, earlier runs included.
    pub fn spent_secs(&self) -> f64 {
        self.spent_before_secs + self.started.elapsed().as_secs_f64()
    }

    /// Share of the training that is done after `step` steps: 0 to 1 and beyond.
    pub fn progress(&self, step: u64) -> f64 {
        let by_steps = step as f64 / self.steps as f64;
        match self.max_secs {
            Some(max) => by_steps.max(self.spent_secs() / max),
            None => by_steps,
        }
    }

    /// Whether nothing is left.
    pub fn is_spent(&self, step: u64) -> bool {
        self.progress(step) >= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scarcer_of_steps_and_time_decides() {
        let budget = Budget::new(100, None, 1e9);
        assert!((budget.progress(25) - 0.25).abs() < 1e-9);
        let budget = Budget::new(100, Some(1.0), 45.0);
        assert!((budget.progress(25) - 0.75).abs() < 0.01);
        assert!(budget.is_spent(100) && !budget.is_spent(99));
    }
}
