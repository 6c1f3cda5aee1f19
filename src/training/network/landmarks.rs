use burn::module::Module;
use burn::tensor::activation::{relu, softmax};
use burn::tensor::{Tensor, TensorData};

use super::{Dense, Initialiser, coordinate_values};
use crate::model::LANDMARK_VALUES;

/// What coordinates, which lie between -1 and 1, are multiplied with, so that heads notice a few pixels.
pub const PLACE_GAIN: f32 = 4.0;
/// What the sum of squared shares is multiplied with.
pub const PEAK_GAIN: f32 = 4.0;
/// Channels of the hidden layer.
const WIDTH: usize = 64;

/// Where landmarks are in what one camera sees: for each a softmax over the cells of the first layer's map.
///
/// A cell's logit is the sum of what that cell shows, what the quarter of the first stage's cell shows that
/// covers it, and what the second stage's cell shows around it.
#[derive(Module, Debug)]
pub struct Landmarks {
    /// On a cell of the first stage's map.
    pub hidden: Dense,
    /// From there to the logits of its four quarters, row, column and landmark in this order.
    pub quarters: Dense,
    /// From a cell of the first layer's map.
    pub own: Dense,
    /// From a cell of the second stage's map, where there is one.
    pub around: Option<Dense>,
}

impl Landmarks {
    /// Random weights for `count` landmarks, from maps with so many channels: the first layer's, then each
    /// stage's.
    ///
    /// # Panics
    /// If there is no stage.
    pub fn new(channels: &[usize], count: usize, init: &mut Initialiser) -> Self {
        Self {
            hidden: Dense::new(channels[1], WIDTH, 2.0, init),
            quarters: Dense::new(WIDTH, 4 * count, 2.0, init),
            own: Dense::new(channels[0], count, 2.0, init),
            around: (channels.get(2)).map(|channels| Dense::new(*channels, count, 2.0, init)),
        }
    }

    /// How many landmarks.
    #[must_use]
    pub fn count(&self) -> usize {
        self.own.weight.val().dims()[1]
    }

    /// Logits of all cells of the first layer's map, `[n, count, cells]`, from the maps
    /// `[n, rows, columns, channels]` of first layer and stages.
    #[must_use]
    pub fn logits(&self, maps: &[Tensor<4>]) -> Tensor<3> {
        let count = self.count();
        let [n, rows, columns, channels] = maps[0].dims();
        let own = self
            .own
            .forward(maps[0].clone().reshape([n * rows * columns, channels]))
            .reshape([n, rows * columns, count]);
        let [_, halved_rows, halved_columns, channels] = maps[1].dims();
        let cells = n * halved_rows * halved_columns;
        let hidden = relu(
            self.hidden
                .forward(maps[1].clone().reshape([cells, channels])),
        );
        let quarters = self
            .quarters
            .forward(hidden)
            .reshape([n, halved_rows, halved_columns, 2, 2, count])
            .swap_dims(2, 3)
            .reshape([n, rows * columns, count]);
        let logits = own + quarters;
        let logits = match &self.around {
            Some(around) => {
                let [_, few_rows, few_columns, channels] = maps[2].dims();
                let side = rows / few_rows;
                let cells = n * few_rows * few_columns;
                let of_blocks = around
                    .forward(maps[2].clone().reshape([cells, channels]))
                    .reshape([n, few_rows, 1, few_columns, 1, count])
                    .repeat_dim(2, side)
                    .repeat_dim(4, side)
                    .reshape([n, rows * columns, count]);
                logits + of_blocks
            }
            None => logits,
        };
        logits.swap_dims(1, 2)
    }

    /// Places and sureness of all landmarks, `[n, 3 * count]`, from logits over a map of that size.
    #[must_use]
    pub fn values(logits: Tensor<3>, rows: usize, columns: usize) -> Tensor<2> {
        let [n, count, cells] = logits.dims();
        let shares = softmax(logits, 2);
        let places = TensorData::new(place_values(rows, columns), [cells, 2]);
        let places = Tensor::<2>::from_data(places, &shares.device());
        let peak = (shares.clone() * shares.clone()).sum_dim(2) * PEAK_GAIN;
        let found = shares
            .reshape([n * count, cells])
            .matmul(places)
            .reshape([n, count, 2]);
        Tensor::cat(vec![found, peak], 2).reshape([n, LANDMARK_VALUES * count])
    }
}

/// The place of each cell of a map as landmarks tell it.
#[must_use]
pub fn place_values(rows: usize, columns: usize) -> Vec<f32> {
    let values = coordinate_values(rows, columns);
    values.into_iter().map(|v| v * PLACE_GAIN).collect()
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::training::evaluation::values;

    fn map(rows: usize, columns: usize, bright: usize) -> Tensor<4> {
        let mut cells = vec![0.0; rows * columns];
        cells[bright] = 1.0;
        let cells = TensorData::new(cells, [1, rows, columns, 1]);
        Tensor::from_data(cells, &Device::flex())
    }

    fn lone_weight(dense: &mut Dense, weights: Vec<f32>) {
        let shape = dense.weight.val().dims();
        let weights = Tensor::from_data(TensorData::new(weights, shape), &Device::flex());
        dense.weight = burn::module::Param::from_tensor(weights);
    }

    #[test]
    fn a_landmark_is_where_all_maps_together_see_it() {
        let mut init = Initialiser::new(1, &Device::flex());
        let mut landmarks = Landmarks::new(&[1, 1, 1], 1, &mut init);
        let mut hidden = vec![0.0; WIDTH];
        hidden[0] = 1.0;
        lone_weight(&mut landmarks.hidden, hidden);
        // The lower left quarter of a cell.
        let mut quarters = vec![0.0; 4 * WIDTH];
        quarters[2] = 20.0;
        lone_weight(&mut landmarks.quarters, quarters);
        lone_weight(&mut landmarks.own, vec![0.0]);
        lone_weight(landmarks.around.as_mut().unwrap(), vec![0.0]);
        // Row 1, column 2 of the first stage's map: row 3, column 4 of the first layer's.
        let maps = [map(4, 8, 0), map(2, 4, 6), map(1, 2, 1)];
        let logits = landmarks.logits(&maps);
        assert_eq!(values(logits.clone())[3 * 8 + 4], 20.0);
        let told = values(Landmarks::values(logits, 4, 8));
        let expected = [PLACE_GAIN * 0.125, PLACE_GAIN * 0.75, PEAK_GAIN];
        for (told, expected) in told.iter().zip(expected) {
            assert!((told - expected).abs() < 1e-3, "{told} {expected}");
        }
        // What lies around counts for each of the sixteen cells of its block.
        lone_weight(landmarks.around.as_mut().unwrap(), vec![7.0]);
        let logits = values(landmarks.logits(&maps));
        assert!(logits.iter().enumerate().all(|(cell, logit)| {
            let around = if cell % 8 >= 4 { 7.0 } else { 0.0 };
            *logit == around + if cell == 28 { 20.0 } else { 0.0 }
        }));
    }
}
