//! Messages to images, whatever they were packed in.

use std::borrow::Cow;

use mcap::read::ChunkReader;
use mcap::records::{ChunkHeader, Record};
use prost::Message as _;

use super::cdr;
use super::messages::{CompressedImage, FoxgloveCompressedImage, FoxgloveRawImage, RawImage};
use super::pixels::{RawPixels, decode_compressed};
use super::topic::ImageFormat;
use crate::trajectory::Image;

/// The image of a message.
pub(super) fn decode_image(format: ImageFormat, message: &[u8]) -> Result<Image, String> {
    match format {
        ImageFormat::File => decode_compressed(message, "file"),
        ImageFormat::CompressedCdr => {
            let plain = without_compression(message)?;
            let image: CompressedImage = cdr::decode(&plain)?;
            decode_compressed(image.data, &image.format)
        }
        ImageFormat::RawCdr => {
            let plain = without_compression(message)?;
            let image: RawImage = cdr::decode(&plain)?;
            RawPixels {
                height: image.height,
                width: image.width,
                encoding: &image.encoding,
                row_bytes: image.step,
                data: image.data,
            }
            .to_rgb()
        }
        ImageFormat::CompressedFoxglove => {
            let image = FoxgloveCompressedImage::decode(message).map_err(|e| e.to_string())?;
            decode_compressed(&image.data, &image.format)
        }
        ImageFormat::RawFoxglove => {
            let image = FoxgloveRawImage::decode(message).map_err(|e| e.to_string())?;
            RawPixels {
                height: image.height,
                width: image.width,
                encoding: &image.encoding,
                row_bytes: image.step,
                data: &image.data,
            }
            .to_rgb()
        }
    }
}

const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// More than any camera's image; a larger claim is damage.
const MESSAGE_BYTES_LIMIT: u64 = 1 << 30;

/// The message itself where rosbag2 compressed each message by itself
/// (`--compression-mode message`); such a file does not say so, but no CDR message starts with the
/// magic number of zstd.
pub(super) fn without_compression(message: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    if !message.starts_with(&ZSTD_MAGIC) {
        return Ok(Cow::Borrowed(message));
    }
    let length = zstd_content_bytes(message)
        .filter(|n| *n <= MESSAGE_BYTES_LIMIT)
        .ok_or("the zstd message does not say how long it is")?;
    unpack_as_chunk(message, length)
        .map(Cow::Owned)
        .ok_or_else(|| format!("the zstd message of {} bytes is damaged", message.len()))
}

/// Unpacks one zstd frame with the decoder that the mcap crate keeps for chunks: behind a stored frame
/// that holds the head of a record, the message becomes the body of the only record of a chunk.
fn unpack_as_chunk(message: &[u8], length: u64) -> Option<Vec<u8>> {
    const PRIVATE_OPCODE: u8 = 0x80;
    const RECORD_HEAD_BYTES: u8 = 9;
    // Magic, "one segment of 9 bytes", one last block, stored, of 9 bytes.
    let mut chunk = ZSTD_MAGIC.to_vec();
    chunk.extend([0x20, RECORD_HEAD_BYTES, (RECORD_HEAD_BYTES << 3) | 1, 0, 0]);
    chunk.push(PRIVATE_OPCODE);
    chunk.extend(length.to_le_bytes());
    chunk.extend(message);
    let header = ChunkHeader {
        message_start_time: 0,
        message_end_time: 0,
        uncompressed_size: u64::from(RECORD_HEAD_BYTES) + length,
        uncompressed_crc: 0,
        compression: "zstd".to_owned(),
        compressed_size: chunk.len() as u64,
    };
    match ChunkReader::new(header, &chunk).ok()?.next()?.ok()? {
        Record::Unknown { data, .. } => Some(data.into_owned()),
        _ => None,
    }
}

/// The uncompressed length that a zstd frame's header gives (RFC 8878, section 3.1.1.1).
fn zstd_content_bytes(frame: &[u8]) -> Option<u64> {
    let descriptor = *frame.get(4)?;
    let single_segment = descriptor & 0x20 != 0;
    let field_bytes = match descriptor >> 6 {
        0 if single_segment => 1,
        0 => return None,
        flag => 1usize << flag,
    };
    let dictionary_bytes = [0, 1, 2, 4][usize::from(descriptor & 3)];
    let start = 5 + usize::from(!single_segment) + dictionary_bytes;
    let mut field = [0; 8];
    field[..field_bytes].copy_from_slice(frame.get(start..start + field_bytes)?);
    let offset = if field_bytes == 2 { 256 } else { 0 };
    Some(u64::from_le_bytes(field) + offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 times "catena ", compressed once with the zstd of Python, content size included.
    const FRAME: [u8; 23] = [
        0x28, 0xb5, 0x2f, 0xfd, 0x20, 0x8c, 0x75, 0x00, 0x00, 0x38, 0x63, 0x61, 0x74, 0x65, 0x6e,
        0x61, 0x20, 0x01, 0x00, 0x02, 0x51, 0xc5, 0x08,
    ];

    #[test]
    fn message_compressed_by_itself_is_unpacked() {
        let plain = without_compression(&FRAME).unwrap();
        assert_eq!(plain, "catena ".repeat(20).as_bytes());
        assert!(without_compression(&FRAME[..15]).is_err());
        assert_eq!(*without_compression(&[0, 1, 0, 0]).unwrap(), [0, 1, 0, 0]);
    }

    #[test]
    fn foxglove_images_are_read() {
        let raw = FoxgloveRawImage {
            width: 1,
            height: 2,
            encoding: "bgr8".to_owned(),
            step: 3,
            data: vec![3, 2, 1, 6, 5, 4],
        };
        let image = decode_image(ImageFormat::RawFoxglove, &raw.encode_to_vec()).unwrap();
        assert_eq!(image.rgb(), [1, 2, 3, 4, 5, 6]);
        let compressed = FoxgloveCompressedImage {
            data: super::super::pixels::encode_jpeg(&image, 95).unwrap(),
            format: "jpeg".to_owned(),
        };
        let bytes = compressed.encode_to_vec();
        let again = decode_image(ImageFormat::CompressedFoxglove, &bytes).unwrap();
        assert_eq!((again.height(), again.width()), (2, 1));
    }
}
