//! Memory of this process, as the system tells it.

/// Resident now, KiB; `None` where the system doesn't say.
pub(crate) fn resident_kib() -> Option<u64> {
    status_kib("VmRSS:")
}

/// Resident at the most so far, KiB; `None` where the system doesn't say.
pub(crate) fn most_kib() -> Option<u64> {
    status_kib("VmHWM:")
}

fn status_kib(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse().ok()
}
