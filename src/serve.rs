//! A policy server: programs in other languages send observations and get actions.
//!
//! The wire is that of the Python package `openpi-client`: a WebSocket whose messages are msgpack, with
//! numpy arrays packed as that package packs them. On connection the server sends one message of
//! metadata; after that every binary message is answered by one binary message, or by a text that says what
//! was wrong with it. Each connection is a [`Conversation`] with a memory of its own; what a [`Service`]
//! loaded is shared by all.
//!
//! [`PolicyService`] answers observations with the actions of a composition, [`EnvironmentService`] answers
//! actions with the observations of a simulated robot, and [`Server`] is what they are reached through.

mod access;
mod arrays;
mod environment_service;
mod error;
mod limits;
mod message;
mod metadata;
mod observation;
mod policy_service;
mod reply;
mod server;
mod service;
mod socket;
mod stop;
#[cfg(test)]
mod tests;

use serde::Serialize;

pub use access::ApiKey;
pub use arrays::{ArrayOf, NdArray};
pub use environment_service::{EnvironmentService, Simulated};
pub use error::ServeError;
pub use limits::ServeLimits;
pub use message::{Message, MessageError};
pub use policy_service::{PolicyLabel, PolicyService};
pub use server::Server;
pub use service::{Conversation, Service};
pub use stop::Stop;

/// A message to be sent.
fn pack(value: &impl Serialize) -> Vec<u8> {
    rmp_serde::to_vec_named(value).expect("what is sent has names and lengths")
}
