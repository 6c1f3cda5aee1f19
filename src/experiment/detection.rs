use std::fmt;

use serde::{Deserialize, Serialize};

use crate::wording::counted;

/// A flag may come so many steps before the truth says that the shortcut is complete: images show a
/// hand closing around a can before the can counts as grasped.
const EARLY_STEPS: usize = 5;

/// How well the monitor noticed shortcuts, judged by the simulator's truth: one decision an episode, its
/// first flag against its first true shortcut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShortcutDetection {
    /// Episodes in which a subgoal was reached before an earlier one.
    pub shortcuts: usize,
    /// Episodes in which the monitor flagged a shortcut.
    pub flagged: usize,
    /// Episodes in which it did so rightly: not more than five steps before there was one.
    pub rightly_flagged: usize,
    /// Share of the flags that are right; none where nothing was flagged.
    pub precision: Option<f64>,
    /// Share of the shortcuts that were rightly flagged; none where there was no shortcut.
    pub recall: Option<f64>,
    /// Steps from the shortcut to its flag at the median, the upper one of an even number; negative where the flag came
    /// first.
    pub median_delay_steps: Option<i64>,
}

impl ShortcutDetection {
    /// Counts over episodes: the step of the first true shortcut, and that of the first flag.
    #[must_use]
    pub fn new(episodes: impl IntoIterator<Item = (Option<usize>, Option<usize>)>) -> Self {
        let (mut shortcuts, mut flagged) = (0, 0);
        let mut delays = Vec::new();
        for (truth, flag) in episodes {
            shortcuts += usize::from(truth.is_some());
            flagged += usize::from(flag.is_some());
            if let (Some(truth), Some(flag)) = (truth, flag)
                && flag + EARLY_STEPS >= truth
            {
                delays.push(flag as i64 - truth as i64);
            }
        }
        delays.sort_unstable();
        let share = |of: usize| (of > 0).then(|| delays.len() as f64 / of as f64);
        Self {
            shortcuts,
            flagged,
            rightly_flagged: delays.len(),
            precision: share(flagged),
            recall: share(shortcuts),
            median_delay_steps: delays.get(delays.len() / 2).copied(),
        }
    }
}

impl fmt::Display for ShortcutDetection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "shortcuts in {}, flagged in {}, rightly in {}",
            counted(self.shortcuts, "episode"),
            self.flagged,
            self.rightly_flagged
        )?;
        match self.median_delay_steps {
            Some(steps) => write!(f, ", {steps} steps late at the median"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_by_hand() {
        let episodes = [
            (Some(50), Some(52)),
            (Some(50), Some(47)),
            (Some(50), Some(20)),
            (Some(50), None),
            (None, Some(30)),
            (None, None),
        ];
        let found = ShortcutDetection::new(episodes);
        assert_eq!((found.shortcuts, found.flagged), (4, 4));
        assert_eq!(found.rightly_flagged, 2);
        assert_eq!((found.precision, found.recall), (Some(0.5), Some(0.5)));
        assert_eq!(found.median_delay_steps, Some(2));
        let nothing = ShortcutDetection::new([(None, None)]);
        assert_eq!((nothing.precision, nothing.recall), (None, None));
    }
}
