//! How much memory a benchmark takes.

use std::fs;

/// The most memory that the process held, or `unknown` on systems without `/proc`.
pub fn peak() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.map_or("unknown", str::trim).to_owned()
}
