use std::path::Path;

use super::layout::{Frame, GraphLayout};
use super::*;
use crate::graph::{Edge, EdgeKind, Node, NodeId, TopologicalGraph, mark_subgoal};
use crate::model::ActionDistribution;
use crate::task::{Automaton, Subgoal, Task};
use crate::trajectory::{ActionSpace, Image, Observation};

const FRAME: Frame = Frame {
    left: 10.0,
    top: 20.0,
    width: 500.0,
    gap: 50.0,
    row_height: 8.0,
};

fn subgoal(task: &str, name: &str) -> Subgoal {
    Subgoal {
        task: task.to_owned(),
        name: name.to_owned(),
    }
}

/// Adds a demonstration of `steps` steps with one subgoal at `marker` and another at its end.
fn demonstrate(
    graph: &mut TopologicalGraph,
    task: &str,
    id: &str,
    steps: u32,
    marker: u32,
) -> Vec<NodeId> {
    let mut nodes: Vec<NodeId> = Vec::new();
    for step in 0..steps {
        let is_end = step + 1 == steps;
        let mut reached = Vec::new();
        if step == marker {
            reached.push(subgoal(task, "half"));
        }
        if is_end {
            reached.push(subgoal(task, "done"));
        }
        let node = Node {
            task: task.to_owned(),
            trajectory: id.to_owned(),
            step,
            reached,
            progress: u32::from(step >= marker) + u32::from(is_end),
            is_end,
        };
        let node = graph.add_node(node, &[0.0]);
        if let Some(before) = nodes.last() {
            graph.add_edge(*before, node, edge(EdgeKind::Temporal, 1.0));
        }
        nodes.push(node);
    }
    nodes
}

fn edge(kind: EdgeKind, probability: f32) -> Edge {
    Edge {
        kind,
        steps: 1,
        probabilities: vec![probability, 0.0, 1.0 - probability],
    }
}

/// Demonstrations of `b` come first in the graph, but a route leads from `a` to `b`.
fn two_tasks() -> (TopologicalGraph, Vec<NodeId>) {
    let mut graph = TopologicalGraph::new(1, 3);
    let b = demonstrate(&mut graph, "b", "b_0", 10, 5);
    demonstrate(&mut graph, "a", "a_0", 30, 7);
    demonstrate(&mut graph, "a", "a_1", 24, 16);
    let used = demonstrate(&mut graph, "a", "a_2", 20, 10);
    graph.add_edge(used[19], b[0], edge(EdgeKind::CrossTask, 0.9));
    graph.add_edge(b[9], used[0], edge(EdgeKind::CrossTask, 0.6));
    graph.add_edge(used[3], used[5], edge(EdgeKind::Learned, 0.8));
    let route = used.into_iter().chain(b).collect();
    (graph, route)
}

#[test]
fn a_subgoal_stands_in_one_column_whenever_it_was_reached() {
    let (graph, route) = two_tasks();
    let layout = GraphLayout::new(&graph, &route, FRAME);
    for block in &layout.blocks {
        assert_eq!(block.columns.len(), 2);
        for column in &block.columns {
            let places: Vec<f32> = graph
                .nodes()
                .filter(|(_, n)| n.reached.contains(&subgoal(&block.task, &column.subgoal)))
                .map(|(id, _)| layout.at(id)[0])
                .collect();
            assert_eq!(places.len(), block.rows.len());
            assert!(
                places.iter().all(|x| (x - column.x).abs() < 1e-3),
                "{places:?}"
            );
        }
    }
}

#[test]
fn time_runs_to_the_right_inside_the_block() {
    let (graph, route) = two_tasks();
    let layout = GraphLayout::new(&graph, &route, FRAME);
    for block in &layout.blocks {
        for row in &block.rows {
            let places: Vec<f32> = row.nodes.iter().map(|id| layout.at(*id)[0]).collect();
            assert!(places.is_sorted_by(|a, b| a < b), "{places:?}");
            let (first, last) = (places[0], places[places.len() - 1]);
            assert!((first - block.x).abs() < 1e-3 && (last - block.x - block.width).abs() < 1e-3);
        }
    }
    let last = &layout.blocks[1];
    assert!((last.x + last.width - 510.0).abs() < 1e-2);
}

#[test]
fn tasks_follow_the_route_and_its_demonstrations_stand_in_the_middle() {
    let (graph, route) = two_tasks();
    let layout = GraphLayout::new(&graph, &route, FRAME);
    let tasks: Vec<&str> = layout.blocks.iter().map(|b| b.task.as_str()).collect();
    assert_eq!(tasks, ["a", "b"]);
    let middle = &layout.blocks[0].rows[1];
    assert_eq!(graph.node(middle.nodes[0]).trajectory, "a_2");
    assert!(!layout.leads_back(route[19], route[20]) && layout.leads_back(route[20], route[0]));

    let without_route = GraphLayout::new(&graph, &[], FRAME);
    assert_eq!(without_route.blocks[0].task, "b");
}

/// A task that is done twice in a row, the same way.
fn twice() -> (TopologicalGraph, Vec<NodeId>) {
    let mut graph = TopologicalGraph::new(1, 3);
    let a = demonstrate(&mut graph, "a", "a_0", 20, 10);
    graph.add_edge(a[19], a[0], edge(EdgeKind::CrossTask, 0.9));
    let route = [a.clone(), a].concat();
    (graph, route)
}

#[test]
fn a_task_that_is_done_again_is_entered_below_the_rows() {
    let (graph, route) = twice();
    let layout = GraphLayout::new(&graph, &route, FRAME);
    let (end, start) = (route[19], route[20]);
    assert!(layout.leads_back(end, start) && layout.is_curved(&graph, end, start));
    let [from, first, second, to] = layout.curve(end, start);
    assert!(to[0] < second[0] && second[0] < first[0] && first[0] < from[0]);
    assert!(first[1] > layout.bottom && second[1] > layout.bottom);

    let svg = merged_graph_svg(&graph, Some(&route), "a, a");
    let bold = svg
        .lines()
        .find(|l| l.contains("stroke-width=\"6.5\" stroke-linecap"));
    let curves = bold.expect("the route").matches('C').count();
    assert_eq!(curves, 1, "the seam is no straight line");
}

/// The places of the numbers of one digit.
fn badges(svg: &str) -> Vec<[f32; 2]> {
    let value = |line: &str, key: &str| -> f32 {
        let (_, rest) = line.split_once(&format!("{key}=\"")).expect("the key");
        let (value, _) = rest.split_once('"').expect("a value");
        value.parse().expect("a number")
    };
    let circles = svg.lines().filter(|line| line.contains("r=\"9.5\""));
    circles
        .map(|line| ["cx", "cy"].map(|key| value(line, key)))
        .collect()
}

#[test]
fn numbers_of_rounds_in_neighbouring_rows_do_not_touch() {
    let mut graph = TopologicalGraph::new(1, 3);
    let first = demonstrate(&mut graph, "a", "a_0", 20, 10);
    let second = demonstrate(&mut graph, "a", "a_1", 20, 10);
    graph.add_edge(first[19], second[0], edge(EdgeKind::CrossTask, 0.9));
    let there_and_again = [first.clone(), second.clone()].concat();
    graph.add_edge(second[19], first[0], edge(EdgeKind::CrossTask, 0.9));
    for route in [there_and_again, [second, first].concat()] {
        let svg = merged_graph_svg(&graph, Some(&route), "twice");
        let places = badges(&svg);
        // Those of four subgoals, and that of the legend.
        assert_eq!(places.len(), 5);
        for (i, a) in places.iter().enumerate() {
            for b in &places[..i] {
                let between = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!(between >= 19.0, "{a:?} and {b:?}");
            }
        }
    }
}

#[test]
fn subgoals_of_later_rounds_are_numbered_too() {
    let (graph, route) = twice();
    let svg = merged_graph_svg(&graph, Some(&route), "a, a");
    for numbers in ["1, 3", "2, 4"] {
        assert!(
            svg.contains(&format!(">{numbers}</text>")),
            "no stages {numbers}"
        );
    }

    let (graph, route) = two_tasks();
    // The seam that leads from `b` back to `a`.
    let rounds = [route.as_slice(), &route[..20]].concat();
    let svg = merged_graph_svg(&graph, Some(&rounds), "a, b, a");
    for numbers in ["1, 5", "2, 6", "3", "4"] {
        assert!(
            svg.contains(&format!(">{numbers}</text>")),
            "no stages {numbers}"
        );
    }
}

/// Two quick demonstrations, and a slow one that alone passes a region on its way to the first subgoal.
fn one_passes() -> TopologicalGraph {
    let mut graph = TopologicalGraph::new(1, 3);
    demonstrate(&mut graph, "a", "a_0", 20, 10);
    demonstrate(&mut graph, "a", "a_1", 20, 10);
    let slow = demonstrate(&mut graph, "a", "a_2", 60, 40);
    mark_subgoal(&mut graph, &subgoal("a", "passed"), 0, &[slow[30]]);
    graph
}

#[test]
fn what_one_slow_demonstration_passes_moves_no_other_column() {
    let layout = GraphLayout::new(&one_passes(), &[], FRAME);
    let block = &layout.blocks[0];
    let columns = block.columns.iter().map(|c| (c.subgoal.as_str(), c.steps));
    assert_eq!(
        columns.collect::<Vec<_>>(),
        [("passed", 7.5), ("half", 10.0), ("done", 19.0)]
    );
    assert_eq!(block.steps, 19.0);
}

#[test]
fn steps_of_a_task_are_those_of_its_median_demonstration() {
    let (graph, route) = two_tasks();
    let layout = GraphLayout::new(&graph, &route, FRAME);
    // Half of it takes 7, 10 or 16 steps, the rest 22, 9 or 7.
    assert_eq!(layout.blocks[0].steps, 19.0);
    assert_eq!(layout.blocks[0].median_steps, 23.0);
    let svg = merged_graph_svg(&graph, Some(&route), "a, b");
    assert!(svg.contains("3 demonstrations, median 23 steps"));
}

/// Fourteen tasks, the nodes of each.
fn many_tasks() -> (TopologicalGraph, Vec<Vec<NodeId>>) {
    let mut graph = TopologicalGraph::new(1, 3);
    let tasks = (0..14)
        .map(|i| {
            let task = format!("task_{i:02}");
            demonstrate(&mut graph, &task, &task, 6, 3)
        })
        .collect();
    (graph, tasks)
}

#[test]
fn time_runs_to_the_right_however_narrow_the_frame_is() {
    let (graph, tasks) = many_tasks();
    let layout = GraphLayout::new(&graph, &[], FRAME);
    let places = tasks.iter().flatten().map(|id| layout.at(*id)[0]);
    assert!(places.is_sorted_by(|a, b| a < b));
}

#[test]
fn arcs_over_many_blocks_rise_no_higher_than_the_head_of_the_picture() {
    let (graph, tasks) = many_tasks();
    let wide = Frame {
        width: 6000.0,
        ..FRAME
    };
    let layout = GraphLayout::new(&graph, &[], wide);
    let [from, first, ..] = layout.curve(tasks[0][5], tasks[13][0]);
    let lift = from[1] - first[1];
    assert!((lift - 130.0).abs() < 0.01, "{lift}");
}

#[test]
fn picture_numbers_the_subgoals_of_the_route_and_stars_its_end() {
    let (graph, route) = two_tasks();
    let svg = merged_graph_svg(&graph, Some(&route), "a & b");
    assert!(svg.contains("a &amp; b") && svg.contains("<polygon"));
    for number in 1..=4 {
        assert!(
            svg.contains(&format!(">{number}</text>")),
            "no stage {number}"
        );
    }
    assert!(!svg.contains(">5</text>"));
    assert!(svg.contains("2 cross-task edges") && svg.contains("1 learned edge "));
    assert_eq!(svg, merged_graph_svg(&graph, Some(&route), "a & b"));

    let plain = merged_graph_svg(&graph, None, "a");
    assert!(!plain.contains("<polygon") && !plain.contains("planned route"));
}

#[test]
fn picture_says_how_many_edges_it_left_out() {
    let mut graph = TopologicalGraph::new(1, 3);
    let a = demonstrate(&mut graph, "a", "a_0", 60, 30);
    let b = demonstrate(&mut graph, "b", "b_0", 60, 30);
    for from in &a {
        for to in b.iter().take(20) {
            graph.add_edge(*from, *to, edge(EdgeKind::CrossTask, 0.7));
        }
    }
    let svg = merged_graph_svg(&graph, None, "many");
    assert!(svg.contains("(500 of 1,200 drawn)"));
}

#[test]
fn empty_graph_has_a_picture_too() {
    let graph = TopologicalGraph::new(1, 3);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("new/empty.svg");
    write_merged_graph_svg(&path, &graph, None, "nothing").expect("the folder can be written");
    let text = std::fs::read_to_string(&path).expect("it was written");
    assert!(text.starts_with("<svg") && text.ends_with("</svg>\n") && !text.contains("NaN"));
}

#[test]
fn picture_that_cannot_be_written_names_its_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, b"").expect("writing a file");
    let path = blocked.join("graph.svg");
    let error = write_merged_graph_svg(&path, &TopologicalGraph::new(1, 3), None, "")
        .expect_err("a file is no folder");
    assert!(error.to_string().contains("graph.svg"), "{error}");
    let cause = std::error::Error::source(&error);
    assert!(
        cause.is_some_and(<dyn std::error::Error>::is::<std::io::Error>),
        "{error:?}"
    );
}

#[test]
fn picture_that_cannot_take_its_place_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("graph.svg");
    std::fs::create_dir(&path).expect("a folder in its place");
    let error = write_merged_graph_svg(&path, &TopologicalGraph::new(1, 3), None, "")
        .expect_err("a folder is in its place");
    let said = error.to_string();
    let named = format!("cannot write {}: ", path.display());
    assert!(said.starts_with(&named), "{said}");
    let left = std::fs::read_dir(folder.path()).expect("the folder");
    assert_eq!(left.count(), 1);
}

fn observation(value: u8) -> Observation {
    let image = Image::new(2, 2, vec![value; 12]).expect("it is full");
    Observation::new([("head".to_owned(), image)])
}

/// Records a rollout along the route; an unfinished one is dropped.
fn record(path: &Path, finish: bool) {
    let (graph, route) = two_tasks();
    let task = |name: &str| Task {
        name: name.to_owned(),
        subgoals: vec![subgoal(name, "half"), subgoal(name, "done")],
    };
    let automaton = Automaton::in_order(&[task("a"), task("b")]);
    let space = ActionSpace::Primitives {
        names: vec!["left".to_owned(), "right".to_owned()],
    };
    let live = observation(7);
    let cameras = live.cameras();
    let scene = RolloutScene {
        title: "a, b",
        graph: &graph,
        automaton: &automaton,
        action_space: &space,
        cameras: &cameras,
        route: &route,
    };
    let mut recording = RolloutRecording::create(path, scene).expect("the folder can be written");
    let actions = ActionDistribution {
        heads: vec![vec![0.25, 0.75]],
    };
    for (step, node) in route.iter().enumerate() {
        let view = StepView {
            step: step as u32,
            time_secs: step as f64,
            observation: &live,
            goal: Some(&live),
            goal_node: route.get(step + 1).copied(),
            current: (step != 4).then_some(*node),
            path: &route[step..],
            stage: 0,
            actions: Some(&actions),
            chosen: Some("right"),
            cost_to_go_steps: Some(f64::INFINITY),
        };
        recording.log_step(&view).expect("it can be logged");
    }
    recording
        .log_event(3, 3.0, EventLevel::Warning, "lost")
        .expect("it can be logged");
    if finish {
        recording.finish().expect("it can be renamed");
    }
}

#[test]
fn recording_takes_its_name_when_it_is_complete() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("rollout.rrd");
    record(&path, false);
    assert!(!path.exists());
    record(&path, true);
    let bytes = std::fs::read(&path).expect("it is there");
    assert!(bytes.starts_with(b"RRF2"), "{:?}", &bytes[..4]);
    let names: Vec<_> = std::fs::read_dir(folder.path())
        .expect("the folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    assert_eq!(names, ["rollout.rrd"]);
}
