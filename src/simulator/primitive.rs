use crate::trajectory::{Action, ActionSpace};

/// How far one primitive moves the gripper.
pub const TOOL_STEP_M: f32 = 0.03;
/// How far one primitive drives the base.
pub const DRIVE_STEP_M: f32 = 0.10;
/// How far one primitive turns the base.
pub const TURN_STEP_RAD: f32 = 15.0 * std::f32::consts::PI / 180.0;
/// How far one primitive tilts the wrist.
pub const WRIST_STEP_RAD: f32 = 30.0 * std::f32::consts::PI / 180.0;

/// The motion primitives of the robot; an action's index is the place in [`Primitive::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Primitive {
    /// Gripper 3 cm to the robot's left.
    EndEffectorLeft,
    /// Gripper 3 cm to the robot's right.
    EndEffectorRight,
    /// Gripper 3 cm away from the robot.
    EndEffectorForward,
    /// Gripper 3 cm towards the robot.
    EndEffectorBackward,
    /// Gripper 3 cm up.
    EndEffectorUp,
    /// Gripper 3 cm down.
    EndEffectorDown,
    /// Base 10 cm forwards.
    BaseForward,
    /// Base 10 cm backwards.
    BaseBackward,
    /// Base 15 degrees counter-clockwise.
    BaseTurnLeft,
    /// Base 15 degrees clockwise.
    BaseTurnRight,
    /// Gripper 30 degrees upwards about the point between the fingers.
    WristUp,
    /// Gripper 30 degrees downwards about the point between the fingers.
    WristDown,
    /// Fingers together, and kept together.
    GripperClose,
    /// Fingers apart, and kept apart.
    GripperOpen,
    /// Says that the task is done; nothing moves.
    Terminate,
}

impl Primitive {
    /// All primitives in the order of their indices.
    pub const ALL: [Self; 15] = [
        Self::EndEffectorLeft,
        Self::EndEffectorRight,
        Self::EndEffectorForward,
        Self::EndEffectorBackward,
        Self::EndEffectorUp,
        Self::EndEffectorDown,
        Self::BaseForward,
        Self::BaseBackward,
        Self::BaseTurnLeft,
        Self::BaseTurnRight,
        Self::WristUp,
        Self::WristDown,
        Self::GripperClose,
        Self::GripperOpen,
        Self::Terminate,
    ];

    /// The name in the action space.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::EndEffectorLeft => "end_effector_left",
            Self::EndEffectorRight => "end_effector_right",
            Self::EndEffectorForward => "end_effector_forward",
            Self::EndEffectorBackward => "end_effector_backward",
            Self::EndEffectorUp => "end_effector_up",
            Self::EndEffectorDown => "end_effector_down",
            Self::BaseForward => "base_forward",
            Self::BaseBackward => "base_backward",
            Self::BaseTurnLeft => "base_turn_left",
            Self::BaseTurnRight => "base_turn_right",
            Self::WristUp => "wrist_up",
            Self::WristDown => "wrist_down",
            Self::GripperClose => "gripper_close",
            Self::GripperOpen => "gripper_open",
            Self::Terminate => "terminate",
        }
    }

    /// The index in the action space.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The action that stands for this primitive.
    #[must_use]
    pub const fn action(self) -> Action {
        Action::Primitive(self.index())
    }

    /// The primitive at an index of the action space.
    #[must_use]
    pub fn from_index(index: usize) -> Option<Self> {
        Self::ALL.get(index).copied()
    }

    /// The action space of the robot: 15 primitives.
    #[must_use]
    pub fn action_space() -> ActionSpace {
        ActionSpace::Primitives {
            names: Self::ALL.iter().map(|p| p.name().to_owned()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_and_place_in_the_list_agree() {
        for (place, primitive) in Primitive::ALL.into_iter().enumerate() {
            assert_eq!(primitive.index(), place);
            assert_eq!(Primitive::from_index(place), Some(primitive));
        }
        assert_eq!(Primitive::from_index(15), None);
    }
}
