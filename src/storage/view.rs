//! How recordings are looked at: as they are, by a mapping file, thinned out, with images of another size.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

use super::StorageError;
use super::mapping::{ActionShape, Mapping, SaidOfTopic};
use super::topic::{Channel, Role, camera_name};
use crate::trajectory::{ActionSpace, Binning, Image};

/// What is asked for beside what mapping files say; it goes before them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Take a step every so many actions, counted from the last one, so that a demonstration keeps its end; 0 is 1.
    pub every: Option<usize>,
    /// The size that images of all cameras get, by [`Image::resized`], which panics at a size of 0.
    pub image_size: Option<ImageSize>,
}

impl ReadOptions {
    /// What belongs into a digest of what is read; empty for recordings as they are.
    pub(super) fn digested(&self) -> String {
        let every = self.every.map(|e| format!("every {e};"));
        let size = self.image_size.map(|s| format!("image size {s};"));
        [every, size].into_iter().flatten().collect()
    }
}

/// Rows and columns of an image; as text `90x160`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
}

impl FromStr for ImageSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const MAX_PIXELS: u32 = 8192;
        let number = |part: &str| part.parse().ok().filter(|n| (1..=MAX_PIXELS).contains(n));
        let parsed = text.split_once('x').and_then(|(height, width)| {
            Some(Self {
                height: number(height)?,
                width: number(width)?,
            })
        });
        parsed.ok_or_else(|| {
            format!(
                "'{text}' is no size: give HEIGHTxWIDTH within 1..={MAX_PIXELS}, such as 90x160"
            )
        })
    }
}

impl fmt::Display for ImageSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.height, self.width)
    }
}

/// A mapping file, if there is one, and what goes before it.
#[derive(Clone, Debug, Default)]
pub(super) struct View {
    pub mapping: Option<Arc<Mapping>>,
    pub options: ReadOptions,
}

impl View {
    /// How the mapping file cuts continuous actions, where it gives a range for any of their dimensions.
    pub fn ranges(&self) -> Option<Binning> {
        let binning = self.mapping.as_ref()?.binning(1);
        binning.has_range().then_some(binning)
    }

    /// What a channel is for.
    pub fn role(&self, channel: &Channel) -> Role {
        let Some(mapping) = &self.mapping else {
            return channel.role();
        };
        let topic = channel.topic.as_str();
        if mapping.action_topic() == Some(topic) {
            return channel.action_role();
        }
        if mapping.task_topic() == Some(topic) {
            return Role::Task;
        }
        if mapping.subgoal_topic() == Some(topic) {
            return Role::Subgoal;
        }
        match (channel.role(), mapping.camera_of(topic)) {
            (
                role @ (Role::Camera(_) | Role::UnreadableCamera(_)),
                SaidOfTopic::Camera(_) | SaidOfTopic::Nothing,
            ) => role,
            (_, SaidOfTopic::Camera(_)) => Role::UnreadableCamera(format!(
                "the mapping file calls it a camera, but its type {} holds no images",
                channel.type_name
            )),
            (Role::Camera(_) | Role::UnreadableCamera(_), SaidOfTopic::NoCamera) => Role::Other,
            (Role::Action(_) | Role::UnreadableAction(_), _)
                if mapping.action_topic().is_some() =>
            {
                Role::Other
            }
            (Role::Task, _) if mapping.task_topic().is_some() => Role::Other,
            (Role::Subgoal, _) if mapping.subgoal_topic().is_some() => Role::Other,
            (role, _) => role,
        }
    }

    /// What the camera of a topic is called.
    pub fn camera_name(&self, topic: &str) -> String {
        match self.mapping.as_ref().map(|m| m.camera_of(topic)) {
            Some(SaidOfTopic::Camera(name)) => name.to_owned(),
            _ => camera_name(topic),
        }
    }

    /// An image of a camera in the size that is asked for.
    pub fn sized(&self, camera: &str, image: Image) -> Image {
        match self.image_size(camera) {
            Some(ImageSize { height, width }) => image.resized(height, width),
            None => image,
        }
    }

    /// The size that is asked for.
    pub fn image_size(&self, camera: &str) -> Option<ImageSize> {
        self.options.image_size.or_else(|| {
            let size = self.mapping.as_ref()?.image_size(camera)?;
            Some(ImageSize {
                height: size.height,
                width: size.width,
            })
        })
    }

    /// What becomes of the actions of a recording.
    pub fn shape(
        &self,
        recording: &Path,
        space: &ActionSpace,
    ) -> Result<ActionShape, StorageError> {
        match &self.mapping {
            Some(mapping) => mapping.shape(recording, space),
            None => Ok(ActionShape::whole(space)),
        }
    }

    /// Which actions begin a step, given the times of all in nanoseconds and in order. The last one always
    /// does; the others are counted from it, so that a demonstration keeps its end.
    pub fn chosen(
        &self,
        recording: &Path,
        space: &ActionSpace,
        times: &[u64],
    ) -> Result<Vec<usize>, StorageError> {
        let mapping = self.mapping.as_ref();
        let every = self.options.every.or_else(|| mapping?.every());
        let rate = match every {
            Some(_) => None,
            None => mapping.and_then(|m| m.rate_hz()),
        };
        let chosen = match (every, rate) {
            (None | Some(0 | 1), None) => return Ok((0..times.len()).collect()),
            (Some(every), _) => every_nth(times.len(), every),
            (None, Some(rate)) => {
                if let (Some(mapping), Some(actual)) = (mapping, typical_rate_hz(times)) {
                    mapping.check_rate(recording, actual)?;
                }
                at_rate(times, rate)
            }
        };
        if matches!(space, ActionSpace::Primitives { .. }) && chosen.len() < times.len() {
            return Err(StorageError::PrimitivesThinned {
                path: recording.to_owned(),
            });
        }
        Ok(chosen)
    }
}

/// Every `every`th index up to the last one.
fn every_nth(count: usize, every: usize) -> Vec<usize> {
    let first = count.saturating_sub(1) % every;
    (first..count).step_by(every).collect()
}

/// The first index at or after each tick of a clock of this rate that ends with the last time. Where
/// nothing happens between two ticks they share an index, which is given once.
fn at_rate(times: &[u64], rate_hz: f64) -> Vec<usize> {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Vec::new();
    };
    // Of a clock that hardly ever ticks only the last tick counts, and 0 periods of it must be 0.
    let period = f64::min(1e9 / rate_hz, f64::MAX);
    // A clock of the same rate as the actions must not miss one by a rounding error, nor take one too early.
    let gap = typical_rate_hz(times).map_or(0.0, |hz| 1e9 / hz);
    let slack = f64::min(0.05 * period, 0.25 * gap);
    let span = last.saturating_sub(*first) as f64;
    // No more ticks than actions can matter.
    let mut chosen = Vec::new();
    let mut ticks = ((span + slack) / period).floor();
    while ticks >= 0.0 {
        let tick = *last as f64 - ticks * period - slack;
        let index = times.partition_point(|t| (*t as f64) < tick);
        let index = index.min(times.len() - 1);
        if chosen.last() != Some(&index) {
            chosen.push(index);
        }
        // Straight to the first tick after this action: a gap of an hour is no loop of an hour.
        let after = ((*last as f64 - times[index] as f64 - slack) / period).ceil() - 1.0;
        ticks = (ticks - 1.0).min(after.max(-1.0));
    }
    chosen
}

/// The inverse of the median of what lies between two times.
pub(super) fn typical_rate_hz(times: &[u64]) -> Option<f64> {
    let mut gaps: Vec<u64> = times
        .windows(2)
        .map(|w| w[1].saturating_sub(w[0]))
        .collect();
    gaps.sort_unstable();
    let median = gaps.get(gaps.len() / 2).copied().filter(|g| *g > 0)?;
    Some(1e9 / median as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_action_is_always_kept() {
        assert_eq!(every_nth(10, 3), [0, 3, 6, 9]);
        assert_eq!(every_nth(11, 3), [1, 4, 7, 10]);
        assert_eq!(every_nth(2, 5), [1]);
        assert!(every_nth(0, 5).is_empty());
    }

    #[test]
    fn a_clock_takes_the_first_action_at_or_after_each_tick() {
        let at_30_hz: Vec<u64> = (0..31).map(|i| i * 33_333_333).collect();
        assert_eq!(
            at_rate(&at_30_hz, 10.0),
            [0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30]
        );
        assert_eq!(at_rate(&at_30_hz, 30.0).len(), 31);
        for slow in [0.1, 1e-300, f64::MIN_POSITIVE] {
            assert_eq!(at_rate(&at_30_hz, slow), [30], "{slow} Hz");
        }
        // A gap of an hour and a half.
        let with_gap = [0, 100_000_000, 5_400_000_000_000, 5_400_100_000_000];
        assert_eq!(at_rate(&with_gap, 10.0), [0, 1, 2, 3]);
        assert!(at_rate(&[], 5.0).is_empty());
        assert_eq!(at_rate(&[7], 5.0), [0]);
        assert_eq!(at_rate(&[7, 7, 7], 5.0), [0]);
    }

    #[test]
    fn sizes_are_read_and_refused() {
        let size = ImageSize {
            height: 90,
            width: 160,
        };
        assert_eq!("90x160".parse(), Ok(size));
        assert_eq!(size.to_string(), "90x160");
        for wrong in ["90", "0x5", "5x", "axb", "9000x9000", "1x2x3", "-1x4"] {
            assert!(wrong.parse::<ImageSize>().unwrap_err().contains("90x160"));
        }
    }
}
