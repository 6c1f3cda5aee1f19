//! What really is the case in the bedroom: for scores and for the operator, never for a planner or
//! a policy.

use nalgebra::{Isometry3, Point3};

use super::kinematics::Tool;
use super::layout::Receptacle;
use super::variation::BedroomTask;
use super::world::{Graspable, TISSUE_HALF_M, World};

/// The drawer counts as open from here on: wide enough to reach for the sock.
const OPEN_M: f32 = 0.18;
/// A thing counts as grasped once it is held this far above its place ...
const LIFTED_M: f32 = 0.02;
/// ... or was carried so far, since a can need not be lifted to be drawn off its shelf and into the bin.
const CARRIED_M: f32 = 0.05;
/// The spill counts as covered once this share of the puddle is under the tissue.
const COVERED_SHARE: f32 = 0.75;
/// Points across the puddle at which it is looked whether the tissue is above.
const PUDDLE_POINTS: i32 = 21;

/// Which subgoals hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools, reason = "one for each subgoal")]
pub struct Truth {
    /// The drawer is pulled out.
    pub drawer_open: bool,
    /// The gripper holds the sock up, or has carried it off.
    pub sock_grasped: bool,
    /// The sock lies in the container box.
    pub sock_in_box: bool,
    /// The gripper holds the can up, or has carried it off.
    pub can_grasped: bool,
    /// The can lies in the waste bin.
    pub can_in_bin: bool,
    /// The gripper holds the tissue up, or has carried it off.
    pub tissue_grasped: bool,
    /// The tissue lies on the chest, over most of the spill.
    pub spill_covered: bool,
}

impl Truth {
    /// Whether the subgoal of that name holds; `None` for a name that the bedroom does not know.
    #[must_use]
    pub fn holds(&self, subgoal: &str) -> Option<bool> {
        Some(match subgoal {
            "drawer_open" => self.drawer_open,
            "sock_grasped" => self.sock_grasped,
            "sock_in_box" => self.sock_in_box,
            "can_grasped" => self.can_grasped,
            "can_in_bin" => self.can_in_bin,
            "tissue_grasped" => self.tissue_grasped,
            "spill_covered" => self.spill_covered,
            _ => return None,
        })
    }

    /// Whether what the task is for is the case.
    #[must_use]
    pub fn is_done(&self, task: BedroomTask) -> bool {
        match task {
            BedroomTask::Sock => self.sock_in_box,
            BedroomTask::Trash => self.can_in_bin,
            BedroomTask::Wine => self.spill_covered,
        }
    }

    pub(crate) fn of(world: &World) -> Self {
        let layout = world.layout();
        let held_up = |thing| {
            let moved = world.lift_m(thing) > LIFTED_M || world.carried_m(thing) > CARRIED_M;
            world.grips(thing) && moved
        };
        let dropped_in = |thing, receptacle: &Receptacle| {
            !world.grips(thing) && is_inside(world, thing, receptacle)
        };
        Self {
            drawer_open: world.drawer_opening_m() > OPEN_M,
            sock_grasped: held_up(Graspable::Sock),
            sock_in_box: dropped_in(Graspable::Sock, &layout.container),
            can_grasped: held_up(Graspable::Can),
            can_in_bin: dropped_in(Graspable::Can, &layout.bin),
            tissue_grasped: held_up(Graspable::Tissue),
            spill_covered: !world.grips(Graspable::Tissue) && covers_spill(world),
        }
    }
}

fn is_inside(world: &World, thing: Graspable, receptacle: &Receptacle) -> bool {
    let at = world.world_from(thing).translation;
    let [x, y] = receptacle.centre_m;
    (at.x - x).abs() < receptacle.half_m
        && (at.y - y).abs() < receptacle.half_m
        && at.z < receptacle.rim_m
}

fn covers_spill(world: &World) -> bool {
    let tissue = world.world_from(Graspable::Tissue);
    let up = tissue.rotation * nalgebra::Vector3::z();
    let above = tissue.translation.z - world.layout().chest.top_m;
    let share = covered_share(world.spill_m(), world.layout().spill_radius_m, &tissue);
    above.abs() < 0.02 && up.z > 0.9 && share >= COVERED_SHARE
}

/// Share of the points of a puddle that lie under the tissue.
fn covered_share([x, y]: [f32; 2], radius: f32, tissue: &Isometry3<f32>) -> f32 {
    let half = PUDDLE_POINTS / 2;
    let (mut points, mut covered) = (0_u32, 0_u32);
    for (i, j) in (-half..=half).flat_map(|i| (-half..=half).map(move |j| (i, j))) {
        let (dx, dy) = (i as f32 / half as f32, j as f32 / half as f32);
        if dx.hypot(dy) > 1.0 {
            continue;
        }
        let at = Point3::new(x + radius * dx, y + radius * dy, tissue.translation.z);
        let seen = tissue.inverse_transform_point(&at);
        points += 1;
        covered += u32::from(seen.x.abs().max(seen.y.abs()) <= TISSUE_HALF_M);
    }
    covered as f32 / points as f32
}

/// What the operator knows besides the subgoals: places in the world, metres and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Insight {
    /// Which subgoals hold.
    pub truth: Truth,
    /// Middle of the base.
    pub base_m: [f32; 2],
    /// Heading of the base.
    pub heading_rad: f32,
    /// Where the gripper is commanded to, in the base frame.
    pub tool: Tool,
    /// Whether the fingers are commanded together.
    pub gripper_shut: bool,
    /// What the gripper holds.
    pub held: Option<Graspable>,
    /// Middle of the drawer's handle.
    pub handle_m: [f32; 3],
    /// How far the drawer is open.
    pub drawer_opening_m: f32,
    /// Middle of the sock.
    pub sock_m: [f32; 3],
    /// Middle of the can.
    pub can_m: [f32; 3],
    /// Middle of the tissue's skirt.
    pub tissue_m: [f32; 3],
    /// Middle of the spill.
    pub spill_m: [f32; 3],
    /// Middle of the waste bin at its rim.
    pub bin_m: [f32; 3],
    /// Middle of the container box at its rim.
    pub container_m: [f32; 3],
}

impl Insight {
    /// The same with a thing in the gripper.
    pub(crate) fn holding(&self, thing: Graspable) -> Self {
        let (sin, cos) = self.heading_rad.sin_cos();
        let [x, y] = self.base_m;
        let tool = &self.tool;
        let at = [
            x + cos * tool.x_m - sin * tool.y_m,
            y + sin * tool.x_m + cos * tool.y_m,
            tool.z_m,
        ];
        let mut held = Self {
            held: Some(thing),
            ..*self
        };
        match thing {
            Graspable::Drawer => held.handle_m = at,
            Graspable::Sock => held.sock_m = at,
            Graspable::Can => held.can_m = at,
            Graspable::Tissue => held.tissue_m = at,
        }
        held
    }

    pub(crate) fn of(world: &World) -> Self {
        let place = |thing| {
            let at = world.world_from(thing).translation;
            [at.x, at.y, at.z]
        };
        let layout = world.layout();
        let rim = |r: &Receptacle| [r.centre_m[0], r.centre_m[1], r.rim_m];
        let robot = world.robot();
        let [x, y] = world.spill_m();
        Self {
            truth: Truth::of(world),
            base_m: robot.stance.position_m,
            heading_rad: robot.stance.heading_rad,
            tool: robot.tool,
            gripper_shut: robot.gripper_shut,
            held: world.held(),
            handle_m: world.handle_m(),
            drawer_opening_m: world.drawer_opening_m(),
            sock_m: place(Graspable::Sock),
            can_m: place(Graspable::Can),
            tissue_m: place(Graspable::Tissue),
            spill_m: [x, y, layout.chest.top_m],
            bin_m: rim(&layout.bin),
            container_m: rim(&layout.container),
        }
    }

    /// A place as seen from the base: ahead, to the left.
    #[must_use]
    pub fn relative_to_base(&self, place_m: [f32; 2]) -> [f32; 2] {
        let (dx, dy) = (place_m[0] - self.base_m[0], place_m[1] - self.base_m[1]);
        let (sine, cosine) = self.heading_rad.sin_cos();
        [cosine * dx + sine * dy, cosine * dy - sine * dx]
    }

    /// Whether the robot stands as it did then, within a fraction of a primitive.
    #[must_use]
    pub fn stands_as(&self, other: &Self) -> bool {
        const STILL: f32 = 1e-4;
        let pairs = [
            (self.base_m[0], other.base_m[0]),
            (self.base_m[1], other.base_m[1]),
            (self.heading_rad, other.heading_rad),
            (self.tool.x_m, other.tool.x_m),
            (self.tool.y_m, other.tool.y_m),
            (self.tool.z_m, other.tool.z_m),
            (self.tool.pitch_rad, other.tool.pitch_rad),
        ];
        self.gripper_shut == other.gripper_shut && pairs.iter().all(|(a, b)| (a - b).abs() < STILL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn share_of_a_puddle_under_the_tissue_by_hand() {
        let share = |aside: f32| {
            let tissue = Isometry3::translation(1.0 + aside, 2.0, 0.5);
            covered_share([1.0, 2.0], 0.05, &tissue)
        };
        assert_eq!(share(0.0), 1.0);
        assert!(
            (share(TISSUE_HALF_M) - 0.5).abs() < 0.05,
            "its edge halves it"
        );
        assert_eq!(share(0.2), 0.0);
        let turned = Isometry3::rotation(nalgebra::Vector3::z() * std::f32::consts::FRAC_PI_4);
        // Turned by 45 degrees the corner reaches 12 cm, the edges run through the puddle.
        let corner = Isometry3::translation(1.1, 2.0, 0.5) * turned;
        let aside = covered_share([1.0, 2.0], 0.05, &corner);
        assert!((0.2..0.8).contains(&aside), "{aside}");
    }

    #[test]
    fn every_subgoal_of_every_task_is_known_by_name() {
        let truth = Truth {
            can_in_bin: true,
            ..Truth::default()
        };
        for task in BedroomTask::ALL {
            for subgoal in task.subgoals() {
                let expected = *subgoal == "can_in_bin";
                assert_eq!(truth.holds(subgoal), Some(expected));
            }
            assert_eq!(truth.is_done(task), task == BedroomTask::Trash);
        }
        assert_eq!(truth.holds("room_tidy"), None);
    }
}
