use std::net::SocketAddr;
use std::path::PathBuf;

use thiserror::Error;

/// Why a server does not come up.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ServeError {
    /// Another program has the port, or the address is not this machine's.
    #[error("cannot listen on {address}: {reason}; another port is taken with --bind {}", SocketAddr::new(.address.ip(), 0))]
    Bind {
        /// Where.
        address: SocketAddr,
        /// What the system said.
        reason: String,
    },
    /// Whoever reaches the address would move the robot.
    #[error(
        "{address} can be reached from other machines: protect it with --api-key-file FILE, or bind to 127.0.0.1"
    )]
    KeyNeeded {
        /// Where.
        address: SocketAddr,
    },
    /// The key is not usable.
    #[error("{}: {reason}; `openssl rand -hex 32 > FILE` makes one", .path.display())]
    KeyFile {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The system gives no threads or no signals.
    #[error("the server cannot start: {0}")]
    System(#[source] std::io::Error),
}
