/// What a server offers, shared by all its connections.
pub trait Service: Sync {
    /// The first message of every connection, packed: what clients need to know.
    fn metadata(&self) -> Vec<u8>;

    /// A conversation that has heard nothing yet.
    fn converse(&self) -> Box<dyn Conversation + Send + '_>;
}

/// One connection's side of a [`Service`].
pub trait Conversation {
    /// The packed answer to a packed message.
    ///
    /// # Errors
    /// What is wrong with the message, for the client to read; the conversation goes on.
    fn answer(&mut self, message: &[u8]) -> Result<Vec<u8>, String>;
}
