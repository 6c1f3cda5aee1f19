//! Pictures: a merged graph as SVG, and a rollout as a Rerun recording.

mod error;
mod file;
mod layout;
mod palette;
mod recording;
mod selection;
mod svg;

pub use error::ViewError;
pub use recording::{EventLevel, RolloutRecording, RolloutScene, StepView};
pub use svg::{
    Curve, Panel, Rate, Spread, Timing, automaton_svg, curves_svg, merged_graph_svg, rates_svg,
    spreads_svg, times_svg, write_automaton_svg, write_curves_svg, write_merged_graph_svg,
    write_rates_svg, write_spreads_svg, write_times_svg,
};

#[cfg(test)]
mod tests;
