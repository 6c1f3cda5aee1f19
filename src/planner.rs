//! Where to go next: shortest paths that reach every subgoal in its order (Fu & Finn, section III-D).
//!
//! # The search
//! A [`Layout`] lays the graph out along a composition: a place is a node at one occurrence of its
//! task, and has a stage, the number of subgoals of the composition that hold there. An edge may be
//! planned if it keeps the stage, or if it reaches exactly the subgoals that are due. The cost-to-go
//! of a place `n` is the cheapest cost of such edges to a final state:
//!
//! ```text
//! J(n) = 0                                  for final states
//! J(n) = min over edges n -> m of  c(n, m) + J(m)
//! ```
//!
//! It does not depend on where the robot is, so it is searched once ([`CostToGo`], backwards) and
//! repaired when an edge changes. At each step the current state `s` costs
//!
//! ```text
//! J(s) = min over n of  c(d(s, n)) + J(n)
//! ```
//!
//! which is what Dijkstra finds on the graph with `s` inserted *in both directions*, as the paper does:
//! all costs are positive, so a path from `s` that came back to `s` would become cheaper by leaving
//! out the loop; no shortest path from `s` uses an edge into `s`, and those edges, the only ones that
//! `J` does not know, change nothing. (They matter for localisation, which uses them.)
//!
//! # Who does what
//! [`Planner`] plans and chooses goal states, [`StageFilter`] says where in the composition the robot
//! is, [`audit`] says which subgoals a route skips, [`NoPath`] says why there is no route. None of
//! them knows a robot or a network: they are given distributions.

mod audit;
mod belief;
mod choice;
mod cost;
mod cost_to_go;
mod error;
mod evidence;
mod explanation;
#[cfg(test)]
pub(crate) mod fakes;
mod filter_options;
mod goal;
mod grips;
mod groups;
mod layout;
mod live;
mod localisation;
mod motion;
mod nearest_pair;
mod no_path;
mod options;
mod order;
mod outset;
mod plain;
mod plan;
mod roads;
mod source;
mod stage_sense;
mod stages;
mod suspects;
mod terms;
#[cfg(test)]
mod tests;
mod timeline;

pub use audit::{Audit, AuditedEdge, Shortcut, audit};
pub use choice::FinalChoice;
pub use cost::{EdgeCost, Price};
pub use cost_to_go::CostToGo;
pub use error::PlannerError;
pub use explanation::{
    EndCandidate, Explanation, OrderExplained, OrdersExplained, PlanOdds, PlanPart, StageExplained,
    TaskEnds,
};
pub use filter_options::FilterOptions;
pub use goal::{GoalBasis, GoalChoice};
pub use layout::{Layout, Place, PlaceId};
pub use live::LiveDistances;
pub use localisation::{Localisation, StageFilter};
pub use no_path::{Gap, NoPath};
pub use options::{EdgeChoice, Join, PlannerOptions, Search};
pub use order::{SettledOrder, settle_order};
pub use plain::PlainSearch;
pub use plan::{Plan, Planner};
pub use stages::StageChange;
pub use suspects::{SuspectEdge, suspects};
pub use terms::{AvoidedRegion, Start, Terms};
