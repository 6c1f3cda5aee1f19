use indicatif::ProgressBar;

use super::percent;
use crate::cli::parent::EndOfInput;
use crate::training::{TrainingEvent, TrainingObserver};

/// Tells people how a training goes, and stops it where nobody waits for it.
pub(in crate::cli) struct Printer {
    pub(in crate::cli) bar: ProgressBar,
    pub(in crate::cli) end_of_input: EndOfInput,
}

impl Printer {
    fn print(&self, line: String) {
        if self.bar.is_hidden() {
            println!("{line}");
        } else {
            self.bar.println(line);
        }
    }
}

impl TrainingObserver for Printer {
    fn notice(&mut self, event: &TrainingEvent) {
        match event {
            TrainingEvent::Started {
                training_states,
                validation_states,
                resumed_from,
                parameters,
                ..
            } => {
                self.print(format!(
                    "{training_states} states to train on, {validation_states} held out, {parameters} weights"
                ));
                self.bar.set_position(*resumed_from);
                self.bar.reset_eta();
            }
            TrainingEvent::Step {
                step,
                losses,
                states_per_sec,
                ..
            } => {
                self.bar.set_position(*step);
                self.bar.set_message(format!(
                    "loss {:.3}, {states_per_sec:.0} states/s",
                    losses.total
                ));
            }
            TrainingEvent::Validated {
                step,
                metrics,
                is_best,
                ..
            } => {
                let line = format!(
                    "step {step:>6}: held out: traversability loss {:.3}, {:.1} % right; policy loss {:.3}, {:.1} % right, across {}{}{}{}",
                    metrics.traversability_loss,
                    100.0 * metrics.traversability_accuracy,
                    metrics.policy_loss,
                    100.0 * metrics.policy_accuracy,
                    percent(metrics.policy_accuracy_across),
                    (metrics.motion_explained).map_or_else(String::new, |e| format!(
                        "; motion to go {:.1} % explained",
                        100.0 * e
                    )),
                    (metrics.landmark_error_pixels)
                        .map_or_else(String::new, |e| format!("; landmarks {e:.1} pixels off")),
                    if *is_best { "  (best)" } else { "" },
                );
                self.print(line);
            }
            TrainingEvent::BaselineValidated {
                step,
                validation,
                is_best,
            } => self.print(format!(
                "step {step:>6}: held out: loss {:.3}, {:.1} % of actions right{}",
                validation.loss,
                100.0 * validation.accuracy,
                if *is_best { "  (best)" } else { "" },
            )),
            TrainingEvent::CheckpointWritten { .. } => {}
        }
    }

    fn wants_stop(&mut self) -> bool {
        self.end_of_input.has_come()
    }
}
