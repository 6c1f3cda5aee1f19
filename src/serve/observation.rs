use super::{Message, NdArray};
use crate::trajectory::{CameraSpec, Image, Observation};

/// The observation in a message: for each camera the array of its name, at the top or deeper down, where
/// `observation/images/head` and `observation.images.head` are of camera `head` too. Images of another size
/// are resized as in training.
pub(super) fn observation(
    message: &Message<'_>,
    cameras: &[CameraSpec],
) -> Result<Observation, String> {
    if !matches!(message, Message::Map(_)) {
        return Err(format!(
            "an observation is a map of arrays by camera, this is {}",
            message.kind()
        ));
    }
    let mut entries = Vec::new();
    collect("", message, &mut entries);
    let images = cameras.iter().map(|camera| {
        let entry = find(&entries, &camera.name)?;
        let image = image(entry, camera)?;
        Ok((camera.name.clone(), image))
    });
    Ok(Observation::new(
        images.collect::<Result<Vec<_>, String>>()?,
    ))
}

/// A value with the names that lead to it.
struct Entry<'a, 'm> {
    path: String,
    value: &'a Message<'m>,
}

fn collect<'a, 'm>(path: &str, message: &'a Message<'m>, entries: &mut Vec<Entry<'a, 'm>>) {
    let Message::Map(values) = message else {
        return;
    };
    for (name, value) in values {
        let path = if path.is_empty() {
            (*name).to_owned()
        } else {
            format!("{path}/{name}")
        };
        collect(&path, value, entries);
        if !matches!(value, Message::Map(_)) {
            entries.push(Entry { path, value });
        }
    }
}

/// The entry of a camera: the one that is called like it, or else the only one whose path ends so.
fn find<'e, 'a, 'm>(
    entries: &'e [Entry<'a, 'm>],
    camera: &str,
) -> Result<&'e Entry<'a, 'm>, String> {
    if let Some(entry) = entries.iter().find(|e| e.path == camera) {
        return Ok(entry);
    }
    let ends_so = |e: &&Entry<'_, '_>| e.path.rsplit(['/', '.']).next() == Some(camera);
    let found: Vec<_> = entries.iter().filter(ends_so).collect();
    match found[..] {
        [entry] => Ok(entry),
        [] => Err(format!(
            "no camera '{camera}' in the observation, which has {}; the metadata's `cameras` lists what is needed",
            listed(entries)
        )),
        [first, second, ..] => Err(format!(
            "both '{}' and '{}' may be camera '{camera}': send it as '{camera}'",
            first.path, second.path
        )),
    }
}

fn listed(entries: &[Entry<'_, '_>]) -> String {
    const SHOWN: usize = 8;
    if entries.is_empty() {
        return "nothing".to_owned();
    }
    let name = |e: &Entry<'_, '_>| {
        let short: String = e.path.chars().take(64).collect();
        format!("'{short}'")
    };
    let mut list: Vec<String> = entries.iter().take(SHOWN).map(name).collect();
    if entries.len() > SHOWN {
        list.push(format!("{} more", entries.len() - SHOWN));
    }
    list.join(", ")
}

fn image(entry: &Entry<'_, '_>, camera: &CameraSpec) -> Result<Image, String> {
    let wanted = |found: String| {
        format!(
            "camera '{}' is {found}: send uint8 [height, width, 3], {}x{} or any other size",
            camera.name, camera.height, camera.width
        )
    };
    let Message::Array(NdArray { dtype, shape, data }) = entry.value else {
        return Err(wanted(entry.value.kind()));
    };
    let size = |length: usize| u32::try_from(length).ok().filter(|l| *l > 0);
    let (height, width) = match shape[..] {
        [height, width, 3] if *dtype == "|u1" => size(height).zip(size(width)),
        _ => None,
    }
    .ok_or_else(|| wanted(entry.value.kind()))?;
    let image = Image::new(height, width, *data).map_err(|e| e.to_string())?;
    Ok(image.resized(camera.height, camera.width))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head() -> [CameraSpec; 1] {
        [CameraSpec {
            name: "head".to_owned(),
            height: 1,
            width: 2,
        }]
    }

    fn pixels(data: &[u8]) -> Message<'_> {
        Message::Array(NdArray {
            dtype: "|u1",
            shape: vec![1, data.len() / 3, 3],
            data,
        })
    }

    fn map<'a>(entries: Vec<(&'a str, Message<'a>)>) -> Message<'a> {
        Message::Map(entries)
    }

    #[test]
    fn a_camera_is_found_by_its_name_wherever_it_lies() {
        let data = [1, 2, 3, 4, 5, 6];
        let nested = map(vec![("images", map(vec![("head", pixels(&data))]))]);
        for message in [
            map(vec![("head", pixels(&data)), ("wrist", Message::Nil)]),
            map(vec![("observation/head", pixels(&data))]),
            map(vec![("observation.images.head", pixels(&data))]),
            nested,
        ] {
            let seen = observation(&message, &head()).expect("a head");
            assert_eq!(seen.image("head").expect("a head").rgb(), data);
        }
    }

    #[test]
    fn another_size_is_resized() {
        let data = [10, 20, 30].repeat(4 * 8);
        let large = Message::Array(NdArray {
            dtype: "|u1",
            shape: vec![4, 8, 3],
            data: &data,
        });
        let seen = observation(&map(vec![("head", large)]), &head()).expect("a head");
        assert_eq!(
            seen.image("head").expect("a head").rgb(),
            [10, 20, 30, 10, 20, 30]
        );
    }

    #[test]
    fn what_is_no_observation_is_refused_with_the_reason() {
        let data = [0_u8; 6];
        let of = |dtype: &'static str, shape: Vec<usize>| {
            map(vec![(
                "head",
                Message::Array(NdArray {
                    dtype,
                    shape,
                    data: &data,
                }),
            )])
        };
        for (message, expected) in [
            (Message::Nil, "a map of arrays by camera, this is nothing"),
            (
                map(vec![]),
                "no camera 'head' in the observation, which has nothing",
            ),
            (map(vec![("wrist", pixels(&data))]), "has 'wrist'"),
            (
                map(vec![("a/head", pixels(&data)), ("b/head", pixels(&data))]),
                "both 'a/head' and 'b/head' may be camera 'head'",
            ),
            (
                of("<f4", vec![1, 2, 3]),
                "is an array <f4 [1, 2, 3]: send uint8",
            ),
            (
                of("|u1", vec![3, 1, 2]),
                "is an array |u1 [3, 1, 2]: send uint8",
            ),
            (of("|u1", vec![6]), "is an array |u1 [6]"),
            (of("|u1", vec![0, 2, 3]), "[0, 2, 3]"),
            (
                map(vec![("head", Message::Text("x"))]),
                "is a text: send uint8",
            ),
        ] {
            let error = observation(&message, &head()).expect_err(expected);
            assert!(error.contains(expected), "{error} lacks {expected}");
        }
    }
}
