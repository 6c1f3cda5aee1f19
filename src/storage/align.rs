use super::Loss;

const NANOS_PER_MILLI: u64 = 1_000_000;

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

/// Fewer images do not say how often a camera usually gives one.
const FEWEST_IMAGES: usize = 6;

/// How many images a camera left out by its own rate, and its longest gap in nanoseconds: where two images
/// lie nearly two of its usual intervals or more apart. `times` are in nanoseconds and sorted.
fn missing_images(times: &[u64]) -> Option<(u64, u64)> {
    const LONG_INTERVALS: f64 = 1.8;
    if times.len() < FEWEST_IMAGES {
        return None;
    }
    let gaps = sorted_gaps(times);
    let usual = gaps[gaps.len() / 2] as f64;
    let long = gaps
        .iter()
        .filter(|gap| usual > 0.0 && **gap as f64 > LONG_INTERVALS * usual);
    let missing: u64 = long
        .clone()
        .map(|gap| (*gap as f64 / usual).round() as u64 - 1)
        .sum();
    Some((missing, *long.max()?))
}

/// What is missing of a camera after its last image.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct MissingTail {
    /// How many images: by the camera's own rate, or by that of the steps where it gave only one.
    pub images: u64,
    /// From its last image to the last step, in nanoseconds.
    pub nanos: u64,
    /// Whether it lasts so long that the camera does not show how the demonstration ends.
    pub is_long: bool,
}

impl MissingTail {
    /// The camera, named by its topic, is told to have stopped if that lasts long.
    pub fn stopped(&self, topic: &str) -> Option<Loss> {
        self.is_long.then(|| Loss::CameraStopped {
            topic: topic.to_owned(),
            images: self.images,
            millis: self.nanos / NANOS_PER_MILLI,
        })
    }
}

/// What a camera did not give: between its images, and after the last one. All times are in nanoseconds and
/// sorted.
pub(super) fn images_left_out(topic: &str, times: &[u64], step_times: &[u64]) -> Vec<Loss> {
    let tail = missing_tail(times, step_times);
    let short = tail.as_ref().filter(|tail| !tail.is_long);
    let gaps = [missing_images(times), short.map(|t| (t.images, t.nanos))];
    let together = |a: (u64, u64), b: (u64, u64)| (a.0.saturating_add(b.0), a.1.max(b.1));
    let gaps = gaps.into_iter().flatten().reduce(together);
    let gaps = gaps.map(|(images, nanos)| Loss::MissingImages {
        topic: topic.to_owned(),
        images,
        longest_millis: nanos / NANOS_PER_MILLI,
    });
    let stopped = tail.and_then(|tail| tail.stopped(topic));
    gaps.into_iter().chain(stopped).collect()
}

/// What is missing of a camera between its last image and the last step, if it waits longer there than cameras
/// do that are slow, or that end a little before the actions. All times are in nanoseconds and sorted.
///
/// Long is measured in the camera's usual interval or in that of the steps, whichever is longer. Of few images
/// the longest interval stands for the usual one, and only a long tail counts.
pub(super) fn missing_tail(image_times: &[u64], step_times: &[u64]) -> Option<MissingTail> {
    const SHORT_INTERVALS: f64 = 4.0;
    const LONG_INTERVALS: f64 = 10.0;
    const LONG_NANOS: u64 = 1_000_000_000;
    let nanos = step_times.last()?.checked_sub(*image_times.last()?)?;
    let are_few = image_times.len() < FEWEST_IMAGES;
    let (gaps, steps) = (sorted_gaps(image_times), sorted_gaps(step_times));
    let usual = if are_few {
        gaps.last()
    } else {
        gaps.get(gaps.len() / 2)
    };
    let usual = usual.copied().filter(|gap| *gap > 0);
    let step = steps.get(steps.len() / 2).copied().filter(|gap| *gap > 0);
    let interval = usual.max(step)?;
    let intervals = nanos as f64 / interval as f64;
    let least = if are_few {
        LONG_INTERVALS
    } else {
        SHORT_INTERVALS
    };
    (intervals > least).then(|| MissingTail {
        images: nanos / usual.unwrap_or(interval),
        nanos,
        is_long: intervals > LONG_INTERVALS && nanos > LONG_NANOS,
    })
}

/// What lies between neighbouring times, in order of length. `times` are sorted.
fn sorted_gaps(times: &[u64]) -> Vec<u64> {
    let mut gaps: Vec<u64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_unstable();
    gaps
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
    fn a_camera_that_stops_is_told_and_one_that_is_slow_or_ends_a_little_earlier_is_not() {
        const MILLIS: u64 = 1_000_000;
        let times = |count: u64, period: u64| -> Vec<u64> {
            (0..count).map(|i| i * period * MILLIS).collect()
        };
        let tail = |images: &[u64], steps: &[u64]| {
            let tail = missing_tail(images, steps)?;
            Some((tail.images, tail.nanos / MILLIS, tail.is_long))
        };
        let steps = times(101, 100);
        // Twenty images of 10 Hz, the last at 1.9 s, and 10 s of steps.
        assert_eq!(tail(&times(20, 100), &steps), Some((81, 8100, true)));
        assert_eq!(tail(&times(95, 100), &steps), Some((6, 600, false)));
        assert_eq!(tail(&times(98, 100), &steps), None, "0.3 s earlier");
        assert_eq!(tail(&times(105, 100), &steps), None, "it goes on");
        assert_eq!(tail(&times(10, 1000), &steps), None, "one image a second");
        assert_eq!(tail(&times(290, 33), &steps), Some((14, 463, false)));
        assert_eq!(tail(&times(296, 33), &steps), None, "by the steps");
        assert_eq!(tail(&times(1, 1), &steps), Some((100, 10_000, true)));
        assert_eq!(tail(&times(1, 1), &times(10, 100)), None);
        assert_eq!(tail(&times(3, 100), &steps), Some((98, 9800, true)));
        assert_eq!(tail(&times(3, 1000), &steps), None, "8 s at 1 Hz");
        assert_eq!(tail(&[], &steps), None);
        assert_eq!(tail(&times(9, 100), &[]), None);
        assert_eq!(tail(&[5; 9], &[7]), None);
    }

    #[test]
    fn camera_without_image_leaves_no_step() {
        let alignment = align(&[5, 10], &[vec![0], vec![]]);
        assert_eq!(alignment.first_action, 2);
        assert!(alignment.images.iter().all(Vec::is_empty));
    }
}
