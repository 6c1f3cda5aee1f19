use std::fmt;
use std::ops::RangeInclusive;

/// States of one task's demonstrations, said by what is known of them: all that is said must hold.
///
/// ```
/// use catena::task::Region;
///
/// let region = Region::of("trash").demonstration("trash_01000032").steps(30..=40);
/// assert_eq!(region.to_string(), "steps 30..40 of trash_01000032");
/// let region = Region::of("sock").after("drawer_open").before("sock_grasped");
/// assert_eq!(region.to_string(), "sock after drawer_open before sock_grasped");
/// assert_eq!(region.named("reaching").to_string(), "reaching");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// What it is called: in messages, and as a subgoal where it must be passed.
    pub name: Option<String>,
    /// The task whose states these are.
    pub task: String,
    /// The id of the one demonstration that they are of; `None` for all of the task.
    pub demonstration: Option<String>,
    /// Steps of demonstrations, counted from 0, the last one included.
    pub steps: Option<RangeInclusive<u32>>,
    /// A subgoal of the task that holds there.
    pub after: Option<String>,
    /// A subgoal of the task that does not hold there yet.
    pub before: Option<String>,
    /// Also states of other demonstrations to which a learned edge of at most so many steps leads from one of
    /// these, and from which one leads to one of these: the same way, seen by somebody else. 0 for none.
    pub within_steps: u32,
}

impl Region {
    /// All states of a task.
    #[must_use]
    pub fn of(task: impl Into<String>) -> Self {
        Self {
            name: None,
            task: task.into(),
            demonstration: None,
            steps: None,
            after: None,
            before: None,
            within_steps: 0,
        }
    }

    /// The same with a name.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = Some(name.into());
        self
    }

    /// Only states of this demonstration.
    #[must_use]
    pub fn demonstration(mut self, id: impl Into<String>) -> Self {
        self.demonstration = Some(id.into());
        self
    }

    /// Only these steps of demonstrations.
    #[must_use]
    pub fn steps(mut self, steps: RangeInclusive<u32>) -> Self {
        self.steps = Some(steps);
        self
    }

    /// Only states at which this subgoal of the task holds.
    #[must_use]
    pub fn after(mut self, subgoal: impl Into<String>) -> Self {
        self.after = Some(subgoal.into());
        self
    }

    /// Only states at which this subgoal of the task does not hold yet.
    #[must_use]
    pub fn before(mut self, subgoal: impl Into<String>) -> Self {
        self.before = Some(subgoal.into());
        self
    }

    /// Also states of other demonstrations that learned edges of so many steps join to these, both ways.
    #[must_use]
    pub fn within_steps(mut self, steps: u32) -> Self {
        self.within_steps = steps;
        self
    }
}

impl fmt::Display for Region {
    /// Its name, or what it consists of.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(name) = &self.name {
            return write!(f, "{name}");
        }
        match &self.steps {
            Some(steps) if steps.start() == steps.end() => write!(f, "step {} of ", steps.start())?,
            Some(steps) if *steps.end() == u32::MAX => write!(f, "steps {}.. of ", steps.start())?,
            Some(steps) => write!(f, "steps {}..{} of ", steps.start(), steps.end())?,
            None => {}
        }
        write!(f, "{}", self.demonstration.as_ref().unwrap_or(&self.task))?;
        if let Some(after) = &self.after {
            write!(f, " after {after}")?;
        }
        if let Some(before) = &self.before {
            write!(f, " before {before}")?;
        }
        if self.within_steps > 0 {
            write!(f, " and what is {} steps off", self.within_steps)?;
        }
        Ok(())
    }
}
