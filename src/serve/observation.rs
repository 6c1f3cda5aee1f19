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
    collect(&[], message, &mut entries);
    let images = cameras.iter().map(|camera| {
        let entry = find(&entries, &camera.name)?;
        let image = image(entry, camera)?;
        Ok((camera.name.clone(), image))
    });
    Ok(Observation::new(
        images.collect::<Result<Vec<_>, String>>()?,
    ))
}

/// A value with the names that lead to it, which are borrowed: a message may hold a long name around thousands of
/// values.
struct Entry<'a, 'm> {
    names: Vec<&'m str>,
    value: &'a Message<'m>,
}

fn collect<'a, 'm>(names: &[&'m str], message: &'a Message<'m>, entries: &mut Vec<Entry<'a, 'm>>) {
    let Message::Map(values) = message else {
        return;
    };
    for (name, value) in values {
        let names = [names, &[*name]].concat();
        collect(&names, value, entries);
        if !matches!(value, Message::Map(_)) {
            entries.push(Entry { names, value });
        }
    }
}

impl Entry<'_, '_> {
    /// Whether the names, joined by `/`, are this path.
    fn is_at(&self, path: &str) -> bool {
        let mut rest = Some(path);
        for (place, name) in self.names.iter().enumerate() {
            let inner = rest.and_then(|rest| match place {
                0 => Some(rest),
                _ => rest.strip_prefix('/'),
            });
            rest = inner.and_then(|inner| inner.strip_prefix(name));
        }
        rest == Some("")
    }

    /// Whether the last of all names, also of those within a name, is a camera's.
    fn ends_in(&self, camera: &str) -> bool {
        let last = self.names.last();
        last.and_then(|name| name.rsplit(['/', '.']).next()) == Some(camera)
    }

    /// The beginning of the path, to be shown.
    fn shown(&self) -> String {
        const CHARACTERS: usize = 64;
        let parts = self.names.iter().enumerate();
        let separated = parts.flat_map(|(place, name)| [if place == 0 { "" } else { "/" }, name]);
        let characters = separated.flat_map(str::chars);
        format!("'{}'", characters.take(CHARACTERS).collect::<String>())
    }
}

/// The entry of a camera: the one that is called like it, or else the only one whose path ends so.
fn find<'e, 'a, 'm>(
    entries: &'e [Entry<'a, 'm>],
    camera: &str,
) -> Result<&'e Entry<'a, 'm>, String> {
    if let Some(entry) = entries.iter().find(|e| e.is_at(camera)) {
        return Ok(entry);
    }
    let found: Vec<_> = entries.iter().filter(|e| e.ends_in(camera)).collect();
    match found[..] {
        [entry] => Ok(entry),
        [] => Err(format!(
            "no camera '{camera}' in the observation, which has {}; the metadata's `cameras` lists what is needed",
            listed(entries)
        )),
        [first, second, ..] => Err(format!(
            "both {} and {} may be camera '{camera}': send it as '{camera}'",
            first.shown(),
            second.shown()
        )),
    }
}

fn listed(entries: &[Entry<'_, '_>]) -> String {
    const SHOWN: usize = 8;
    if entries.is_empty() {
        return "nothing".to_owned();
    }
    let mut list: Vec<String> = entries.iter().take(SHOWN).map(Entry::shown).collect();
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
    if shape
        .iter()
        .any(|side| *side > Image::LONGEST_SIDE as usize)
    {
        return Err(format!(
            "camera '{}' is {}: no side may be longer than {} pixels",
            camera.name,
            entry.value.kind(),
            Image::LONGEST_SIDE
        ));
    }
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
    fn long_names_around_many_values_take_no_memory_of_their_own() {
        let long = "A".repeat(200_000);
        let numbers: Vec<String> = (0..9_000).map(|i| i.to_string()).collect();
        let inner = numbers.iter().map(|n| (n.as_str(), Message::Nil));
        let data = [1, 2, 3, 4, 5, 6];
        let around = map(vec![
            (long.as_str(), map(inner.collect())),
            ("head", pixels(&data)),
        ]);
        // As text, the paths would be 1.8 GB.
        let Message::Map(parts) = &around else {
            unreachable!("a map")
        };
        let mut entries = Vec::new();
        collect(&[], &around, &mut entries);
        assert_eq!((parts.len(), entries.len()), (2, 9_001));
        assert!(entries.iter().all(|e| e.shown().len() <= 66));
        let seen = observation(&around, &head()).expect("a head");
        assert_eq!(seen.image("head").expect("a head").rgb(), data);
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
            (
                of("|u1", vec![1, 10_000_000, 3]),
                "[1, 10000000, 3]: no side may be longer than 16384 pixels",
            ),
            (of("|u1", vec![0, 2, 3]), "[0, 2, 3]"),
            (
                map(vec![("head", Message::Text("x"))]),
                "is the text 'x': send uint8",
            ),
        ] {
            let error = observation(&message, &head()).expect_err(expected);
            assert!(error.contains(expected), "{error} lacks {expected}");
        }
    }
}
