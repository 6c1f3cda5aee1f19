//! Images that are none: maps of how far away things are, as depth cameras give them.

use prost::Message as _;

use super::cdr;
use super::decode::without_compression;
use super::messages::{CompressedImage, FoxgloveCompressedImage, FoxgloveRawImage, RawImage};
use super::topic::ImageFormat;

/// How the message of a topic with images, or the file of a picture, tells that it holds depths; none where it does not.
/// Only its head is looked at.
pub(super) fn depths_in(format: ImageFormat, message: &[u8]) -> Option<String> {
    match format {
        ImageFormat::File => of_file(message),
        ImageFormat::CompressedCdr => {
            let plain = without_compression(message).ok()?;
            let image: CompressedImage = cdr::decode(&plain).ok()?;
            of_compressed(&image.format, image.data)
        }
        ImageFormat::RawCdr => {
            let plain = without_compression(message).ok()?;
            let image: RawImage = cdr::decode(&plain).ok()?;
            of_encoding(&image.encoding)
        }
        ImageFormat::CompressedFoxglove => {
            let image = FoxgloveCompressedImage::decode(message).ok()?;
            of_compressed(&image.format, &image.data)
        }
        ImageFormat::RawFoxglove => {
            let image = FoxgloveRawImage::decode(message).ok()?;
            of_encoding(&image.encoding)
        }
    }
}

fn of_encoding(encoding: &str) -> Option<String> {
    let is_deep = matches!(encoding, "16UC1" | "32FC1" | "64FC1" | "mono16");
    is_deep.then(|| told(&format!("encoding '{encoding}'")))
}

/// ROS packs depths as PNG behind a head of its own, and says so in the format.
fn of_compressed(format: &str, data: &[u8]) -> Option<String> {
    let is_deep = format.contains("compressedDepth") || is_deep_png(data);
    is_deep.then(|| told(&format!("format '{format}'")))
}

/// LeRobot keeps depths as TIFF, and nothing else; older programs as PNG.
fn of_file(bytes: &[u8]) -> Option<String> {
    let is_tiff = bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*");
    let kind = if is_tiff { "TIFF" } else { "PNG" };
    (is_tiff || is_deep_png(bytes)).then(|| told(kind))
}

/// Whether a file is a PNG with grey values of 16 bits.
fn is_deep_png(bytes: &[u8]) -> bool {
    const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";
    // Behind the size stand the bits of a value, and the kind of colour: grey, or grey with transparency.
    bytes.starts_with(MAGIC) && matches!(bytes.get(24..26), Some([16, 0 | 4]))
}

fn told(what: &str) -> String {
    format!("values of more than 8 bits ({what}), as of a depth camera, are not used")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::fixtures::{depth_picture, picture};
    use crate::storage::pixels::{encode_jpeg, encode_png};

    #[test]
    fn files_of_depths_are_told_from_pictures() {
        let deep = depth_picture(4, 6);
        let seen = picture(4, 6, 0);
        let is_deep = |bytes: &[u8]| depths_in(ImageFormat::File, bytes).is_some();
        assert!(is_deep(&deep) && is_deep(b"II*\0 and so on"));
        assert!(!is_deep(&encode_png(&seen).unwrap()));
        assert!(!is_deep(&encode_jpeg(&seen, 90).unwrap()));
        assert!(!is_deep(&deep[..20]) && !is_deep(b""));
    }

    #[test]
    fn foxglove_depths_are_told_from_pictures() {
        let raw = |encoding: &str| {
            let image = FoxgloveRawImage {
                encoding: encoding.to_owned(),
                ..FoxgloveRawImage::default()
            };
            depths_in(ImageFormat::RawFoxglove, &image.encode_to_vec())
        };
        let told = raw("32FC1").unwrap();
        assert!(told.contains("(encoding '32FC1')"), "{told}");
        assert_eq!(raw("rgb8"), None);
        let packed = FoxgloveCompressedImage {
            data: depth_picture(2, 2),
            format: "png".to_owned(),
        };
        let packed = depths_in(ImageFormat::CompressedFoxglove, &packed.encode_to_vec());
        assert!(packed.is_some_and(|told| told.contains("(format 'png')")));
    }
}
