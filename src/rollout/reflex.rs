use crate::model::ActionDistribution;
use crate::trajectory::Observation;

/// Keeps a robot from trying what just had no effect: an arm at its limit, a base against furniture.
///
/// Known from images and actions alone: as long as the cameras show the same, the classes that were
/// tried are ruled out.
#[derive(Clone, Debug, Default)]
pub(super) struct Reflex {
    ruled_out: Vec<Vec<usize>>,
}

impl Reflex {
    /// Notes what `tried` did: nothing, if no pixel changed by more than `still_levels` on average.
    pub(super) fn note(
        &mut self,
        tried: &[usize],
        before: &Observation,
        after: &Observation,
        still_levels: f32,
    ) {
        if largest_mean_change(before, after) < still_levels {
            self.ruled_out.push(tried.to_vec());
        } else {
            self.ruled_out.clear();
        }
    }

    /// The most probable classes that are not ruled out; the most probable ones if nothing is left.
    /// Only spaces with one head (primitives) have something ruled out: with several, the most
    /// probable classes always stand.
    pub(super) fn choose(&self, distribution: &ActionDistribution) -> Vec<usize> {
        let best = distribution.most_probable();
        let [head] = &distribution.heads[..] else {
            return best;
        };
        let allowed = |class: &usize| !self.ruled_out.iter().any(|r| r[..] == [*class]);
        (0..head.len())
            .filter(allowed)
            .max_by(|a, b| head[*a].total_cmp(&head[*b]).then(b.cmp(a)))
            .map_or(best, |class| vec![class])
    }
}

/// The mean absolute change of a channel value, of the camera that changed most.
fn largest_mean_change(before: &Observation, after: &Observation) -> f32 {
    before
        .iter()
        .filter_map(|(camera, old)| {
            let new = after.image(camera).ok()?;
            let sum: u64 = old
                .rgb()
                .iter()
                .zip(new.rgb())
                .map(|(a, b)| u64::from(a.abs_diff(*b)))
                .sum();
            Some(sum as f32 / old.rgb().len().max(1) as f32)
        })
        .fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Image;

    fn grey(level: u8) -> Observation {
        let image = Image::new(1, 2, vec![level; 6]).expect("6 bytes");
        Observation::new([("head".to_owned(), image)])
    }

    #[test]
    fn what_had_no_effect_is_not_tried_again_until_something_moves() {
        let policy = ActionDistribution {
            heads: vec![vec![0.2, 0.5, 0.3]],
        };
        let mut reflex = Reflex::default();
        assert_eq!(reflex.choose(&policy), [1]);
        reflex.note(&[1], &grey(10), &grey(11), 2.0);
        assert_eq!(reflex.choose(&policy), [2]);
        reflex.note(&[2], &grey(11), &grey(11), 2.0);
        assert_eq!(reflex.choose(&policy), [0]);
        reflex.note(&[0], &grey(11), &grey(11), 2.0);
        assert_eq!(reflex.choose(&policy), [1], "nothing is left: try again");
        reflex.note(&[1], &grey(11), &grey(90), 2.0);
        assert_eq!(reflex.choose(&policy), [1]);
    }
}
