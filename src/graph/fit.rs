use super::{GraphError, TopologicalGraph};

impl TopologicalGraph {
    /// Checks that there is a state. `what` names the graph in the error, such as `the graph in graphs/sock`.
    ///
    /// # Errors
    /// [`GraphError::NoStates`] when there is none.
    pub fn ensure_states(&self, what: &str) -> Result<(), GraphError> {
        if self.node_count() == 0 {
            return Err(GraphError::NoStates {
                what: what.to_owned(),
            });
        }
        Ok(())
    }

    /// Checks that edges have `d_max` classes and latents `latent_dim` values, as a model says of its own.
    /// `what` names the graph in the error.
    ///
    /// # Errors
    /// [`GraphError::DMaxDiffers`] and [`GraphError::LatentLengthDiffers`] with both numbers.
    pub fn ensure_fits(
        &self,
        what: &str,
        d_max: usize,
        latent_dim: usize,
    ) -> Result<(), GraphError> {
        if self.d_max() != d_max {
            return Err(GraphError::DMaxDiffers {
                what: what.to_owned(),
                expected: d_max,
                found: self.d_max(),
            });
        }
        if self.latents().dim() != latent_dim {
            return Err(GraphError::LatentLengthDiffers {
                what: what.to_owned(),
                expected: latent_dim,
                found: self.latents().dim(),
            });
        }
        Ok(())
    }
}
