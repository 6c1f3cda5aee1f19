//! Floor, walls, baseboards, door and window.
//!
//! The sun stands in the south-west. What hangs on the walls on that side is painted, not built of
//! wood or cloth, where its shadow would darken the room: paint lets the sun through.

use super::{Material, Room, Texture, matt, satin};

/// How far the niches reach behind the planes of the walls.
pub(super) const BED_DEPTH_M: f32 = 0.95;
pub(super) const BOOKS_DEPTH_M: f32 = 0.26;
pub(super) const DESK_DEPTH_M: f32 = 0.52;
pub(super) const PLANT_DEPTH_M: f32 = 0.36;

/// Where niches begin or end along their wall, in world coordinates.
pub(super) const BED_FROM_Y_M: f32 = -0.70;
pub(super) const BOOKS_TO_X_M: f32 = -0.52;
pub(super) const DESK_FROM_X_M: f32 = 0.42;
pub(super) const PLANT_FROM_X_M: f32 = 0.98;

const THICK_M: f32 = 0.10;

const BLUE_WALL: Material = matt(Texture::Plaster, [0.40, 0.55, 0.66], 1.2);
const CREAM_WALL: Material = matt(Texture::Plaster, [0.86, 0.77, 0.60], 1.2);
const SAGE_WALL: Material = matt(Texture::Plaster, [0.56, 0.70, 0.46], 1.2);
const ROSE_WALL: Material = matt(Texture::Plaster, [0.92, 0.58, 0.47], 1.2);
const WHITE: Material = satin(Texture::Plaster, [0.84, 0.83, 0.79], 1.0);

impl Room {
    pub(super) fn shell(&mut self) {
        self.floor();
        self.north_wall();
        self.east_wall();
        self.south_wall();
        self.west_wall();
        self.baseboards();
    }

    fn floor(&mut self) {
        let boards = satin(Texture::Floor, [0.60, 0.40, 0.23], 0.8);
        let x = [self.west - THICK_M, self.east + BED_DEPTH_M + THICK_M];
        let y = [
            self.south - PLANT_DEPTH_M - THICK_M,
            self.north + DESK_DEPTH_M + THICK_M,
        ];
        self.block(x, y, [-0.05, 0.0], boards);
    }

    fn north_wall(&mut self) {
        let (north, all) = (self.north, [0.0, self.height]);
        let books = north + BOOKS_DEPTH_M;
        let desk = north + DESK_DEPTH_M;
        let middle = [BOOKS_TO_X_M, DESK_FROM_X_M];
        self.block(
            [self.west, middle[0]],
            [books, books + THICK_M],
            all,
            BLUE_WALL,
        );
        self.block(middle, [north, desk + THICK_M], all, BLUE_WALL);
        let paper = matt(Texture::Plaster, [0.80, 0.62, 0.20], 1.2);
        self.block([middle[1], self.east], [desk, desk + THICK_M], all, paper);
    }

    fn east_wall(&mut self) {
        let (east, all) = (self.east, [0.0, self.height]);
        let back = east + BED_DEPTH_M;
        let head = [self.north, self.north + DESK_DEPTH_M + THICK_M];
        self.block(
            [back, back + THICK_M],
            [BED_FROM_Y_M, head[0]],
            all,
            CREAM_WALL,
        );
        self.block([east, back + THICK_M], head, all, CREAM_WALL);
        let stub = [self.south - PLANT_DEPTH_M, BED_FROM_Y_M];
        self.block([east, back + THICK_M], stub, all, SAGE_WALL);
    }

    fn south_wall(&mut self) {
        let all = [0.0, self.height];
        let back = self.south - PLANT_DEPTH_M;
        let wall = [self.west - THICK_M, PLANT_FROM_X_M];
        self.block(wall, [back - THICK_M, self.south], all, ROSE_WALL);
        let niche = [PLANT_FROM_X_M, self.east + THICK_M];
        self.block(niche, [back - THICK_M, back], all, CREAM_WALL);
    }

    fn west_wall(&mut self) {
        let y = [self.south, self.north + BOOKS_DEPTH_M + THICK_M];
        self.block(
            [self.west - THICK_M, self.west],
            y,
            [0.0, self.height],
            SAGE_WALL,
        );
    }

    fn baseboards(&mut self) {
        let z = [0.0, 0.07];
        let (north, south, west) = (self.north, self.south, self.west);
        self.block(
            [BOOKS_TO_X_M, DESK_FROM_X_M],
            [north - 0.012, north],
            z,
            WHITE,
        );
        self.block([west, PLANT_FROM_X_M], [south, south + 0.012], z, WHITE);
        self.block([west, west + 0.012], [south, north], z, WHITE);
    }

    pub(super) fn door(&mut self) {
        let teal = satin(Texture::Plaster, [0.06, 0.32, 0.36], 1.0);
        let panel = satin(Texture::Plaster, [0.10, 0.44, 0.48], 1.0);
        let (west, y) = (self.west, [0.42, 1.16]);
        self.block(
            [west, west + 0.02],
            [y[0] - 0.07, y[1] + 0.07],
            [0.0, 2.0],
            WHITE,
        );
        self.block([west, west + 0.035], y, [0.01, 1.93], teal);
        for z in [[0.10, 0.46], [0.60, 1.80]] {
            for side in [[0.50, 0.75], [0.83, 1.08]] {
                self.block([west, west + 0.042], side, z, panel);
            }
        }
        let brass = satin(Texture::Plaster, [0.70, 0.52, 0.20], 1.0);
        self.ball([west + 0.07, 0.48, 0.95], 0.028, brass);
    }

    pub(super) fn window(&mut self) {
        let (south, z) = (self.south, [0.80, 1.75]);
        let sky = Material {
            emission: 0.9,
            ..matt(Texture::Plaster, [0.62, 0.80, 0.98], 1.0)
        };
        self.block([-0.30, 0.55], [south, south + 0.004], z, sky);
        for x in [-0.34, 0.105, 0.55] {
            self.block([x, x + 0.04], [south, south + 0.03], z, WHITE);
        }
        self.block(
            [-0.38, 0.63],
            [south, south + 0.05],
            [z[0] - 0.04, z[0]],
            WHITE,
        );
        self.block(
            [-0.34, 0.59],
            [south, south + 0.03],
            [z[1], z[1] + 0.04],
            WHITE,
        );
        let cloth = matt(Texture::Plaster, [0.86, 0.38, 0.07], 3.0);
        for from in [-0.93, 0.70] {
            for fold in 0..3 {
                let x = from + 0.084 * fold as f32;
                let deep = 0.046 + 0.010 * (fold % 2) as f32;
                self.post([x, south + 0.04], deep, [0.03, 1.86], cloth);
            }
        }
        let rod = satin(Texture::Plaster, [0.10, 0.09, 0.08], 1.0);
        self.block(
            [-1.05, 0.95],
            [south + 0.03, south + 0.05],
            [1.87, 1.89],
            rod,
        );
    }

    pub(super) fn radiator(&mut self) {
        let (west, from) = (self.west, -0.36);
        for rib in 0..6 {
            let y = from + 0.10 * rib as f32;
            self.block(
                [west + 0.02, west + 0.08],
                [y, y + 0.075],
                [0.12, 0.54],
                WHITE,
            );
        }
        self.block(
            [west + 0.03, west + 0.07],
            [from - 0.04, from + 0.62],
            [0.16, 0.20],
            WHITE,
        );
    }
}
