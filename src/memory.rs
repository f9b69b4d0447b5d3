//! Memory of this process, as reported by the system.

use std::hint::black_box;

use crate::failure::Failure;

/// Address space that a dive needs besides the ring buffers of its sensors, bytes.
///
/// With less, replays of a vehicle with two heads abort in a tunnel of 100 m. Longer tunnels need more. The
/// figure was measured in steps of 10 MB of `ulimit -v`. Most of this space is never used.
const DIVE_BYTES: usize = 232 << 20;

/// Checks that the system has the address space for a dive. Without the check, an allocation would fail later
/// and end the program.
///
/// Errors: there is too little address space.
pub(crate) fn check_room(ring_bytes: usize) -> Result<(), Failure> {
    let bytes = DIVE_BYTES.saturating_add(ring_bytes);
    let mut room = Vec::<u8>::new();
    // `black_box` keeps the compiler from removing the unused allocation.
    match black_box(&mut room).try_reserve_exact(bytes) {
        Ok(()) => Ok(()),
        Err(_) => Err(Failure::NoRoom { mib: bytes.div_ceil(1 << 20) }),
    }
}

/// Present resident memory, KiB; `None` if the system doesn't report it.
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
