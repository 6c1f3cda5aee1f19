use super::*;
use crate::trajectory::ActionSpace;

fn weights(name: &str, value: f32) -> NamedWeights {
    NamedWeights {
        name: name.to_owned(),
        shape: vec![2],
        values: vec![value, -value],
    }
}

fn checkpoint() -> Checkpoint {
    let names = ["z.last", "a.first"];
    Checkpoint {
        state: TrainingState {
            progress: Progress {
                step: 7,
                spent_secs: 1.5,
                ..Progress::default()
            },
            best: None,
            config: TrainingConfig::default(),
            spec: ModelSpec {
                cameras: Vec::new(),
                stack: 2,
                action_space: ActionSpace::Primitives { names: Vec::new() },
                d_max: 5,
                latent_dim: 8,
            },
            normalisation: Vec::new(),
            demonstrations: "ab".to_owned(),
        },
        weights: names.iter().map(|n| weights(n, 1.0)).collect(),
        average: names.iter().map(|n| weights(n, 2.0)).collect(),
        best: Vec::new(),
        optimiser: vec![1, 2, 3],
    }
}

#[test]
fn what_is_saved_is_loaded_in_the_same_order() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(<Checkpoint>::load(folder.path()).unwrap(), None);
    checkpoint().save(folder.path()).unwrap();
    checkpoint().save(folder.path()).unwrap();
    let loaded = Checkpoint::load(folder.path()).unwrap();
    assert_eq!(loaded, Some(checkpoint()));
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 1, "nothing is left beside it");
}

#[test]
fn another_training_is_told_by_what_differs_and_another_time_limit_is_none() {
    let folder = Path::new("a.run");
    let found = TrainingConfig::default();
    let mut wanted = found.clone();
    wanted.max_minutes = Some(5.0);
    let check = |wanted: &TrainingConfig, others: &[(&str, bool)]| {
        check_same(folder, [&found, wanted], others).map_err(|error| error.to_string())
    };
    let others = [("demonstrations", false), ("actions", true), ("eyes", true)];
    check(&wanted, &others[..1]).unwrap();
    let told = check(&wanted, &others).unwrap_err();
    assert!(
        told.contains("a.run") && told.contains("its actions differ"),
        "{told}"
    );
    wanted.seed = 2;
    wanted.network.dropout = 0.5;
    let told = check(&wanted, &others).unwrap_err();
    let dropout = found.network.dropout;
    let differing = format!(
        "its configurations (network.dropout is {dropout:?} there and 0.5 here, seed is 1 there and 2 here) differ"
    );
    assert!(told.contains(&differing), "{told}");
    assert!(!told.contains("learning rate"), "{told}");
}

#[test]
fn damage_is_named_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = checkpoint().save(folder.path()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 7, 8, 60, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(matches!(
            <Checkpoint>::load(folder.path()),
            Err(TrainingError::CheckpointUnusable { .. })
        ));
    }
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    std::fs::write(&path, &flipped).unwrap();
    let message = <Checkpoint>::load(folder.path()).unwrap_err().to_string();
    assert!(message.contains("SHA-256"), "{message}");
}

/// With one bit changed, which is another one from place to place.
fn damaged_at(bytes: &[u8], place: usize) -> Vec<u8> {
    let mut damaged = bytes.to_vec();
    damaged[place] ^= 1_u8 << (place % 8);
    damaged
}

/// With another text of the same length in the place of one that is there.
fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut windows = bytes.windows(from.len());
    let at = windows.position(|window| window == from.as_bytes());
    let at = at.unwrap_or_else(|| panic!("there is no {from}"));
    let mut other = bytes.to_vec();
    other[at..at + to.len()].copy_from_slice(to.as_bytes());
    other
}

#[test]
fn a_bit_that_changed_anywhere_is_told() {
    let bytes = checkpoint().to_bytes();
    assert_eq!(Checkpoint::from_bytes(bytes.clone()), Ok(checkpoint()));
    for place in (0..bytes.len()).step_by(3) {
        let read = <Checkpoint>::from_bytes(damaged_at(&bytes, place));
        assert!(read.is_err(), "byte {place} of {}", bytes.len());
    }
    let step = replaced(&bytes, r#"{\"step\":7"#, r#"{\"step\":9"#);
    let told = <Checkpoint>::from_bytes(step).unwrap_err();
    assert!(told.contains("SHA-256"), "{told}");
}

#[test]
fn a_file_is_one_of_the_safetensors_format() {
    let bytes = checkpoint().to_bytes();
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: Map<String, Value> = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let metadata = header["__metadata__"].as_object().unwrap();
    assert!(metadata.values().all(Value::is_string), "{metadata:?}");
    let mut ranges: Vec<[usize; 2]> = header
        .iter()
        .filter(|(name, _)| *name != "__metadata__")
        .map(|(_, entry)| serde_json::from_value(entry["data_offsets"].clone()).unwrap())
        .collect();
    ranges.sort_unstable();
    assert_eq!(ranges[0][0], 0);
    assert!(ranges.windows(2).all(|two| two[0][1] == two[1][0]));
    assert_eq!(ranges.last().unwrap()[1], bytes.len() - 8 - length);
}

#[test]
fn a_checkpoint_of_an_earlier_version_is_read_and_its_damage_told_where_it_can_be_seen() {
    let bytes = in_old_form(&checkpoint().to_bytes());
    assert_eq!(Checkpoint::from_bytes(bytes.clone()), Ok(checkpoint()));
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    for place in 0..bytes.len() {
        // Its checksum is of the data alone; what it leaves out must not be a panic.
        let read = <Checkpoint>::from_bytes(damaged_at(&bytes, place));
        assert!(read.is_err() || place < 8 + length, "byte {place}");
    }
    for (from, to, told) in [
        (
            "\"data_offsets\":[16,24]",
            "\"data_offsets\":[16,28]",
            "average.000",
        ),
        (
            "\"data_offsets\":[16,24]",
            "\"data_offsets\":[24,16]",
            "average.000",
        ),
        ("\"data_offsets\":[16,24]", "\"data_offsets\":[16,99]", "99"),
        (
            "\"data_offsets\":[32,35]",
            "\"data_offsets\":[32,34]",
            "optimiser",
        ),
        ("\"shape\":[2]", "\"shape\":[3]", "of shape [3]"),
        ("\"dtype\":\"F32\"", "\"dtype\":\"F64\"", "F64"),
        ("average.001.", "averbge.001.", "averbge.001.a.first"),
        ("average.001.", "best.00001.a", "tell of the best weights"),
    ] {
        let read = <Checkpoint>::from_bytes(replaced(&bytes, from, to));
        let message = read.unwrap_err();
        assert!(message.contains(told), "{from} to {to}: {message}");
    }
}
