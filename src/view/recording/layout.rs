use ::rerun::blueprint::components::PanelState;
use ::rerun::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView,
    TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
};

use super::RolloutScene;

/// How the viewer arranges a rollout: the graph large, what the robot sees beside what it is to see,
/// and below the plan, the actions, the curves and the events.
pub(super) fn blueprint(scene: &RolloutScene<'_>) -> Blueprint {
    let graph = Spatial2DView::new("merged graph").with_origin("/graph");
    let curves: [ContainerLike; 3] = [
        TimeSeriesView::new("probability of each action")
            .with_origin("/policy/probability")
            .into(),
        TimeSeriesView::new("entropy (nats)")
            .with_origin("/monitor")
            .into(),
        TimeSeriesView::new("steps to go, stage")
            .with_origin("/progress")
            .into(),
    ];
    let left = Vertical::new([
        graph.into(),
        Horizontal::new(curves)
            .with_column_shares([1.7, 1.0, 1.0])
            .into(),
        TextLogView::new("events").with_origin("/events").into(),
    ])
    .with_row_shares([4.2, 1.9, 1.7]);

    let cameras: Vec<ContainerLike> = scene
        .cameras
        .iter()
        .map(|camera| {
            let view = |title: &str, folder: &str| {
                Spatial2DView::new(format!("{}: {title}", camera.name))
                    .with_origin(format!("/{folder}/{}", camera.name))
                    .into()
            };
            Horizontal::new([view("now", "live"), view("goal state", "goal")]).into()
        })
        .collect();
    let texts: [ContainerLike; 2] = [
        TextDocumentView::new("plan").with_origin("/plan").into(),
        TextDocumentView::new("actions")
            .with_origin("/policy/actions")
            .into(),
    ];
    let right = Vertical::new([Vertical::new(cameras).into(), Horizontal::new(texts).into()])
        .with_row_shares([1.0, 1.15]);

    Blueprint::new(Horizontal::new([left.into(), right.into()]).with_column_shares([3.1, 2.0]))
        .with_auto_views(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline("step")
                .with_fps(8.0),
        )
}
