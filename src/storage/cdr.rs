//! ROS 2's wire format: a 4-byte encapsulation header that names the byte order, then plain CDR.

use byteorder::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize};

const HEADER_BYTES: usize = 4;

/// A message as ROS 2 writes it on a little-endian machine.
pub(super) fn encode<T: Serialize>(message: &T, bytes_hint: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + bytes_hint);
    bytes.extend_from_slice(&[0, 1, 0, 0]);
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// Reads a message of either byte order; what follows the message is ignored.
pub(super) fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, String> {
    let Some((header, body)) = bytes.split_at_checked(HEADER_BYTES) else {
        return Err(format!(
            "{} bytes are too few for a CDR message",
            bytes.len()
        ));
    };
    let message = match header[..2] {
        [0, 0] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        [0, 1] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        _ => {
            return Err(format!(
                "encapsulation {:02x} {:02x} is not plain CDR (00 00 or 00 01)",
                header[0], header[1]
            ));
        }
    };
    message
        .map(|(value, _)| value)
        .map_err(|e| format!("the CDR message cannot be read: {e}"))
}

#[cfg(test)]
mod tests {
    use super::super::messages::JointState;
    use super::*;

    #[test]
    fn big_endian_message_reads_like_the_little_endian_one() {
        let message = JointState {
            name: vec!["x".to_owned(), "gripper".to_owned()],
            position: vec![0.25, -1.5],
            ..JointState::default()
        };
        let mut big = vec![0, 0, 0, 0];
        cdr_encoding::to_writer::<_, BigEndian, _>(&mut big, &message).unwrap();
        let little = encode(&message, 64).unwrap();
        assert_ne!(big, little);
        assert_eq!(decode::<JointState>(&big).unwrap(), message);
        assert_eq!(decode::<JointState>(&little).unwrap(), message);
    }

    #[test]
    fn foreign_encapsulation_and_short_message_say_what_they_are() {
        let parameter_list = decode::<JointState>(&[0, 3, 0, 0, 1, 2, 3, 4]).unwrap_err();
        assert!(parameter_list.contains("00 03"), "{parameter_list}");
        assert!(decode::<JointState>(&[0, 1]).unwrap_err().contains('2'));
        assert!(decode::<JointState>(&[0, 1, 0, 0, 9]).is_err());
    }
}
