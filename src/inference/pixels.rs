use crate::model::ModelError;
use crate::trajectory::{CameraSpec, Image, Observation, State};

/// What one camera saw in some states, as the encoder takes it: `f32 [states, 3 * stack, height,
/// width]` with values 0..=255, oldest frame first, the planes red, green, blue.
pub(super) fn planes(
    states: &[State],
    camera: &CameraSpec,
    stack: usize,
) -> Result<Vec<f32>, ModelError> {
    let pixels = camera.height as usize * camera.width as usize;
    let mut planes = vec![0.0; states.len() * stack * 3 * pixels];
    for (state, target) in states
        .iter()
        .zip(planes.chunks_exact_mut(stack * 3 * pixels))
    {
        if state.frames().len() != stack {
            return Err(ModelError::Length {
                what: "stacked frames of a state".to_owned(),
                expected: stack,
                found: state.frames().len(),
            });
        }
        for (frame, target) in state
            .frames()
            .iter()
            .zip(target.chunks_exact_mut(3 * pixels))
        {
            separate(image(frame, camera)?, target, pixels);
        }
    }
    Ok(planes)
}

fn image<'a>(observation: &'a Observation, camera: &CameraSpec) -> Result<&'a Image, ModelError> {
    observation
        .image(&camera.name)
        .ok()
        .filter(|image| (image.height(), image.width()) == (camera.height, camera.width))
        .ok_or_else(|| ModelError::CameraMissing {
            camera: camera.name.clone(),
            height: camera.height,
            width: camera.width,
            present: observation
                .cameras()
                .iter()
                .map(|c| format!("'{}' at {}x{}", c.name, c.height, c.width))
                .collect::<Vec<_>>()
                .join(", "),
        })
}

fn separate(image: &Image, target: &mut [f32], pixels: usize) {
    let (red, rest) = target.split_at_mut(pixels);
    let (green, blue) = rest.split_at_mut(pixels);
    for (i, rgb) in image.rgb().chunks_exact(3).enumerate() {
        red[i] = f32::from(rgb[0]);
        green[i] = f32::from(rgb[1]);
        blue[i] = f32::from(rgb[2]);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn observation(first: u8) -> Arc<Observation> {
        let rgb: Vec<u8> = (first..first + 6).collect();
        let image = Image::new(1, 2, rgb).expect("2 pixels");
        Arc::new(Observation::new([("head".to_owned(), image)]))
    }

    fn camera(name: &str, width: u32) -> CameraSpec {
        CameraSpec {
            name: name.to_owned(),
            height: 1,
            width,
        }
    }

    #[test]
    fn planes_come_frame_by_frame_and_colour_by_colour() {
        let state = State::from_history(&[observation(0), observation(100)], 2);
        let planes = planes(&[state], &camera("head", 2), 2).expect("the camera is there");
        assert_eq!(
            planes,
            [
                0.0, 3.0, 1.0, 4.0, 2.0, 5.0, 100.0, 103.0, 101.0, 104.0, 102.0, 105.0
            ]
        );
    }

    #[test]
    fn another_size_or_depth_or_name_is_an_error_that_names_the_camera() {
        let state = State::from_history(&[observation(0)], 2);
        for wrong in [camera("head", 3), camera("wrist", 2)] {
            let error =
                planes(std::slice::from_ref(&state), &wrong, 2).expect_err("it does not fit");
            let message = error.to_string();
            assert!(
                message.contains(&wrong.name) && message.contains("'head' at 1x2"),
                "{message}"
            );
        }
        assert!(planes(&[state], &camera("head", 2), 3).is_err());
    }
}
