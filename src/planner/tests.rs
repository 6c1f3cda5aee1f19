//! The planner against references that share no code with it.

mod corridor;
mod following;
mod orders;
mod reference;
mod routes;
mod terms;
mod worlds;

pub(super) use corridor::layout as layout_of_corridor;
