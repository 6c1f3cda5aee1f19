use std::fmt;
use std::sync::Arc;

use image::RgbImage;
use image::imageops::{FilterType, resize};
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
        let expected = height as usize * width as usize * 3;
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

    /// The image at another size, each pixel the mean of those that it covers, weighed by a triangle
    /// (bilinear where it grows). An image that has the size already is shared.
    ///
    /// # Panics
    /// Never: an image has as many pixels as it says.
    #[must_use]
    pub fn resized(&self, height: u32, width: u32) -> Self {
        if (self.height, self.width) == (height, width) {
            return self.clone();
        }
        let pixels = RgbImage::from_raw(self.width, self.height, self.rgb.to_vec());
        let pixels = pixels.expect("an image has all its pixels");
        let rgb = resize(&pixels, width, height, FilterType::Triangle).into_raw();
        Self {
            height,
            width,
            rgb: rgb.into(),
        }
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
