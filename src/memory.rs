//! Memory of this process, as reported by the system.

use std::hint::black_box;

use crate::failure::Failure;

/// Address space that a dive needs besides the ring buffers of its sensors and the tunnel, bytes.
///
/// With less address space, replays of a vehicle with two heads abort in a tunnel of 100 m. The figure was measured in
/// steps of 10 MB of `ulimit -v`. Most of this space is never used.
const DIVE_BYTES: usize = 232 << 20;
/// Address space for each metre of tunnel, bytes: the largest of six measurements with tunnels of 1 to 20 km (28 to 69
/// KiB).
const TUNNEL_BYTES_PER_M: f64 = 70.0 * 1024.0;
/// Length of each allocation by which the check tries the address space, bytes. One large allocation would be refused
/// if it exceeds the machine's memory, even if most of it is never used.
const PIECE_BYTES: usize = 32 << 20;

/// Checks that the system has the address space for a dive. Without the check, an allocation would fail later
/// and end the program.
///
/// Errors: there is too little address space.
pub(crate) fn check_room(ring_bytes: usize, tunnel_m: f64) -> Result<(), Failure> {
    let tunnel_bytes = headrace_geometry::math::floor_to_i64(tunnel_m * TUNNEL_BYTES_PER_M);
    let bytes =
        DIVE_BYTES.saturating_add(ring_bytes).saturating_add(usize::try_from(tunnel_bytes).unwrap_or(0));
    let mut pieces = Vec::new();
    for _ in 0..bytes.div_ceil(PIECE_BYTES) {
        let mut piece = Vec::<u8>::new();
        // `black_box` keeps the compiler from removing the unused allocations.
        if black_box(&mut piece).try_reserve_exact(PIECE_BYTES).is_err() {
            return Err(Failure::NoRoom { mib: bytes.div_ceil(1 << 20) });
        }
        pieces.push(piece);
    }
    Ok(())
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
