use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use super::{Dense, Initialiser, Keypoints, Landmarks, StandardisedConvolution};
use crate::training::patches::PatchGrid;
use crate::training::{EncoderConfig, NetworkVariant};

/// Variance of a residual branch's last weights at the start, so that a block begins close to passing
/// its input on.
const BRANCH_GAIN: f64 = 0.25;

/// The small residual network of one camera. Feature maps are `[n, rows, columns, channels]`.
///
/// Its last feature map is flattened into the latent, cell by cell: where a thing is matters for
/// control. What changes the size of a map are layers over patches that do not overlap, which are
/// plain matrix products and by far the fastest on a CPU; neighbours are looked at in the residual
/// blocks.
#[derive(Module, Debug)]
pub struct CameraEncoder {
    /// The first layer, on patches of the stacked frames.
    pub stem: Dense,
    /// Each halves rows and columns.
    pub stages: Vec<Stage>,
    /// From all cells of the last feature map to the latent.
    pub latent: Dense,
    /// What the places in the first stage's map add to the latent.
    pub keypoints: Option<Keypoints>,
    /// Where landmarks are, which is told beside the latent.
    pub landmarks: Option<Landmarks>,
    /// Rows of patches.
    pub rows: usize,
    /// Columns of patches.
    pub columns: usize,
    /// The first layer's other half, for the state that is to be reached, where two states are joined in
    /// their pixels: `[patch_len, channels]`.
    pub joined: Option<Param<Tensor<2>>>,
    /// Whether the other half sees the difference to the first state.
    pub sees_difference: bool,
}

/// A layer that halves rows and columns, and a residual block.
#[derive(Module, Debug)]
pub struct Stage {
    /// From four neighbouring cells (`[row, column, channel]`) to one.
    pub merge: Dense,
    /// Works on the smaller map.
    pub block: ResidualBlock,
}

/// A 3x3 convolution and a layer on each cell, whose result is added to their input.
#[derive(Module, Debug)]
pub struct ResidualBlock {
    /// Looks at the neighbours of a cell.
    pub neighbours: StandardisedConvolution,
    /// Mixes the channels of a cell.
    pub cell: Dense,
}

impl CameraEncoder {
    /// An encoder with random weights that tells so many landmarks.
    pub fn new(
        grid: &PatchGrid,
        config: &EncoderConfig,
        variant: NetworkVariant,
        landmarks: usize,
        init: &mut Initialiser,
    ) -> Self {
        let joins = variant.joins_pixels();
        // Two halves share the variance that one layer over both would have.
        let gain = if joins { 1.0 } else { 2.0 };
        let stem = Dense::new(grid.patch_len(), config.stem_channels, gain, init);
        let (stages, channels) = Stage::all(config, init);
        let cells = grid.positions() >> (2 * stages.len());
        let latent = Dense::new(cells * channels, config.latent_dim, 1.0, init);
        let first = config
            .stage_channels
            .first()
            .filter(|_| config.keypoints > 0);
        let keypoints = first
            .map(|channels| Keypoints::new(*channels, config.keypoints, config.latent_dim, init));
        let widths = [&[config.stem_channels], config.stage_channels.as_slice()].concat();
        let landmarks = (landmarks > 0).then(|| Landmarks::new(&widths, landmarks, init));
        let deviation = (gain / grid.patch_len() as f64).sqrt();
        let shape = [grid.patch_len(), config.stem_channels];
        Self {
            stem,
            stages,
            latent,
            keypoints,
            landmarks,
            rows: grid.rows(),
            columns: grid.columns(),
            joined: joins.then(|| init.normal(shape, deviation)),
            sees_difference: variant == NetworkVariant::PixelDifference,
        }
    }

    /// Whether two states are joined in the first layer.
    #[must_use]
    pub fn joins_pixels(&self) -> bool {
        self.joined.is_some()
    }

    /// Values of the first layer's map: channels x rows x columns.
    #[must_use]
    pub fn map_len(&self) -> usize {
        self.stem.weight.val().dims()[1] * self.rows * self.columns
    }

    /// The first layer's matrices for a state that is left and one that is to be reached,
    /// `[patch_len, channels]` each.
    ///
    /// # Panics
    /// If states are not joined in their pixels.
    #[must_use]
    pub fn halves(&self) -> (Tensor<2>, Tensor<2>) {
        let to = self.joined.as_ref().expect("two states are joined").val();
        let from = self.stem.weight.val();
        if self.sees_difference {
            (from - to.clone(), to)
        } else {
            (from, to)
        }
    }

    /// What the first layer makes of states as those that are left and as those to be reached; the sum of
    /// two is what it makes of a pair. Patches `[n, positions, patch_len]` to twice `[n, map_len]`, channels
    /// first.
    #[must_use]
    pub fn both_maps(&self, patches: Tensor<3>) -> (Tensor<2>, Tensor<2>) {
        let [n, positions, patch_len] = patches.dims();
        let patches = patches.reshape([n * positions, patch_len]);
        let (from, to) = self.halves();
        let channels = from.dims()[1];
        let flat = |map: Tensor<2>| -> Tensor<2> {
            map.reshape([n, positions, channels])
                .swap_dims(1, 2)
                .reshape([n, channels * positions])
        };
        let left = patches.clone().matmul(from) + self.stem.bias.val().unsqueeze();
        (flat(left), flat(patches.matmul(to)))
    }

    /// Latents `[n, latent_dim]` of the first layer's maps `[n, map_len]`, channels first.
    #[must_use]
    pub fn of_map(&self, map: Tensor<2>, masks: Option<&[Tensor<4>]>) -> Tensor<2> {
        let n = map.dims()[0];
        let channels = self.stem.weight.val().dims()[1];
        let map = map
            .reshape([n, channels, self.rows, self.columns])
            .permute([0, 2, 3, 1]);
        self.latent_of(&after_first_layer(&self.stages, map, masks))
    }

    /// Patches `[n, positions, patch_len]` to latents `[n, latent_dim]`, and to the values of landmarks,
    /// `[n, 3 * count]`, where they are told. A mask of a block is 0 for the states that skip it.
    #[must_use]
    pub fn forward(
        &self,
        patches: Tensor<3>,
        masks: Option<&[Tensor<4>]>,
    ) -> (Tensor<2>, Option<Tensor<2>>) {
        let maps = self.maps(patches, masks);
        let values = (self.landmarks.as_ref())
            .map(|landmarks| Landmarks::values(landmarks.logits(&maps), self.rows, self.columns));
        (self.latent_of(&maps), values)
    }

    /// The latents, and beside them the landmarks' logits: `[n, latent_dim + count * cells]`.
    #[must_use]
    pub fn forward_with_logits(
        &self,
        patches: Tensor<3>,
        masks: Option<&[Tensor<4>]>,
    ) -> Tensor<2> {
        let maps = self.maps(patches, masks);
        let latent = self.latent_of(&maps);
        match &self.landmarks {
            Some(landmarks) => {
                let logits = landmarks.logits(&maps);
                let [n, count, cells] = logits.dims();
                Tensor::cat(vec![latent, logits.reshape([n, count * cells])], 1)
            }
            None => latent,
        }
    }

    fn maps(&self, patches: Tensor<3>, masks: Option<&[Tensor<4>]>) -> Vec<Tensor<4>> {
        let size = [self.rows, self.columns];
        feature_maps(&self.stem, &self.stages, size, patches, masks)
    }

    /// Values of the latent.
    #[must_use]
    pub fn latent_dim(&self) -> usize {
        self.latent.bias.val().dims()[0]
    }

    /// The latent from the maps of the first layer and of all stages.
    fn latent_of(&self, maps: &[Tensor<4>]) -> Tensor<2> {
        let first = maps[1.min(maps.len() - 1)].clone();
        let places = self.keypoints.as_ref().map(|k| k.forward(first));
        let x = maps[maps.len() - 1].clone();
        let [n, rows, columns, channels] = x.dims();
        let latent = self
            .latent
            .forward(x.reshape([n, rows * columns * channels]));
        match places {
            Some(places) => latent + places,
            None => latent,
        }
    }
}

/// The maps of the first layer and of each stage, `[n, rows, columns, channels]` each, from patches
/// `[n, positions, patch_len]` of `size` rows and columns.
#[must_use]
pub fn feature_maps(
    stem: &Dense,
    stages: &[Stage],
    [rows, columns]: [usize; 2],
    patches: Tensor<3>,
    masks: Option<&[Tensor<4>]>,
) -> Vec<Tensor<4>> {
    let [n, positions, patch_len] = patches.dims();
    let seen = stem.forward(patches.reshape([n * positions, patch_len]));
    let channels = seen.dims()[1];
    let map = relu(seen).reshape([n, rows, columns, channels]);
    after_first_layer(stages, map, masks)
}

fn after_first_layer(
    stages: &[Stage],
    map: Tensor<4>,
    masks: Option<&[Tensor<4>]>,
) -> Vec<Tensor<4>> {
    let mut maps = vec![map];
    for (index, stage) in stages.iter().enumerate() {
        let x = stage.merge(maps[index].clone());
        maps.push(stage.block.forward(x, masks.map(|m| m[index].clone())));
    }
    maps
}

impl Stage {
    /// The stages of a configuration with random weights, and the channels of the last one's map.
    pub fn all(config: &EncoderConfig, init: &mut Initialiser) -> (Vec<Self>, usize) {
        let mut channels = config.stem_channels;
        let mut stages = Vec::new();
        for wider in &config.stage_channels {
            stages.push(Self {
                merge: Dense::new(4 * channels, *wider, 2.0, init),
                block: ResidualBlock::new(*wider, init),
            });
            channels = *wider;
        }
        (stages, channels)
    }

    fn merge(&self, x: Tensor<4>) -> Tensor<4> {
        let [n, rows, columns, channels] = x.dims();
        let (rows, columns) = (rows / 2, columns / 2);
        let cells = x
            .reshape([n * rows, 2, columns, 2 * channels])
            .swap_dims(1, 2)
            .reshape([n * rows * columns, 4 * channels]);
        let merged = relu(self.merge.forward(cells));
        let wider = merged.dims()[1];
        merged.reshape([n, rows, columns, wider])
    }
}

impl ResidualBlock {
    /// A block with random weights.
    pub fn new(channels: usize, init: &mut Initialiser) -> Self {
        Self {
            neighbours: StandardisedConvolution::new(channels, channels, init),
            cell: Dense::new(channels, channels, BRANCH_GAIN, init),
        }
    }

    /// `relu(x + mask * cell(relu(neighbours(x))))`.
    #[must_use]
    pub fn forward(&self, x: Tensor<4>, mask: Option<Tensor<4>>) -> Tensor<4> {
        let [n, rows, columns, channels] = x.dims();
        let seen = relu(self.neighbours.forward(x.clone().permute([0, 3, 1, 2])));
        let cells = seen
            .permute([0, 2, 3, 1])
            .reshape([n * rows * columns, channels]);
        let branch = self
            .cell
            .forward(cells)
            .reshape([n, rows, columns, channels]);
        let branch = match mask {
            Some(mask) => branch * mask,
            None => branch,
        };
        relu(x + branch)
    }
}
