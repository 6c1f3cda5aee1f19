//! Procedural patterns with mip maps.

mod pattern;

use std::sync::OnceLock;

use super::Texture;

/// Texels along each side of the finest level.
const SIDE: usize = 128;

/// Levels from `SIDE` texels down to one.
const LEVELS: usize = SIDE.ilog2() as usize + 1;

/// Linear RGB, and how much of a material's tint colours it.
type Texel = [f32; 4];

/// One pattern at all sizes; each level tiles.
#[derive(Debug)]
pub(super) struct Pattern {
    levels: [Vec<Texel>; LEVELS],
}

impl Pattern {
    /// The pattern of a texture; all are made at the first call.
    pub fn of(texture: Texture) -> &'static Self {
        static ALL: OnceLock<[Pattern; 10]> = OnceLock::new();
        &ALL.get_or_init(|| {
            pattern::ALL.map(|paint| {
                let texels = (0..SIDE * SIDE).map(|at| {
                    let centre = |texel: usize| (texel as f32 + 0.5) / SIDE as f32;
                    paint(centre(at % SIDE), centre(at / SIDE))
                });
                Self::new(texels.collect())
            })
        })[texture as usize]
    }

    fn new(finest: Vec<Texel>) -> Self {
        let mut next = finest;
        let levels = std::array::from_fn(|level| {
            let this = std::mem::take(&mut next);
            next = halve(&this, SIDE >> level);
            this
        });
        Self { levels }
    }

    /// The colour at `(u, v)`, in repeats, of a surface with a tint, averaged over about
    /// `footprint` repeats.
    #[inline]
    pub fn colour(&self, u: f32, v: f32, footprint: f32, tint: &[f32; 3]) -> [f32; 3] {
        let texels = footprint * SIDE as f32;
        let level = if texels > 1.0 { texels.log2() } else { 0.0 };
        let level = level.min((LEVELS - 1) as f32);
        let fine = level as usize;
        let share = level - fine as f32;
        let mut texel = self.bilinear(fine, u, v);
        if share > 0.02 {
            let coarse = self.bilinear((fine + 1).min(LEVELS - 1), u, v);
            texel = mix(&texel, &coarse, share);
        }
        let [.., tinted] = texel;
        std::array::from_fn(|channel| texel[channel] * (1.0 + tinted * (tint[channel] - 1.0)))
    }

    #[inline]
    fn bilinear(&self, level: usize, u: f32, v: f32) -> Texel {
        let side = SIDE >> level;
        let texels = &self.levels[level];
        let [(left, right, across), (low, high, along)] = [u, v].map(|at| {
            let at = at * side as f32 - 0.5;
            // Rounding down by hand: `floor` is a call where the processor may be an old one.
            let first = at as i32 - i32::from(at < 0.0);
            let wrap = |texel: i32| texel as usize & (side - 1);
            (wrap(first), wrap(first + 1), at - first as f32)
        });
        let lower = mix(
            &texels[low * side + left],
            &texels[low * side + right],
            across,
        );
        let upper = mix(
            &texels[high * side + left],
            &texels[high * side + right],
            across,
        );
        mix(&lower, &upper, along)
    }
}

fn mix(a: &Texel, b: &Texel, share: f32) -> Texel {
    std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * share)
}

fn halve(texels: &[Texel], side: usize) -> Vec<Texel> {
    let half = side / 2;
    (0..half * half)
        .map(|at| {
            let corner = 2 * (at / half) * side + 2 * (at % half);
            std::array::from_fn(|channel| {
                let sum: f32 = [0, 1, side, side + 1]
                    .iter()
                    .map(|step| texels[corner + step][channel])
                    .sum();
                0.25 * sum
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{LEVELS, Pattern};
    use crate::simulator::render::Texture;

    const ALL: [Texture; 10] = [
        Texture::Plain,
        Texture::Wood,
        Texture::Floor,
        Texture::Fabric,
        Texture::Checks,
        Texture::Stripes,
        Texture::Label,
        Texture::Plaster,
        Texture::Picture,
        Texture::Knit,
    ];

    #[test]
    fn coarser_levels_keep_the_mean_colour() {
        for texture in ALL {
            let pattern = Pattern::of(texture);
            let finest = &pattern.levels[0];
            let [coarsest] = pattern.levels[LEVELS - 1][..] else {
                panic!("one texel remains");
            };
            for channel in 0..4 {
                let sum: f32 = finest.iter().map(|texel| texel[channel]).sum();
                let mean = sum / finest.len() as f32;
                assert!((mean - coarsest[channel]).abs() < 1e-3, "{texture:?}");
            }
        }
    }

    #[test]
    fn patterns_repeat_and_have_no_seam() {
        for texture in ALL {
            let pattern = Pattern::of(texture);
            let colour = |u: f32, v: f32| pattern.colour(u, v, 0.0, &[0.5, 0.4, 0.3]);
            for (u, v) in [(0.3, 0.7), (0.0, 0.5), (0.99, 0.01)] {
                for (here, there) in colour(u, v).into_iter().zip(colour(u - 3.0, v + 2.0)) {
                    assert!((here - there).abs() < 0.02, "{texture:?} at {u}, {v}");
                }
            }
            // Just left and right of the seam lie within a texel.
            for (left, right) in colour(0.9999, 0.4).into_iter().zip(colour(1.0001, 0.4)) {
                assert!((left - right).abs() < 0.1, "{texture:?}");
            }
        }
    }

    #[test]
    fn the_tint_colours_what_is_tinted() {
        let red = [0.8, 0.0, 0.0];
        let [plain, ..] = Pattern::of(Texture::Plain).colour(0.1, 0.2, 0.0, &red);
        assert!((plain - 0.8).abs() < 1e-6);
        let [_, tinted_green, _] = Pattern::of(Texture::Stripes).colour(0.5, 0.5, 0.0, &red);
        let [_, pale_green, _] = Pattern::of(Texture::Stripes).colour(0.0, 0.5, 0.0, &red);
        assert!(tinted_green < 0.01 && pale_green > 0.5);
    }
}
