/// Which image of each camera belongs to which action.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Alignment {
    /// The first action with an image of every camera at or before it; those before make no step.
    pub first_action: usize,
    /// For each camera the index of its image for each action from `first_action` on.
    pub images: Vec<Vec<usize>>,
}

/// Gives each action the latest image of each camera at or before it. All times are in nanoseconds and
/// sorted.
pub(super) fn align(action_times: &[u64], image_times: &[Vec<u64>]) -> Alignment {
    let first_action = image_times
        .iter()
        .map(|times| match times.first() {
            Some(first) => action_times.partition_point(|t| t < first),
            None => action_times.len(),
        })
        .max()
        .unwrap_or(0);
    let images = image_times
        .iter()
        .map(|times| {
            action_times[first_action..]
                .iter()
                .map(|action| times.partition_point(|t| t <= action) - 1)
                .collect()
        })
        .collect();
    Alignment {
        first_action,
        images,
    }
}

/// How many images a camera left out by its own rate, and its longest gap in nanoseconds: where two images
/// lie nearly two of its usual intervals or more apart. `times` are in nanoseconds and sorted.
pub(super) fn missing_images(times: &[u64]) -> Option<(u64, u64)> {
    const FEWEST_IMAGES: usize = 6;
    const LONG_INTERVALS: f64 = 1.8;
    if times.len() < FEWEST_IMAGES {
        return None;
    }
    let gaps: Vec<u64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_unstable();
    let usual = sorted[sorted.len() / 2] as f64;
    let long = gaps
        .iter()
        .filter(|gap| usual > 0.0 && **gap as f64 > LONG_INTERVALS * usual);
    let missing: u64 = long
        .clone()
        .map(|gap| (*gap as f64 / usual).round() as u64 - 1)
        .sum();
    Some((missing, *long.max()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_action_takes_the_latest_image_at_or_before_it() {
        let alignment = align(&[5, 10, 20, 30], &[vec![10, 19, 21, 29], vec![0, 30]]);
        assert_eq!(alignment.first_action, 1);
        assert_eq!(alignment.images, [vec![0, 1, 3], vec![0, 0, 1]]);
    }

    #[test]
    fn gaps_of_a_camera_are_counted_in_its_own_intervals() {
        assert_eq!(missing_images(&[0, 10, 20, 31, 40, 50]), None);
        assert_eq!(missing_images(&[0, 10, 20, 30, 60, 70, 90]), Some((3, 30)));
        assert_eq!(missing_images(&[0, 500]), None);
        assert_eq!(missing_images(&[5; 9]), None);
    }

    #[test]
    fn camera_without_image_leaves_no_step() {
        let alignment = align(&[5, 10], &[vec![0], vec![]]);
        assert_eq!(alignment.first_action, 2);
        assert!(alignment.images.iter().all(Vec::is_empty));
    }
}
