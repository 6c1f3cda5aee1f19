//! What changes from one episode to the next, and how it is drawn from a seed.

use std::f32::consts::PI;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::layout::{Layout, StartPose};
use super::palette::Palette;
use super::ranges::WrittenVariation;

// The drawer, the shelf and the chest leave the objects less room in depth than in width.
/// Farthest that the sock may lie from its place in the drawer, along x and along y.
const SOCK_ROOM_M: f32 = 0.04;
/// The same of the can on the shelf.
const CAN_ROOM_M: f32 = 0.05;
/// The same of the tissue on the night stand, which has most room.
pub(super) const TISSUE_ROOM_M: f32 = 0.06;
/// The same of the spill on the chest.
const SPILL_ROOM_M: f32 = 0.05;

/// A task of the bedroom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BedroomTask {
    /// Sock out of the drawer into the container box.
    Sock,
    /// Can from the shelf into the waste bin.
    Trash,
    /// Tissue onto the wine spill.
    Wine,
}

impl BedroomTask {
    /// All tasks, in the order in which they chain.
    pub const ALL: [Self; 3] = [Self::Sock, Self::Trash, Self::Wine];

    /// The task's name, as in files and compositions.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sock => "sock",
            Self::Trash => "trash",
            Self::Wine => "wine",
        }
    }

    /// The task of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }

    /// Names of the task's subgoals in the order in which they are reached.
    #[must_use]
    pub const fn subgoals(self) -> &'static [&'static str] {
        match self {
            Self::Sock => &["drawer_open", "sock_grasped", "sock_in_box"],
            Self::Trash => &["can_grasped", "can_in_bin"],
            Self::Wine => &["tissue_grasped", "spill_covered"],
        }
    }
}

/// How much one episode differs from the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// One real room with objects put back by hand, as in the paper.
    #[default]
    Paper,
    /// Twice the ranges of start, heading and light; objects as far from their places as each of them
    /// can lie, which is the same for the sock and up to half as far again for the others; colours,
    /// textures and clutter drawn anew for each episode.
    Hard,
}

/// Ranges that an episode is drawn from; each but `object_position_m` is the largest deviation to either
/// side.
///
/// They are at most those of [`MOST`](Self::MOST), as [`check`](Self::check) says. One that is read is
/// checked, and what is not written of it is as at level `paper`; that of a
/// [`BedroomConfig`](super::BedroomConfig) as at its level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenVariation")]
pub struct Variation {
    /// Robot's start along x and along y, metres.
    pub start_position_m: f32,
    /// Robot's heading at the start, degrees.
    pub start_heading_deg: f32,
    /// Places of sock, can, tissue and spill, along x and along y, metres. It is the largest deviation of
    /// those that have so much room: the sock deviates by 0.04 at most, can and spill by 0.05, the
    /// tissue by 0.06.
    pub object_position_m: f32,
    /// Strength of the light, as a part of the nominal one.
    pub light: f32,
    /// Largest noise of a pixel's channel, in levels of 0..=255.
    pub noise_levels: f32,
    /// Whether colours, textures and clutter are drawn anew.
    pub appearance: bool,
}

impl Variation {
    /// Every episode the same but for the turns of sock, can and tissue, which are always drawn (and for
    /// what the other tasks leave, where that is [`Varied`](Leftovers::Varied)); without noise.
    pub const NONE: Self = Self {
        start_position_m: 0.0,
        start_heading_deg: 0.0,
        object_position_m: 0.0,
        light: 0.0,
        noise_levels: 0.0,
        appearance: false,
    };
}

impl Level {
    /// The ranges of this level.
    #[must_use]
    pub const fn variation(self) -> Variation {
        match self {
            Self::Paper => Variation {
                start_position_m: 0.15,
                start_heading_deg: 15.0,
                object_position_m: 0.04,
                light: 0.2,
                noise_levels: 6.0,
                appearance: false,
            },
            Self::Hard => Variation {
                start_position_m: 0.30,
                start_heading_deg: 30.0,
                object_position_m: TISSUE_ROOM_M,
                light: 0.4,
                noise_levels: 6.0,
                appearance: true,
            },
        }
    }
}

/// In which state a task that is not being done finds its objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Leftovers {
    /// At their own starts.
    #[default]
    AtStart,
    /// At their starts or as the other tasks leave them, by lot: what a chain of tasks meets.
    Varied,
}

/// One episode's arrangement, as drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrangement {
    /// Where the robot starts.
    pub start: StartPose,
    /// Where the sock lies: offset from the middle of the drawer, or a place in the container box.
    pub sock: SockPlace,
    /// How far the drawer is open.
    pub drawer_opening_m: f32,
    /// Where the can stands; `None` is in the waste bin.
    pub can_m: Option<[f32; 2]>,
    /// Where the tissue lies; `None` is on the spill.
    pub tissue_m: Option<[f32; 2]>,
    /// Where the spill is.
    pub spill_m: [f32; 2],
    /// Turn of the sock, the can and the tissue.
    pub yaws_rad: [f32; 3],
    /// Strengths of sun, surrounding light and light at the camera.
    pub light: [f32; 3],
    /// Largest noise of a pixel's channel, in levels.
    pub noise_levels: f32,
    /// Colours and textures.
    pub palette: Palette,
    /// Seed of what else is drawn during the episode.
    pub noise_seed: u64,
}

/// Where the sock starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SockPlace {
    /// In the drawer, at an offset from its middle.
    Drawer([f32; 2]),
    /// In the container box.
    Container,
}

impl Variation {
    /// Draws an arrangement; the same arguments give the same one. The ranges are not checked.
    #[must_use]
    pub fn arrangement(
        &self,
        layout: &Layout,
        task: BedroomTask,
        leftovers: Leftovers,
        seed: u64,
    ) -> Arrangement {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut around = |place: [f32; 2], reach: f32| {
            place.map(|p| p + reach * rng.random_range(-1.0..=1.0_f32))
        };
        let nominal = match task {
            BedroomTask::Trash => layout.start_at_container,
            BedroomTask::Sock | BedroomTask::Wine => layout.start_at_bin,
        };
        let object = self.object_position_m;
        let position_m = around(nominal.position_m, self.start_position_m);
        let sock = around(layout.sock_offset_m, object.min(SOCK_ROOM_M));
        let can = around(layout.can_m, object.min(CAN_ROOM_M));
        let tissue = around(layout.tissue_m, object.min(TISSUE_ROOM_M));
        let spill_m = around(layout.spill_m, object.min(SPILL_ROOM_M));
        let heading = self.start_heading_deg.to_radians();
        let heading_rad = nominal.heading_rad + heading * rng.random_range(-1.0..=1.0_f32);
        let yaws_rad = [0; 3].map(|_| rng.random_range(-PI..=PI));
        let light = [0; 3].map(|_| 1.0 + self.light * rng.random_range(-1.0..=1.0_f32));
        let left = [0; 4].map(|_| rng.random_bool(0.5));
        let opening: f32 = rng.random_range(0.20..=0.30);
        let varied = leftovers == Leftovers::Varied;
        let sock_done = varied && task != BedroomTask::Sock && left[0];
        let drawer_left = varied && task != BedroomTask::Sock && (sock_done || left[1]);
        Arrangement {
            start: StartPose {
                position_m,
                heading_rad,
            },
            sock: if sock_done {
                SockPlace::Container
            } else {
                SockPlace::Drawer(sock)
            },
            drawer_opening_m: if drawer_left { opening } else { 0.0 },
            can_m: (!(varied && task != BedroomTask::Trash && left[2])).then_some(can),
            tissue_m: (!(varied && task != BedroomTask::Wine && left[3])).then_some(tissue),
            spill_m,
            yaws_rad,
            light,
            noise_levels: self.noise_levels,
            palette: if self.appearance {
                Palette::drawn(&mut rng)
            } else {
                Palette::default()
            },
            noise_seed: rng.random(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::ranges::VariationError;

    #[test]
    fn seed_decides_the_arrangement_and_the_ranges_hold() {
        let layout = Layout::bedroom();
        let variation = Level::Paper.variation();
        let draw =
            |seed| variation.arrangement(&layout, BedroomTask::Wine, Leftovers::Varied, seed);
        assert_eq!(draw(4), draw(4));
        assert_ne!(draw(4), draw(5));
        let (mut drawers_left_open, mut cans_gone) = (0, 0);
        for drawn in (0..40).map(draw) {
            let start = drawn.start;
            let off = start.position_m[0] - layout.start_at_bin.position_m[0];
            let turned = start.heading_rad - layout.start_at_bin.heading_rad;
            assert!(off.abs() <= 0.15 && turned.abs() <= 15.1_f32.to_radians());
            assert!(
                drawn.tissue_m.is_some(),
                "the task's own tissue is at its start"
            );
            drawers_left_open += usize::from(drawn.drawer_opening_m > 0.0);
            cans_gone += usize::from(drawn.can_m.is_none());
        }
        assert!((5..40).contains(&drawers_left_open) && (5..35).contains(&cans_gone));
    }

    #[test]
    fn without_variation_all_episodes_are_the_same_but_for_yaws() {
        let layout = Layout::bedroom();
        let draw = |seed| {
            let none = Variation::NONE;
            none.arrangement(&layout, BedroomTask::Trash, Leftovers::AtStart, seed)
        };
        let (one, other) = (draw(1), draw(2));
        assert_eq!((one.start, one.can_m), (other.start, other.can_m));
        assert_eq!(one.start, layout.start_at_container);
        assert_eq!(one.light, [1.0; 3]);
    }

    #[test]
    fn objects_lie_at_level_hard_as_far_off_as_they_have_room_and_no_range_is_larger() {
        let layout = Layout::bedroom();
        let hard = Level::Hard.variation();
        // What the level said before the ranges were checked: the same episodes come of it.
        let beyond = Variation {
            object_position_m: 0.08,
            ..hard
        };
        let mut farthest = [0.0_f32; 4];
        for seed in 0..200 {
            let draw = |variation: &Variation| {
                variation.arrangement(&layout, BedroomTask::Sock, Leftovers::AtStart, seed)
            };
            let drawn = draw(&hard);
            assert_eq!(drawn, draw(&beyond));
            let SockPlace::Drawer(sock) = drawn.sock else {
                panic!("the task's own sock is in the drawer")
            };
            let can = drawn.can_m.expect("it stands on the shelf");
            let tissue = drawn.tissue_m.expect("it lies on the night stand");
            let offs = [
                sock[0] - layout.sock_offset_m[0],
                can[0] - layout.can_m[0],
                tissue[0] - layout.tissue_m[0],
                drawn.spill_m[0] - layout.spill_m[0],
            ];
            for (most, off) in farthest.iter_mut().zip(offs) {
                *most = most.max(off.abs());
            }
        }
        let rooms = [SOCK_ROOM_M, CAN_ROOM_M, TISSUE_ROOM_M, SPILL_ROOM_M];
        for (off, room) in farthest.into_iter().zip(rooms) {
            assert!(off > 0.9 * room && off < room + 1e-6, "{off} of {room}");
            assert!(room <= hard.object_position_m);
        }
        assert_eq!(hard.object_position_m, Variation::MOST.object_position_m);
    }

    #[test]
    fn ranges_without_a_possible_world_are_refused_with_key_value_and_limits() {
        for level in [Level::Paper, Level::Hard] {
            assert_eq!(level.variation().check(), Ok(()));
        }
        for sound in [Variation::NONE, Variation::MOST] {
            assert_eq!(sound.check(), Ok(()));
        }
        let told = |variation: Variation| variation.check().unwrap_err().to_string();
        let outside = Variation {
            start_position_m: 3.0,
            ..Variation::NONE
        };
        assert_eq!(
            told(outside),
            "`start_position_m` is 3, out of range: choose a number within 0..=0.3"
        );
        let no_strength = Variation {
            light: f32::INFINITY,
            ..Variation::NONE
        };
        assert!(told(no_strength).starts_with("`light` is inf, out of range"));
        let no_number = Variation {
            start_heading_deg: f32::NAN,
            ..Variation::NONE
        };
        assert!(told(no_number).starts_with("`start_heading_deg` is NaN"));
        let below_none = Variation {
            noise_levels: -1.0,
            ..Variation::NONE
        };
        assert!(told(below_none).ends_with("within 0..=255"));
        let cut_before = Variation {
            object_position_m: 0.08,
            ..Variation::NONE
        };
        assert_eq!(
            cut_before.check(),
            Err(VariationError {
                key: "object_position_m",
                value: 0.08,
                most: 0.06,
            })
        );
    }

    #[test]
    fn a_variation_is_checked_when_it_is_read_and_may_be_written_in_part() {
        let read = |text: &str| serde_json::from_str::<Variation>(text);
        let brighter = Variation {
            light: 0.3,
            ..Level::Paper.variation()
        };
        assert_eq!(read(r#"{"light": 0.3}"#).expect("it is possible"), brighter);
        let whole = serde_json::to_string(&Variation::MOST).expect("it is data");
        assert_eq!(read(&whole).expect("it is possible"), Variation::MOST);
        let fault = read(r#"{"light": 99}"#).unwrap_err().to_string();
        assert!(fault.starts_with("`light` is 99, out of range"), "{fault}");
        assert!(read(r#"{"light": 1e39}"#).is_err());
        assert!(read(r#"{"lihgt": 0.1}"#).is_err());
    }
}
