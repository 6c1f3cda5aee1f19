//! Where everything in the bedroom stands: one place for all positions and sizes.
//!
//! World frame: x east, y north, z up, origin on the floor in the middle of the room; metres and
//! radians. Furniture is static; only the things listed under "objects" are moved by variation.

/// An upright box-shaped piece of furniture that stands on the floor unless `base_m` is above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Centre on the floor plan, x and y.
    pub centre_m: [f32; 2],
    /// Half of the extent along x and y.
    pub half_m: [f32; 2],
    /// Height of the underside above the floor.
    pub base_m: f32,
    /// Height of the top above the floor.
    pub top_m: f32,
}

/// An open receptacle with a floor and four walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receptacle {
    /// Centre on the floor plan, x and y.
    pub centre_m: [f32; 2],
    /// Half of the outer width, along x and y alike.
    pub half_m: f32,
    /// Height of the rim above the floor.
    pub rim_m: f32,
    /// Thickness of walls and floor.
    pub wall_m: f32,
}

/// The drawer: opens towards -y out of the cabinet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawer {
    /// Centre of the shut drawer's inside, x, y and z of its middle height.
    pub centre_m: [f32; 3],
    /// Half of width (x), depth (y) and height (z).
    pub half_m: [f32; 3],
    /// How far it can be pulled out.
    pub travel_m: f32,
    /// How far the handle's post stands before the middle of the front panel.
    pub handle_standoff_m: f32,
    /// Radius of the handle's upright post.
    pub handle_radius_m: f32,
    /// Half of the height of the handle's post.
    pub handle_half_m: f32,
}

/// Where a robot starts: x, y and heading (0 = east, counter-clockwise).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartPose {
    /// x and y of the middle of the base.
    pub position_m: [f32; 2],
    /// Heading.
    pub heading_rad: f32,
}

/// Positions and sizes of everything that physics knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Walls' inner faces: west x, east x, south y, north y.
    pub walls_m: [f32; 4],
    /// Height of the walls.
    pub wall_height_m: f32,
    /// Dresser with the drawer; its front is its south face.
    pub cabinet: Block,
    /// The drawer in it.
    pub drawer: Drawer,
    /// Board on the south wall on which the can stands.
    pub shelf: Block,
    /// High chest on the south wall, with the spill on its top.
    pub chest: Block,
    /// Night stand in the south-west on which the tissue stands.
    pub night_stand: Block,
    /// Waste bin in the west.
    pub bin: Receptacle,
    /// Container box in the east.
    pub container: Receptacle,
    /// Sock's place: offset from the middle of the drawer, x and y.
    pub sock_offset_m: [f32; 2],
    /// Can's place on the shelf.
    pub can_m: [f32; 2],
    /// Tissue's place on the night stand.
    pub tissue_m: [f32; 2],
    /// Spill's place on the chest.
    pub spill_m: [f32; 2],
    /// Radius of the spill.
    pub spill_radius_m: f32,
    /// Start near the waste bin, facing it: tasks `sock` and `wine`.
    pub start_at_bin: StartPose,
    /// Start near the container box, facing it: task `trash`.
    pub start_at_container: StartPose,
}

impl Layout {
    /// The bedroom.
    #[must_use]
    pub const fn bedroom() -> Self {
        Self {
            walls_m: [-1.5, 1.5, -1.3, 1.4],
            wall_height_m: 2.2,
            cabinet: Block {
                centre_m: [-0.20, 1.18],
                half_m: [0.24, 0.22],
                base_m: 0.0,
                top_m: 0.44,
            },
            drawer: Drawer {
                centre_m: [-0.20, 1.16, 0.29],
                half_m: [0.20, 0.19, 0.045],
                travel_m: 0.34,
                handle_standoff_m: 0.07,
                handle_radius_m: 0.014,
                handle_half_m: 0.042,
            },
            shelf: Block {
                centre_m: [0.30, -1.13],
                half_m: [0.30, 0.17],
                base_m: 0.39,
                top_m: 0.42,
            },
            chest: Block {
                centre_m: [-0.45, -1.08],
                half_m: [0.26, 0.22],
                base_m: 0.0,
                top_m: 0.42,
            },
            night_stand: Block {
                centre_m: [-1.14, -0.66],
                half_m: [0.20, 0.20],
                base_m: 0.0,
                top_m: 0.29,
            },
            bin: Receptacle {
                centre_m: [-1.10, 0.0],
                half_m: 0.15,
                rim_m: 0.28,
                wall_m: 0.01,
            },
            container: Receptacle {
                centre_m: [1.10, 0.0],
                half_m: 0.17,
                rim_m: 0.24,
                wall_m: 0.01,
            },
            sock_offset_m: [0.0, -0.02],
            can_m: [0.30, -1.03],
            tissue_m: [-1.05, -0.60],
            spill_m: [-0.45, -0.98],
            spill_radius_m: 0.05,
            start_at_bin: StartPose {
                position_m: [-0.45, 0.0],
                heading_rad: std::f32::consts::PI,
            },
            start_at_container: StartPose {
                position_m: [0.45, 0.0],
                heading_rad: 0.0,
            },
        }
    }
}
