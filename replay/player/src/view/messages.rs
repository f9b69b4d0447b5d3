//! Messages for viewers, in JSON. The keys are those of Foxglove's schemas, or of this program's own schemas.
//!
//! Numbers are rounded to display precision, which keeps the text short.

use headrace_geometry::time::MonoNs;
use serde::Serialize;

/// A time in Foxglove's format. Like all times in a log, it is on the host's monotonic clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Time {
    sec: u64,
    nsec: u64,
}

impl From<MonoNs> for Time {
    fn from(at: MonoNs) -> Self {
        Self { sec: at.0 / 1_000_000_000, nsec: at.0 % 1_000_000_000 }
    }
}

/// A position or displacement, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

impl Xyz {
    /// Creates a position, rounded to a tenth of a millimetre.
    pub(super) fn new([x, y, z]: [f64; 3]) -> Self {
        Self { x: rounded(x, 1e4), y: rounded(y, 1e4), z: rounded(z, 1e4) }
    }
}

/// A unit quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Turn {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl Turn {
    /// The identity rotation, for frames whose axes coincide.
    pub(super) const NONE: Self = Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };

    /// Creates a quaternion, rounded to a microradian.
    pub(super) fn of_wxyz(wxyz: [f64; 4]) -> Self {
        let [w, x, y, z] = wxyz.map(|part| rounded(part, 1e6));
        Self { x, y, z, w }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Pose {
    pub(super) position: Xyz,
    pub(super) orientation: Turn,
}

#[derive(Debug, Serialize)]
pub(super) struct FrameTransform {
    pub(super) timestamp: Time,
    pub(super) parent_frame_id: &'static str,
    pub(super) child_frame_id: &'static str,
    pub(super) translation: Xyz,
    pub(super) rotation: Turn,
}

#[derive(Debug, Serialize)]
pub(super) struct FrameTransforms {
    pub(super) transforms: Vec<FrameTransform>,
}

#[derive(Debug, Serialize)]
pub(super) struct PoseInFrame {
    pub(super) timestamp: Time,
    pub(super) frame_id: &'static str,
    pub(super) pose: Pose,
}

/// A field of an element in packed binary data. The type is a number of Foxglove's `NumericType`.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Field {
    name: &'static str,
    offset: u32,
    #[serde(rename = "type")]
    kind: u8,
}

impl Field {
    /// Creates a field of type u8 at this offset in the element.
    pub(super) const fn byte(name: &'static str, offset: u32) -> Self {
        Self { name, offset, kind: 1 }
    }

    /// Creates a field of type f32, little-endian, at this offset in the element.
    pub(super) const fn float(name: &'static str, offset: u32) -> Self {
        Self { name, offset, kind: 7 }
    }
}

#[derive(Debug, Serialize)]
pub(super) struct PointCloud {
    pub(super) timestamp: Time,
    pub(super) frame_id: &'static str,
    pub(super) pose: Pose,
    pub(super) point_stride: usize,
    pub(super) fields: &'static [Field],
    pub(super) data: String,
}

#[derive(Debug, Serialize)]
pub(super) struct Xy {
    pub(super) x: f64,
    pub(super) y: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct Grid {
    pub(super) timestamp: Time,
    pub(super) frame_id: &'static str,
    pub(super) pose: Pose,
    pub(super) column_count: usize,
    pub(super) cell_size: Xy,
    pub(super) row_stride: usize,
    pub(super) cell_stride: usize,
    pub(super) fields: &'static [Field],
    pub(super) data: String,
}

/// Severity of a log line. The values are numbers of Foxglove's `LogLevel`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Info = 2,
    Warning = 3,
    Error = 4,
}

#[derive(Debug, Serialize)]
pub(super) struct Log {
    timestamp: Time,
    level: u8,
    message: String,
    name: &'static str,
    file: &'static str,
    line: u32,
}

impl Log {
    pub(super) fn new(at: MonoNs, level: Level, message: String) -> Self {
        Self { timestamp: at.into(), level: level as u8, message, name: "headrace", file: "", line: 0 }
    }
}

/// State of the vehicle, for plots. Unknown values are left out, because viewers' schema parsers don't support null.
#[derive(Debug, Serialize)]
pub(super) struct Vehicle {
    pub(super) timestamp: Time,
    pub(super) position: &'static str,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub(super) known: Option<Known>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub(super) deviations: Option<Deviations>,
}

#[derive(Debug, Serialize)]
pub(super) struct Known {
    pub(super) chainage_m: f64,
    pub(super) left_m: f64,
    pub(super) up_m: f64,
    pub(super) roll_deg: f64,
    pub(super) pitch_deg: f64,
    pub(super) yaw_deg: f64,
    pub(super) speed_mps: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct Deviations {
    pub(super) chainage_sd_m: f64,
    pub(super) place_sd_m: f64,
    pub(super) tilt_sd_deg: f64,
    pub(super) yaw_sd_deg: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct Section {
    pub(super) timestamp: Time,
    pub(super) start_m: f64,
    pub(super) end_m: f64,
    pub(super) verdict: &'static str,
    pub(super) hole_m: f64,
    pub(super) hole_sd_m: f64,
    pub(super) hole_x_m: f64,
    pub(super) hole_clock: String,
    pub(super) target_m: f64,
    pub(super) flagged: bool,
    /// Cause for which the section fails; empty unless the section is flagged or fails.
    pub(super) cause: &'static str,
    pub(super) words: String,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct Stretch {
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    pub(super) hole_m: f64,
    pub(super) cause: &'static str,
}

#[derive(Debug, Serialize)]
pub(super) struct Missed {
    pub(super) timestamp: Time,
    pub(super) missed_m: f64,
    pub(super) stretches: Vec<Stretch>,
}

#[derive(Debug, Serialize)]
pub(super) struct Advice {
    pub(super) timestamp: Time,
    pub(super) v_max_mps: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) speed_mps: Option<f64>,
    pub(super) will_exceed: bool,
    pub(super) reason: &'static str,
    pub(super) words: String,
}

/// Rounds to 1 / `parts`. Non-finite values become zero, because JSON can't represent them.
pub(super) fn rounded(value: f64, parts: f64) -> f64 {
    if value.is_finite() { (value * parts).round() / parts + 0.0 } else { 0.0 }
}

/// Encodes bytes in base64. Source: RFC 4648, section 4.
pub(super) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |bits: u32| DIGITS.get((bits & 63) as usize).map_or('=', |digit| char::from(*digit));
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |place: usize| u32::from(group.get(place).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            text.push(if place <= group.len() { digit(bits >> (18 - 6 * place)) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_rfc_examples() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xbf]), "+/+/");
    }

    #[test]
    fn times_and_numbers_are_serialised_compactly() {
        let json = |value: &dyn erased::Json| value.json();
        assert_eq!(json(&Time::from(MonoNs(12_000_000_034))), r#"{"sec":12,"nsec":34}"#);
        assert_eq!(json(&Xyz::new([1.0 / 3.0, -0.000_01, f64::NAN])), r#"{"x":0.3333,"y":0.0,"z":0.0}"#);
    }

    mod erased {
        pub(super) trait Json {
            fn json(&self) -> String;
        }

        impl<T: serde::Serialize> Json for T {
            fn json(&self) -> String {
                serde_json::to_string(self).unwrap()
            }
        }
    }
}
