//! Memory of this process, as reported by the system.

use std::hint::black_box;

use crate::failure::Failure;

/// Address space of an assembled dive, apart from the rings of its sensors, bytes.
///
/// With less, replays of a vehicle with two heads abort in a tunnel of 100 m; longer tunnels take more.
/// Measured in steps of 10 MB of `ulimit -v`. Most of it stays untouched.
const DIVE_BYTES: usize = 232 << 20;

/// Checks that the system has the address space for a dive: a failed allocation later ends the program.
///
/// Errors: it hasn't.
pub(crate) fn check_room(ring_bytes: usize) -> Result<(), Failure> {
    let bytes = DIVE_BYTES.saturating_add(ring_bytes);
    let mut room = Vec::<u8>::new();
    // Without the black box the compiler may omit the unused allocation.
    match black_box(&mut room).try_reserve_exact(bytes) {
        Ok(()) => Ok(()),
        Err(_) => Err(Failure::NoRoom { mib: bytes.div_ceil(1 << 20) }),
    }
}

/// Resident memory now, KiB; `None` if the system doesn't report it.
pub(crate) fn resident_kib() -> Option<u64> {
    status_kib("VmRSS:")
}

/// Peak resident memory so far, KiB; `None` if the system doesn't report it.
pub(crate) fn most_kib() -> Option<u64> {
    status_kib("VmHWM:")
}

fn status_kib(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse().ok()
}
