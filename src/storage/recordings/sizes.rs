//! Whether a camera has one size in all recordings of a task.

use crate::storage::{RecordingReport, StorageError};
use crate::trajectory::Trajectory;

/// Refuses a recording in which a camera has another size than in the first. The trajectories are those of the reports
/// that are not left out, in their order. Cameras of other names are told by the set.
pub(super) fn check_sizes(
    task: &str,
    trajectories: &[Trajectory],
    reports: &[RecordingReport],
) -> Result<(), StorageError> {
    let kept = reports.iter().filter(|r| r.left_out.is_none());
    let mut seen = kept.zip(trajectories.iter().map(Trajectory::cameras));
    let Some((first, expected)) = seen.next() else {
        return Ok(());
    };
    for (report, cameras) in seen {
        for camera in cameras {
            let same = expected.iter().find(|c| c.name == camera.name);
            if let Some(other) = same.filter(|c| **c != camera) {
                return Err(StorageError::SizesDiffer {
                    task: task.to_owned(),
                    first: first.place(),
                    first_size: (other.height, other.width),
                    recording: report.place(),
                    size: (camera.height, camera.width),
                    camera: camera.name,
                });
            }
        }
    }
    Ok(())
}
