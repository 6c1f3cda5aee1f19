//! The columns of a table of frames that is written.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BinaryArray, FixedSizeListArray, Float32Array, StringArray, StructArray,
};
use arrow::datatypes::{DataType, Field, Fields};

use super::ACTION;
use crate::trajectory::{Action, ActionSpace, CameraSpec};

pub(super) const IMAGES: &str = "observation.images.";

pub(super) fn image_key(camera: &str) -> String {
    format!("{IMAGES}{camera}")
}

/// Numbers in an action: one a dimension, or one a motion primitive.
pub(super) fn width(space: &ActionSpace) -> usize {
    match space {
        ActionSpace::Primitives { names } | ActionSpace::Continuous { names } => names.len(),
        ActionSpace::Binned { dimensions } => dimensions.len(),
    }
}

/// An action as numbers: a motion primitive is a one among zeros.
pub(super) fn row(action: &Action, width: usize) -> Vec<f64> {
    match action {
        Action::Primitive(index) => (0..width)
            .map(|i| f64::from(u8::from(i == *index)))
            .collect(),
        Action::Continuous(values) => values.iter().map(|v| f64::from(*v)).collect(),
    }
}

pub(super) fn fields(cameras: &[CameraSpec], width: usize) -> Vec<Field> {
    let mut fields: Vec<Field> = cameras
        .iter()
        .map(|c| Field::new(image_key(&c.name), DataType::Struct(picture_fields()), true))
        .collect();
    let action = match width {
        1 => DataType::Float32,
        _ => DataType::FixedSizeList(Arc::new(item()), width as i32),
    };
    fields.push(Field::new(ACTION, action, true));
    fields.push(Field::new("timestamp", DataType::Float32, true));
    for name in ["frame_index", "episode_index", "index", "task_index"] {
        fields.push(Field::new(name, DataType::Int64, true));
    }
    fields
}

fn item() -> Field {
    Field::new_list_field(DataType::Float32, true)
}

fn picture_fields() -> Fields {
    Fields::from(vec![
        Field::new("bytes", DataType::Binary, true),
        Field::new("path", DataType::Utf8, true),
    ])
}

/// The files of pictures, the first of which is of step `first`.
pub(super) fn picture_column(files: &[Vec<u8>], first: usize, ending: &str) -> ArrayRef {
    let bytes = BinaryArray::from_iter_values(files);
    let numbers = first..first + files.len();
    let paths = numbers.map(|i| format!("frame-{i:06}.{ending}"));
    let paths = StringArray::from_iter_values(paths);
    Arc::new(StructArray::new(
        picture_fields(),
        vec![Arc::new(bytes), Arc::new(paths)],
        None,
    ))
}

pub(super) fn action_column(width: usize, values: Vec<f32>) -> Result<ArrayRef, String> {
    let values = Arc::new(Float32Array::from(values));
    if width == 1 {
        return Ok(values);
    }
    FixedSizeListArray::try_new(Arc::new(item()), width as i32, values, None)
        .map(|array| Arc::new(array) as ArrayRef)
        .map_err(|e| e.to_string())
}
