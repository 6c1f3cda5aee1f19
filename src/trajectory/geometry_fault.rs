//! What no robot can be like.

use std::f32::consts::PI;

use super::RobotGeometry;

impl RobotGeometry {
    /// The first value of a description that no robot can have: its key, itself, and what it may be.
    #[must_use]
    pub fn fault(&self) -> Option<(String, f32, &'static str)> {
        const FINITE: &str = "it must be a finite number of metres";
        const ANGLE: &str = "it must be an angle in radians, not degrees, from -pi to pi";
        const VIEW: &str = "it must be an angle in radians, not degrees, above 0 and below pi";
        let places = |key: String, place: &[f32]| -> Vec<(String, f32, &'static str)> {
            let all = place.iter().filter(|metres| !metres.is_finite());
            all.map(|metres| (key.clone(), *metres, FINITE)).collect()
        };
        let angle = |key: String, angle: f32| {
            let is_one = (-PI..=PI).contains(&angle);
            (!is_one).then_some((key, angle, ANGLE))
        };
        let mut faults = places("gripper_m".to_owned(), &self.gripper_m);
        faults.extend(places(
            "waist_m".to_owned(),
            self.waist_m.as_slice().as_flattened(),
        ));
        for (name, moved) in &self.primitives {
            let key = |value: &str| format!("primitives.{name}.{value}");
            faults.extend(places(key("gripper_m"), &moved.gripper_m));
            faults.extend(places(key("drive_m"), &[moved.drive_m]));
            faults.extend(angle(key("gripper_tilt_rad"), moved.gripper_tilt_rad));
            faults.extend(angle(key("turn_rad"), moved.turn_rad));
        }
        for (name, mount) in &self.cameras {
            let key = |value: &str| format!("cameras.{name}.{value}");
            faults.extend(places(key("position_m"), &mount.position_m));
            faults.extend(angle(key("tilt_rad"), mount.tilt_rad));
            let view = mount.vertical_fov_rad;
            if !(view > 0.0 && view < PI) {
                faults.push((key("vertical_fov_rad"), view, VIEW));
            }
        }
        faults.into_iter().next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_that_no_robot_has_is_told_with_its_key() {
        assert_eq!(RobotGeometry::locobot().fault(), None);
        let told = |change: fn(&mut RobotGeometry)| {
            let mut robot = RobotGeometry::locobot();
            change(&mut robot);
            let (key, _, way_out) = robot.fault().unwrap();
            (key, way_out.contains("radians, not degrees"))
        };
        let told_of_view = ("cameras.head.vertical_fov_rad".to_owned(), true);
        assert_eq!(
            told(|r| r.cameras.get_mut("head").unwrap().vertical_fov_rad = 42.0),
            told_of_view
        );
        assert_eq!(
            told(|r| r.cameras.get_mut("head").unwrap().vertical_fov_rad = 0.0),
            told_of_view
        );
        assert_eq!(
            told(|r| r.cameras.get_mut("wrist").unwrap().tilt_rad = 22.0),
            ("cameras.wrist.tilt_rad".to_owned(), true)
        );
        assert_eq!(
            told(|r| r.primitives.get_mut("base_turn_left").unwrap().turn_rad = f32::NAN),
            ("primitives.base_turn_left.turn_rad".to_owned(), true)
        );
        assert_eq!(
            told(|r| r.waist_m = Some([0.0, f32::INFINITY])).0,
            "waist_m"
        );
    }
}
