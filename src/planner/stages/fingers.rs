use crate::model::GraspSight;

/// How sure it must be that the gripper is open, or holds something; it is shut where it is as sure not to be open.
const SURE: f64 = 0.7;

/// When the gripper opened and shut.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fingers {
    /// Whether it was seen open after it was last seen shut.
    is_open: bool,
    /// Whether it last shut where nothing was to be taken: on a handle, whatever it seems to hold since.
    is_idle: bool,
    hold: Hold,
}

/// What became of what the gripper should hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Hold {
    #[default]
    Nothing,
    /// It is held.
    Full,
    /// It was held a step ago, and now the gripper is open.
    LetGo,
}

impl Fingers {
    /// Notes what is seen: whether that is what the gripper should hold, if it holds something, and whether anything
    /// is to be taken where the robot is.
    pub(super) fn note(&mut self, sight: GraspSight, is_due: bool, is_to_take: bool) {
        if sight.open > SURE {
            self.is_open = true;
            self.hold = match self.hold {
                Hold::Full => Hold::LetGo,
                Hold::LetGo | Hold::Nothing => Hold::Nothing,
            };
            return;
        }
        if self.is_open && sight.open < 1.0 - SURE {
            self.is_open = false;
            self.is_idle = !is_to_take;
        }
        if is_due && sight.held > SURE {
            self.hold = Hold::Full;
        } else if self.hold == Hold::LetGo {
            self.hold = Hold::Nothing;
        }
    }

    /// Whether it is seen to let go, in this step, of what it should hold.
    pub(super) fn lets_go(self) -> bool {
        self.hold == Hold::LetGo
    }

    /// Whether it last shut where nothing was to be taken.
    pub(super) const fn is_idle(self) -> bool {
        self.is_idle
    }

    /// Forgets what was held, for another stage.
    pub(super) const fn forget_hold(&mut self) {
        self.hold = Hold::Nothing;
    }
}
