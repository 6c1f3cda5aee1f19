use super::ModelError;

/// The probabilities of actions: one distribution a head of the action space.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionDistribution {
    /// Probabilities of the classes of each head, each summing to 1.
    pub heads: Vec<Vec<f32>>,
}

impl ActionDistribution {
    /// The most probable class of each head; the lowest index wins a tie.
    #[must_use]
    pub fn most_probable(&self) -> Vec<usize> {
        self.heads
            .iter()
            .map(|head| {
                let mut best = 0;
                for (class, p) in head.iter().enumerate() {
                    if *p > head[best] {
                        best = class;
                    }
                }
                best
            })
            .collect()
    }

    /// The same without a class of the first head, whose probability goes to the others in proportion; as it is where
    /// they have none.
    #[must_use]
    pub fn without(&self, class: usize) -> Self {
        let mut heads = self.heads.clone();
        if let Some(head) = heads.first_mut()
            && let Some(p) = head.get_mut(class)
        {
            *p = 0.0;
            let rest: f32 = head.iter().sum();
            if rest <= 0.0 {
                return self.clone();
            }
            for p in head.iter_mut() {
                *p /= rest;
            }
        }
        Self { heads }
    }

    /// The weighted mean of distributions over the same heads; weights need not sum to 1, but to more than 0.
    ///
    /// # Panics
    /// If there is none, or their heads differ.
    #[must_use]
    pub fn mixture(parts: &[(Self, f32)]) -> Self {
        let total: f32 = parts.iter().map(|(_, weight)| weight).sum();
        let mut heads: Vec<Vec<f32>> = parts[0]
            .0
            .heads
            .iter()
            .map(|head| vec![0.0; head.len()])
            .collect();
        for (part, weight) in parts {
            assert_eq!(
                part.heads.len(),
                heads.len(),
                "distributions of different heads"
            );
            for (mean, head) in heads.iter_mut().zip(&part.heads) {
                assert_eq!(mean.len(), head.len(), "heads of different classes");
                for (m, p) in mean.iter_mut().zip(head) {
                    *m += p * weight / total;
                }
            }
        }
        Self { heads }
    }

    /// Refuses what a policy gave if it is not a finite number for each class of each head.
    ///
    /// # Errors
    /// [`ModelError::Length`] and [`ModelError::NotFinite`].
    pub(crate) fn ensure_of(&self, head_sizes: &[usize]) -> Result<(), ModelError> {
        let found: Vec<usize> = self.heads.iter().map(Vec::len).collect();
        if found != head_sizes {
            return Err(ModelError::Length {
                what: format!("heads of {found:?} classes, which should be {head_sizes:?},"),
                expected: head_sizes.iter().sum(),
                found: found.iter().sum(),
            });
        }
        let mut all = self.heads.iter().flatten().enumerate();
        match all.find(|(_, p)| !p.is_finite()) {
            None => Ok(()),
            Some((place, p)) => Err(ModelError::NotFinite {
                what: "the local policy's probabilities".to_owned(),
                place,
                value: p.to_string(),
            }),
        }
    }

    /// Shannon entropy in nats, summed over the heads; 0 for a policy that is certain.
    #[must_use]
    pub fn entropy(&self) -> f32 {
        self.heads
            .iter()
            .flatten()
            .filter(|p| **p > 0.0)
            .map(|p| -p * p.ln())
            .sum()
    }
}

/// The local goal-conditioned policy: which action leads from one state to a nearby goal state
/// (Fu & Finn, section III-E).
pub trait LocalPolicy {
    /// The action probabilities on the way from the state with latent `from` to the one with latent
    /// `goal`: for each head of the action space a probability for each of its classes. The closed loop refuses
    /// any other number of them, and what is not finite.
    ///
    /// # Errors
    /// [`ModelError::Length`] for latents of another length, [`ModelError::Engine`] when the network
    /// cannot be run.
    fn act(&self, from: &[f32], goal: &[f32]) -> Result<ActionDistribution, ModelError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_class_the_others_keep_their_proportions() {
        let of = |head: &[f32]| ActionDistribution {
            heads: vec![head.to_vec()],
        };
        assert_eq!(of(&[0.5, 0.25, 0.25]).without(0), of(&[0.0, 0.5, 0.5]));
        assert_eq!(of(&[0.0, 1.0]).without(1), of(&[0.0, 1.0]));
        assert_eq!(of(&[0.4, 0.6]).without(2).most_probable(), [1]);
    }

    #[test]
    fn what_is_no_distribution_over_the_actions_is_refused() {
        let given = |heads: &[&[f32]], head_sizes: &[usize]| {
            let heads = heads.iter().map(|head| head.to_vec()).collect();
            let refused = ActionDistribution { heads }.ensure_of(head_sizes).err();
            refused.map_or_else(String::new, |error| error.to_string())
        };
        assert_eq!(given(&[&[0.5, 0.5], &[1.0]], &[2, 1]), "");
        let error = given(&[&[0.5, 0.5]], &[3]);
        assert!(
            error.contains("heads of [2] classes, which should be [3]"),
            "{error}"
        );
        assert!(given(&[&[0.5, 0.5]], &[1, 1]).contains("[1, 1]"));
        let error = given(&[&[1.0], &[0.5, f32::NAN]], &[1, 2]);
        assert!(
            error.contains("value 2 of the local policy's probabilities is NaN"),
            "{error}"
        );
    }
}
