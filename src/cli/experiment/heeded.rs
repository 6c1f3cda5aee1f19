//! Flags that not every experiment of the paper heeds.

use crate::cli::arguments::PaperArguments;
use crate::cli::error::CliError;

/// A flag, and the experiments whose figures it changes.
struct Flag {
    name: &'static str,
    is_given: fn(&PaperArguments) -> bool,
    heeding: &'static [&'static str],
}

const FLAGS: [Flag; 4] = [
    Flag {
        name: "--episodes",
        is_given: |paper| paper.episodes.is_some(),
        heeding: &["table1", "table3", "fig6"],
    },
    Flag {
        name: "--seed",
        is_given: |paper| paper.seed.is_some(),
        heeding: &["table1", "table2", "table3", "fig6"],
    },
    Flag {
        name: "--baseline-steps",
        is_given: |paper| paper.baseline_steps.is_some(),
        heeding: &["table1", "table2", "fig6"],
    },
    Flag {
        name: "--frozen-encoder",
        is_given: |paper| paper.frozen_encoder.is_some(),
        heeding: &["table1", "table2"],
    },
];

/// Refuses a flag that would change nothing in an experiment.
pub(super) fn ensure_heeded(
    experiment: &'static str,
    paper: &PaperArguments,
) -> Result<(), CliError> {
    let is_idle = |flag: &&Flag| (flag.is_given)(paper) && !flag.heeding.contains(&experiment);
    match FLAGS.iter().find(is_idle) {
        None => Ok(()),
        Some(flag) => Err(CliError::FlagOfOthers {
            flag: flag.name,
            experiment,
            heeding: flag.heeding.join(", "),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::committed::paper_arguments;

    #[test]
    fn a_flag_that_changes_nothing_is_refused_with_the_experiments_that_heed_it() {
        let flags: [(&str, &str, &[&str]); 5] = [
            ("--episodes", "3", &["table1", "table3", "fig6"]),
            ("--seed", "3", &["table1", "table2", "table3", "fig6"]),
            ("--baseline-steps", "3", &["table1", "table2", "fig6"]),
            ("--frozen-encoder", "a.onnx", &["table1", "table2"]),
            (
                "--steps",
                "3",
                &["table1", "table2", "table3", "fig5", "fig6"],
            ),
        ];
        for (flag, value, heeding) in flags {
            for experiment in ["table1", "table2", "table3", "fig5", "fig6"] {
                let paper = paper_arguments(&[experiment, "--quick", flag, value]);
                let refused = ensure_heeded(experiment, &paper);
                let is_heeded = heeding.contains(&experiment);
                assert_eq!(refused.is_ok(), is_heeded, "{flag} in {experiment}");
                if let Err(error) = refused {
                    let said = error.to_string();
                    let those = heeding.join(", ");
                    let told = [flag, experiment, those.as_str()];
                    assert!(told.iter().all(|word| said.contains(*word)), "{said}");
                }
            }
        }
    }
}
