use std::fmt::Write;

use ::rerun::{Color, SeriesLines, TextLog, TextLogLevel};

use super::{EventLevel, RolloutScene, StepView};
use crate::graph::{NodeId, TopologicalGraph};
use crate::model::ActionDistribution;
use crate::trajectory::ActionSpace;
use crate::wording::counted;

const BAR_CELLS: f32 = 12.0;
/// Classes of a head that are shown when it has many.
const MOST_CLASSES: usize = 15;

/// Names and colours of the curves.
pub(super) fn styles() -> [(&'static str, SeriesLines); 3] {
    let style = |name: &str, colour: [u8; 3]| {
        SeriesLines::new()
            .with_names([name])
            .with_colors([Color::from_rgb(colour[0], colour[1], colour[2])])
            .with_widths([1.6])
    };
    [
        ("monitor/entropy", style("entropy", [0xff, 0xc9, 0x3c])),
        (
            "progress/cost_to_go",
            style("cost to go", [0x6d, 0xb3, 0xf2]),
        ),
        ("progress/stage", style("stage", [0x6f, 0xd0, 0x8c])),
    ]
}

/// The subgoals with what is reached and what is due, the goal state and the final state.
pub(super) fn plan(scene: &RolloutScene<'_>, view: &StepView<'_>) -> String {
    let mut text = format!("## {}\n\n", scene.title);
    for (due, subgoal) in scene.automaton.subgoals().iter().enumerate() {
        let line = match due.cmp(&view.stage) {
            std::cmp::Ordering::Less => format!("✔ {}", subgoal.name),
            std::cmp::Ordering::Equal => format!("▶ **{}**", subgoal.name),
            std::cmp::Ordering::Greater => format!("· {}", subgoal.name),
        };
        let _ = writeln!(text, "{}. {line}  *({})*", due + 1, subgoal.task);
    }
    text.push('\n');
    let place = |what: &str, node: Option<NodeId>, none: &str| {
        let place = node.map_or_else(|| none.to_owned(), |id| name(scene.graph, id));
        format!("**{what}**  {place}\n\n")
    };
    text.push_str(&place("here", view.current, "lost"));
    text.push_str(&place("goal", view.goal_node, "none"));
    text.push_str(&place("final state", view.path.last().copied(), "no path"));
    let _ = write!(text, "**path**  {}", counted(view.path.len(), "state"));
    if let Some(cost) = view.cost_to_go_steps {
        let _ = write!(text, ", cost {cost:.1} steps");
    }
    text
}

fn name(graph: &TopologicalGraph, id: NodeId) -> String {
    let node = graph.node(id);
    format!("{} · {} · step {}", node.task, node.trajectory, node.step)
}

/// The probabilities of the actions as bars, the most probable first, the one that was taken in bold.
pub(super) fn actions(
    space: &ActionSpace,
    actions: &ActionDistribution,
    chosen: Option<&str>,
) -> String {
    let mut text = String::from("| action | p | |\n|:--|--:|:--|\n");
    for (head, probabilities) in actions.heads.iter().enumerate() {
        let mut classes: Vec<usize> = (0..probabilities.len()).collect();
        classes.sort_by(|a, b| probabilities[*b].total_cmp(&probabilities[*a]));
        classes.truncate(MOST_CLASSES.div_ceil(actions.heads.len()).max(2));
        for class in classes {
            let p = probabilities[class];
            let mut label = class_name(space, head, class);
            if chosen == Some(label.as_str()) {
                label = format!("**{label}**");
            }
            // A square that the viewer's font has.
            let bar = "■".repeat((p * BAR_CELLS).round() as usize);
            let _ = writeln!(text, "| {label} | {:.0} % | {bar} |", p * 100.0);
        }
    }
    text
}

/// What the curves show: each primitive, or the most probable bin of each dimension.
pub(super) fn probabilities(
    space: &ActionSpace,
    actions: &ActionDistribution,
) -> Vec<(String, f64)> {
    match space {
        ActionSpace::Primitives { .. } => actions
            .heads
            .iter()
            .flatten()
            .enumerate()
            .map(|(class, p)| (class_name(space, 0, class), f64::from(*p)))
            .collect(),
        ActionSpace::Binned { .. } | ActionSpace::Continuous { .. } => actions
            .heads
            .iter()
            .enumerate()
            .map(|(head, p)| {
                let most = p.iter().copied().fold(0.0, f32::max);
                (head_name(space, head), f64::from(most))
            })
            .collect(),
    }
}

fn head_name(space: &ActionSpace, head: usize) -> String {
    match space {
        ActionSpace::Binned { dimensions } => dimensions.get(head).map(|d| d.name.clone()),
        ActionSpace::Primitives { .. } => None,
        ActionSpace::Continuous { names } => names.get(head).cloned(),
    }
    .unwrap_or_else(|| format!("head {head}"))
}

fn class_name(space: &ActionSpace, head: usize, class: usize) -> String {
    match space {
        ActionSpace::Primitives { names } if class < names.len() => names[class].clone(),
        _ => format!("{} bin {class}", head_name(space, head)),
    }
}

/// A line of the log of events.
pub(super) fn event(level: EventLevel, text: &str) -> TextLog {
    let (level, colour) = match level {
        EventLevel::Info => (TextLogLevel::INFO, [0xc8, 0xcc, 0xd4]),
        EventLevel::Success => (TextLogLevel::INFO, [0x6f, 0xd0, 0x8c]),
        EventLevel::Warning => (TextLogLevel::WARN, [0xff, 0xc9, 0x3c]),
        EventLevel::Error => (TextLogLevel::ERROR, [0xff, 0x6b, 0x7f]),
    };
    TextLog::new(text)
        .with_level(level)
        .with_color(Color::from_rgb(colour[0], colour[1], colour[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Automaton, Subgoal, Task};
    use crate::trajectory::{ActionDimension, Observation};

    #[test]
    fn actions_are_sorted_and_the_one_taken_is_bold() {
        let space = ActionSpace::Primitives {
            names: ["left", "right"].map(String::from).to_vec(),
        };
        let distribution = ActionDistribution {
            heads: vec![vec![0.25, 0.75]],
        };
        let text = actions(&space, &distribution, Some("left"));
        let rows: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(
            rows,
            ["| right | 75 % | ■■■■■■■■■ |", "| **left** | 25 % | ■■■ |"]
        );
    }

    #[test]
    fn binned_actions_give_one_curve_a_dimension() {
        let dimension = |name: &str, bins| ActionDimension::uniform(name, 0.0, 1.0, bins);
        let space = ActionSpace::Binned {
            dimensions: vec![dimension("x", 2), dimension("grip", 3)],
        };
        let distribution = ActionDistribution {
            heads: vec![vec![0.25, 0.75], vec![0.5, 0.25, 0.25]],
        };
        let curves = probabilities(&space, &distribution);
        assert_eq!(curves, [("x".to_owned(), 0.75), ("grip".to_owned(), 0.5)]);
    }

    #[test]
    fn plan_tells_done_due_and_later_subgoals_apart() {
        let subgoal = |name: &str| Subgoal {
            task: "sock".to_owned(),
            name: name.to_owned(),
        };
        let automaton = Automaton::in_order(&[Task {
            name: "sock".to_owned(),
            subgoals: ["open", "grasped", "placed"].map(subgoal).to_vec(),
        }]);
        let space = ActionSpace::Primitives { names: Vec::new() };
        let scene = RolloutScene {
            title: "sock",
            graph: &TopologicalGraph::new(1, 3),
            automaton: &automaton,
            action_space: &space,
            cameras: &[],
            route: &[],
        };
        let view = StepView {
            step: 0,
            time_secs: 0.0,
            observation: &Observation::default(),
            goal: None,
            goal_node: None,
            current: None,
            path: &[],
            stage: 1,
            actions: None,
            chosen: None,
            cost_to_go_steps: None,
        };
        let text = plan(&scene, &view);
        for line in [
            "1. ✔ open",
            "2. ▶ **grasped**",
            "3. · placed",
            "**here**  lost",
            "no path",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }
}
