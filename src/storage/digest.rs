use std::fmt::Write as _;
use std::fs::File;
use std::io;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::StorageError;

/// SHA-256 of a file's bytes, as 64 hexadecimal digits.
///
/// # Errors
/// [`StorageError::Io`] when the file cannot be read.
pub fn sha256_file(path: &Path) -> Result<String, StorageError> {
    let mut hasher = Sha256::new();
    File::open(path)
        .and_then(|mut file| io::copy(&mut file, &mut hasher))
        .map_err(StorageError::io("read", path))?;
    Ok(hexadecimal(&hasher.finalize()))
}

pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
