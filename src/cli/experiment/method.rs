use crate::cli::error::CliError;

/// What is trained and compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Method {
    /// Its name in files.
    pub(super) name: &'static str,
    /// What it is, for people.
    pub(super) described: &'static str,
    /// The name of the one that it is trained as, with which it shares model and graphs; mostly its own.
    pub(super) trained_as: &'static str,
    /// What `catena train` is told for it.
    pub(super) flags: &'static [&'static str],
    /// What `catena graph build` is told for it.
    pub(super) building: &'static [&'static str],
    /// What `catena evaluate` is told for it.
    pub(super) running: &'static [&'static str],
    /// Whether it plans over a graph; the baselines do not.
    pub(super) plans: bool,
    /// Whether it learns from windows of several states.
    pub(super) has_memory: bool,
}

/// What `catena graph build` is told where each pair costs an encoding. Its learned edges are not planned over
/// within a task.
const FEW_EDGES: [&str; 2] = ["--nearest", "0.05"];
/// What `catena evaluate` is told there.
const FEW_STATES: [&str; 2] = ["--nearest-states", "128"];

/// One that plans over a graph.
const fn planning(
    name: &'static str,
    described: &'static str,
    flags: &'static [&'static str],
) -> Method {
    Method {
        name,
        described,
        trained_as: name,
        flags,
        building: &[],
        running: &[],
        plans: true,
        has_memory: false,
    }
}

/// One that plans over a graph with a network that encodes each pair of states, so that only the pairs of the nearest
/// states are asked for.
const fn of_pairs(
    name: &'static str,
    described: &'static str,
    flags: &'static [&'static str],
) -> Method {
    Method {
        building: &FEW_EDGES,
        running: &FEW_STATES,
        ..planning(name, described, flags)
    }
}

/// One that does not.
const fn baseline(
    name: &'static str,
    described: &'static str,
    flags: &'static [&'static str],
) -> Method {
    Method {
        plans: false,
        ..planning(name, described, flags)
    }
}

/// One that does not, and that acts on several states.
const fn with_memory(
    name: &'static str,
    described: &'static str,
    flags: &'static [&'static str],
) -> Method {
    Method {
        has_memory: true,
        ..baseline(name, described, flags)
    }
}

/// This crate's way.
pub(super) const OURS: Method = planning("ours", "ours: latent flow, two cameras, planned", &[]);
/// The same model and graphs, without what leads the robot over the last steps before the gripper closes or opens, which
/// the baselines do not have either.
const NOT_LED: Method = Method {
    trained_as: OURS.name,
    running: &["--last-steps", "policy"],
    ..planning("ours_not_led", "ours, last steps not led", &[])
};
/// The same, whose policy learns with goal states of its own demonstration alone.
pub(super) const OWN_GOALS: Method = planning(
    "own_goals",
    "ours, trained with its own goals alone",
    &["--own-goals"],
);
/// Behaviour cloning.
pub(super) const BC: Method = baseline("bc", "BC", &["--method", "bc"]);
/// The pre-trained representation, which the user has to bring.
pub(super) const MVP: &str = "mvp";

/// The rows of Table II.
pub(super) const TABLE_2: [Method; 5] = [
    OURS,
    BC,
    with_memory("bc_rnn", "BC-RNN", &["--method", "bc_rnn"]),
    with_memory("rt1", "RT-1", &["--method", "rt1"]),
    baseline(MVP, "MVP", &["--method", "mvp"]),
];

/// The rows of Table I.
pub(super) const TABLE_1: [Method; 6] = {
    let [ours, baselines @ ..] = TABLE_2;
    let [bc, bc_rnn, rt1, mvp] = baselines;
    [ours, NOT_LED, bc, bc_rnn, rt1, mvp]
};

/// The rows of Table III and the lines of Figure 5.
pub(super) const TABLE_3: [Method; 6] = [
    OURS,
    planning("siamese", "Siamese", &["--variant", "siamese"]),
    of_pairs(
        "pixel_difference",
        "difference of pixels",
        &["--variant", "pixel_difference"],
    ),
    of_pairs(
        "frame_stacking",
        "stacked frames",
        &["--variant", "frame_stacking"],
    ),
    planning("only_head", "head camera only", &["--camera", "head"]),
    planning("only_wrist", "wrist camera only", &["--camera", "wrist"]),
];

/// Those methods that are asked for, in the order of the table; all where none is named.
pub(super) fn chosen(all: &[Method], names: &[String]) -> Result<Vec<Method>, CliError> {
    if let Some(unknown) = names.iter().find(|n| all.iter().all(|m| m.name != **n)) {
        let known: Vec<&str> = all.iter().map(|m| m.name).collect();
        return Err(CliError::UnknownMethod {
            found: unknown.clone(),
            known: known.join(", "),
        });
    }
    let is_chosen = |m: &&Method| names.is_empty() || names.iter().any(|n| n == m.name);
    Ok(all.iter().filter(is_chosen).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_networks_that_encode_pairs_are_asked_for_the_nearest_states_alone() {
        let spared: Vec<&str> = (TABLE_3.iter().chain(&TABLE_1))
            .filter(|m| m.building == FEW_EDGES && m.running == FEW_STATES)
            .map(|m| m.name)
            .collect();
        assert_eq!(spared, ["pixel_difference", "frame_stacking"]);
    }

    #[test]
    fn what_is_trained_as_another_follows_it_and_is_told_the_same() {
        for table in [&TABLE_1[..], &TABLE_2, &TABLE_3] {
            for of_training in table.chunk_by(|a, b| a.trained_as == b.trained_as) {
                assert_eq!(of_training[0].trained_as, of_training[0].name);
            }
            for method in table {
                let of = |m: &&Method| m.name == method.trained_as;
                let trained = table.iter().find(of).unwrap();
                let told = |m: &Method| (m.flags, m.building, m.plans, m.has_memory);
                assert_eq!(told(trained), told(method), "{}", method.name);
            }
        }
    }

    #[test]
    fn named_methods_are_taken_in_the_order_of_the_table() {
        let named = ["rt1".to_owned(), "ours".to_owned()];
        let names: Vec<&str> = chosen(&TABLE_1, &named)
            .unwrap()
            .iter()
            .map(|m| m.name)
            .collect();
        assert_eq!(names, ["ours", "rt1"]);
        assert_eq!(chosen(&TABLE_3, &[]).unwrap().len(), 6);
        let message = chosen(&TABLE_1, &["siamese".to_owned()])
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("siamese") && message.contains("bc_rnn"),
            "{message}"
        );
    }
}
