use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::model::ActionDistribution;
use crate::task::GripperSignal;
use crate::trajectory::{Action, ActionSpace, Image, Observation};

/// Keeps a robot from trying what just had no effect: an arm at its limit, a base against furniture.
///
/// Known from images and actions alone: as long as the cameras show the same, the classes that were
/// tried are ruled out.
#[derive(Clone, Debug, Default)]
pub(super) struct Reflex {
    ruled_out: Vec<Vec<usize>>,
    /// What had no effect lately, and how many steps ago.
    recent: Vec<(usize, u32)>,
    /// For each class of a space of primitives, the one that undoes it.
    opposites: Vec<Option<usize>>,
    /// For each class, the one of the base that moves the hand the same way.
    by_base: Vec<Option<usize>>,
    /// The classes that close and open the gripper.
    gripper: Vec<usize>,
    /// The class that ends an episode: no substitute for another one.
    end: Option<usize>,
    /// What had an effect, in order, what was undone taken off.
    done: Vec<usize>,
    /// Steps without effect since the robot last came nearer to its goal.
    blocked_steps: usize,
    /// Steps of a retreat that are left.
    retreat_steps: usize,
    /// Whether the last action was one of a retreat.
    is_retreating: bool,
}

/// How far a robot retreats, in actions that had an effect.
const RETREAT_STEPS: usize = 12;
/// Steps for which it is remembered that a class had no effect.
const MEMORY_STEPS: u32 = 8;

impl Reflex {
    pub(super) fn new(space: &ActionSpace) -> Self {
        Self {
            opposites: space.opposites(),
            by_base: space.by_base(),
            gripper: GripperSignal::default().classes(space),
            end: match space.terminate() {
                Some(Action::Primitive(class)) => Some(class),
                _ => None,
            },
            ..Self::default()
        }
    }

    /// Notes what `tried` did, and says whether it did anything: nothing, if in no image as much changed as
    /// `stillness` says. To close or open the gripper changes less than to move, so any change will do.
    pub(super) fn note(
        &mut self,
        tried: &[usize],
        before: &Observation,
        after: &Observation,
        stillness: Stillness,
    ) -> bool {
        for (_, age) in &mut self.recent {
            *age += 1;
        }
        self.recent.retain(|(_, age)| *age <= MEMORY_STEPS);
        let share = changed_share(before, after, stillness.levels);
        let is_gripper = matches!(tried, [class] if self.gripper.contains(class));
        let has_moved = share > 0.0 && (is_gripper || share >= stillness.share);
        if has_moved {
            self.ruled_out.clear();
            if let ([class], false) = (tried, self.is_retreating) {
                self.done.push(*class);
            }
        } else {
            self.ruled_out.push(tried.to_vec());
            self.recent.extend(tried.first().map(|class| (*class, 0)));
            self.blocked_steps += 1;
            self.retreat_steps = 0;
        }
        self.is_retreating = false;
        has_moved
    }

    /// The robot came nearer to its goal.
    pub(super) fn note_progress(&mut self) {
        self.blocked_steps = 0;
    }

    /// The next step of a retreat: where so many steps had no effect that the robot has driven itself into
    /// a corner, such as beside what it wanted to grasp with its arm at the limit, it undoes the way that
    /// led there and tries again. What the gripper did stays.
    pub(super) fn retreat(&mut self, patience_steps: usize) -> Option<Vec<usize>> {
        if self.blocked_steps >= patience_steps {
            self.blocked_steps = 0;
            self.retreat_steps = RETREAT_STEPS;
        }
        while self.retreat_steps > 0 {
            let Some(last) = self.done.pop() else {
                self.retreat_steps = 0;
                break;
            };
            let undo = self.opposites.get(last).copied().flatten();
            let Some(undo) = undo.filter(|_| !self.gripper.contains(&last)) else {
                continue;
            };
            self.retreat_steps -= 1;
            self.is_retreating = true;
            return Some(vec![undo]);
        }
        None
    }

    /// The most probable classes that are not ruled out; the most probable ones if nothing is left.
    /// Where all that is left is less probable than `least_substitute`, what undoes the one that had no
    /// effect: a hand that is stopped on its way is in the wrong place, and the next best class, such as
    /// closing the gripper there, is a guess. Before that the base is tried, where it moves the hand the same
    /// way: an arm that is stretched out gets no further, a base does. Where what is wanted had no effect
    /// lately either, undoing it did not help, and would not end: then the next best class after all, but
    /// never the gripper on a guess.
    ///
    /// Only spaces with one head (primitives) have something ruled out: with several, the most
    /// probable classes always stand.
    pub(super) fn choose(
        &self,
        distribution: &ActionDistribution,
        least_substitute: f32,
    ) -> Vec<usize> {
        let best = distribution.most_probable();
        let ([head], [wanted]) = (&distribution.heads[..], &best[..]) else {
            return best;
        };
        let most_probable = |skipped: &dyn Fn(usize) -> bool| {
            self.allowed(head.len(), *wanted)
                .filter(|class| !skipped(*class))
                .max_by(|a, b| head[*a].total_cmp(&head[*b]).then(b.cmp(a)))
        };
        let Some(substitute) = most_probable(&|_| false) else {
            return best;
        };
        if substitute == *wanted || head[substitute] >= least_substitute {
            return vec![substitute];
        }
        if let Some(drive) = self.driven(*wanted) {
            return vec![drive];
        }
        let undoes = self.opposites.get(*wanted).copied().flatten();
        let is_undoing = |class: usize| Some(class) == undoes;
        let again = self.recent.iter().filter(|(c, _)| c == wanted).count() > 1;
        let instead = if again {
            most_probable(&|class| is_undoing(class) || self.gripper.contains(&class))
        } else {
            most_probable(&|class| !is_undoing(class))
        };
        vec![instead.unwrap_or(substitute)]
    }

    /// Classes drawn by their probabilities, with what is ruled out left out: a robot that does the
    /// same again and again gets out of it by doing something else that is not improbable.
    pub(super) fn draw(
        &self,
        distribution: &ActionDistribution,
        rng: &mut ChaCha8Rng,
    ) -> Vec<usize> {
        let [head] = &distribution.heads[..] else {
            return distribution.most_probable();
        };
        let [wanted] = distribution.most_probable()[..] else {
            return distribution.most_probable();
        };
        if let Some(drive) = self.driven(wanted) {
            return vec![drive];
        }
        let allowed = || self.allowed(head.len(), wanted);
        let total: f32 = allowed().map(|class| head[class]).sum();
        let mut lot = rng.random_range(0.0..=1.0_f32) * total;
        allowed()
            .find(|class| {
                lot -= head[*class];
                lot <= 0.0
            })
            .map_or_else(|| self.choose(distribution, 0.0), |class| vec![class])
    }

    /// What the base does instead, where the arm is at its limit: the class of the base that moves the hand as
    /// one would that had no effect, if it has not been without effect itself lately.
    fn driven(&self, wanted: usize) -> Option<usize> {
        if !self.is_ruled_out(wanted) {
            return None;
        }
        let drive = self.by_base.get(wanted).copied().flatten()?;
        let is_tried = self.recent.iter().any(|(class, _)| *class == drive);
        (!is_tried && !self.is_ruled_out(drive)).then_some(drive)
    }

    pub(super) fn is_ruled_out(&self, class: usize) -> bool {
        self.ruled_out.iter().any(|r| r[..] == [class])
    }

    /// The classes that are not ruled out; the one that ends an episode only where it is wanted.
    fn allowed(&self, classes: usize, wanted: usize) -> impl Iterator<Item = usize> {
        let ends = self.end.filter(|end| *end != wanted);
        (0..classes).filter(move |class| Some(*class) != ends && !self.is_ruled_out(*class))
    }
}

/// Side of the squares whose mean values are compared, in pixels: large enough for camera noise to
/// average out, small enough for a finger to show.
const SQUARE_PIXELS: usize = 10;

/// When nothing moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stillness {
    /// Change of the mean value of a square of pixels that counts, in any channel.
    pub(super) levels: f32,
    /// Share of a camera's squares that change when the robot moves. A thing that sways between the fingers of a
    /// robot that is stopped changes fewer.
    pub(super) share: f32,
}

/// The largest share of the squares of one camera whose mean value changed by so many levels, in any channel.
fn changed_share(before: &Observation, after: &Observation, levels: f32) -> f32 {
    let of_camera = |(camera, old): (&str, &Image)| {
        let new = after.image(camera).ok()?;
        let (old, new): (Vec<_>, Vec<_>) =
            (square_means(old).collect(), square_means(new).collect());
        let is_changed = |(a, b): &(&[f32; 3], &[f32; 3])| {
            a.iter().zip(*b).any(|(a, b)| (a - b).abs() >= levels)
        };
        let changed = old.iter().zip(&new).filter(is_changed).count();
        Some(changed as f32 / old.len().max(1) as f32)
    };
    before.iter().filter_map(of_camera).fold(0.0, f32::max)
}

/// Mean value of each channel of each square, row by row; squares at the far edges may be smaller.
fn square_means(image: &Image) -> impl Iterator<Item = [f32; 3]> {
    let (height, width) = (image.height() as usize, image.width() as usize);
    let columns = width.div_ceil(SQUARE_PIXELS);
    let mut squares = vec![([0_u32; 3], 0_u32); columns * height.div_ceil(SQUARE_PIXELS)];
    for (y, row) in image.rgb().chunks_exact(3 * width.max(1)).enumerate() {
        let squares = &mut squares[y / SQUARE_PIXELS * columns..][..columns];
        for ((sums, count), pixels) in squares.iter_mut().zip(row.chunks(3 * SQUARE_PIXELS)) {
            for rgb in pixels.chunks_exact(3) {
                for (sum, value) in sums.iter_mut().zip(rgb) {
                    *sum += u32::from(*value);
                }
                *count += 1;
            }
        }
    }
    squares.into_iter().map(|(sums, count)| {
        let count = count.max(1) as f32;
        sums.map(|sum| sum as f32 / count)
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    const STILL: Stillness = Stillness {
        levels: 2.0,
        share: 0.17,
    };

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
        assert_eq!(reflex.choose(&policy, 0.0), [1]);
        reflex.note(&[1], &grey(10), &grey(11), STILL);
        assert_eq!(reflex.choose(&policy, 0.0), [2]);
        reflex.note(&[2], &grey(11), &grey(11), STILL);
        assert_eq!(reflex.choose(&policy, 0.0), [0]);
        reflex.note(&[0], &grey(11), &grey(11), STILL);
        assert_eq!(
            reflex.choose(&policy, 0.0),
            [1],
            "nothing is left: try again"
        );
        reflex.note(&[1], &grey(11), &grey(90), STILL);
        assert_eq!(reflex.choose(&policy, 0.0), [1]);
    }

    #[test]
    fn an_improbable_substitute_gives_way_to_what_undoes_the_blocked_class() {
        let names = ["hand_down", "gripper_close", "hand_up"].map(str::to_owned);
        let mut reflex = Reflex::new(&ActionSpace::Primitives {
            names: names.to_vec(),
        });
        let policy = |close: f32| ActionDistribution {
            heads: vec![vec![0.6, close, 0.4 - close]],
        };
        assert_eq!(reflex.choose(&policy(0.2), 0.25), [0]);
        reflex.note(&[0], &grey(10), &grey(10), STILL);
        assert_eq!(reflex.choose(&policy(0.3), 0.25), [1]);
        assert_eq!(reflex.choose(&policy(0.2), 0.25), [2]);
        reflex.note(&[2], &grey(10), &grey(10), STILL);
        assert_eq!(reflex.choose(&policy(0.2), 0.25), [1], "up is blocked too");
    }

    #[test]
    fn a_robot_in_a_corner_undoes_the_way_that_led_there() {
        let names = ["hand_left", "hand_right", "gripper_close", "gripper_open"];
        let mut reflex = Reflex::new(&ActionSpace::Primitives {
            names: names.map(str::to_owned).to_vec(),
        });
        let mut level = 0;
        let mut moves = |reflex: &mut Reflex, class: usize, has_effect: bool| {
            let before = grey(level);
            level = level.wrapping_add(if has_effect { 50 } else { 0 });
            reflex.note(&[class], &before, &grey(level), STILL);
        };
        for class in [0, 0, 2, 1] {
            moves(&mut reflex, class, true);
        }
        for _ in 0..3 {
            assert_eq!(reflex.retreat(3), None);
            moves(&mut reflex, 1, false);
        }
        let mut undone = Vec::new();
        while let Some(classes) = reflex.retreat(3) {
            moves(&mut reflex, classes[0], true);
            undone.extend(classes);
        }
        assert_eq!(undone, [0, 1, 1], "the last first, and the gripper stays");
        reflex.note_progress();
        assert_eq!(reflex.retreat(3), None);
    }

    #[test]
    fn where_the_arm_is_at_its_limit_the_base_drives() {
        let names = [
            "end_effector_forward",
            "end_effector_backward",
            "base_forward",
        ];
        let mut reflex = Reflex::new(&ActionSpace::Primitives {
            names: names.map(str::to_owned).to_vec(),
        });
        let policy = ActionDistribution {
            heads: vec![vec![0.9, 0.06, 0.04]],
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert_eq!(reflex.choose(&policy, 0.25), [0]);
        reflex.note(&[0], &grey(10), &grey(10), STILL);
        assert_eq!(reflex.choose(&policy, 0.25), [2]);
        assert_eq!(
            reflex.draw(&policy, &mut rng),
            [2],
            "nor is it left to chance"
        );
        reflex.note(&[2], &grey(10), &grey(10), STILL);
        assert_eq!(reflex.choose(&policy, 0.25), [1], "the base is stopped too");
    }

    #[test]
    fn what_is_blocked_again_is_not_undone_again() {
        let names = [
            "hand_up",
            "hand_down",
            "gripper_open",
            "gripper_close",
            "back",
        ];
        let mut reflex = Reflex::new(&ActionSpace::Primitives {
            names: names.map(str::to_owned).to_vec(),
        });
        let policy = ActionDistribution {
            heads: vec![vec![0.8, 0.02, 0.1, 0.03, 0.05]],
        };
        let mut chosen = Vec::new();
        let mut height = 2;
        for _ in 0..6 {
            let class = reflex.choose(&policy, 0.25)[0];
            chosen.push(names[class]);
            let before = grey(10 * height);
            height = match class {
                0 => (height + 1).min(3),
                1 => height - 1,
                _ => 9,
            };
            reflex.note(&[class], &before, &grey(10 * height), STILL);
        }
        assert_eq!(
            chosen[..5],
            ["hand_up", "hand_up", "hand_down", "hand_up", "hand_up"]
        );
        assert_eq!(chosen[5], "back", "not down once more, nor the gripper");
    }

    #[test]
    fn an_episode_is_not_ended_for_want_of_something_better() {
        let names = ["ahead", "terminate", "aside"].map(str::to_owned);
        let mut reflex = Reflex::new(&ActionSpace::Primitives {
            names: names.to_vec(),
        });
        let wants_ahead = ActionDistribution {
            heads: vec![vec![0.7, 0.2, 0.1]],
        };
        reflex.note(&[0], &grey(10), &grey(10), STILL);
        assert_eq!(reflex.choose(&wants_ahead, 0.0), [2]);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            assert_eq!(reflex.draw(&wants_ahead, &mut rng), [2]);
        }
        let wants_the_end = ActionDistribution {
            heads: vec![vec![0.1, 0.8, 0.1]],
        };
        assert_eq!(reflex.choose(&wants_the_end, 0.0), [1]);
    }

    #[test]
    fn lots_follow_the_probabilities_and_leave_out_what_is_ruled_out() {
        let policy = ActionDistribution {
            heads: vec![vec![0.2, 0.5, 0.3]],
        };
        let mut reflex = Reflex::default();
        reflex.note(&[1], &grey(10), &grey(10), STILL);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut counts = [0; 3];
        for _ in 0..1000 {
            counts[reflex.draw(&policy, &mut rng)[0]] += 1;
        }
        assert_eq!(counts[1], 0);
        assert!((350..450).contains(&counts[0]), "{counts:?}: 0.2 of 0.5");
    }
}
