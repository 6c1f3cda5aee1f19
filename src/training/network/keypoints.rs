use burn::module::Module;
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor, TensorData};

use super::{Dense, Initialiser};

/// Where in a feature map things are: for each keypoint the mean place under a softmax over all cells.
///
/// Places are what control needs most, and a few coordinates are learnt from far fewer demonstrations than
/// a matrix over all cells (a spatial softmax, as in Levine et al., End-to-End Training of Deep Visuomotor
/// Policies, 2016).
#[derive(Module, Debug)]
pub struct Keypoints {
    /// From the channels of a cell to the logit of each keypoint.
    pub logits: Dense,
    /// From the coordinates of all keypoints, `[x, y]` one after another, to the latent.
    pub latent: Dense,
}

impl Keypoints {
    /// Random weights for `count` keypoints in a map of `channels`.
    pub fn new(channels: usize, count: usize, latent_dim: usize, init: &mut Initialiser) -> Self {
        Self {
            logits: Dense::new(channels, count, 4.0, init),
            latent: Dense::new(2 * count, latent_dim, 4.0, init),
        }
    }

    /// A map `[n, rows, columns, channels]` to what its keypoints add to the latent, `[n, latent_dim]`.
    #[must_use]
    pub fn forward(&self, x: Tensor<4>) -> Tensor<2> {
        let [n, rows, columns, channels] = x.dims();
        let cells = rows * columns;
        let logits = self.logits.forward(x.reshape([n * cells, channels]));
        let count = logits.dims()[1];
        let shares = softmax(logits.reshape([n, cells, count]).swap_dims(1, 2), 2);
        let places = coordinates(rows, columns, &shares.device());
        let found = shares.reshape([n * count, cells]).matmul(places);
        self.latent.forward(found.reshape([n, 2 * count]))
    }
}

/// The middle of each cell, row by row, as values of `[x, y]`: -1 at the left and upper edge of the map,
/// 1 at the right and lower edge.
#[must_use]
pub fn coordinate_values(rows: usize, columns: usize) -> Vec<f32> {
    let middle = |index: usize, count: usize| (2 * index + 1) as f32 / count as f32 - 1.0;
    (0..rows)
        .flat_map(|y| (0..columns).flat_map(move |x| [middle(x, columns), middle(y, rows)]))
        .collect()
}

fn coordinates(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    let values = coordinate_values(rows, columns);
    Tensor::from_data(TensorData::new(values, [rows * columns, 2]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_cell_is_found_where_it_is() {
        let device = Device::flex();
        let mut init = Initialiser::new(1, &device);
        let mut keypoints = Keypoints::new(1, 1, 2, &mut init);
        let whole = |values: Vec<f32>, shape: [usize; 2]| {
            burn::module::Param::from_tensor(Tensor::from_data(
                TensorData::new(values, shape),
                &device,
            ))
        };
        keypoints.logits.weight = whole(vec![50.0], [1, 1]);
        keypoints.latent.weight = whole(vec![1.0, 0.0, 0.0, 1.0], [2, 2]);
        let mut map = vec![0.0; 2 * 4];
        map[4 + 3] = 1.0;
        let map: Tensor<4> = Tensor::from_data(TensorData::new(map, [1, 2, 4, 1]), &device);
        let found: Vec<f32> = keypoints.forward(map).into_data().try_to_vec().unwrap();
        assert!((found[0] - 0.75).abs() < 1e-4 && (found[1] - 0.5).abs() < 1e-4);
    }
}
