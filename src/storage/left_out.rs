//! Which recordings are left out, and why.

use super::RecordingReport;
use super::episode::{PRACTICE_NOTE, keys};

/// Why a recording is no demonstration, if it is none.
pub(super) fn why_left_out(report: &RecordingReport) -> Option<String> {
    why_failed(report)
        .or_else(|| why_practice(report))
        .or_else(|| why_damaged(report))
}

/// Why a recording shows nothing of practice, if it shows nothing.
pub(super) fn why_not_practised_on(report: &RecordingReport) -> Option<String> {
    why_failed(report).or_else(|| why_damaged(report))
}

fn why_failed(report: &RecordingReport) -> Option<String> {
    let has_failed = report.metadata.get(keys::SUCCESS)? == "false";
    has_failed.then(|| "its metadata says that the task was not done".to_owned())
}

fn why_practice(report: &RecordingReport) -> Option<String> {
    let kind = report.metadata.get(PRACTICE_NOTE)?;
    Some(format!(
        "it is practice ({kind}) and no demonstration, `catena train --practice` takes it"
    ))
}

/// Why what follows in a recording need not be what followed.
pub(super) fn why_damaged(report: &RecordingReport) -> Option<String> {
    let damage = report.losses.iter().find(|l| l.breaks_the_sequence())?;
    Some(format!("steps may be missing: {damage}"))
}
