use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};

/// The values of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedWeights {
    /// Where it is in the network, such as `encoders.0.stem.weight`.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its values, row-major.
    pub values: Vec<f32>,
}

/// All parameters of a network in a fixed order.
pub fn collect<M: Module>(network: &M) -> Vec<NamedWeights> {
    let mut collector = Collector::default();
    network.visit(&mut collector);
    collector.found
}

/// Number of single weights.
pub fn weight_count(weights: &[NamedWeights]) -> usize {
    weights.iter().map(|w| w.values.len()).sum()
}

/// The network with other values in its parameters, or the name of the first parameter that does not
/// fit.
pub fn assign<M: Module>(network: M, weights: &[NamedWeights]) -> Result<M, String> {
    check_fit(&network, weights)?;
    Ok(network.map(&mut Assigner { left: weights }))
}

/// Checks that values are there for all parameters of a network, or names the first one that does not fit.
pub fn check_fit<M: Module>(network: &M, weights: &[NamedWeights]) -> Result<(), String> {
    let present = collect(network);
    if present.len() != weights.len() {
        return Err(format!(
            "{} parameters for {}",
            weights.len(),
            present.len()
        ));
    }
    for (have, want) in present.iter().zip(weights) {
        if (&have.name, &have.shape) != (&want.name, &want.shape) {
            return Err(format!(
                "parameter '{}' has shape {:?}, the network has '{}' of {:?}",
                want.name, want.shape, have.name, have.shape
            ));
        }
        if have.values.len() != want.values.len() {
            return Err(format!(
                "parameter '{}' of shape {:?} has {} values",
                want.name,
                want.shape,
                want.values.len()
            ));
        }
    }
    Ok(())
}

/// Averages of the weights over the last steps; they often do better than the last weights.
pub struct Average {
    decay: f64,
    /// The averages.
    pub weights: Vec<NamedWeights>,
}

impl Average {
    /// Starts at the given weights.
    pub fn new(decay: f64, weights: Vec<NamedWeights>) -> Self {
        Self { decay, weights }
    }

    /// Moves the averages towards the weights after `step` steps; early averages forget faster.
    pub fn update<M: Module>(&mut self, network: &M, step: u64) {
        let early = (1.0 + step as f64) / (10.0 + step as f64);
        let keep = self.decay.min(early) as f32;
        for (average, current) in self.weights.iter_mut().zip(collect(network)) {
            for (a, c) in average.values.iter_mut().zip(current.values) {
                *a = keep * *a + (1.0 - keep) * c;
            }
        }
    }
}

#[derive(Default)]
struct Collector {
    path: Vec<String>,
    found: Vec<NamedWeights>,
}

impl ModuleVisitor for Collector {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let data = param.val().into_data().convert::<f32>();
        self.found.push(NamedWeights {
            name: self.path.join("."),
            shape: param.val().dims().to_vec(),
            values: data.try_to_vec().expect("converted to f32"),
        });
    }

    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }
}

struct Assigner<'a> {
    left: &'a [NamedWeights],
}

impl ModuleMapper for Assigner<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (next, left) = self.left.split_first().expect("as many as parameters");
        self.left = left;
        param.map(|tensor| {
            let data = TensorData::new(next.values.clone(), next.shape.clone());
            let value = Tensor::from_data(data, &tensor.device());
            if tensor.is_require_grad() {
                value.require_grad()
            } else {
                value
            }
        })
    }
}
