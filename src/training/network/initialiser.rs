use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Makes the first weights. It has a generator of its own, since Burn's is shared by the whole
/// process, and numbers the parameters, so that a stored optimiser state finds them again.
pub struct Initialiser {
    rng: ChaCha8Rng,
    next_id: u64,
    device: Device,
}

impl Initialiser {
    /// An initialiser for parameters on `device`.
    #[must_use]
    pub fn new(seed: u64, device: &Device) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            next_id: 1,
            device: device.clone(),
        }
    }

    /// Normally distributed values around 0.
    pub fn normal<const D: usize>(
        &mut self,
        shape: [usize; D],
        deviation: f64,
    ) -> Param<Tensor<D>> {
        let count = shape.iter().product();
        let values = (0..count)
            .map(|_| {
                // Box and Muller's transform; 1 - u keeps the logarithm finite.
                let radius = (-2.0 * (1.0 - self.rng.random::<f64>()).ln()).sqrt();
                let angle = std::f64::consts::TAU * self.rng.random::<f64>();
                (deviation * radius * angle.cos()) as f32
            })
            .collect();
        self.parameter(values, shape)
    }

    /// The same value everywhere.
    pub fn constant<const D: usize>(&mut self, shape: [usize; D], value: f32) -> Param<Tensor<D>> {
        self.parameter(vec![value; shape.iter().product()], shape)
    }

    fn parameter<const D: usize>(
        &mut self,
        values: Vec<f32>,
        shape: [usize; D],
    ) -> Param<Tensor<D>> {
        let id = ParamId::from(self.next_id);
        self.next_id += 1;
        let value = Tensor::from_data(TensorData::new(values, shape), &self.device);
        Param::initialized(
            id,
            if self.device.is_autodiff() {
                value.require_grad()
            } else {
                value
            },
        )
    }
}
