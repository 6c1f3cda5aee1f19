/// What a long piece of work on a graph is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GraphPhase {
    /// States become latents; counted in states.
    Encode,
    /// Pairs of states are scored; counted in pairs.
    Score,
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GraphProgress {
    /// What is being counted.
    pub phase: GraphPhase,
    /// Done so far.
    pub done: u64,
    /// To be done in this phase.
    pub total: u64,
}

/// Told from several threads how far the work is; calls may overtake each other.
pub type ProgressFn<'a> = &'a (dyn Fn(GraphProgress) + Sync);
