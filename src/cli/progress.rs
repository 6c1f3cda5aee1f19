use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::graph::GraphProgress;

/// A bar with a name, a count and a note at its end; drawn on the terminal only, so that pipes and
/// logs stay clean.
pub(super) fn bar(name: &'static str, total: u64) -> ProgressBar {
    let style = ProgressStyle::with_template(
        "{prefix:>12.bold} [{bar:32.cyan/blue}] {pos}/{len} {msg} ({elapsed}, {eta} left)",
    )
    .expect("the template is a constant")
    .progress_chars("━╸─");
    let bar = ProgressBar::new(total).with_style(style).with_prefix(name);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Moves a bar to how far work on a graph is.
pub(super) fn show_progress(bar: &ProgressBar, progress: GraphProgress) {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
}
