use ::rerun::{AsComponents, Color, LineStrips2D, Points2D, Radius};

use super::labels::Labels;
use super::{RolloutScene, StepView};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};
use crate::view::layout::{Frame, GraphLayout, least_width};
use crate::view::palette::{self, CROSS_TASK, CROSS_TASK_PALE, Rgb, STAR};
use crate::view::selection::{Ends, most_probable_of_each_pair, of_kind, spread};

/// Viewers stay quick with these, and eyes do too.
const MOST_LEARNED: usize = 3000;
const MOST_CROSS_TASK: usize = 600;
const CURVE_POINTS: usize = 20;
const LEAST_WIDTH: f32 = 1600.0;
const HEIGHT: f32 = 640.0;
const GAP: f32 = 180.0;
const WHITE: Rgb = Rgb(255, 255, 255);
/// The viewer's background: lines that stand back are mixed with it.
const BACKGROUND: Rgb = Rgb(13, 16, 17);

type Logged = Box<dyn AsComponents>;

/// The merged graph with the robot in it.
pub(super) struct Map {
    layout: GraphLayout,
    labels: Labels,
    trail: Vec<NodeId>,
    path: Option<Vec<NodeId>>,
}

impl Map {
    pub(super) fn new(scene: &RolloutScene<'_>) -> Self {
        let layout =
            |row_height| GraphLayout::new(scene.graph, scene.route, frame(scene.graph, row_height));
        let draft = layout(1.0);
        let layout = layout(HEIGHT / draft.bottom.max(1.0));
        Self {
            labels: Labels::new(&layout, frame(scene.graph, 1.0).width),
            layout,
            trail: Vec::new(),
            path: None,
        }
    }

    /// What never changes: nodes, edges, names.
    pub(super) fn still_life(&self, graph: &TopologicalGraph) -> Vec<(String, Logged)> {
        let mut scene = vec![
            ("graph/edges/learned".to_owned(), self.learned(graph)),
            ("graph/edges/cross_task".to_owned(), self.cross_task(graph)),
            ("graph/margin".to_owned(), self.margin()),
        ];
        for (index, block) in self.layout.blocks.iter().enumerate() {
            let colour = palette::task(index);
            let at = |part: &str| format!("graph/tasks/{}/{part}", block.task);
            let rows = block.rows.iter().map(|row| self.strip(&row.nodes));
            scene.push((
                at("demonstrations"),
                Box::new(
                    LineStrips2D::new(rows)
                        .with_colors([solid(colour.mixed(BACKGROUND, 0.45))])
                        .with_radii([Radius::new_ui_points(0.5)])
                        .with_draw_order(2.0),
                ),
            ));
            scene.push((at("states"), self.states(graph, index)));
            scene.push((at("subgoals"), self.subgoals(index)));
            let names = block.columns.iter().zip(self.subgoal_places(index));
            for (number, (column, place)) in names.enumerate() {
                let name = Self::subgoal_name(index, place, &column.subgoal);
                scene.push((at(&format!("subgoal_names/{number}")), name));
            }
            let name = Points2D::new([[block.x, self.labels.tasks_y]])
                .with_labels([block.task.as_str()])
                .with_show_labels(true)
                .with_colors([solid(colour)])
                .with_radii([Radius::new_ui_points(4.0)]);
            scene.push((at("name"), Box::new(name)));
        }
        scene
    }

    /// What changed with this step.
    pub(super) fn step(
        &mut self,
        graph: &TopologicalGraph,
        view: &StepView<'_>,
    ) -> Vec<(&'static str, Logged)> {
        let mut changes: Vec<(&'static str, Logged)> = Vec::new();
        if self.path.as_deref() != Some(view.path) {
            changes.push((
                "graph/plan/path",
                self.route(graph, view.path, WHITE, 1.6, 30.0),
            ));
            let end = view.path.last().copied();
            changes.push((
                "graph/plan/final_state",
                self.mark(end, "final state", STAR, 7.0),
            ));
            self.path = Some(view.path.to_vec());
        }
        if let Some(current) = view.current
            && self.trail.last() != Some(&current)
        {
            self.trail.push(current);
            changes.push((
                "graph/robot/trail",
                self.route(graph, &self.trail, STAR, 2.2, 31.0),
            ));
        }
        changes.push((
            "graph/plan/goal_state",
            self.mark(view.goal_node, "goal", CROSS_TASK, 6.0),
        ));
        let here = if view.current.is_some() { "" } else { "lost" };
        let place = view.current.or(self.trail.last().copied());
        changes.push(("graph/robot/here", self.mark(place, here, WHITE, 8.0)));
        changes
    }

    fn strip(&self, nodes: &[NodeId]) -> Vec<[f32; 2]> {
        nodes.iter().map(|id| self.layout.at(*id)).collect()
    }

    fn states(&self, graph: &TopologicalGraph, block: usize) -> Logged {
        let colour = palette::task(block);
        let nodes: Vec<NodeId> = self.layout.blocks[block]
            .rows
            .iter()
            .flat_map(|row| row.nodes.iter().copied())
            .collect();
        let is_special = |id: &NodeId| {
            let node = graph.node(*id);
            node.is_end || !node.reached.is_empty()
        };
        let colours = nodes.iter().map(|id| {
            solid(if is_special(id) {
                colour.mixed(WHITE, 0.55)
            } else {
                colour
            })
        });
        let radii = nodes
            .iter()
            .map(|id| Radius::new_ui_points(if is_special(id) { 2.6 } else { 1.5 }));
        Box::new(
            Points2D::new(self.strip(&nodes))
                .with_colors(colours)
                .with_radii(radii)
                .with_draw_order(10.0),
        )
    }

    fn subgoals(&self, block: usize) -> Logged {
        let lines = self
            .subgoal_places(block)
            .map(|[x, y]| [[x, y], [x, self.layout.bottom]]);
        Box::new(
            LineStrips2D::new(lines)
                .with_colors([solid(palette::task(block).mixed(BACKGROUND, 0.3))])
                .with_radii([Radius::new_ui_points(0.7)])
                .with_draw_order(3.0),
        )
    }

    /// The viewer writes a point's label below it.
    fn subgoal_name(block: usize, place: [f32; 2], name: &str) -> Logged {
        Box::new(
            Points2D::new([place])
                .with_labels([name])
                .with_show_labels(true)
                .with_colors([solid(palette::task(block).mixed(WHITE, 0.3))])
                .with_radii([Radius::new_ui_points(2.0)]),
        )
    }

    fn subgoal_places(&self, block: usize) -> impl Iterator<Item = [f32; 2]> {
        let columns = self.layout.blocks[block].columns.iter();
        let heights = self.labels.subgoals_y(block).iter();
        columns.zip(heights).map(|(column, y)| [column.x, *y])
    }

    /// A line that nobody sees, around the map and its names: the viewer shows as much as all lines need, and forgets names.
    /// (Of a few points it would show twice as much, since it takes points for scattered.)
    fn margin(&self) -> Logged {
        Box::new(
            LineStrips2D::new([self.labels.corners(&self.layout)])
                .with_colors([Color::from_unmultiplied_rgba(0, 0, 0, 0)])
                .with_radii([Radius::new_ui_points(0.1)]),
        )
    }

    fn learned(&self, graph: &TopologicalGraph) -> Logged {
        let all = of_kind(graph, EdgeKind::Learned);
        let shown = spread(&all, MOST_LEARNED);
        let lines = shown.iter().map(|(from, to, _)| self.strip(&[*from, *to]));
        let colours = shown.iter().map(|(from, ..)| {
            let colour = palette::task(self.layout.block_of[from.index()]);
            solid(colour.mixed(BACKGROUND, 0.82))
        });
        Box::new(
            LineStrips2D::new(lines)
                .with_colors(colours)
                .with_radii([Radius::new_ui_points(0.4)])
                .with_draw_order(0.0),
        )
    }

    fn cross_task(&self, graph: &TopologicalGraph) -> Logged {
        let all = of_kind(graph, EdgeKind::CrossTask);
        let shown = most_probable_of_each_pair(&self.layout, &all, MOST_CROSS_TASK);
        let lines = shown.iter().map(|(from, to, _)| self.curve(*from, *to));
        let colours = shown.iter().map(|ends| solid(self.cross_task_colour(ends)));
        Box::new(
            LineStrips2D::new(lines)
                .with_colors(colours)
                .with_radii([Radius::new_ui_points(0.4)])
                .with_draw_order(1.0),
        )
    }

    fn cross_task_colour(&self, (from, to, edge): &Ends<'_>) -> Rgb {
        let certain = CROSS_TASK.mixed(CROSS_TASK_PALE, 0.25);
        let retreat = if self.layout.leads_back(*from, *to) {
            0.75
        } else {
            0.45
        };
        let doubt = 1.0 - edge.connected_probability();
        certain.mixed(BACKGROUND, (retreat + doubt).min(0.9))
    }

    fn curve(&self, from: NodeId, to: NodeId) -> Vec<[f32; 2]> {
        let points = self.layout.curve(from, to);
        (0..=CURVE_POINTS)
            .map(|i| {
                let t = i as f32 / CURVE_POINTS as f32;
                let s = 1.0 - t;
                let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
                let along = |axis: usize| -> f32 {
                    points.iter().zip(weights).map(|(p, w)| p[axis] * w).sum()
                };
                [along(0), along(1)]
            })
            .collect()
    }

    /// A way through the graph, along the curves where it changes the task or begins it again.
    fn route(
        &self,
        graph: &TopologicalGraph,
        nodes: &[NodeId],
        colour: Rgb,
        radius: f32,
        order: f32,
    ) -> Logged {
        let mut strip: Vec<[f32; 2]> = nodes
            .first()
            .map(|id| self.layout.at(*id))
            .into_iter()
            .collect();
        for pair in nodes.windows(2) {
            if self.layout.is_curved(graph, pair[0], pair[1]) {
                strip.extend(self.curve(pair[0], pair[1]));
            } else {
                strip.push(self.layout.at(pair[1]));
            }
        }
        Box::new(
            LineStrips2D::new([strip])
                .with_colors([solid(colour)])
                .with_radii([Radius::new_ui_points(radius)])
                .with_draw_order(order),
        )
    }

    fn mark(&self, node: Option<NodeId>, label: &str, colour: Rgb, radius: f32) -> Logged {
        let place: Vec<[f32; 2]> = node.map(|id| self.layout.at(id)).into_iter().collect();
        let labels = node.map(|_| label).filter(|label| !label.is_empty());
        Box::new(
            Points2D::new(place)
                .with_labels(labels)
                .with_show_labels(true)
                .with_colors([solid(colour)])
                .with_radii([Radius::new_ui_points(radius)])
                .with_draw_order(40.0),
        )
    }
}

/// The rows of all tasks, next to each other in as much room as these need.
fn frame(graph: &TopologicalGraph, row_height: f32) -> Frame {
    Frame {
        left: 0.0,
        top: 0.0,
        width: LEAST_WIDTH.max(least_width(graph, GAP)),
        gap: GAP,
        row_height,
    }
}

fn solid(Rgb(r, g, b): Rgb) -> Color {
    Color::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Node;

    #[test]
    fn many_tasks_widen_the_map() {
        let mut graph = TopologicalGraph::new(1, 3);
        for i in 0..12 {
            let node = Node {
                task: format!("task_{i:02}"),
                trajectory: format!("demonstration_{i:02}"),
                step: 0,
                reached: Vec::new(),
                progress: 0,
                is_end: true,
            };
            graph.add_node(node, &[0.0]);
        }
        let layout = GraphLayout::new(&graph, &[], frame(&graph, 1.0));
        assert_eq!(layout.blocks.len(), 12);
        for pair in layout.blocks.windows(2) {
            assert!(pair[0].width > 200.0, "{pair:?}");
            let gap = pair[1].x - pair[0].x - pair[0].width;
            assert!((gap - GAP).abs() < 0.01, "{pair:?}");
        }
    }
}
