use std::fmt;
use std::sync::Arc;

use image::imageops::{self, FilterType};
use image::{ImageBuffer, Rgb};
use serde::{Deserialize, Serialize};

use super::TrajectoryError;

/// An RGB image: `height` rows of `width` pixels, three bytes (0..=255) a pixel, row-major (HWC).
///
/// Cloning shares the pixels.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Image {
    height: u32,
    width: u32,
    rgb: Arc<[u8]>,
}

impl Image {
    /// Longest side of a picture, in pixels, that is read from a file or a client; cameras give less. A longer one
    /// could take more memory to resize than there is.
    pub const LONGEST_SIDE: u32 = 16_384;

    /// Wraps pixels that are in HWC order.
    ///
    /// # Errors
    /// [`TrajectoryError::PixelCount`] when the buffer's length is not `height * width * 3`.
    pub fn new(
        height: u32,
        width: u32,
        rgb: impl Into<Arc<[u8]>>,
    ) -> Result<Self, TrajectoryError> {
        let rgb = rgb.into();
        let expected = (height as usize)
            .saturating_mul(width as usize)
            .saturating_mul(3);
        if rgb.len() != expected {
            return Err(TrajectoryError::PixelCount {
                height,
                width,
                expected,
                found: rgb.len(),
            });
        }
        Ok(Self { height, width, rgb })
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// The same picture as `height` rows of `width` pixels: all of it is stretched or squeezed, whatever
    /// its shape, by bilinear interpolation that averages over what a pixel covers where it gets smaller
    /// (a triangle filter). A picture of that size already is returned as it is.
    ///
    /// Recordings are resized by the same rule, so that what a robot sees is what its model was
    /// trained on.
    ///
    /// # Panics
    /// If a size is 0.
    #[must_use]
    pub fn resized(&self, height: u32, width: u32) -> Self {
        assert!(height > 0 && width > 0, "a picture has pixels");
        if (height, width) == (self.height, self.width) {
            return self.clone();
        }
        let pixels = ImageBuffer::<Rgb<u8>, _>::from_raw(self.width, self.height, &self.rgb[..])
            .expect("an image holds as many bytes as its size needs");
        let rgb = imageops::resize(&pixels, width, height, FilterType::Triangle).into_raw();
        Self {
            height,
            width,
            rgb: rgb.into(),
        }
    }

    /// All pixels, HWC.
    #[must_use]
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }
}

impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Image({}x{})", self.height, self.width)
    }
}

/// A camera by name, with the size of the images that it gives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraSpec {
    /// Unique within a robot, such as `head`.
    pub name: String,
    /// Rows of its images.
    pub height: u32,
    /// Columns of its images.
    pub width: u32,
}

/// Cameras with their sizes, for messages.
pub(crate) fn printed_cameras(cameras: &[CameraSpec]) -> String {
    let each: Vec<String> = cameras
        .iter()
        .map(|c| format!("{} {}x{}", c.name, c.height, c.width))
        .collect();
    format!("[{}]", each.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_that_are_not_as_many_as_the_size_needs_are_refused() {
        for (height, width, bytes) in [(2, 3, 17), (2, 3, 19), (u32::MAX, u32::MAX, 3)] {
            let refused = Image::new(height, width, vec![0; bytes]);
            assert!(
                matches!(refused, Err(TrajectoryError::PixelCount { found, .. }) if found == bytes),
                "{refused:?}"
            );
        }
    }

    #[test]
    fn resizing_averages_and_keeps_what_is_plain() {
        let halves: Vec<u8> = (0..4 * 8)
            .flat_map(|i| if i % 8 < 4 { [0; 3] } else { [200; 3] })
            .collect();
        let image = Image::new(4, 8, halves).unwrap();
        let small = image.resized(2, 2);
        assert_eq!((small.height(), small.width()), (2, 2));
        assert!(
            small.rgb()[0] < 40 && small.rgb()[3] > 160,
            "{:?}",
            small.rgb()
        );
        assert_eq!(image.resized(4, 8), image);
        let grey = Image::new(3, 5, vec![77; 45]).unwrap();
        assert!(grey.resized(7, 2).rgb().iter().all(|v| *v == 77));
    }
}
