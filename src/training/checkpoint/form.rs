//! The form of a checkpoint's file: safetensors, with a checksum over all of it.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{Checkpoint, CheckpointState};
use crate::model::sha256_hex;
use crate::training::weights::NamedWeights;

/// Bytes before the header, which say how long it is.
const LENGTH: usize = 8;
/// The key of what the format leaves to who writes: strings by their names.
const METADATA: &str = "__metadata__";
/// The key of everything that is no tensor.
const STATE: &str = "catena";
/// The key of the checksum of the whole file, in which its own digits count as zeros.
const CHECKSUM: &str = "sha256_of_file";
/// The key of the checksum of the data alone, which earlier versions wrote.
const CHECKSUM_OF_DATA: &str = "sha256";
/// Hexadecimal digits of a checksum.
const DIGITS: usize = 64;
const OPTIMISER: &str = "optimiser";

/// What the header says of a tensor.
#[derive(Serialize, Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

impl<S: CheckpointState> Checkpoint<S> {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let (header, data) = self.tensors();
        let state = serde_json::to_string(&self.state).expect("the state has a JSON form");
        let metadata = BTreeMap::from([(STATE, state), (CHECKSUM, "0".repeat(DIGITS))]);
        let mut bytes = assembled(&header, &metadata, &data);
        let checksum = sha256_hex(&bytes);
        let header = &bytes[..bytes.len() - data.len()];
        let place = checksum_place(header).expect("it was just written");
        bytes[place].copy_from_slice(checksum.as_bytes());
        bytes
    }

    /// What the header says of all tensors, and their bytes.
    fn tensors(&self) -> (BTreeMap<String, Entry>, Vec<u8>) {
        let (mut header, mut data) = (BTreeMap::new(), Vec::new());
        for (part, weights) in [
            ("weights", &self.weights),
            ("average", &self.average),
            ("best", &self.best),
        ] {
            for (index, tensor) in weights.iter().enumerate() {
                let start = data.len();
                data.extend(tensor.values.iter().flat_map(|v| v.to_le_bytes()));
                // The number keeps names apart, and shows the order of the parameters.
                let name = format!("{part}.{index:03}.{}", tensor.name);
                header.insert(name, entry("F32", tensor.shape.clone(), start, data.len()));
            }
        }
        let start = data.len();
        data.extend(&self.optimiser);
        let shape = vec![self.optimiser.len()];
        header.insert(OPTIMISER.to_owned(), entry("U8", shape, start, data.len()));
        (header, data)
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote, or an earlier version; what is wrong with it otherwise.
    pub(super) fn from_bytes(mut bytes: Vec<u8>) -> Result<Self, String> {
        let data_start = data_start(&bytes).ok_or_else(|| "it is cut off".to_owned())?;
        let mut header: Map<String, Value> = serde_json::from_slice(&bytes[LENGTH..data_start])
            .map_err(|e| format!("its header is damaged: {e}"))?;
        let metadata = header.remove(METADATA).unwrap_or_default();
        check_sum(&mut bytes, data_start, &metadata)?;
        let state = metadata[STATE].as_str().unwrap_or_default();
        let state: S = serde_json::from_str(state)
            .map_err(|e| format!("its training state is of another method or version: {e}"))?;
        let mut checkpoint = Self {
            state,
            weights: Vec::new(),
            average: Vec::new(),
            best: Vec::new(),
            optimiser: Vec::new(),
        };
        checkpoint.put_all(header, &bytes[data_start..])?;
        match (checkpoint.state.has_best(), checkpoint.best.is_empty()) {
            (true, true) => Err("its state tells of best weights, and it holds none".to_owned()),
            (false, false) => Err("its state does not tell of the best weights in it".to_owned()),
            _ => Ok(checkpoint),
        }
    }

    /// Takes the tensors of a header from their data, which they fill without a gap.
    fn put_all(&mut self, header: Map<String, Value>, data: &[u8]) -> Result<(), String> {
        let mut entries = Vec::new();
        for (name, value) in header {
            let entry: Entry = serde_json::from_value(value)
                .map_err(|e| format!("its header is damaged: tensor '{name}': {e}"))?;
            entries.push((name, entry));
        }
        // They were written in the order of the network's parameters.
        entries.sort_by_key(|(_, entry)| entry.data_offsets);
        let mut filled = 0;
        for (name, entry) in entries {
            let raw = bytes_of(&name, &entry, data, filled)?;
            filled += raw.len();
            self.put(&name, entry.shape, raw)?;
        }
        if filled == data.len() {
            return Ok(());
        }
        let len = data.len();
        Err(format!(
            "its tensors fill {filled} bytes of data, and it holds {len}"
        ))
    }

    fn put(&mut self, name: &str, shape: Vec<usize>, raw: &[u8]) -> Result<(), String> {
        if name == OPTIMISER {
            self.optimiser = raw.to_vec();
            return Ok(());
        }
        let mut parts = name.splitn(3, '.');
        let part = match parts.next() {
            Some("weights") => &mut self.weights,
            Some("average") => &mut self.average,
            Some("best") => &mut self.best,
            _ => return Err(format!("it holds an unknown tensor '{name}'")),
        };
        let name = parts.nth(1).unwrap_or_default().to_owned();
        let values = raw
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        part.push(NamedWeights {
            name,
            shape,
            values,
        });
        Ok(())
    }
}

fn entry(dtype: &str, shape: Vec<usize>, start: usize, end: usize) -> Entry {
    Entry {
        dtype: dtype.to_owned(),
        shape,
        data_offsets: [start, end],
    }
}

/// A file of the safetensors format.
fn assembled(
    header: &BTreeMap<String, Entry>,
    metadata: &BTreeMap<&str, String>,
    data: &[u8],
) -> Vec<u8> {
    let mut json = serde_json::to_value(header).expect("the header has a JSON form");
    json[METADATA] = serde_json::to_value(metadata).expect("strings have a JSON form");
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(8), b' ');
    let mut bytes = (json.len() as u64).to_le_bytes().to_vec();
    bytes.extend(json);
    bytes.extend(data);
    bytes
}

/// Where the data of a file begin; none where it ends before.
fn data_start(bytes: &[u8]) -> Option<usize> {
    let (length, rest) = bytes.split_first_chunk::<LENGTH>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    (length <= rest.len()).then_some(LENGTH + length)
}

/// Where in a file's header the digits of its checksum are. Quotes within the state are escaped, so that it cannot be
/// taken for it.
fn checksum_place(header: &[u8]) -> Option<Range<usize>> {
    let mark = format!("\"{CHECKSUM}\":\"");
    let at = (header.windows(mark.len())).position(|window| window == mark.as_bytes())?;
    let start = at + mark.len();
    (start + DIGITS <= header.len()).then_some(start..start + DIGITS)
}

/// Checks a file against its checksum, whose digits become zeros, or against that of its data alone where an earlier
/// version wrote it.
fn check_sum(bytes: &mut [u8], data_start: usize, metadata: &Value) -> Result<(), String> {
    let is_whole = if let Some(place) = checksum_place(&bytes[..data_start]) {
        let written = bytes[place.clone()].to_vec();
        bytes[place].fill(b'0');
        written == sha256_hex(bytes).as_bytes()
    } else {
        let written = metadata[CHECKSUM_OF_DATA].as_str();
        written.is_some_and(|written| written == sha256_hex(&bytes[data_start..]))
    };
    if is_whole {
        Ok(())
    } else {
        Err("its contents do not match their SHA-256".to_owned())
    }
}

/// The bytes of a tensor, which begin where those of the one before end, and are as many as its shape asks for.
fn bytes_of<'a>(
    name: &str,
    entry: &Entry,
    data: &'a [u8],
    filled: usize,
) -> Result<&'a [u8], String> {
    let damaged = |what: String| format!("its header is damaged: tensor '{name}' {what}");
    let (dtype, width) = if name == OPTIMISER {
        ("U8", 1)
    } else {
        ("F32", 4)
    };
    if entry.dtype != dtype {
        let found = &entry.dtype;
        return Err(damaged(format!("is of type {found}, not {dtype}")));
    }
    let [start, end] = entry.data_offsets;
    let raw = if start == filled {
        data.get(start..end)
    } else {
        None
    };
    let raw = raw.ok_or_else(|| {
        let len = data.len();
        damaged(format!(
            "has bytes {start} to {end} of {len}, and the one before it ends at {filled}"
        ))
    })?;
    let shape = &entry.shape;
    let needed = (shape.iter()).try_fold(width, |bytes: usize, of| bytes.checked_mul(*of));
    if needed != Some(raw.len()) {
        let found = raw.len();
        return Err(damaged(format!("of shape {shape:?} has {found} bytes")));
    }
    Ok(raw)
}

/// The same checkpoint as an earlier version wrote it.
#[cfg(test)]
pub fn in_old_form(bytes: &[u8]) -> Vec<u8> {
    let data_start = data_start(bytes).unwrap();
    let mut header: Map<String, Value> =
        serde_json::from_slice(&bytes[LENGTH..data_start]).unwrap();
    let metadata = header.remove(METADATA).unwrap();
    let state = metadata[STATE].as_str().unwrap().to_owned();
    let header: BTreeMap<String, Entry> = serde_json::from_value(Value::Object(header)).unwrap();
    let data = &bytes[data_start..];
    let metadata = BTreeMap::from([(STATE, state), (CHECKSUM_OF_DATA, sha256_hex(data))]);
    assembled(&header, &metadata, data)
}
