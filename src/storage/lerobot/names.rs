//! What the values of a feature are called, as `info.json` has it.

use std::fmt;

use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// Names in the order of the values: a list of them, lists within a map (`{"motors": [..]}`) in the order in which they
/// are written, or a map that numbers them (`{"x": 0, "y": 1}`); none where something else is written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Names(pub Vec<String>);

/// A part of what is written.
enum Part {
    Names(Vec<String>),
    Number(f64),
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match Part::deserialize(deserializer)? {
            Part::Names(names) => Self(names),
            Part::Number(_) => Self::default(),
        })
    }
}

impl<'de> Deserialize<'de> for Part {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PartVisitor)
    }
}

/// Keeps the order of a map, which a tree of values would not.
struct PartVisitor;

impl<'de> Visitor<'de> for PartVisitor {
    type Value = Part;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("names of values")
    }

    fn visit_str<E>(self, name: &str) -> Result<Part, E> {
        Ok(Part::Names(vec![name.to_owned()]))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Part, E> {
        Ok(Part::Number(number as f64))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Part, E> {
        Ok(Part::Number(number as f64))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Part, E> {
        Ok(Part::Number(number))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Part, E> {
        Ok(Part::Names(Vec::new()))
    }

    fn visit_unit<E>(self) -> Result<Part, E> {
        Ok(Part::Names(Vec::new()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Part, A::Error> {
        let mut names = Vec::new();
        while let Some(part) = list.next_element::<Part>()? {
            if let Part::Names(more) = part {
                names.extend(more);
            }
        }
        Ok(Part::Names(names))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Part, A::Error> {
        let mut numbered: Vec<(f64, String)> = Vec::new();
        let mut lists: Vec<Vec<String>> = Vec::new();
        while let Some((name, part)) = map.next_entry::<String, Part>()? {
            match part {
                Part::Number(number) => numbered.push((number, name)),
                Part::Names(names) => lists.push(names),
            }
        }
        if !lists.is_empty() {
            return Ok(Part::Names(lists.concat()));
        }
        numbered.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let names = numbered.into_iter().map(|(_, name)| name);
        Ok(Part::Names(names.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_in_the_order_of_the_values() {
        let names = |text: &str| serde_json::from_str::<Names>(text).unwrap().0;
        assert_eq!(names(r#"["y", "x"]"#), ["y", "x"]);
        assert_eq!(
            names(r#"{"motors": ["waist", "elbow"]}"#),
            ["waist", "elbow"]
        );
        assert_eq!(
            names(r#"{"right": ["b", "a"], "left": ["c"]}"#),
            ["b", "a", "c"]
        );
        let by_number = ["x", "y", "gripper"];
        assert_eq!(names(r#"{"x": 0, "y": 1, "gripper": 2}"#), by_number);
        assert_eq!(names(r#"{"gripper": 2, "y": 1, "x": 0}"#), by_number);
        for nothing in ["null", "3", "true", "{}", "[]", "[0, 1]"] {
            assert!(names(nothing).is_empty(), "{nothing}");
        }
    }
}
