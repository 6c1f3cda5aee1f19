//! The planner against references that share no code with it.

mod corridor;
mod following;
mod reference;
mod routes;
mod worlds;
