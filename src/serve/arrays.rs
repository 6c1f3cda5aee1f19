use std::fmt;

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use super::Message;

/// How the package msgpack-numpy (and `openpi-client`) marks an array, a scalar, and what they hold.
pub(super) const ARRAY_KEY: &str = "__ndarray__";
pub(super) const SCALAR_KEY: &str = "__npgeneric__";
pub(super) const DATA_KEY: &str = "data";
const DTYPE_KEY: &str = "dtype";
const SHAPE_KEY: &str = "shape";

/// A numpy array as it was received: its bytes are as many as its shape and dtype say.
#[derive(Clone, Debug, PartialEq)]
pub struct NdArray<'a> {
    /// Numpy's name of the values' type, such as `|u1` or `<f4`.
    pub dtype: &'a str,
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Values in C order, little-endian unless the dtype begins with `>`.
    pub data: &'a [u8],
}

impl<'a> NdArray<'a> {
    /// An array out of the map that it is packed as.
    pub(super) fn unpack(map: &Message<'a>) -> Result<Self, String> {
        let (Some(Message::Bytes(data)), Some(Message::Text(dtype)), Some(Message::List(axes))) =
            (map.get(DATA_KEY), map.get(DTYPE_KEY), map.get(SHAPE_KEY))
        else {
            return Err("an array lacks its data (bytes), dtype (text) or shape (list)".to_owned());
        };
        let axis = |length: &Message<'_>| match length {
            Message::Integer(length) => usize::try_from(*length).ok(),
            _ => None,
        };
        let shape: Option<Vec<usize>> = axes.iter().map(axis).collect();
        let shape = shape.ok_or("a shape that is no list of whole numbers from 0")?;
        let array = Self { dtype, shape, data };
        let values = array
            .shape
            .iter()
            .try_fold(1_usize, |n, axis| n.checked_mul(*axis));
        let bytes = values
            .zip(array.value_bytes())
            .and_then(|(n, size)| n.checked_mul(size));
        if bytes != Some(data.len()) {
            return Err(format!(
                "an array says that it is {array}, and has {} bytes",
                data.len()
            ));
        }
        Ok(array)
    }

    /// Bytes of one value: the number in numpy's name of the type, which is that of characters in the type of texts, such as
    /// `<U7`. The type of times has a unit behind it, as `<M8[ns]` does.
    fn value_bytes(&self) -> Option<usize> {
        let kind = self
            .dtype
            .trim_start_matches(|c: char| !c.is_ascii_alphabetic());
        let number = kind.trim_start_matches(|c: char| !c.is_ascii_digit());
        let number = number.split('[').next().unwrap_or_default();
        let number: usize = number.parse().ok()?;
        let size = if kind.starts_with('U') { 4 } else { 1 };
        number.checked_mul(size).filter(|bytes| *bytes > 0)
    }

    /// The values, of whatever real type they are; `None` for other types than those of numpy's numbers
    /// of 1, 2, 4 or 8 bytes.
    #[must_use]
    pub fn values(&self) -> Option<Vec<f64>> {
        let (order, kind) = match self.dtype.as_bytes() {
            [order @ (b'|' | b'<' | b'>' | b'='), kind, ..] => (*order, *kind),
            _ => return None,
        };
        let size = self.value_bytes()?;
        let value = |bytes: &[u8]| -> Option<f64> {
            let mut little = [0; 8];
            little[..size].copy_from_slice(bytes);
            if order == b'>' {
                little[..size].reverse();
            }
            let bits = u64::from_le_bytes(little);
            // The highest bit of the value is moved to the top and back, which keeps its sign.
            let signed = ((bits << (64 - 8 * size)) as i64) >> (64 - 8 * size);
            match (kind, size) {
                (b'u', _) | (b'b', 1) => Some(bits as f64),
                (b'i', _) => Some(signed as f64),
                (b'f', 4) => Some(f64::from(f32::from_bits(bits as u32))),
                (b'f', 8) => Some(f64::from_bits(bits)),
                _ => None,
            }
        };
        if !matches!(size, 1 | 2 | 4 | 8) {
            return None;
        }
        self.data.chunks_exact(size).map(value).collect()
    }
}

impl fmt::Display for NdArray<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dtype: String = self.dtype.chars().take(16).collect();
        write!(f, "{dtype} {:?}", &self.shape[..self.shape.len().min(8)])
    }
}

/// An array to be sent: numpy finds an array where it is unpacked.
#[derive(Clone, Debug, PartialEq)]
pub enum ArrayOf<'a> {
    /// `uint8`, such as an image in the order height, width, channel.
    Bytes(&'a [u8], Vec<usize>),
    /// `float32`.
    Floats(Vec<f32>, Vec<usize>),
}

impl Serialize for ArrayOf<'_> {
    fn serialize<S: Serializer>(&self, writer: S) -> Result<S::Ok, S::Error> {
        let key = serde_bytes::Bytes::new;
        let (dtype, shape) = match self {
            Self::Bytes(_, shape) => ("|u1", shape),
            Self::Floats(_, shape) => ("<f4", shape),
        };
        let mut map = writer.serialize_map(Some(4))?;
        map.serialize_entry(key(ARRAY_KEY.as_bytes()), &true)?;
        match self {
            Self::Bytes(data, _) => map.serialize_entry(key(DATA_KEY.as_bytes()), key(data))?,
            Self::Floats(values, _) => {
                let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
                map.serialize_entry(key(DATA_KEY.as_bytes()), key(&data))?;
            }
        }
        map.serialize_entry(key(DTYPE_KEY.as_bytes()), dtype)?;
        map.serialize_entry(key(SHAPE_KEY.as_bytes()), shape)?;
        map.end()
    }
}
