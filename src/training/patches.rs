use super::augmentation::Variation;
use super::{ChannelNormalisation, EncoderConfig};
use crate::trajectory::{CameraSpec, Image};

/// How the pictures of one camera are cut into the overlapping square patches that the network's
/// first layer sees. Cutting them here, straight from bytes, makes that layer one matrix product; in
/// the exported network it is an ordinary convolution with the same padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatchGrid {
    /// Rows of the pictures.
    pub height: usize,
    /// Columns of the pictures.
    pub width: usize,
    /// Frames in a state.
    pub stack: usize,
    /// Side of a patch in pixels.
    pub kernel: usize,
    /// Distance of neighbouring patches in pixels.
    pub stride: usize,
    /// Rows and columns of patches are a multiple of this, so that every stage can halve them.
    pub multiple: usize,
}

impl PatchGrid {
    /// The grid of a camera's pictures.
    pub fn new(height: u32, width: u32, stack: usize, encoder: &EncoderConfig) -> Self {
        Self {
            height: height as usize,
            width: width as usize,
            stack,
            kernel: encoder.stem_kernel,
            stride: encoder.stem_stride,
            multiple: 1 << encoder.stage_channels.len(),
        }
    }

    /// The grids of some cameras.
    pub fn of_cameras(cameras: &[CameraSpec], stack: usize, encoder: &EncoderConfig) -> Vec<Self> {
        cameras
            .iter()
            .map(|c| Self::new(c.height, c.width, stack, encoder))
            .collect()
    }

    /// Rows of patches.
    pub fn rows(&self) -> usize {
        self.height
            .div_ceil(self.stride)
            .next_multiple_of(self.multiple)
    }

    /// Columns of patches.
    pub fn columns(&self) -> usize {
        self.width
            .div_ceil(self.stride)
            .next_multiple_of(self.multiple)
    }

    /// Number of patches.
    pub fn positions(&self) -> usize {
        self.rows() * self.columns()
    }

    /// Values of a patch: frames (oldest first) x RGB x rows x columns.
    pub fn patch_len(&self) -> usize {
        3 * self.stack * self.kernel * self.kernel
    }

    /// Padding `[top, left, bottom, right]` in pixels, as ONNX wants it.
    pub fn padding(&self) -> [usize; 4] {
        let over = |patches: usize, pixels: usize| {
            ((patches - 1) * self.stride + self.kernel).saturating_sub(pixels)
        };
        let (vertical, horizontal) = (
            over(self.rows(), self.height),
            over(self.columns(), self.width),
        );
        let (top, left) = (vertical / 2, horizontal / 2);
        [top, left, vertical - top, horizontal - left]
    }

    /// Writes the normalised patches of a state, `[positions, patch_len]`, into `out`. Pixels that a
    /// shift moves in repeat the picture's edge; padding is 0, the mean colour.
    pub fn cut(
        &self,
        frames: &[&Image],
        normalisation: &ChannelNormalisation,
        variation: &Variation,
        out: &mut [f32],
    ) {
        let [top, left, bottom, right] = self.padding();
        let (rows, columns) = (self.height + top + bottom, self.width + left + right);
        let mut plane = vec![0.0; rows * columns];
        for (frame, image) in frames.iter().enumerate() {
            for channel in 0..3 {
                let table = lookup(normalisation, variation, channel);
                for y in 0..self.height {
                    let start = (y + top) * columns + left;
                    let row = &mut plane[start..start + self.width];
                    self.fill_row(image, channel, y, variation, &table, row);
                }
                self.scatter(&plane, columns, frame * 3 + channel, out);
            }
        }
    }

    fn fill_row(
        &self,
        image: &Image,
        channel: usize,
        y: usize,
        variation: &Variation,
        table: &[f32; 256],
        row: &mut [f32],
    ) {
        let clamp = |at: usize, shift: i32, len: usize| {
            (at as i64 - i64::from(shift)).clamp(0, len as i64 - 1) as usize
        };
        let source = clamp(y, variation.down_pixels, self.height) * self.width;
        let rgb = &image.rgb()[source * 3..(source + self.width) * 3];
        let moved = variation.right_pixels;
        if moved == 0 && !variation.is_mirrored {
            for (value, pixel) in row.iter_mut().zip(rgb.chunks_exact(3)) {
                *value = table[usize::from(pixel[channel])];
            }
            return;
        }
        for (x, value) in row.iter_mut().enumerate() {
            let mut from = clamp(x, moved, self.width);
            if variation.is_mirrored {
                from = self.width - 1 - from;
            }
            *value = table[usize::from(rgb[from * 3 + channel])];
        }
    }

    fn scatter(&self, plane: &[f32], columns: usize, channel: usize, out: &mut [f32]) {
        let (kernel, patch_len) = (self.kernel, self.patch_len());
        let offset = channel * kernel * kernel;
        for (row, patches) in out.chunks_exact_mut(self.columns() * patch_len).enumerate() {
            for (column, patch) in patches.chunks_exact_mut(patch_len).enumerate() {
                let start = row * self.stride * columns + column * self.stride;
                let target = &mut patch[offset..offset + kernel * kernel];
                for (line, values) in target.chunks_exact_mut(kernel).enumerate() {
                    let from = start + line * columns;
                    values.copy_from_slice(&plane[from..from + kernel]);
                }
            }
        }
    }
}

/// The normalised value of each byte.
fn lookup(
    normalisation: &ChannelNormalisation,
    variation: &Variation,
    channel: usize,
) -> [f32; 256] {
    let (mean, deviation) = (
        normalisation.mean[channel],
        normalisation.deviation[channel],
    );
    std::array::from_fn(|byte| {
        let value = (byte as f32 * variation.gain[channel]).min(255.0);
        (value - mean) / deviation
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: ChannelNormalisation = ChannelNormalisation {
        mean: [0.0; 3],
        deviation: [1.0; 3],
    };

    fn grid() -> PatchGrid {
        PatchGrid {
            height: 5,
            width: 4,
            stack: 1,
            kernel: 3,
            stride: 2,
            multiple: 1,
        }
    }

    /// Red counts pixels from 1, green is 100, blue is 0.
    fn image() -> Image {
        let rgb: Vec<u8> = (1..=20).flat_map(|i| [i, 100, 0]).collect();
        Image::new(5, 4, rgb).unwrap()
    }

    fn cut(variation: &Variation) -> Vec<f32> {
        let grid = grid();
        let mut out = vec![-1.0; grid.positions() * grid.patch_len()];
        grid.cut(&[&image()], &PLAIN, variation, &mut out);
        out
    }

    #[test]
    fn patches_by_hand() {
        let grid = grid();
        assert_eq!((grid.rows(), grid.columns()), (3, 2));
        assert_eq!(grid.padding(), [1, 0, 1, 1]);
        let out = cut(&Variation::NONE);
        let red = |position: usize| out[position * 27..position * 27 + 9].to_vec();
        assert_eq!(red(0), [0., 0., 0., 1., 2., 3., 5., 6., 7.]);
        assert_eq!(red(3), [7., 8., 0., 11., 12., 0., 15., 16., 0.]);
        assert_eq!(out[3 * 27 + 9..3 * 27 + 12], [100., 100., 0.]);
    }

    #[test]
    fn every_stage_can_halve_the_grid() {
        let grid = PatchGrid::new(90, 160, 2, &EncoderConfig::default());
        assert_eq!((grid.rows(), grid.columns()), (24, 40));
        assert_eq!(grid.padding(), [4, 1, 4, 1]);
    }

    #[test]
    fn a_shift_repeats_the_edge() {
        let out = cut(&Variation {
            right_pixels: 1,
            ..Variation::NONE
        });
        assert_eq!(out[..9], [0., 0., 0., 1., 1., 2., 5., 5., 6.]);
        let out = cut(&Variation {
            down_pixels: -1,
            ..Variation::NONE
        });
        assert_eq!(out[..9], [0., 0., 0., 5., 6., 7., 9., 10., 11.]);
    }

    #[test]
    fn a_mirrored_picture_shows_its_right_side_first() {
        let out = cut(&Variation {
            is_mirrored: true,
            ..Variation::NONE
        });
        assert_eq!(out[..9], [0., 0., 0., 4., 3., 2., 8., 7., 6.]);
        let out = cut(&Variation {
            is_mirrored: true,
            right_pixels: 1,
            ..Variation::NONE
        });
        assert_eq!(out[..9], [0., 0., 0., 4., 4., 3., 8., 8., 7.]);
    }
}
