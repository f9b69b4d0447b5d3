//! Recognises the kind of a file by its first bytes.

/// First bytes of an ArduPilot dataflash log.
pub const DATAFLASH: [u8; 2] = *b"\xA3\x95";
/// Number of bytes at the start of a file that are enough to recognise its kind.
pub const ENOUGH_BYTES: usize = 64;

/// Returns the probable kind of a file, as text; `None` if unknown.
pub fn looks_like(front: &[u8]) -> Option<&'static str> {
    const MAGICS: [(&[u8], &str); 16] = [
        (
            b"\x89MCAP",
            "an MCAP file; if it has raw device bytes, replay it with `headrace replay`; if it has ROS messages, import it with --format mcap",
        ),
        (b"#ROSBAG V", "a ROS bag; as `.bag`, or with --format rosbag, it can be imported"),
        (b"\x1F\x8B", "compressed by gzip; unpack it first"),
        (b"\x28\xB5\x2F\xFD", "compressed by zstd; unpack it first"),
        (b"PK\x03\x04", "a zip file; unpack it first"),
        (b"BZh", "compressed by bzip2; unpack it first"),
        (
            b"SQLite format 3",
            "an SQLite file, perhaps a ROS 2 bag; `ros2 bag convert` makes MCAP of it, which can be imported",
        ),
        (&DATAFLASH, "a dataflash log of ArduPilot (.BIN); its telemetry log (.tlog) can be imported"),
        (b"852", "an Imagenex file"),
        (b"81A", "an Imagenex file"),
        (b"81B", "an Imagenex file"),
        (b"81S", "an Imagenex file"),
        (b"31L", "an Imagenex file"),
        (b"BR", "bare Ping frames, which have no times"),
        (b"\0\0\0\x34\0P\0i\0n\0g", "a log of Ping Viewer"),
        (b"(", "a log of candump"),
    ];
    if front.is_empty() {
        return Some("empty");
    }
    let magic = MAGICS.iter().find(|(magic, _)| front.starts_with(magic));
    if let Some((_, words)) = magic {
        return Some(words);
    }
    // A telemetry log begins with a time in microseconds (eight bytes), then a MAVLink frame. The first byte of a time
    // before the year 4253 is zero.
    if front.first() == Some(&0) && matches!(front.get(8), Some(0xFE | 0xFD)) {
        return Some("a telemetry log of MAVLink");
    }
    let is_text = front.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\t' | b'\r' | b'\n'));
    is_text.then(|| if front.contains(&b',') { "text with commas" } else { "text" })
}
