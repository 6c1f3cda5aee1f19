use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::tensor::Tensor;
use rayon::prelude::*;

/// The latents of a step, made by one encoder for each camera.
///
/// Single operations of a small network keep no more than a part of a processor busy, and encoders of
/// different cameras share nothing. So they run beside each other, forward and backward: the latents are cut off
/// from what made them, and the gradient that the rest of the network has for them is then handed on to each
/// encoder. The gradients are the same as in one go.
pub struct Encodings {
    parts: Vec<Tensor<2>>,
    latents: Tensor<2>,
}

impl Encodings {
    /// Runs the encoder of each of so many cameras, all at the same time.
    ///
    /// # Panics
    /// If there is no camera.
    pub fn of(cameras: usize, encode: impl Fn(usize) -> Tensor<2> + Send + Sync) -> Self {
        let parts = beside_each_other(cameras, encode);
        if !parts[0].is_autodiff() {
            return Self::uncut(Tensor::cat(parts, 1));
        }
        let cut_off = parts.iter().map(|part| part.clone().detach()).collect();
        Self {
            latents: Tensor::cat(cut_off, 1).require_grad(),
            parts,
        }
    }

    /// Latents that are not cut off from what made them, if anything did.
    pub fn uncut(latents: Tensor<2>) -> Self {
        Self {
            parts: Vec::new(),
            latents,
        }
    }

    /// The latents `[states, latent_dim]`, cameras one after another.
    pub fn latents(&self) -> Tensor<2> {
        self.latents.clone()
    }
}

/// What is made of so many cameras, all computed at the same time.
pub fn beside_each_other<T: Send>(
    cameras: usize,
    encode: impl Fn(usize) -> T + Send + Sync,
) -> Vec<T> {
    (0..cameras).into_par_iter().map(encode).collect()
}

/// The gradients of `total`, which was computed from the latents of `encodings`.
pub fn gradients_of<M: Module>(
    total: &Tensor<1>,
    encodings: &Encodings,
    network: &M,
) -> GradientsParams {
    let mut gradients = total.backward();
    if encodings.parts.is_empty() {
        return GradientsParams::from_grads(gradients, network);
    }
    let wanted = encodings.latents.grad_remove(&mut gradients);
    let mut sum = GradientsAccumulator::new();
    sum.accumulate(network, GradientsParams::from_grads(gradients, network));
    if let Some(wanted) = wanted {
        let mut start = 0;
        let shares: Vec<_> = (encodings.parts.iter())
            .map(|part| {
                let width = part.dims()[1];
                start += width;
                (
                    part,
                    Tensor::from_inner(wanted.clone().narrow(1, start - width, width)),
                )
            })
            .collect();
        let of_encoders: Vec<_> = shares
            .into_par_iter()
            .map(|(part, wanted)| (part.clone() * wanted).sum().backward())
            .collect();
        for gradients in of_encoders {
            sum.accumulate(network, GradientsParams::from_grads(gradients, network));
        }
    }
    sum.grads()
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::training::evaluation::values;
    use crate::training::network::{Dense, Initialiser};

    #[test]
    fn gradients_computed_apart_are_those_of_one_go() {
        let device = Device::flex().autodiff();
        let mut init = Initialiser::new(3, &device);
        let mut layer = |inputs, outputs| Dense::new(inputs, outputs, 2.0, &mut init);
        // Two encoders and what comes after them.
        let network = vec![layer(4, 3), layer(4, 2), layer(5, 6)];
        let seen: Vec<f32> = (0..28).map(|i| ((i * 5) % 13) as f32 / 6.0 - 1.0).collect();
        let seen = Tensor::<2>::from_data(TensorData::new(seen, [7, 4]), &device);
        let encode = |camera: usize| network[camera].forward(seen.clone()).tanh();
        let loss = |latents: Tensor<2>| network[2].forward(latents).tanh().sum();

        let apart = Encodings::of(2, encode);
        let found = gradients_of(&loss(apart.latents()), &apart, &network);
        let whole = Encodings::uncut(Tensor::cat(vec![encode(0), encode(1)], 1));
        let expected = gradients_of(&loss(whole.latents()), &whole, &network);
        for layer in &network {
            let of = |gradients: &GradientsParams| {
                values::<2>(gradients.get(layer.weight.id).expect("every layer has one"))
            };
            let expected = of(&expected);
            assert!(expected.iter().any(|g| g.abs() > 0.01), "{expected:?}");
            for (found, expected) in of(&found).iter().zip(expected) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
    }
}
