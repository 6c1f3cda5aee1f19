use burn::module::{Module, Param};
use burn::tensor::activation::{relu, softmax};
use burn::tensor::{Tensor, TensorData};

use super::dropout::{Dropout, dropped};
use super::layers::LayerNorm;
use super::{BaselineConfig, TransformerConfig};
use crate::training::network::{Dense, Initialiser};

/// Added to what a token must not look at: its share becomes 0.
pub const HIDDEN: f32 = -1e9;
/// Width of a layer's perceptron, in widths of a token.
const EXPANSION: usize = 2;

/// A small transformer over the tokens of the goal and of the last states, with an action after each state
/// (RT-1 in Fu & Finn, section IV-A).
///
/// The tokens of the goal come first. A token sees those of its own state, of earlier ones and of the goal;
/// the mean of a state's tokens after the last layer gives its action.
#[derive(Module, Debug)]
pub struct CausalTransformer {
    /// Added to each token by its place, `[(1 + history) * tokens, width]`: goal first, then the oldest
    /// state.
    pub places: Param<Tensor<2>>,
    /// The layers.
    pub blocks: Vec<Block>,
    /// Before the action.
    pub norm: LayerNorm,
    /// Its outputs are logits.
    pub output: Dense,
    /// Tokens of a state: all cameras together.
    pub tokens: usize,
    /// Attention heads of each layer.
    pub heads: usize,
}

/// Attention and a perceptron on each token, both added to their input, which is normalised before.
#[derive(Module, Debug)]
pub struct Block {
    /// Before the attention.
    pub attention_norm: LayerNorm,
    /// What a token looks for.
    pub query: Dense,
    /// What a token is found by.
    pub key: Dense,
    /// What a token gives to those that look at it.
    pub value: Dense,
    /// Joins the heads.
    pub joined: Dense,
    /// Before the perceptron.
    pub cell_norm: LayerNorm,
    /// Widens.
    pub wider: Dense,
    /// Narrows.
    pub narrower: Dense,
}

impl CausalTransformer {
    /// Random weights for states of so many `cameras`.
    pub fn new(
        cameras: usize,
        config: &BaselineConfig,
        classes: usize,
        init: &mut Initialiser,
    ) -> Self {
        let TransformerConfig {
            tokens,
            width,
            heads,
            layers,
        } = config.transformer;
        let tokens = cameras * tokens;
        Self {
            places: init.normal([(1 + config.history) * tokens, width], 0.1),
            blocks: (0..layers).map(|_| Block::new(width, init)).collect(),
            norm: LayerNorm::new(width, init),
            output: Dense::new(width, classes, 0.1, init),
            tokens,
            heads,
        }
    }

    /// Values of a token.
    #[must_use]
    pub fn width(&self) -> usize {
        self.places.val().dims()[1]
    }

    /// States that it acts on.
    #[must_use]
    pub fn history(&self) -> usize {
        self.places.val().dims()[0] / self.tokens - 1
    }

    /// What is added to the attention of each token (row) to each other (column): 0 where it may look.
    #[must_use]
    pub fn mask_values(&self) -> Vec<f32> {
        let all = (1 + self.history()) * self.tokens;
        let seen = |row: usize, column: usize| column / self.tokens <= row / self.tokens;
        (0..all * all)
            .map(|i| if seen(i / all, i % all) { 0.0 } else { HIDDEN })
            .collect()
    }

    /// Latents of the last states `[n, history, tokens * width]` and of the goal `[n, tokens * width]` to the
    /// logits after each state, `[n * history, classes]`.
    #[must_use]
    pub fn forward(
        &self,
        history: Tensor<3>,
        goal: Tensor<2>,
        mut dropout: Option<&mut Dropout>,
    ) -> Tensor<2> {
        let [n, steps, latent] = history.dims();
        let (tokens, width) = (self.tokens, self.width());
        let all = (1 + steps) * tokens;
        let x = Tensor::cat(vec![goal.reshape([n, 1, latent]), history], 1);
        let x: Tensor<3> = x.reshape([n, all, width]) + self.places.val().unsqueeze();
        let mask = TensorData::new(self.mask_values(), [1, 1, all, all]);
        let mask: Tensor<4> = Tensor::from_data(mask, &x.device());
        let mut x = x.reshape([n * all, width]);
        for block in &self.blocks {
            x = block.forward(x, [n, all, self.heads], &mask, &mut dropout);
        }
        let means: Tensor<4> = x.reshape([n, 1 + steps, tokens, width]).mean_dim(2);
        let states = means.narrow(1, 1, steps).reshape([n * steps, width]);
        self.output.forward(self.norm.forward(states))
    }
}

impl Block {
    /// Random weights; both branches begin small, so that a layer begins close to passing its input on.
    pub fn new(width: usize, init: &mut Initialiser) -> Self {
        let mut dense = |from, to, gain| Dense::new(from, to, gain, init);
        let query = dense(width, width, 1.0);
        let key = dense(width, width, 1.0);
        let value = dense(width, width, 1.0);
        let joined = dense(width, width, 0.25);
        let wider = dense(width, EXPANSION * width, 2.0);
        let narrower = dense(EXPANSION * width, width, 0.25);
        Self {
            attention_norm: LayerNorm::new(width, init),
            query,
            key,
            value,
            joined,
            cell_norm: LayerNorm::new(width, init),
            wider,
            narrower,
        }
    }

    fn forward(
        &self,
        x: Tensor<2>,
        [n, all, heads]: [usize; 3],
        mask: &Tensor<4>,
        dropout: &mut Option<&mut Dropout>,
    ) -> Tensor<2> {
        let width = x.dims()[1];
        let part = width / heads;
        let split = |dense: &Dense, x: Tensor<2>| -> Tensor<4> {
            let whole = dense.forward(x).reshape([n, all, heads, part]);
            whole.swap_dims(1, 2)
        };
        let even = self.attention_norm.forward(x.clone());
        let query = split(&self.query, even.clone());
        let key = split(&self.key, even.clone());
        let value = split(&self.value, even);
        let fits = query.matmul(key.swap_dims(2, 3)) / (part as f64).sqrt();
        let looked = softmax(fits + mask.clone(), 3).matmul(value);
        let looked = looked.swap_dims(1, 2).reshape([n * all, width]);
        let x = x + dropped(self.joined.forward(looked), dropout);
        let even = self.cell_norm.forward(x.clone());
        let wide = relu(self.wider.forward(even));
        x + dropped(self.narrower.forward(wide), dropout)
    }
}
