//! The patterns themselves: functions from `(u, v)` in 0..1 to a texel.
//!
//! All of them repeat, because noise is drawn on a lattice that wraps around.

use super::Texel;

/// Off-white that stays as it is whatever the tint.
const PALE: [f32; 3] = [0.82, 0.80, 0.75];

/// In the order of [`Texture`](super::Texture).
pub(super) const ALL: [fn(f32, f32) -> Texel; 10] = [
    plain, wood, floor, fabric, checks, stripes, label, plaster, picture, knit,
];

fn plain(_: f32, _: f32) -> Texel {
    [1.0; 4]
}

fn wood(u: f32, v: f32) -> Texel {
    let bend = noise(u, v, [2, 3], 11) - 0.5;
    let rings = noise(u, v + 0.05 * bend, [2, 14], 12);
    let grain = noise(u, v, [5, 64], 13);
    let pores = noise(u, v, [24, 128], 14);
    let dark = f32::from(pores > 0.86) * 0.10;
    let tone = 0.66 + 0.34 * smooth(rings) + 0.16 * grain - dark;
    // Darker wood is also redder.
    [
        tone,
        tone * (0.94 + 0.06 * tone),
        tone * (0.86 + 0.12 * tone),
        1.0,
    ]
}

fn floor(u: f32, v: f32) -> Texel {
    const BOARDS: f32 = 8.0;
    let board = (v * BOARDS).floor();
    let within = v * BOARDS - board;
    // One joint a board and repeat, staggered.
    let shift = lattice(board as i32, 0, 21);
    let along = (u + shift).fract();
    let half = f32::from(along < 0.5);
    let tone = lattice(board as i32, half as i32, 22);
    let grain = noise(u, v, [4, 64], 23);
    let cloud = noise(u, v, [6, 24], 24);
    let gap = within < 0.07 || along.min((along - 0.5).abs()) < 0.005;
    let light = if gap {
        0.42
    } else {
        0.74 + 0.22 * tone + 0.12 * grain + 0.08 * cloud
    };
    [
        light,
        light * (0.95 + 0.05 * tone),
        light * (0.90 + 0.08 * tone),
        1.0,
    ]
}

fn fabric(u: f32, v: f32) -> Texel {
    let weave = (std::f32::consts::TAU * 32.0 * u).sin() * (std::f32::consts::TAU * 32.0 * v).sin();
    let yarn = noise(u, v, [64, 64], 31);
    let folds = noise(u, v, [3, 3], 32);
    grey(0.82 + 0.06 * weave + 0.10 * yarn + 0.08 * folds)
}

fn checks(u: f32, v: f32) -> Texel {
    let cloth = 0.90 + 0.10 * noise(u, v, [64, 64], 41);
    let tinted = (u < 0.5) == (v < 0.5);
    two_tone(tinted, cloth)
}

fn stripes(u: f32, v: f32) -> Texel {
    let cloth = 0.88 + 0.12 * noise(u, v, [64, 64], 51);
    two_tone((0.25..0.75).contains(&u), cloth)
}

fn label(u: f32, v: f32) -> Texel {
    let (x, y) = ((u * 2.0).fract() - 0.5, v - 0.52);
    let band = 0.34 + 0.05 * (std::f32::consts::TAU * 2.0 * u).sin();
    let mark = (x * x * 1.6 + y * y * 2.2).sqrt();
    if mark < 0.16 {
        [0.90, 0.62, 0.10, 0.0]
    } else if mark < 0.20 || y.abs() < band - 0.16 {
        [PALE[0], PALE[1], PALE[2], 0.0]
    } else if (y.abs() - band).abs() < 0.015 {
        [0.75, 0.75, 0.75, 0.0]
    } else {
        [1.0; 4]
    }
}

fn plaster(u: f32, v: f32) -> Texel {
    let broad = noise(u, v, [4, 4], 71);
    let fine = noise(u, v, [64, 64], 72);
    grey(0.93 + 0.05 * broad + 0.035 * fine)
}

fn picture(u: f32, v: f32) -> Texel {
    let ridge = |base: f32, height: f32, lattice: [i32; 2], seed: u32| {
        base + height * noise(u, 0.0, lattice, seed)
    };
    let daub = 0.90 + 0.20 * noise(u, v, [24, 24], 81);
    let (x, y) = (u - 0.68, v - 0.74);
    let rgb = if v < ridge(0.12, 0.20, [3, 1], 82) {
        [0.10, 0.22, 0.12]
    } else if v < ridge(0.30, 0.22, [4, 1], 83) {
        [0.20, 0.42, 0.30]
    } else if v < ridge(0.46, 0.24, [5, 1], 84) {
        [0.34, 0.46, 0.62]
    } else if x * x + y * y < 0.011 {
        [1.0, 0.86, 0.50]
    } else {
        let glow = (1.0 - v) * 1.2;
        [0.62 + 0.34 * glow, 0.64 + 0.10 * glow, 0.80 - 0.35 * glow]
    };
    let [red, green, blue] = rgb.map(|value| (value * daub).min(1.0));
    [red, green, blue, 0.8]
}

fn knit(u: f32, v: f32) -> Texel {
    let (columns, rows) = (16.0, 16.0);
    let x = (u * columns).fract() - 0.5;
    // Each stitch is a V: the rows bend towards the middle of a column.
    let y = (v * rows + x.abs()).fract();
    let stitch = 0.62 + 0.30 * (std::f32::consts::PI * y).sin() + 0.12 * (1.0 - 2.0 * x.abs());
    two_tone((v * 4.0).fract() < 0.72, stitch)
}

fn grey(tone: f32) -> Texel {
    [tone, tone, tone, 1.0]
}

fn two_tone(tinted: bool, tone: f32) -> Texel {
    if tinted {
        grey(tone)
    } else {
        let [red, green, blue] = PALE.map(|value| value * tone);
        [red, green, blue, 0.0]
    }
}

/// Smooth noise in 0..=1 on a lattice of so many cells a side, which wraps around.
fn noise(u: f32, v: f32, cells: [i32; 2], seed: u32) -> f32 {
    let [(left, across), (low, along)] = [(u, cells[0]), (v, cells[1])].map(|(at, cells)| {
        let at = at * cells as f32;
        (at.floor() as i32, smooth(at - at.floor()))
    });
    let corner = |right: i32, up: i32| {
        lattice(
            (left + right).rem_euclid(cells[0]),
            (low + up).rem_euclid(cells[1]),
            seed,
        )
    };
    let lower = corner(0, 0) + (corner(1, 0) - corner(0, 0)) * across;
    let upper = corner(0, 1) + (corner(1, 1) - corner(0, 1)) * across;
    lower + (upper - lower) * along
}

fn smooth(share: f32) -> f32 {
    share * share * (3.0 - 2.0 * share)
}

/// A fixed number in 0..=1 for each point of a lattice.
fn lattice(x: i32, y: i32, seed: u32) -> f32 {
    let mut hash = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ seed.wrapping_mul(0xc2b2_ae3d);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297a_2d39);
    ((hash ^ (hash >> 15)) & 0xffff) as f32 / 65535.0
}
