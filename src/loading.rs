//! A composition with all that planning and running it needs: [`LoadedComposition`] has the model, the graphs of
//! the tasks merged as their orders allow, and the order and regions settled on them.
//!
//! [`composer`](crate::composer) reads what is to be done and loads nothing; here is done with graphs and model what
//! a composition says of them, so that nothing of it is forgotten: `calibration: none`, regions, and that the graphs
//! were built with this model and with the subgoals that the tasks have now.

mod error;
mod graph_folders;
mod loaded_composition;
mod merging;

pub use error::LoadError;
pub(crate) use graph_folders::{GraphFolders, in_folder};
pub use loaded_composition::LoadedComposition;
pub use merging::merge_options;
pub(crate) use merging::merge_tasks;
