use burn::module::Module;
use burn::tensor::activation::softmax;
use burn::tensor::{Tensor, TensorData};

use crate::training::EncoderConfig;
use crate::training::network::{Dense, Initialiser, Stage, coordinate_values, feature_maps};
use crate::training::patches::PatchGrid;

/// A few tokens out of the pictures of one camera, each a learned choice of the cells of the last feature
/// map, as RT-1 has it (Fu & Finn, section IV-A; Ryoo et al., `TokenLearner`, 2021).
///
/// A cell's place on the map joins its channels: a mean over cells would forget where a thing is.
#[derive(Module, Debug)]
pub struct TokenEncoder {
    /// The first layer, on patches of the stacked frames.
    pub stem: Dense,
    /// Each halves rows and columns.
    pub stages: Vec<Stage>,
    /// From the channels and the place of a cell to how much each token looks at it.
    pub attention: Dense,
    /// From the mean of the cells that a token looks at to the token.
    pub token: Dense,
    /// Rows of patches.
    pub rows: usize,
    /// Columns of patches.
    pub columns: usize,
}

impl TokenEncoder {
    /// An encoder with random weights.
    pub fn new(
        grid: &PatchGrid,
        config: &EncoderConfig,
        [tokens, width]: [usize; 2],
        init: &mut Initialiser,
    ) -> Self {
        let stem = Dense::new(grid.patch_len(), config.stem_channels, 2.0, init);
        let (stages, channels) = Stage::all(config, init);
        Self {
            stem,
            stages,
            attention: Dense::new(channels + 2, tokens, 4.0, init),
            token: Dense::new(channels + 2, width, 2.0, init),
            rows: grid.rows(),
            columns: grid.columns(),
        }
    }

    /// Patches `[n, positions, patch_len]` to tokens one after another, `[n, tokens * width]`. A mask of a
    /// block is 0 for the states that skip it.
    #[must_use]
    pub fn forward(&self, patches: Tensor<3>, masks: Option<&[Tensor<4>]>) -> Tensor<2> {
        let size = [self.rows, self.columns];
        let maps = feature_maps(&self.stem, &self.stages, size, patches, masks);
        let map = maps[maps.len() - 1].clone();
        let [n, rows, columns, channels] = map.dims();
        let cells = rows * columns;
        let places = TensorData::new(coordinate_values(rows, columns), [1, cells, 2]);
        let places: Tensor<3> = Tensor::from_data(places, &map.device()).repeat_dim(0, n);
        let map = Tensor::cat(vec![map.reshape([n, cells, channels]), places], 2);
        let logits = self
            .attention
            .forward(map.clone().reshape([n * cells, channels + 2]));
        let tokens = logits.dims()[1];
        let shares = softmax(logits.reshape([n, cells, tokens]).swap_dims(1, 2), 2);
        let seen = shares.matmul(map).reshape([n * tokens, channels + 2]);
        let tokens_of = self.token.forward(seen);
        let width = tokens_of.dims()[1];
        tokens_of.reshape([n, tokens * width])
    }
}
