//! Depth cameras beside others.

use prost::Message as _;

use super::*;
use crate::storage::cdr;
use crate::storage::messages::CompressedImage;
use crate::storage::{ReadOptions, Recordings};

const RAW: &str = "/camera/depth/image_raw";
const PACKED: &str = "/camera/depth/image_raw/compressedDepth";

/// Ten images on `/camera/top` with an action each, and depths beside them.
fn write(path: &Path) {
    let (mut writer, [camera, raw, packed, actions]) = begin(
        path,
        [
            ["/camera/top", "foxglove.CompressedImage", "protobuf"],
            [RAW, "sensor_msgs/msg/Image", "cdr"],
            [PACKED, "sensor_msgs/msg/CompressedImage", "cdr"],
            ["/action", "any.Action", "json"],
        ],
    );
    let depths = RawImage {
        header: Header::default(),
        height: 2,
        width: 3,
        encoding: "16UC1".to_owned(),
        is_bigendian: 0,
        step: 6,
        data: &[7; 12],
    };
    let compressed = CompressedImage {
        header: Header::default(),
        format: "16UC1; compressedDepth png".to_owned(),
        data: &[0; 40],
    };
    for i in 0..10_u64 {
        let seen = FoxgloveCompressedImage {
            data: encode_png(&picture(4, 6, i as usize)).unwrap(),
            format: "png".to_owned(),
        };
        let messages = [
            (camera, seen.encode_to_vec()),
            (raw, cdr::encode(&depths, 64).unwrap()),
            (packed, cdr::encode(&compressed, 64).unwrap()),
            (actions, br#"{"values": [1, 2]}"#.to_vec()),
        ];
        for (channel_id, data) in messages {
            let header = at(channel_id, i * 100_000_000);
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
    writer.finish().unwrap();
}

#[test]
fn depths_are_left_out_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rgbd.mcap");
    write(&path);
    let Recording { trajectory, report } = read_trajectory(&path).unwrap();
    let cameras: Vec<_> = trajectory.cameras().into_iter().map(|c| c.name).collect();
    assert_eq!(cameras, ["top"]);
    assert_eq!((trajectory.steps.len(), report.losses.len()), (10, 0));
    let told = |what: &str| {
        format!("values of more than 8 bits ({what}), as of a depth camera, are not used")
    };
    let raw = told("encoding '16UC1'");
    let packed = told("format '16UC1; compressedDepth png'");
    let notes = [format!("{RAW}: {raw}"), format!("{PACKED}: {packed}")];
    assert_eq!(report.notes, notes);
    assert_eq!(inspect(&path).unwrap(), report);
}

#[test]
fn a_mapping_file_that_names_depths_as_a_camera_is_refused_at_its_line() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("rgbd.mcap"));
    let mapping = folder.path().join("rgbd.yaml");
    let opened = |cameras: &str| {
        let text = format!("recordings: rgbd.mcap\ntopics: {{cameras: {{{cameras}}}}}\n");
        fs::write(&mapping, text).unwrap();
        let paths = [mapping.clone()];
        Recordings::open(&paths, &ReadOptions::default()).unwrap()
    };
    let recordings = opened(&format!("top: /camera/top, deep: {RAW}"));
    let read = recordings.read().next().unwrap().unwrap_err().to_string();
    for part in [
        "rgbd.yaml:2:",
        "cannot be camera 'deep'",
        "(encoding '16UC1')",
    ] {
        assert!(read.contains(part), "{read}");
    }
    let looked = recordings.inspect().remove(0).unwrap_err().to_string();
    assert_eq!(looked, read);
    let silent = opened("top: /camera/top").inspect().remove(0).unwrap();
    assert_eq!(silent.notes, Vec::<String>::new());
}
