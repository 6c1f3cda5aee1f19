//! Messages as they come from outside, taken for nothing that they were not checked to be.

use std::cell::Cell;
use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use thiserror::Error as ThisError;

use super::arrays::{self, NdArray};

/// Levels of maps and lists in each other.
const DEEPEST: usize = 16;
/// Longest text that is shown in an error.
const SHOWN_BYTES: usize = 40;
/// Values of all kinds in one message; an observation has some dozens. Without a limit each byte of a
/// message could become a value of 40 bytes.
const MOST_VALUES: usize = 10_000;

/// A message that was received: borrowed from its bytes where it is long.
#[derive(Clone, Debug, PartialEq)]
pub enum Message<'a> {
    /// Nothing.
    Nil,
    /// True or false.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Float(f64),
    /// A text.
    Text(&'a str),
    /// Bytes that are no text.
    Bytes(&'a [u8]),
    /// Values in order.
    List(Vec<Message<'a>>),
    /// Values by name, in the order in which they came.
    Map(Vec<(&'a str, Message<'a>)>),
    /// A numpy array.
    Array(NdArray<'a>),
}

/// What is wrong with a message.
#[derive(Clone, Debug, PartialEq, Eq, ThisError)]
#[error(
    "the message cannot be read: {reason}; send msgpack as `openpi_client.msgpack_numpy` packs it"
)]
pub struct MessageError {
    reason: String,
}

impl<'a> Message<'a> {
    /// Reads one whole message.
    ///
    /// # Errors
    /// [`MessageError`] when it is no msgpack, deeper or richer than messages are, goes on after its end,
    /// has keys that are no text, or an array that is not what it says it is.
    pub fn read(bytes: &'a [u8]) -> Result<Self, MessageError> {
        let failed = |reason: String| MessageError { reason };
        let left = Cell::new(MOST_VALUES);
        let mut reader = rmp_serde::Deserializer::from_read_ref(bytes);
        reader.set_max_depth(DEEPEST);
        let message = Seed { left: &left }
            .deserialize(&mut reader)
            .map_err(|e| failed(e.to_string()))?;
        // What may follow is not read on: a list that is cut off would end as if nothing followed.
        match <()>::deserialize(&mut reader) {
            Err(rmp_serde::decode::Error::InvalidMarkerRead(_)) => Ok(message),
            _ => Err(failed("more follows after its end".to_owned())),
        }
    }

    /// The value under a name of a map.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Map(entries) => entries.iter().find(|(n, _)| *n == name).map(|(_, v)| v),
            _ => None,
        }
    }

    /// A truth value, Python's or numpy's.
    #[must_use]
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Bool(value) => Some(*value),
            _ => None,
        }
    }

    /// The seed of the episode that a message asks to begin, if it does; 0 where it names none.
    pub(super) fn reset(&self) -> Result<Option<u64>, String> {
        match self.get("reset") {
            None | Some(Self::Nil | Self::Bool(false)) => return Ok(None),
            Some(Self::Bool(true)) => {}
            Some(other) => {
                return Err(format!("`reset` is {}: send true or false", other.kind()));
            }
        }
        match self.get("seed") {
            None | Some(Self::Nil) => Ok(Some(0)),
            Some(Self::Integer(seed)) if *seed >= 0 => Ok(Some(*seed as u64)),
            Some(other) => Err(format!(
                "`seed` is {}: send a whole number from 0",
                other.kind()
            )),
        }
    }

    /// What the value is, for errors.
    pub(super) fn kind(&self) -> String {
        match self {
            Self::Nil => "nothing".to_owned(),
            Self::Bool(_) => "a truth value".to_owned(),
            Self::Integer(number) => format!("the number {number}"),
            Self::Float(number) => format!("the number {number:?}"),
            Self::Text(text) if text.len() <= SHOWN_BYTES => format!("the text '{text}'"),
            Self::Text(_) => "a text".to_owned(),
            Self::Bytes(_) => "bytes without a shape".to_owned(),
            Self::List(_) => "a list".to_owned(),
            Self::Map(_) => "a map".to_owned(),
            Self::Array(array) => format!("an array {array}"),
        }
    }
}

/// Reads a value while there are some left.
#[derive(Clone, Copy)]
struct Seed<'c> {
    left: &'c Cell<usize>,
}

impl<'de> DeserializeSeed<'de> for Seed<'_> {
    type Value = Message<'de>;

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<Message<'de>, D::Error> {
        let left = self.left.get().checked_sub(1);
        self.left.set(
            left.ok_or_else(|| D::Error::custom(format!("it has more than {MOST_VALUES} values")))?,
        );
        reader.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Seed<'_> {
    type Value = Message<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value of msgpack without extensions")
    }

    fn visit_unit<E>(self) -> Result<Message<'de>, E> {
        Ok(Message::Nil)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Message<'de>, E> {
        Ok(Message::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Message<'de>, E> {
        Ok(Message::Integer(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Message<'de>, E> {
        let value = i64::try_from(value)
            .map_err(|_| E::custom(format!("{value} is too large a number")))?;
        Ok(Message::Integer(value))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Message<'de>, E> {
        Ok(Message::Float(value))
    }

    fn visit_borrowed_str<E>(self, value: &'de str) -> Result<Message<'de>, E> {
        Ok(Message::Text(value))
    }

    fn visit_borrowed_bytes<E>(self, value: &'de [u8]) -> Result<Message<'de>, E> {
        Ok(Message::Bytes(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<Message<'de>, A::Error> {
        let mut list = Vec::new();
        while let Some(value) = values.next_element_seed(self)? {
            list.push(value);
        }
        Ok(Message::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut values: A) -> Result<Message<'de>, A::Error> {
        let mut entries: Vec<(&'de str, Message<'de>)> = Vec::new();
        while let Some(key) = values.next_key_seed(self)? {
            let key = match key {
                Message::Text(text) => text,
                Message::Bytes(bytes) => std::str::from_utf8(bytes)
                    .map_err(|_| A::Error::custom("a key of a map is no text"))?,
                other => {
                    let kind = other.kind();
                    return Err(A::Error::custom(format!("a key of a map is {kind}")));
                }
            };
            if entries.iter().any(|(known, _)| *known == key) {
                return Err(A::Error::custom(format!("'{key}' is there twice")));
            }
            entries.push((key, values.next_value_seed(self)?));
        }
        numpy(Message::Map(entries)).map_err(A::Error::custom)
    }
}

/// Maps that numpy's values are packed as, unpacked.
fn numpy(map: Message<'_>) -> Result<Message<'_>, String> {
    if map.get(arrays::ARRAY_KEY).is_some() {
        return NdArray::unpack(&map).map(Message::Array);
    }
    if map.get(arrays::SCALAR_KEY).is_some()
        && let Message::Map(entries) = map
    {
        let data = entries
            .into_iter()
            .find(|(name, _)| *name == arrays::DATA_KEY);
        return data
            .map(|(_, value)| value)
            .ok_or("a numpy scalar without data".to_owned());
    }
    Ok(map)
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::super::ArrayOf;
    use super::*;

    #[derive(Serialize)]
    struct Sent<'a> {
        head: ArrayOf<'a>,
        reset: bool,
        seed: i64,
    }

    fn packed(value: &impl Serialize) -> Vec<u8> {
        rmp_serde::to_vec_named(value).expect("memory takes what is written")
    }

    fn reason(bytes: &[u8]) -> String {
        Message::read(bytes).expect_err("no message").to_string()
    }

    /// A map of one entry, `head`, that is an array as numpy's are packed, except where it lies.
    fn array(dtype: &str, shape: &[i64], data: &[u8]) -> Vec<u8> {
        #[derive(Serialize)]
        struct Packed<'a> {
            __ndarray__: bool,
            data: &'a serde_bytes::Bytes,
            dtype: &'a str,
            shape: &'a [i64],
        }
        let data = serde_bytes::Bytes::new(data);
        packed(&Packed {
            __ndarray__: true,
            data,
            dtype,
            shape,
        })
    }

    #[test]
    fn what_is_packed_is_read() {
        let pixels = [1, 2, 3, 4, 5, 6];
        let sent = Sent {
            head: ArrayOf::Bytes(&pixels, vec![1, 2, 3]),
            reset: true,
            seed: -7,
        };
        let bytes = packed(&sent);
        let message = Message::read(&bytes).expect("a message");
        let array = NdArray {
            dtype: "|u1",
            shape: vec![1, 2, 3],
            data: &pixels,
        };
        assert_eq!(message.get("head"), Some(&Message::Array(array)));
        assert_eq!(message.get("reset").and_then(Message::as_bool), Some(true));
        assert_eq!(message.get("seed"), Some(&Message::Integer(-7)));
    }

    #[test]
    fn a_scalar_of_numpy_is_its_value() {
        // {b"__npgeneric__": True, b"data": True, b"dtype": "|b1"} as the Python client packs it.
        let mut bytes = vec![0x83, 0xc4, 13];
        bytes.extend(b"__npgeneric__");
        bytes.extend([0xc3, 0xc4, 4]);
        bytes.extend(b"data");
        bytes.extend([0xc3, 0xc4, 5]);
        bytes.extend(b"dtype");
        bytes.extend([0xa3]);
        bytes.extend(b"|b1");
        assert_eq!(
            Message::read(&bytes).expect("a scalar"),
            Message::Bool(true)
        );
    }

    #[test]
    fn messages_that_lie_are_refused_with_the_reason() {
        for (bytes, expected) in [
            (
                array("|u1", &[2, 2, 3], &[0; 11]),
                "|u1 [2, 2, 3], and has 11 bytes",
            ),
            (array("<f4", &[3], &[0; 3]), "<f4 [3], and has 3 bytes"),
            (array("|u1", &[-1, 2, 3], &[]), "no list of whole numbers"),
            (array("|u1", &[i64::MAX, 4, 4], &[]), "and has 0 bytes"),
            (array("|O8", &[i64::MAX], &[0; 8]), "and has 8 bytes"),
            (
                array("object", &[1], &[0; 8]),
                "object [1], and has 8 bytes",
            ),
            (
                array("<f99999999999999999999", &[1], &[0; 8]),
                "and has 8 bytes",
            ),
            // A byte string, a text, a list and a map of four thousand million entries.
            (vec![0xc6, 0xff, 0xff, 0xff, 0xff, 1], "cannot be read"),
            (vec![0xdb, 0xff, 0xff, 0xff, 0xff, 1], "cannot be read"),
            (vec![0xdd, 0xff, 0xff, 0xff, 0xff, 1], "cannot be read"),
            (vec![0xdf, 0xff, 0xff, 0xff, 0xff, 1], "cannot be read"),
            (vec![0x91; 100_000], "depth"),
            (
                [vec![0xdd, 0, 1, 0, 0], vec![0xc0; 65_536]].concat(),
                "more than 10000 values",
            ),
            (vec![0xc0, 0xc0], "more follows after its end"),
            // A list and a map that are cut off after their first byte.
            (vec![0xc0, 0x91], "more follows after its end"),
            (vec![0xc0, 0x81], "more follows after its end"),
            (vec![0x81, 0x01, 0x02], "a key of a map is the number 1"),
            (
                vec![0x82, 0xa1, b'a', 1, 0xa1, b'a', 2],
                "'a' is there twice",
            ),
            (vec![0x81, 0xc4, 1, 0xff, 1], "a key of a map is no text"),
            (
                vec![0xcf, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff],
                "too large a number",
            ),
            (vec![0xd4, 1, 2], "cannot be read"),
            (vec![], "cannot be read"),
            (vec![0xc1], "cannot be read"),
        ] {
            let error = reason(&bytes);
            assert!(error.contains(expected), "{error} lacks {expected}");
            assert!(error.contains("openpi_client"), "{error} says no way out");
        }
    }

    /// `openpi-client` packs them too, and nobody looks at what is no camera.
    #[test]
    fn arrays_of_texts_and_times_are_read_and_have_no_values() {
        let text: Vec<u8> = "pick"
            .chars()
            .flat_map(|c| u32::from(c).to_le_bytes())
            .collect();
        for (dtype, shape, data) in [
            ("<U4", &[][..], text),
            ("|S20", &[2][..], vec![b'x'; 40]),
            ("<M8[ns]", &[1][..], vec![0; 8]),
        ] {
            let bytes = array(dtype, shape, &data);
            let Message::Array(array) = Message::read(&bytes).expect(dtype) else {
                panic!("{dtype} is no array")
            };
            assert_eq!(array.values(), None, "{dtype}");
        }
    }

    #[test]
    fn values_of_all_real_types_are_read() {
        for (dtype, data, expected) in [
            ("|u1", vec![255], 255.0),
            ("|i1", vec![255], -1.0),
            ("<i2", vec![0xfe, 0xff], -2.0),
            (">i2", vec![0xff, 0xfe], -2.0),
            ("<f4", 1.5_f32.to_le_bytes().to_vec(), 1.5),
            (">f8", (-2.5_f64).to_be_bytes().to_vec(), -2.5),
            ("<i8", (-3_i64).to_le_bytes().to_vec(), -3.0),
            ("|b1", vec![1], 1.0),
        ] {
            let bytes = array(dtype, &[1], &data);
            let Message::Array(array) = Message::read(&bytes).expect(dtype) else {
                panic!("{dtype} is no array")
            };
            assert_eq!(array.values(), Some(vec![expected]), "{dtype}");
        }
        let halves = array("<f2", &[1], &[0, 0]);
        let Message::Array(array) = Message::read(&halves).expect("an array") else {
            panic!("halves are an array")
        };
        assert_eq!(array.values(), None);
    }

    mod any_bytes {
        use proptest::prelude::*;

        use super::super::Message;

        proptest! {
            #![proptest_config(ProptestConfig::with_cases(2_000))]

            /// Whatever comes is read or refused.
            #[test]
            fn are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
                let _ = Message::read(&bytes);
            }

            /// A sound message with a few bytes changed, or cut.
            #[test]
            fn in_a_message_are_survived(
                changes in proptest::collection::vec((0..80_usize, any::<u8>()), 0..4),
                cut in 0..80_usize,
            ) {
                let mut bytes = super::array("|u1", &[1, 2, 3], &[9; 6]);
                for (place, byte) in changes {
                    let place = place % bytes.len();
                    bytes[place] = byte;
                }
                bytes.truncate(bytes.len().min(80 - cut));
                let _ = Message::read(&bytes);
            }
        }
    }
}
