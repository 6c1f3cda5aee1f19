use std::fmt;
use std::path::Path;

use serde::Deserialize;

use super::network::{Network, Tensor, in_batches};
use super::pixels::planes;
use super::{Engine, EngineChoice, InferenceError};
use crate::model::{FeatureEncoder, FrozenPictures, Latents, ModelError};
use crate::trajectory::{CameraSpec, State};

/// A visual encoder that was trained elsewhere, from an ONNX file (MVP in Fu & Finn, section IV-A).
///
/// The network has one input `f32 [n, 3, height, width]` (red, green, blue) and one output
/// `f32 [n, features]`, of any names. Beside `NAME.onnx` there may lie a `NAME.json`:
///
/// ```json
/// {"mean": [123.675, 116.28, 103.53], "deviation": [58.395, 57.12, 57.375], "height": 224, "width": 224}
/// ```
///
/// Pictures are stretched to the input's size, and each value `v` of 0..=255 is given as
/// `(v - mean) / deviation`. Without the file values are given as they are (mean 0, deviation 1). `height` and
/// `width` are needed where the network leaves them open.
pub struct FrozenEncoder {
    engine: &'static Engine,
    pictures: FrozenPictures,
    file: Vec<u8>,
    network: Network,
}

/// The file beside the network, as it is written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Written {
    mean: Option<[f32; 3]>,
    deviation: Option<[f32; 3]>,
    height: Option<u32>,
    width: Option<u32>,
}

impl FrozenEncoder {
    /// Loads the network, checks that it is one of pictures to features, and runs it once.
    ///
    /// # Errors
    /// [`InferenceError::FrozenEncoderUnreadable`], [`InferenceError::PicturesMalformed`] for the file beside it,
    /// [`InferenceError::FrozenEncoderMisfit`] when its inputs and outputs are others,
    /// [`InferenceError::EngineFailed`] when the engine refuses it, and the errors of [`Engine::select`].
    pub fn load(path: &Path, choice: EngineChoice) -> Result<Self, InferenceError> {
        let file = read(path)?;
        let written = Written::beside(path)?;
        let engine = Engine::select(choice)?;
        let network = Network::load(engine, "the frozen encoder", path, file.clone())?;
        let mut pictures = pictures_of(path, &network, &written)?;
        pictures.feature_dim = measured_dim(path, engine, &network, &pictures)?;
        Ok(Self {
            engine,
            pictures,
            file,
            network,
        })
    }

    /// The encoder in a baseline's folder, whose manifest says how its pictures are made.
    pub(super) fn of_baseline(
        path: &Path,
        engine: &'static Engine,
        file: Vec<u8>,
        pictures: &FrozenPictures,
    ) -> Result<Self, InferenceError> {
        let network = Network::load(engine, "the frozen encoder", path, file.clone())?;
        super::model::check_names(path, &network, &[&pictures.input], &[&pictures.output])?;
        Ok(Self {
            engine,
            pictures: pictures.clone(),
            file,
            network,
        })
    }

    /// What computes it.
    #[must_use]
    pub fn engine(&self) -> &'static Engine {
        self.engine
    }
}

impl FeatureEncoder for FrozenEncoder {
    fn pictures(&self) -> &FrozenPictures {
        &self.pictures
    }

    fn file(&self) -> &[u8] {
        &self.file
    }

    fn features(&self, states: &[State], cameras: &[CameraSpec]) -> Result<Latents, ModelError> {
        let dim = self.pictures.feature_dim;
        let count = states.len() * cameras.len();
        // One picture at a time: a network may have been exported for one, and large ones gain nothing.
        let [features] = in_batches(count, 1, |range| {
            let (state, camera) = (range.start / cameras.len(), range.start % cameras.len());
            let pixels = picture(&states[state], &cameras[camera], &self.pictures)?;
            let values = run(&self.network, &self.pictures, &pixels)?;
            ModelError::unless_as_many("features of a picture", dim, values.len())?;
            Ok([values])
        })?;
        Ok(Latents::from_values(dim * cameras.len(), features))
    }
}

impl fmt::Debug for FrozenEncoder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrozenEncoder")
            .field("pictures", &self.pictures)
            .field("engine", &self.engine.description())
            .finish_non_exhaustive()
    }
}

impl Written {
    fn beside(network: &Path) -> Result<Self, InferenceError> {
        let path = network.with_extension("json");
        if !path.exists() {
            return Ok(Self::default());
        }
        let malformed = |reason: String, source| InferenceError::PicturesMalformed {
            path: path.clone(),
            reason,
            source,
        };
        let written: Self = serde_json::from_slice(&read(&path)?)
            .map_err(|error| malformed(error.to_string(), Some(error)))?;
        let is_fine = |values: &[f32; 3]| values.iter().all(|v| v.is_finite() && *v > 0.0);
        if written.deviation.is_some_and(|d| !is_fine(&d)) {
            return Err(malformed("a deviation is not above 0".to_owned(), None));
        }
        let is_bounded = |side: u32| (1..=4096).contains(&side);
        let mut sides = written.height.iter().chain(&written.width);
        if let Some(side) = sides.find(|side| !is_bounded(**side)) {
            return Err(malformed(format!("a side of {side} pixels"), None));
        }
        Ok(written)
    }
}

/// How the pictures of a network are made; the number of features is not known yet.
fn pictures_of(
    path: &Path,
    network: &Network,
    written: &Written,
) -> Result<FrozenPictures, InferenceError> {
    let misfit = |what, expected: &str, found: String| InferenceError::FrozenEncoderMisfit {
        path: path.to_path_buf(),
        what,
        expected: expected.to_owned(),
        found,
    };
    let (names, shapes) = (network.names(), network.shapes());
    let ([input], [output]) = (&names.0[..], &names.1[..]) else {
        let found = format!("{} and {}", names.0.join(", "), names.1.join(", "));
        return Err(misfit(
            "what goes in and out",
            "one input and one output",
            found,
        ));
    };
    let shape = shapes.0[0].as_deref();
    let Some([rows, 3 | -1, height, width]) = shape else {
        let found = printed(shape);
        return Err(misfit("its input", "[n, 3, height, width]", found));
    };
    if !matches!(rows, -1 | 1) {
        let found = format!("for {rows} pictures at once");
        return Err(misfit(
            "its input",
            "for any number of pictures, or one",
            found,
        ));
    }
    let shape = shapes.1[0].as_deref();
    // An engine that cannot tell the rank says so with no dimensions; the trial shows it then.
    if !matches!(shape, Some([] | [_, _])) {
        return Err(misfit("its output", "[n, features]", printed(shape)));
    }
    let side = |of_network: i64, of_file: Option<u32>, what: &'static str| match (
        u32::try_from(of_network).ok().filter(|n| *n > 0),
        of_file,
    ) {
        (Some(known), Some(other)) if known != other => {
            let expected = format!("{other} as the file beside it says");
            Err(misfit(what, &expected, known.to_string()))
        }
        (Some(side), _) | (None, Some(side)) => Ok(side),
        (None, None) => Err(misfit(
            what,
            "known: write it into the file beside the network",
            "open".to_owned(),
        )),
    };
    Ok(FrozenPictures {
        input: input.clone(),
        output: output.clone(),
        height: side(*height, written.height, "the height of its input")?,
        width: side(*width, written.width, "the width of its input")?,
        mean: written.mean.unwrap_or([0.0; 3]),
        deviation: written.deviation.unwrap_or([1.0; 3]),
        feature_dim: 0,
    })
}

fn printed(shape: Option<&[i64]>) -> String {
    let Some(shape) = shape else {
        return "no tensor of float32".to_owned();
    };
    let sides: Vec<String> = shape
        .iter()
        .map(|side| match side {
            -1 => "?".to_owned(),
            side => side.to_string(),
        })
        .collect();
    format!("[{}]", sides.join(", "))
}

/// Values that a grey picture gives.
fn measured_dim(
    path: &Path,
    engine: &'static Engine,
    network: &Network,
    pictures: &FrozenPictures,
) -> Result<usize, InferenceError> {
    let pixels = vec![0.0; 3 * pictures.height as usize * pictures.width as usize];
    let features =
        run(network, pictures, &pixels).map_err(|error| InferenceError::EngineFailed {
            engine: engine.description(),
            place: path.display().to_string(),
            reason: error.to_string(),
        })?;
    if features.is_empty() {
        return Err(InferenceError::FrozenEncoderMisfit {
            path: path.to_path_buf(),
            what: "its output",
            expected: "[n, features]".to_owned(),
            found: "empty".to_owned(),
        });
    }
    Ok(features.len())
}

fn read(path: &Path) -> Result<Vec<u8>, InferenceError> {
    std::fs::read(path).map_err(|source| InferenceError::FrozenEncoderUnreadable {
        path: path.to_path_buf(),
        source,
    })
}

fn run(
    network: &Network,
    pictures: &FrozenPictures,
    pixels: &[f32],
) -> Result<Vec<f32>, ModelError> {
    let input = Tensor {
        name: &pictures.input,
        shape: vec![1, 3, pictures.height as usize, pictures.width as usize],
        values: pixels,
    };
    let [values] = network.run(&[input], 1, [&pictures.output])?;
    Ok(values)
}

/// The newest picture of a camera, stretched and normalised, plane by plane.
fn picture(
    state: &State,
    camera: &CameraSpec,
    pictures: &FrozenPictures,
) -> Result<Vec<f32>, ModelError> {
    let newest = state.newest();
    let missing = || ModelError::CameraMissing {
        camera: camera.name.clone(),
        height: camera.height,
        width: camera.width,
        present: newest
            .cameras()
            .iter()
            .map(|c| format!("'{}' at {}x{}", c.name, c.height, c.width))
            .collect::<Vec<_>>()
            .join(", "),
    };
    let size = CameraSpec {
        name: camera.name.clone(),
        height: pictures.height,
        width: pictures.width,
    };
    let fitted = newest
        .fitted(std::slice::from_ref(&size))
        .map_err(|_| missing())?;
    let state = State::from_history(&[std::sync::Arc::new(fitted)], 1);
    let mut values = planes(&[state], &size, 1)?;
    let pixels = size.height as usize * size.width as usize;
    for (channel, plane) in values.chunks_exact_mut(pixels).enumerate() {
        for value in plane {
            *value = (*value - pictures.mean[channel]) / pictures.deviation[channel];
        }
    }
    Ok(values)
}
