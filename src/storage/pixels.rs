//! Pixels as files hold them: JPEG and PNG, and the raw encodings of ROS and Foxglove.

use std::io::Cursor;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ColorType, ExtendedColorType, ImageEncoder as _, ImageReader, Limits};

use crate::trajectory::Image;

/// An image as JPEG of the given quality, 1..=100.
pub(super) fn encode_jpeg(image: &Image, quality: u8) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(
            image.rgb(),
            image.width(),
            image.height(),
            ExtendedColorType::Rgb8,
        )
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// An image as PNG, which loses nothing.
pub(super) fn encode_png(image: &Image) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(
            image.rgb(),
            image.width(),
            image.height(),
            ExtendedColorType::Rgb8,
        )
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// Bytes of a decoded picture.
pub(super) const MAX_IMAGE_BYTES: u64 = 256 << 20;

/// Reads a JPEG or PNG, whatever its name says it is.
pub(super) fn decode_compressed(bytes: &[u8], format: &str) -> Result<Image, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    // A few damaged bytes can claim a picture that fits into no memory.
    let mut limits = Limits::default();
    limits.max_image_width = Some(Image::LONGEST_SIDE);
    limits.max_image_height = Some(Image::LONGEST_SIDE);
    limits.max_alloc = Some(MAX_IMAGE_BYTES);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| {
        // Some decoders say it on several lines.
        let reason = e
            .to_string()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        format!(
            "{} bytes of format '{format}' are no JPEG or PNG: {reason}",
            bytes.len()
        )
    })?;
    // As colours they would be nearly black.
    if matches!(decoded.color(), ColorType::L16 | ColorType::La16) {
        return Err(format!(
            "grey values of 16 bits in format '{format}', as of a depth camera, are not supported (8 bits are)"
        ));
    }
    let decoded = decoded.into_rgb8();
    Image::new(decoded.height(), decoded.width(), decoded.into_raw()).map_err(|e| e.to_string())
}

/// Raw rows of pixels; `row_bytes` may be more than the pixels need.
pub(super) struct RawPixels<'a> {
    pub height: u32,
    pub width: u32,
    pub encoding: &'a str,
    pub row_bytes: u32,
    pub data: &'a [u8],
}

impl RawPixels<'_> {
    /// The same picture as RGB.
    pub fn to_rgb(&self) -> Result<Image, String> {
        // Where red, green and blue lie in a pixel of so many bytes.
        let (pixel_bytes, order) = match self.encoding {
            "rgb8" => (3, [0, 1, 2]),
            "bgr8" => (3, [2, 1, 0]),
            "rgba8" => (4, [0, 1, 2]),
            "bgra8" => (4, [2, 1, 0]),
            "mono8" | "8UC1" => (1, [0, 0, 0]),
            other => {
                return Err(format!(
                    "encoding '{other}' is not supported (rgb8, bgr8, rgba8, bgra8 and mono8 are)"
                ));
            }
        };
        let (height, width, row) = (
            self.height as usize,
            self.width as usize,
            self.row_bytes as usize,
        );
        let used = width.saturating_mul(pixel_bytes);
        let needed = row
            .saturating_mul(height.saturating_sub(1))
            .saturating_add(used);
        if height == 0 || width == 0 || row < used || self.data.len() < needed {
            return Err(format!(
                "{height}x{width} {} in rows of {row} bytes does not fit into {} bytes",
                self.encoding,
                self.data.len()
            ));
        }
        if self.height.max(self.width) > Image::LONGEST_SIDE {
            return Err(format!(
                "{height}x{width} is longer than {} pixels",
                Image::LONGEST_SIDE
            ));
        }
        let mut rgb = Vec::with_capacity(height * width * 3);
        for y in 0..height {
            for pixel in self.data[y * row..y * row + used].chunks_exact(pixel_bytes) {
                rgb.extend(order.map(|channel| pixel[channel]));
            }
        }
        Image::new(self.height, self.width, rgb).map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(encoding: &str, row_bytes: u32, data: &[u8]) -> Result<Image, String> {
        RawPixels {
            height: 2,
            width: 1,
            encoding,
            row_bytes,
            data,
        }
        .to_rgb()
    }

    #[test]
    fn every_encoding_gives_red_green_blue() {
        let expected = Image::new(2, 1, vec![10, 20, 30, 40, 50, 60]).unwrap();
        let same =
            |encoding, row, data: &[u8]| assert_eq!(raw(encoding, row, data).unwrap(), expected);
        same("rgb8", 3, &[10, 20, 30, 40, 50, 60]);
        same("bgr8", 3, &[30, 20, 10, 60, 50, 40]);
        same("rgba8", 4, &[10, 20, 30, 9, 40, 50, 60, 9]);
        same("bgra8", 4, &[30, 20, 10, 9, 60, 50, 40, 9]);
        same("rgb8", 5, &[10, 20, 30, 0, 0, 40, 50, 60]);
        let grey = raw("mono8", 1, &[7, 8]).unwrap();
        assert_eq!(grey.rgb(), [7, 7, 7, 8, 8, 8]);
    }

    #[test]
    fn a_picture_of_depths_is_refused() {
        let bytes = crate::storage::fixtures::depth_picture(1, 2);
        let refused = decode_compressed(&bytes, "16UC1; png compressed").unwrap_err();
        assert!(
            refused.contains("16 bits in format '16UC1; png"),
            "{refused}"
        );
    }

    #[test]
    fn wrong_sizes_and_encodings_are_refused() {
        assert!(raw("rgb8", 3, &[0; 5]).unwrap_err().contains("5 bytes"));
        assert!(raw("rgb8", 2, &[0; 9]).is_err());
        assert!(raw("16UC1", 2, &[0; 9]).unwrap_err().contains("16UC1"));
        assert!(
            decode_compressed(&[1, 2, 3], "jpeg")
                .unwrap_err()
                .contains("'jpeg'")
        );
    }
}
