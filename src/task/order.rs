use std::fmt;

/// Tasks to be done, and in which orders they may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// One task, by name.
    Task(String),
    /// One part after the other.
    InOrder(Vec<Order>),
    /// All parts, in whichever order; a part is not interrupted by another one.
    AnyOrder(Vec<Order>),
    /// One of the parts.
    Choice(Vec<Order>),
    /// The part where a way leads through it, else nothing.
    Optional(Box<Order>),
    /// The part so many times, one after the other.
    Repeat(u32, Box<Order>),
}

impl Order {
    /// The tasks that it names, as often as it names them; what is repeated is named once.
    #[must_use]
    pub fn tasks(&self) -> Vec<&str> {
        match self {
            Self::Task(task) => vec![task],
            Self::InOrder(parts) | Self::AnyOrder(parts) | Self::Choice(parts) => {
                parts.iter().flat_map(Self::tasks).collect()
            }
            Self::Optional(part) | Self::Repeat(_, part) => part.tasks(),
        }
    }

    /// The lines that [`Display`](fmt::Display) prints, each with how deep it lies in containers.
    #[must_use]
    pub fn outline(&self) -> Vec<(usize, String)> {
        let (head, parts): (String, &[Self]) = match self {
            Self::Task(task) => (task.clone(), &[]),
            Self::InOrder(parts) => ("in order".to_owned(), parts),
            Self::AnyOrder(parts) => ("in any order".to_owned(), parts),
            Self::Choice(parts) => ("one of".to_owned(), parts),
            Self::Optional(part) => ("optional".to_owned(), std::slice::from_ref(part)),
            Self::Repeat(times, part) => (format!("{times} times"), std::slice::from_ref(part)),
        };
        let below = parts.iter().flat_map(Self::outline);
        let mut lines = vec![(0, head)];
        lines.extend(below.map(|(depth, line)| (depth + 1, line)));
        lines
    }
}

impl fmt::Display for Order {
    /// A line a task or container, those within a container indented below it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (depth, line)) in self.outline().iter().enumerate() {
            let end = if i > 0 { "\n" } else { "" };
            write!(f, "{end}{:indent$}{line}", "", indent = 2 * depth)?;
        }
        Ok(())
    }
}
