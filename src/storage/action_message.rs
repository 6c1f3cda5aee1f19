//! Messages of the action topic to actions and their space.

use std::collections::BTreeSet;

use serde::Deserialize;

use super::cdr;
use super::decode::without_compression;
use super::messages::{JointState, MultiArray, Twist, TwistStamped};
use crate::trajectory::{Action, ActionSpace};
use crate::wording::counted;

/// How actions are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ActionFormat {
    /// `{"index": 3, "name": "ahead"}` or `{"values": [0.1, ..]}`.
    Json,
    /// The positions of `sensor_msgs/JointState`.
    JointState,
    Float32Array,
    Float64Array,
    Float32,
    Float64,
    Twist,
    TwistStamped,
}

/// An action as a message gives it, before the space of all actions is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ActionMessage {
    Primitive {
        index: usize,
        name: Option<String>,
    },
    /// Without names where the message has none.
    Values {
        names: Vec<String>,
        values: Vec<f64>,
    },
}

#[derive(Deserialize)]
struct JsonAction {
    #[serde(alias = "action")]
    index: Option<usize>,
    name: Option<String>,
    values: Option<Vec<f64>>,
}

const TWIST_NAMES: [&str; 6] = [
    "linear_x",
    "linear_y",
    "linear_z",
    "angular_x",
    "angular_y",
    "angular_z",
];

impl ActionFormat {
    /// The format of a message type, if it is one that can hold actions.
    pub fn of(type_name: &str, encoding: &str) -> Option<Self> {
        match (type_name, encoding) {
            (_, "json") => Some(Self::Json),
            ("sensor_msgs/JointState", "cdr") => Some(Self::JointState),
            ("std_msgs/Float32MultiArray", "cdr") => Some(Self::Float32Array),
            ("std_msgs/Float64MultiArray", "cdr") => Some(Self::Float64Array),
            ("std_msgs/Float32", "cdr") => Some(Self::Float32),
            ("std_msgs/Float64", "cdr") => Some(Self::Float64),
            ("geometry_msgs/Twist", "cdr") => Some(Self::Twist),
            ("geometry_msgs/TwistStamped", "cdr") => Some(Self::TwistStamped),
            _ => None,
        }
    }

    /// Reads one message.
    pub fn decode(self, message: &[u8]) -> Result<ActionMessage, String> {
        if self == Self::Json {
            return decode_json(message);
        }
        let plain = without_compression(message)?;
        let twist = |values: Twist| (TWIST_NAMES.map(str::to_owned).to_vec(), values.to_vec());
        let (names, values) = match self {
            Self::JointState => {
                let state: JointState = cdr::decode(&plain)?;
                if state.name.len() == state.position.len() {
                    (state.name, state.position)
                } else {
                    (Vec::new(), state.position)
                }
            }
            Self::Float32Array => {
                let array: MultiArray<f32> = cdr::decode(&plain)?;
                (Vec::new(), array.data.into_iter().map(f64::from).collect())
            }
            Self::Float64Array => (Vec::new(), cdr::decode::<MultiArray<f64>>(&plain)?.data),
            Self::Float32 => (Vec::new(), vec![f64::from(cdr::decode::<f32>(&plain)?)]),
            Self::Float64 => (Vec::new(), vec![cdr::decode(&plain)?]),
            Self::Twist => twist(cdr::decode(&plain)?),
            Self::TwistStamped => twist(cdr::decode::<TwistStamped>(&plain)?.twist),
            Self::Json => unreachable!("JSON is handled above"),
        };
        checked_values(names, values)
    }
}

fn decode_json(message: &[u8]) -> Result<ActionMessage, String> {
    let json: JsonAction = serde_json::from_slice(message).map_err(|e| e.to_string())?;
    match (json.index, json.values) {
        (Some(index), None) => Ok(ActionMessage::Primitive {
            index,
            name: json.name,
        }),
        (None, Some(values)) => checked_values(Vec::new(), values),
        _ => Err("an action needs either 'index' or 'values'".to_owned()),
    }
}

fn checked_values(names: Vec<String>, values: Vec<f64>) -> Result<ActionMessage, String> {
    if values.is_empty() {
        return Err("the action has no values".to_owned());
    }
    // Actions are kept as 32-bit floats, which must be able to hold them.
    match values.iter().position(|v| !(*v as f32).is_finite()) {
        Some(bad) => Err(format!(
            "value {bad} of the action is {:e}: a robot cannot be told that. Leave the recording out, or mend it",
            values[bad]
        )),
        None => Ok(ActionMessage::Values { names, values }),
    }
}

/// The space of a recording's actions: the one that the file declares, else what the messages show.
///
/// `None` without any message.
pub(super) fn action_space(
    declared: Option<ActionSpace>,
    messages: &[ActionMessage],
) -> Option<ActionSpace> {
    if declared.is_some() {
        return declared;
    }
    match messages.first()? {
        ActionMessage::Values { names, values } => {
            // Names that several values share tell none of them.
            let distinct: BTreeSet<&String> = names.iter().collect();
            Some(ActionSpace::Continuous {
                names: if distinct.len() == values.len() {
                    names.clone()
                } else {
                    (0..values.len()).map(numbered).collect()
                },
            })
        }
        ActionMessage::Primitive { .. } => Some(primitives_seen(messages)),
    }
}

/// Primitives by the indices and names that were used; unused indices are called `primitive_3`.
fn primitives_seen(messages: &[ActionMessage]) -> ActionSpace {
    let mut names: Vec<String> = Vec::new();
    for message in messages {
        if let ActionMessage::Primitive { index, name } = message {
            // An index beyond any real list of primitives is refused later, by `action`.
            while names.len() <= (*index).min(u16::MAX.into()) {
                names.push(format!("primitive_{}", names.len()));
            }
            if let (Some(name), Some(place)) = (name, names.get_mut(*index)) {
                place.clone_from(name);
            }
        }
    }
    ActionSpace::Primitives { names }
}

/// The action that a message stands for in `space`, or why it does not belong there.
pub(super) fn action(space: &ActionSpace, message: ActionMessage) -> Result<Action, String> {
    match (space, message) {
        (ActionSpace::Primitives { names }, ActionMessage::Primitive { index, name }) => {
            match (names.get(index), name) {
                (None, _) => Err(format!(
                    "its index is {index}, but the recording has {}, counted from 0: record it again with all primitives \
                     in its action space, or leave the recording out",
                    counted(names.len(), "primitive")
                )),
                (Some(known), Some(name)) if *known != name => Err(format!(
                    "primitive {index} is called '{name}' here and '{known}' in the action space"
                )),
                _ => Ok(Action::Primitive(index)),
            }
        }
        (ActionSpace::Binned { dimensions }, ActionMessage::Values { names, values }) => {
            let wanted: Vec<&str> = dimensions.iter().map(|d| d.name.as_str()).collect();
            continuous(dimensions.len(), &in_order(&wanted, &names, values)?)
        }
        (ActionSpace::Continuous { names: wanted }, ActionMessage::Values { names, values }) => {
            let wanted: Vec<&str> = wanted.iter().map(String::as_str).collect();
            continuous(wanted.len(), &in_order(&wanted, &names, values)?)
        }
        (space, message) => Err(format!(
            "{} where the recording has {space}",
            match message {
                ActionMessage::Primitive { .. } => "a primitive",
                ActionMessage::Values { .. } => "continuous values",
            }
        )),
    }
}

/// The values of a message that names them, in the order in which the recording has them: a driver may give its joints
/// in another order each time.
fn in_order(wanted: &[&str], names: &[String], values: Vec<f64>) -> Result<Vec<f64>, String> {
    let is_numbered = |(i, name): (usize, &&str)| **name == numbered(i);
    // Where the first message had no names, those of the recording say nothing but the place.
    let say_nothing = names.is_empty() || wanted.iter().enumerate().all(is_numbered);
    if say_nothing || wanted == names {
        return Ok(values);
    }
    let place = |name: &&str| names.iter().position(|own| own == name);
    let places: Option<Vec<usize>> = wanted.iter().map(place).collect();
    let is_whole = |places: &Vec<usize>| {
        let distinct: BTreeSet<&usize> = places.iter().collect();
        distinct.len() == values.len()
    };
    match places.filter(is_whole) {
        Some(places) => Ok(places.into_iter().map(|place| values[place]).collect()),
        None => Err(format!(
            "it moves {} where the recording has {}: record the same joints in every message, or leave the recording out",
            names.join(", "),
            wanted.join(", ")
        )),
    }
}

/// What the values of messages without names are called.
fn numbered(place: usize) -> String {
    format!("action_{place}")
}

fn continuous(expected: usize, values: &[f64]) -> Result<Action, String> {
    if values.len() == expected {
        Ok(Action::Continuous(
            values.iter().map(|v| *v as f32).collect(),
        ))
    } else {
        Err(format!(
            "{} values where the recording has {expected}",
            values.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn primitives_are_learned_from_the_messages() {
        let messages: Vec<_> = [
            r#"{"index":2,"name":"left"}"#,
            r#"{"index":0,"name":"ahead"}"#,
        ]
        .iter()
        .map(|text| ActionFormat::Json.decode(text.as_bytes()).unwrap())
        .collect();
        let space = action_space(None, &messages).unwrap();
        let names = ["ahead", "primitive_1", "left"].map(str::to_owned).to_vec();
        assert_eq!(space, ActionSpace::Primitives { names });
        assert_eq!(
            action(&space, messages[0].clone()),
            Ok(Action::Primitive(2))
        );
    }

    #[test]
    fn actions_of_another_space_say_what_differs() {
        let values = |n: usize| ActionMessage::Values {
            names: Vec::new(),
            values: vec![0.5; n],
        };
        let space = action_space(None, &[values(3)]).unwrap();
        assert_eq!(
            action(&space, values(3)),
            Ok(Action::Continuous(vec![0.5; 3]))
        );
        assert!(action(&space, values(2)).unwrap_err().contains("2 values"));
        let primitives = ActionSpace::Primitives {
            names: vec!["ahead".to_owned()],
        };
        assert!(action(&primitives, values(1)).is_err());
        let wrong_name = ActionMessage::Primitive {
            index: 0,
            name: Some("back".to_owned()),
        };
        assert!(
            action(&primitives, wrong_name)
                .unwrap_err()
                .contains("'back'")
        );
        let beyond = ActionMessage::Primitive {
            index: 7,
            name: None,
        };
        let said = action(&primitives, beyond).unwrap_err();
        assert!(
            said.contains("index is 7") && said.contains("has 1 primitive,"),
            "{said}"
        );
    }

    #[test]
    fn joints_are_taken_by_their_names() {
        let message = |names: &[&str]| {
            let state = JointState {
                name: names.iter().map(|name| (*name).to_owned()).collect(),
                position: (0..names.len()).map(|i| i as f64).collect(),
                ..JointState::default()
            };
            let bytes = cdr::encode(&state, 256).unwrap();
            ActionFormat::JointState.decode(&bytes).unwrap()
        };
        let space = action_space(None, &[message(&["waist", "elbow", "wrist"])]).unwrap();
        let taken = |names: &[&str]| action(&space, message(names));
        let orders = [
            (["waist", "elbow", "wrist"], [0.0, 1.0, 2.0]),
            (["wrist", "waist", "elbow"], [1.0, 2.0, 0.0]),
        ];
        for (names, values) in orders {
            assert_eq!(taken(&names), Ok(Action::Continuous(values.to_vec())));
        }
        for other in [
            &["waist", "elbow", "finger"][..],
            &["waist", "waist", "elbow"],
            &["waist", "elbow"],
            &["waist", "elbow", "wrist", "finger"],
        ] {
            let said = taken(other).unwrap_err();
            assert!(said.contains(&other.join(", ")), "{said}");
            assert!(said.contains("has waist, elbow, wrist"), "{said}");
        }
        // Drivers without names leave them empty.
        let space = action_space(None, &[message(&["", "", ""])]).unwrap();
        let names = ["action_0", "action_1", "action_2"].map(str::to_owned);
        assert_eq!(
            space,
            ActionSpace::Continuous {
                names: names.to_vec()
            }
        );
        let unnamed = action(&space, message(&["", "", ""]));
        assert_eq!(unnamed, Ok(Action::Continuous(vec![0.0, 1.0, 2.0])));
        // The first message named nothing, so that later names are no other ones.
        let values_alone = ActionMessage::Values {
            names: Vec::new(),
            values: vec![0.5; 2],
        };
        let space = action_space(None, &[values_alone]).unwrap();
        let named = action(&space, message(&["waist", "elbow"]));
        assert_eq!(named, Ok(Action::Continuous(vec![0.0, 1.0])));
    }

    #[test]
    fn multi_arrays_twists_and_bad_values_are_read_or_refused() {
        let array = MultiArray {
            data: vec![1.0f32, -2.0],
            ..MultiArray::default()
        };
        let bytes = cdr::encode(&array, 64).unwrap();
        let ActionMessage::Values { values, .. } =
            ActionFormat::Float32Array.decode(&bytes).unwrap()
        else {
            panic!("values")
        };
        assert_eq!(values, [1.0, -2.0]);
        let twist = cdr::encode(&[0.1, 0., 0., 0., 0., 0.2f64], 64).unwrap();
        let ActionMessage::Values { names, values } = ActionFormat::Twist.decode(&twist).unwrap()
        else {
            panic!("values")
        };
        assert_eq!((names[5].as_str(), values[5]), ("angular_z", 0.2));
        let nan = cdr::encode(&f64::NAN, 8).unwrap();
        assert!(
            ActionFormat::Float64
                .decode(&nan)
                .unwrap_err()
                .contains("NaN")
        );
        assert!(ActionFormat::Json.decode(b"{}").is_err());
    }
}
