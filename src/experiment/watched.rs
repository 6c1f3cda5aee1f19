use std::sync::Arc;

use crate::rollout::{Event, Monitor, RolloutError, RolloutObserver, StepRecord};
use crate::trajectory::Observation;

/// Lets a monitor watch a run that another plan drives.
pub struct Watched<'a> {
    monitor: Monitor<'a>,
    flagged_step: Option<usize>,
    failure: Option<RolloutError>,
}

impl<'a> Watched<'a> {
    /// A monitor that has seen nothing yet.
    #[must_use]
    pub fn new(mut monitor: Monitor<'a>) -> Self {
        monitor.reset();
        Self {
            monitor,
            flagged_step: None,
            failure: None,
        }
    }

    /// The step at which the monitor first flagged a shortcut; none where it saw none.
    ///
    /// # Errors
    /// The first error of its networks.
    pub fn flagged_step(self) -> Result<Option<usize>, RolloutError> {
        self.failure.map_or(Ok(self.flagged_step), Err)
    }

    /// What is seen next, where nobody's plan drives.
    pub fn look(&mut self, observation: &Arc<Observation>) {
        if self.failure.is_some() || self.flagged_step.is_some() {
            return;
        }
        match self.monitor.look(Arc::clone(observation)) {
            Ok(sight) => {
                let flag = sight.events.iter().find_map(Event::shortcut);
                self.flagged_step = flag.map(|(step, _)| step);
            }
            Err(failure) => self.failure = Some(failure),
        }
    }
}

impl RolloutObserver for Watched<'_> {
    fn on_step(&mut self, record: &StepRecord) {
        self.look(&record.observation);
    }

    fn on_end(&mut self, _step: usize, observation: &Arc<Observation>, _events: &[Event]) {
        self.look(observation);
    }
}
