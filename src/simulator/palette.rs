//! Colours and textures of the furniture, the objects and the robot.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::render::{Material, Texture};

/// Surfaces of everything that physics knows, and loose clutter.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette {
    /// Dresser.
    pub cabinet: Material,
    /// Drawer's front.
    pub drawer_front: Material,
    /// Drawer's inside.
    pub drawer_inside: Material,
    /// Drawer's handle.
    pub handle: Material,
    /// Shelf's board.
    pub shelf: Material,
    /// High chest.
    pub chest: Material,
    /// Night stand.
    pub night_stand: Material,
    /// Waste bin.
    pub bin: Material,
    /// Container box.
    pub container: Material,
    /// Sock.
    pub sock: Material,
    /// Can.
    pub can: Material,
    /// Tissue.
    pub tissue: Material,
    /// Wine.
    pub spill: Material,
    /// Robot's body.
    pub robot: Material,
    /// Robot's fingers.
    pub finger: Material,
    /// Loose pieces on the floor along the walls, where the robot does not drive.
    pub clutter: Vec<Clutter>,
}

/// A box that stands in the way of nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clutter {
    /// Its middle on the plan, x and y.
    pub place_m: [f32; 2],
    /// Half of its width and depth.
    pub half_m: f32,
    /// Its height.
    pub height_m: f32,
    /// Its surface.
    pub material: Material,
}

const CLUTTER_PLACES_M: [[f32; 2]; 6] = [
    [1.3, 1.15],
    [0.9, 1.2],
    [1.3, -1.1],
    [-1.3, 1.2],
    [-0.8, 1.25],
    [1.0, -1.15],
];

const fn surface(texture: Texture, tint: [f32; 3], scale: f32, specular: f32) -> Material {
    Material {
        texture,
        tint,
        scale,
        specular,
        emission: 0.0,
    }
}

impl Default for Palette {
    /// The room of level `paper`.
    fn default() -> Self {
        use Texture::{Checks, Fabric, Knit, Label, Plain, Stripes, Wood};
        Self {
            cabinet: surface(Wood, [0.62, 0.42, 0.24], 2.0, 0.1),
            drawer_front: surface(Wood, [0.80, 0.62, 0.40], 2.5, 0.1),
            drawer_inside: surface(Plain, [0.75, 0.70, 0.60], 1.0, 0.0),
            handle: surface(Plain, [0.08, 0.08, 0.10], 1.0, 0.5),
            shelf: surface(Wood, [0.88, 0.86, 0.80], 2.0, 0.1),
            chest: surface(Wood, [0.28, 0.20, 0.16], 2.0, 0.2),
            night_stand: surface(Wood, [0.16, 0.34, 0.36], 2.0, 0.1),
            bin: surface(Stripes, [0.12, 0.30, 0.60], 8.0, 0.2),
            container: surface(Checks, [0.85, 0.50, 0.10], 8.0, 0.0),
            sock: surface(Knit, [0.80, 0.10, 0.12], 20.0, 0.0),
            can: surface(Label, [0.10, 0.55, 0.20], 1.0, 0.6),
            tissue: surface(Fabric, [0.95, 0.95, 0.97], 12.0, 0.0),
            spill: surface(Plain, [0.40, 0.01, 0.06], 1.0, 0.7),
            robot: surface(Plain, [0.16, 0.17, 0.20], 1.0, 0.2),
            finger: surface(Plain, [0.55, 0.57, 0.62], 1.0, 0.3),
            clutter: Vec::new(),
        }
    }
}

impl Palette {
    /// Other colours, textures and clutter, by lot.
    #[must_use]
    pub fn drawn(rng: &mut ChaCha8Rng) -> Self {
        let mut palette = Self::default();
        {
            let p = &mut palette;
            for material in [
                &mut p.cabinet,
                &mut p.drawer_front,
                &mut p.shelf,
                &mut p.chest,
                &mut p.night_stand,
                &mut p.bin,
                &mut p.container,
                &mut p.sock,
                &mut p.can,
            ] {
                *material = drawn_surface(rng, material.specular);
            }
        }
        for place_m in CLUTTER_PLACES_M {
            if rng.random_bool(0.6) {
                palette.clutter.push(Clutter {
                    place_m,
                    half_m: rng.random_range(0.04..0.12),
                    height_m: rng.random_range(0.08..0.45),
                    material: drawn_surface(rng, 0.1),
                });
            }
        }
        palette
    }
}

fn drawn_surface(rng: &mut ChaCha8Rng, specular: f32) -> Material {
    const TEXTURES: [Texture; 6] = [
        Texture::Plain,
        Texture::Wood,
        Texture::Fabric,
        Texture::Checks,
        Texture::Stripes,
        Texture::Knit,
    ];
    let texture = TEXTURES[rng.random_range(0..TEXTURES.len())];
    let tint = [0; 3].map(|_| rng.random_range(0.05..0.9_f32));
    surface(texture, tint, rng.random_range(2.0..10.0), specular)
}
