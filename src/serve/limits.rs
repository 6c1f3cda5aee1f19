use std::time::Duration;

/// What one client may take of a server, so that no other client notices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServeLimits {
    /// Connections at a time, more are refused with status 503.
    pub connections: usize,
    /// Bytes of a message; a longer one ends its connection before it is read.
    pub message_bytes: usize,
    /// A connection that sends nothing for so long is closed. A message must have come as a whole by then.
    pub idle: Duration,
    /// For the head of an HTTP request, and for a client to take what is sent to it.
    pub patience: Duration,
}

impl Default for ServeLimits {
    /// 64 connections, 32 MiB, 10 minutes, 10 seconds.
    fn default() -> Self {
        Self {
            connections: 64,
            message_bytes: 32 << 20,
            idle: Duration::from_mins(10),
            patience: Duration::from_secs(10),
        }
    }
}
