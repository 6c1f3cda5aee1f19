use tokio::sync::watch;

/// Asks a server to end, from any thread. Clones ask the same server.
#[derive(Clone, Debug)]
pub struct Stop {
    sender: watch::Sender<bool>,
}

impl Default for Stop {
    fn default() -> Self {
        Self {
            sender: watch::Sender::new(false),
        }
    }
}

impl Stop {
    /// The server takes no more connections, finishes the steps that are in work, and ends.
    pub fn stop(&self) {
        self.sender.send_replace(true);
    }

    /// Returns once a stop is asked for.
    pub(super) async fn asked(&self) {
        let mut receiver = self.sender.subscribe();
        // The sender is ours, so it lives as long as the wait.
        let _ = receiver.wait_for(|asked| *asked).await;
    }
}
