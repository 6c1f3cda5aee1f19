//! What stands in the niches and hangs on the walls.

use std::f32::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::shell::{
    BED_DEPTH_M, BED_FROM_Y_M, BOOKS_DEPTH_M, BOOKS_TO_X_M, DESK_DEPTH_M, DESK_FROM_X_M,
    PLANT_DEPTH_M, PLANT_FROM_X_M,
};
use super::{Material, Room, Shape, Texture, matt, satin};

const WALNUT: Material = satin(Texture::Wood, [0.36, 0.20, 0.11], 1.6);
const BIRCH: Material = satin(Texture::Wood, [0.78, 0.64, 0.44], 1.6);
const STEEL: Material = satin(Texture::Plain, [0.10, 0.10, 0.11], 1.0);

/// Thickness, height and colour of the volumes of a shelf, from left to right.
type Volume = (f32, f32, [f32; 3]);

const ROWS: [&[Volume]; 3] = [
    &[
        (0.10, 0.22, [0.62, 0.09, 0.08]),
        (0.12, 0.25, [0.85, 0.62, 0.12]),
        (0.14, 0.19, [0.08, 0.22, 0.45]),
        (0.06, 0.24, [0.80, 0.78, 0.70]),
        (0.11, 0.21, [0.10, 0.38, 0.22]),
        (0.14, 0.25, [0.45, 0.16, 0.36]),
    ],
    &[
        (0.07, 0.21, [0.14, 0.16, 0.22]),
        (0.13, 0.24, [0.76, 0.30, 0.28]),
        (0.12, 0.23, [0.24, 0.50, 0.30]),
        (0.15, 0.20, [0.70, 0.68, 0.64]),
        (0.07, 0.25, [0.60, 0.10, 0.14]),
        (0.12, 0.22, [0.20, 0.28, 0.60]),
    ],
    &[
        (0.12, 0.20, [0.80, 0.74, 0.60]),
        (0.06, 0.24, [0.10, 0.34, 0.40]),
        (0.13, 0.22, [0.66, 0.14, 0.10]),
        (0.12, 0.19, [0.86, 0.66, 0.20]),
    ],
];

impl Room {
    pub(super) fn rugs(&mut self) {
        let wool = matt(Texture::Stripes, [0.55, 0.10, 0.12], 5.0);
        self.block([-0.62, 0.50], [-0.42, 0.40], [0.0, 0.008], wool);
        let border = matt(Texture::Fabric, [0.16, 0.18, 0.30], 4.0);
        self.block([-0.66, 0.54], [-0.46, 0.44], [0.0, 0.006], border);
        let mat = matt(Texture::Fabric, [0.20, 0.42, 0.40], 4.0);
        self.post([1.10, 0.72], 0.30, [0.0, 0.007], mat);
    }

    pub(super) fn bed(&mut self) {
        let x = [self.east + 0.005, self.east + BED_DEPTH_M - 0.01];
        let y = [BED_FROM_Y_M + 0.01, self.north - 0.01];
        self.block(x, y, [0.05, 0.26], WALNUT);
        self.block(x, [y[1] - 0.05, y[1]], [0.05, 0.85], WALNUT);
        self.block(x, [y[0], y[0] + 0.04], [0.05, 0.52], WALNUT);
        let linen = matt(Texture::Fabric, [0.86, 0.85, 0.82], 3.0);
        self.block(
            [x[0] + 0.02, x[1]],
            [y[0] + 0.04, y[1] - 0.05],
            [0.26, 0.42],
            linen,
        );
        let quilt = matt(Texture::Checks, [0.18, 0.32, 0.62], 4.0);
        self.block(
            [x[0] + 0.005, x[1]],
            [y[0] + 0.05, y[1] - 0.75],
            [0.22, 0.46],
            quilt,
        );
        let fold = matt(Texture::Fabric, [0.30, 0.44, 0.70], 4.0);
        self.block(
            [x[0] + 0.004, x[1]],
            [y[1] - 0.85, y[1] - 0.66],
            [0.24, 0.48],
            fold,
        );
        let pillows = [([0.86, 0.84, 0.80], 0.25), ([0.80, 0.62, 0.16], 0.68)];
        for (tint, across) in pillows {
            let at = [x[0] + across, y[1] - 0.24, 0.52];
            let pillow = matt(Texture::Fabric, tint, 4.0);
            self.leaning([0.19, 0.06, 0.16], at, Vector3::x(), -0.9, pillow);
        }
    }

    /// A teddy at the foot of the bed, seen over the container from where the robot starts.
    pub(super) fn teddy(&mut self) {
        let [x, y] = [self.east + 0.24, BED_FROM_Y_M + 0.34];
        let fur = matt(Texture::Fabric, [0.52, 0.30, 0.14], 6.0);
        let muzzle = matt(Texture::Fabric, [0.82, 0.64, 0.42], 6.0);
        self.ball([x, y, 0.54], 0.105, fur);
        self.ball([x - 0.01, y, 0.69], 0.078, fur);
        self.ball([x - 0.07, y, 0.675], 0.036, muzzle);
        for side in [-0.062, 0.062] {
            self.ball([x, y + side, 0.755], 0.032, fur);
            self.ball([x - 0.11, y + 1.2 * side, 0.495], 0.042, fur);
        }
    }

    pub(super) fn bookshelf(&mut self) {
        let x = [self.west, BOOKS_TO_X_M];
        let y = [self.north + 0.004, self.north + BOOKS_DEPTH_M];
        for end in [x[0], x[1] - 0.03] {
            self.block([end, end + 0.03], y, [0.0, 1.42], BIRCH);
        }
        for level in 0..5 {
            let z = 0.04 + 0.34 * level as f32;
            self.block([x[0] + 0.03, x[1] - 0.03], y, [z - 0.02, z], BIRCH);
        }
        for (level, row) in ROWS.iter().enumerate() {
            let bottom = 0.04 + 0.34 * level as f32;
            let mut left = x[0] + 0.05;
            for &(thick, tall, tint) in *row {
                let depth = [y[0] + 0.02 + 0.3 * thick, y[0] + 0.20];
                let cloth = matt(Texture::Fabric, tint, 5.0);
                self.block(
                    [left, left + thick - 0.004],
                    depth,
                    [bottom, bottom + tall],
                    cloth,
                );
                left += thick + if thick > 0.11 { 0.05 } else { 0.0 };
            }
        }
        self.ball(
            [x[0] + 0.25, y[0] + 0.13, 1.16],
            0.10,
            satin(Texture::Picture, [0.4, 0.6, 0.9], 1.0),
        );
    }

    pub(super) fn desk(&mut self) {
        let x = [DESK_FROM_X_M + 0.04, self.east - 0.04];
        let y = [self.north + 0.03, self.north + DESK_DEPTH_M];
        self.block(x, y, [0.66, 0.70], BIRCH);
        let red = satin(Texture::Plain, [0.55, 0.08, 0.07], 1.0);
        self.block(
            [x[1] - 0.30, x[1] - 0.02],
            [y[0] + 0.02, y[1]],
            [0.04, 0.66],
            red,
        );
        self.block(
            [x[0], x[0] + 0.04],
            [y[0] + 0.02, y[0] + 0.06],
            [0.0, 0.66],
            STEEL,
        );
        let seat = matt(Texture::Fabric, [0.10, 0.46, 0.42], 5.0);
        let middle = 0.5 * (x[0] + x[1]) - 0.15;
        self.block(
            [middle - 0.19, middle + 0.19],
            [y[0] + 0.06, y[0] + 0.42],
            [0.40, 0.45],
            seat,
        );
        for (dx, dy) in [(-0.16, 0.09), (0.16, 0.09), (-0.16, 0.38), (0.16, 0.38)] {
            self.post([middle + dx, y[0] + dy], 0.016, [0.0, 0.40], BIRCH);
        }
        let laptop = [middle + 0.02, y[0] + 0.22];
        self.block(
            [laptop[0] - 0.15, laptop[0] + 0.15],
            [laptop[1] - 0.1, laptop[1] + 0.1],
            [0.70, 0.715],
            STEEL,
        );
        let screen = Material {
            emission: 0.6,
            ..satin(Texture::Picture, [0.5, 0.7, 1.0], 1.0)
        };
        self.leaning(
            [0.15, 0.006, 0.10],
            [laptop[0], laptop[1] + 0.14, 0.81],
            Vector3::x(),
            -0.3,
            screen,
        );
    }

    pub(super) fn plant(&mut self) {
        let at = [
            0.5 * (PLANT_FROM_X_M + self.east),
            self.south - 0.5 * PLANT_DEPTH_M,
        ];
        let clay = matt(Texture::Fabric, [0.62, 0.27, 0.14], 4.0);
        self.post(at, 0.12, [0.0, 0.22], clay);
        self.post(at, 0.135, [0.20, 0.25], clay);
        for leaf in 0..6 {
            let turn = TAU * 0.382 * leaf as f32;
            let out = 0.10 - 0.006 * leaf as f32;
            let up = 0.33 + 0.07 * leaf as f32;
            let shade = 0.75 + 0.25 * (leaf % 3) as f32;
            let green = matt(
                Texture::Fabric,
                [0.10 * shade, 0.34 * shade, 0.10 * shade],
                6.0,
            );
            let at = [at[0] + out * turn.cos(), at[1] + out * turn.sin(), up];
            self.ball(at, 0.095 - 0.005 * leaf as f32, green);
        }
    }

    pub(super) fn lamp(&mut self) {
        let cabinet = self.layout.cabinet;
        let at = [cabinet.centre_m[0] - 0.15, self.north - 0.09];
        let top = cabinet.top_m;
        let brass = satin(Texture::Plain, [0.62, 0.45, 0.16], 1.0);
        self.post(at, 0.055, [top, top + 0.015], brass);
        self.post(at, 0.012, [top + 0.015, top + 0.20], brass);
        let shade = Material {
            emission: 0.7,
            ..matt(Texture::Fabric, [0.95, 0.80, 0.52], 4.0)
        };
        self.post(at, 0.085, [top + 0.17, top + 0.33], shade);
    }

    pub(super) fn pictures(&mut self) {
        let (north, west, east) = (self.north, self.west, self.east);
        let art = |tint| matt(Texture::Picture, tint, 1.0);
        self.block([-0.36, 0.30], [north - 0.02, north], [0.92, 1.36], WALNUT);
        self.block(
            [-0.33, 0.27],
            [north - 0.024, north],
            [0.95, 1.33],
            art([1.0, 1.0, 1.0]),
        );
        self.block(
            [west, west + 0.024],
            [-0.40, 0.22],
            [0.82, 1.28],
            art([1.0, 0.55, 0.35]),
        );
        let back = east + BED_DEPTH_M;
        let night = matt(Texture::Plain, [0.03, 0.06, 0.16], 1.0);
        self.block([back - 0.02, back], [-0.25, 0.70], [0.72, 1.36], night);
        let moon = satin(Texture::Plain, [0.92, 0.72, 0.24], 1.0);
        let disc = Shape::Cylinder {
            radius: 0.17,
            half_height: 0.008,
        };
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
        let at = Translation3::new(back - 0.02, 0.40, 1.10);
        self.place(disc, Isometry3::from_parts(at, turn), moon);
        let hill = matt(Texture::Plain, [0.10, 0.28, 0.30], 1.0);
        self.block([back - 0.026, back], [-0.24, 0.69], [0.73, 0.90], hill);
        // A low poster on the stretch of wall between the bed and the plant.
        self.block(
            [east - 0.014, east],
            [-1.22, -0.80],
            [0.14, 0.52],
            matt(Texture::Checks, [0.75, 0.12, 0.10], 4.8),
        );
    }
}
