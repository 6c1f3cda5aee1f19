//! The loose things: sock, can and tissue. All are round where the gripper takes them, so that
//! their yaw does not matter.

use std::f32::consts::FRAC_PI_2;

use nalgebra::Isometry3;
use rapier3d::prelude::{CoefficientCombineRule, ColliderBuilder, Group, RigidBodyHandle};

use super::build::groups::{DRAWER, FLOOR, FURNITURE, LOOSE};
use super::build::{Builder, Form, Substance};
use super::furniture::BOTTOM_HALF_M;
use crate::simulator::kinematics::shift;
use crate::simulator::layout::Layout;
use crate::simulator::render::Shape;
use crate::simulator::variation::{Arrangement, SockPlace};

const SOCK_RADIUS_M: f32 = 0.016;
const SOCK_HALF_M: f32 = 0.036;
/// What is left of the sock's radius between fingers: the wool around it gives way.
const SOCK_CORE_RADIUS_M: f32 = 0.011;
/// How fast a spin dies away.
const DAMPING_PER_S: f32 = 1.0;
/// The same for wool, which does not roll, however round it is.
const WOOL_DAMPING_PER_S: f32 = 12.0;
const SOCK_FRICTION: f32 = 0.2;
/// Half of the height of the sock's foot, which has most of its weight.
const FOOT_HALF_M: f32 = 0.006;
const CAN_RADIUS_M: f32 = 0.020;
const CAN_HALF_M: f32 = 0.06;
/// Half of the side of the tissue, a square.
pub(crate) const TISSUE_HALF_M: f32 = 0.085;
const PEAK_RADIUS_M: f32 = 0.016;
const PEAK_HALF_M: f32 = 0.034;
const SKIRT_HALF_M: f32 = 0.003;
/// Things start this far above what they stand on.
const GAP_M: f32 = 0.001;

const THING: Substance = Substance {
    mass_kg: 0.03,
    friction: 0.8,
    own: LOOSE,
    others: Group::ALL,
};

/// As smooth as the smoother of two that touch.
fn smooth(collider: ColliderBuilder) -> ColliderBuilder {
    collider.friction_combine_rule(CoefficientCombineRule::Min)
}

impl Builder {
    /// A rolled-up sock.
    pub fn sock(&mut self, layout: &Layout, arrangement: &Arrangement) -> RigidBodyHandle {
        let place = match arrangement.sock {
            SockPlace::Drawer(offset) => {
                let [x, y, z] = layout.drawer.centre_m;
                let floor = z - layout.drawer.half_m[2] + 2.0 * BOTTOM_HALF_M;
                let y = y + offset[1] - arrangement.drawer_opening_m;
                [x + offset[0], y, floor + SOCK_HALF_M + GAP_M]
            }
            SockPlace::Container => {
                let [x, y] = layout.container.centre_m;
                [x, y, layout.container.wall_m + SOCK_HALF_M + GAP_M]
            }
        };
        let body = self.loose(place, arrangement.yaws_rad[0], WOOL_DAMPING_PER_S);
        let material = arrangement.palette.sock;
        // What a push does to wool is to shift it, not to roll it away or tip it over for good: smooth,
        // slow to spin, and heavy at the foot.
        let wool = Substance {
            mass_kg: 0.004,
            friction: SOCK_FRICTION,
            others: FLOOR | FURNITURE | DRAWER | LOOSE,
            ..THING
        };
        let core = Substance {
            others: Group::ALL,
            ..wool
        };
        let foot = Substance {
            mass_kg: 0.022,
            ..wool
        };
        let mut roll = Form::upright(SOCK_RADIUS_M, SOCK_HALF_M, Isometry3::identity());
        roll.collider = smooth(roll.collider);
        self.attach(body, roll, wool, material);
        let inside = Form::upright(SOCK_CORE_RADIUS_M, SOCK_HALF_M, Isometry3::identity());
        self.feel(body, smooth(inside.collider), core);
        let low = shift(0.0, 0.0, FOOT_HALF_M - SOCK_HALF_M);
        let bottom = Form::upright(SOCK_CORE_RADIUS_M, FOOT_HALF_M, low);
        self.feel(body, smooth(bottom.collider), foot);
        body
    }

    /// An empty can.
    pub fn can(&mut self, layout: &Layout, arrangement: &Arrangement) -> RigidBodyHandle {
        let ([x, y], below) = arrangement.can_m.map_or_else(
            || (layout.bin.centre_m, layout.bin.wall_m),
            |place| (place, layout.shelf.top_m),
        );
        let place = [x, y, below + CAN_HALF_M + GAP_M];
        let body = self.loose(place, arrangement.yaws_rad[1], DAMPING_PER_S);
        let mut can = Form::upright(CAN_RADIUS_M, CAN_HALF_M, Isometry3::identity());
        // Smooth enough that a push moves it along instead of tipping it over.
        can.collider = smooth(can.collider);
        let tin = Substance {
            friction: 0.15,
            ..THING
        };
        self.attach(body, can, tin, arrangement.palette.can);
        body
    }

    /// A tissue pinched at its middle: a peak to take it by above a wide skirt.
    pub fn tissue(&mut self, layout: &Layout, arrangement: &Arrangement) -> RigidBodyHandle {
        let ([x, y], below) = arrangement.tissue_m.map_or_else(
            || (arrangement.spill_m, layout.chest.top_m),
            |place| (place, layout.night_stand.top_m),
        );
        let place = [x, y, below + SKIRT_HALF_M + GAP_M];
        let yaw_rad = arrangement.yaws_rad[2].rem_euclid(FRAC_PI_2);
        let body = self.loose(place, yaw_rad, DAMPING_PER_S);
        let material = arrangement.palette.tissue;
        let half = [TISSUE_HALF_M, TISSUE_HALF_M, SKIRT_HALF_M];
        // The skirt gives way to the gripper, the peak does not.
        let cloth = Substance {
            mass_kg: 0.012,
            others: FLOOR | FURNITURE | LOOSE,
            ..THING
        };
        self.attach(
            body,
            Form::cuboid(half, Isometry3::identity()),
            cloth,
            material,
        );
        let peak = Form::upright(
            PEAK_RADIUS_M,
            PEAK_HALF_M,
            shift(0.0, 0.0, SKIRT_HALF_M + PEAK_HALF_M),
        );
        let pinch = Substance {
            mass_kg: 0.006,
            ..THING
        };
        self.attach(body, peak, pinch, material);
        // Folds between skirt and peak, for the eye only.
        for (radius, height) in [(0.034, 0.006), (0.025, 0.014)] {
            let fold = Shape::Cylinder {
                radius,
                half_height: 0.5 * height,
            };
            let pose = shift(0.0, 0.0, SKIRT_HALF_M + 0.5 * height);
            self.show(Some(body), pose, fold, material);
        }
        body
    }
}
