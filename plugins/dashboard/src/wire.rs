//! Encodes the feed's binary frames, little-endian: a header of 16 bytes, then records of fixed size.
//!
//! `docs/reference/page-feed.md` defines the frames.

use headrace_coverage::{Cause, Unsure, Verdict};
use headrace_monitor::section_row::SectionRow;

/// Kind byte of a frame of sections.
pub const SECTIONS: u8 = 1;
/// Kind byte of a frame of samples.
pub const SAMPLES: u8 = 2;
/// Version byte of frames of sections and of frames of samples.
const VERSION: u8 = 1;
/// Length of a frame's header, bytes.
const HEAD_BYTES: usize = 16;
/// Length of a section record, bytes.
const SECTION_BYTES: usize = 32;
/// Length of a sample record, bytes.
const SAMPLE_BYTES: usize = 20;
/// Byte that means "none" in a section or sample record.
pub(crate) const NONE: u8 = 255;
/// Number of steps into which the perimeter is divided for encoding an arc length.
const ARC_PARTS: f64 = 65_536.0;
/// Verdict byte of a section that is not inspected: it is open, and stays open if the vehicle drives on.
const NOT_INSPECTED: u8 = 4;

/// A section as displayed, without the bit mask of the parts that have samples.
#[derive(Debug, Clone, Copy)]
pub struct SectionRecord {
    /// Chainage of the section's start, as a multiple of the section length.
    pub index: i32,
    /// Verdict: 0 open, 1 pass, 2 fail, 3 can't say, 4 not inspected.
    pub verdict: u8,
    /// Number of the main cause of a miss; 255 if there is none.
    pub cause: u8,
    /// Number of the reason for "can't say"; 255 if there is none.
    pub why: u8,
    /// Bit 0: flagged. Bit 1: settled, which means that no further sample on the present course can change the
    /// verdict. Bits 2 to 4: verdict for a second target plus 1, or 0 without a second target.
    pub flags: u8,
    /// Diameter of the largest hole, the diameter's standard deviation, and chainage and arc length of the hole's
    /// centre, m; NaN without a hole.
    pub hole: [f32; 4],
}

impl PartialEq for SectionRecord {
    /// Compares bit by bit, so that NaN equals NaN.
    fn eq(&self, other: &Self) -> bool {
        let bytes = |of: &Self| [of.verdict, of.cause, of.why, of.flags];
        self.index == other.index
            && bytes(self) == bytes(other)
            && self.hole.map(f32::to_bits) == other.hole.map(f32::to_bits)
    }
}

/// Returns the index of a value in a list, as a byte; [`NONE`] if there is none.
fn number<T: PartialEq>(all: &[T], one: Option<T>) -> u8 {
    let place = one.and_then(|one| all.iter().position(|other| *other == one));
    place.and_then(|place| u8::try_from(place).ok()).unwrap_or(NONE)
}

fn byte(verdict: Verdict) -> u8 {
    match verdict {
        Verdict::Open => 0,
        Verdict::Pass => 1,
        Verdict::Fail => 2,
        Verdict::CannotSay => 3,
    }
}

impl SectionRecord {
    /// Record of a section without data.
    pub fn blank(index: i32) -> Self {
        Self {
            index,
            verdict: 0,
            cause: NONE,
            why: NONE,
            flags: 0,
            hole: [f32::NAN, 0.0, f32::NAN, f32::NAN],
        }
    }

    /// Converts a section of the loop to a record; `None` if its index is out of range.
    #[expect(clippy::cast_possible_truncation, reason = "shown to a fraction of a millimetre")]
    pub fn of(row: &SectionRow) -> Option<Self> {
        let verdict =
            if row.not_inspected && row.verdict == Verdict::Open { NOT_INSPECTED } else { byte(row.verdict) };
        let cause = number(&Cause::ALL, row.cause.map(|evidence| evidence.cause));
        let why = number(&Unsure::ALL, row.cannot_say);
        let flags = u8::from(row.is_flagged()) | u8::from(row.settled) << 1;
        let or_nan = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
        let hole = [or_nan(row.hole_m), row.hole_sd_m as f32, or_nan(row.hole_x_m), or_nan(row.hole_arc_m)];
        Some(Self { index: i32::try_from(row.index).ok()?, verdict, cause, why, flags, hole })
    }

    /// Adds the verdict for a second target.
    #[must_use]
    pub fn compared(self, other: Option<Verdict>) -> Self {
        let bits = other.map_or(0, |verdict| byte(verdict) + 1);
        Self { flags: self.flags | bits << 2, ..self }
    }

    fn put(&self, seen: u64, to: &mut Vec<u8>) {
        to.extend_from_slice(&self.index.to_le_bytes());
        to.extend_from_slice(&[self.verdict, self.cause, self.why, self.flags]);
        for value in self.hole {
            to.extend_from_slice(&value.to_le_bytes());
        }
        to.extend_from_slice(&seen.to_le_bytes());
    }
}

/// Outcome of a ping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// A return that is accepted as wall.
    Wall = 0,
    /// A return that isn't accepted as wall.
    Doubtful = 1,
    /// No return. The sample's position is the point that the ping was aimed at.
    NoReturn = 2,
}

/// A sample as stored and sent, 20 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRecord {
    /// Milliseconds since the dive began.
    pub t_ms: u32,
    /// Chainage of the sample, m.
    pub x_m: f32,
    /// Distance to the left of the axis, m; NaN without a return.
    pub y_m: f32,
    /// Height above the floor, m; NaN without a return.
    pub z_m: f32,
    /// Arc length, in steps of 1/65,536 of the perimeter.
    pub arc: u16,
    /// Number of the head that took the sample; 255 if unknown.
    pub head: u8,
    /// Outcome of the ping, as a value of [`Outcome`].
    pub outcome: u8,
}

impl SampleRecord {
    /// Converts an arc length from metres to wire units.
    #[expect(clippy::cast_possible_truncation, reason = "clamped to the range before")]
    pub fn arc_of(arc_m: f64, perimeter_m: f64) -> u16 {
        (arc_m / perimeter_m * ARC_PARTS).clamp(0.0, ARC_PARTS - 1.0) as u16
    }

    /// Returns the bit of this sample in the mask `seen` of its section; 0 if the sample isn't wall.
    pub(crate) fn seen(&self) -> u64 {
        if self.outcome == Outcome::Wall as u8 { 1 << (self.arc >> 10) } else { 0 }
    }

    fn put(&self, to: &mut Vec<u8>) {
        to.extend_from_slice(&self.t_ms.to_le_bytes());
        for value in [self.x_m, self.y_m, self.z_m] {
            to.extend_from_slice(&value.to_le_bytes());
        }
        to.extend_from_slice(&self.arc.to_le_bytes());
        to.extend_from_slice(&[self.head, self.outcome]);
    }
}

fn frame(kind: u8, count: usize, seq: u64, record_bytes: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEAD_BYTES + count * record_bytes);
    bytes.extend_from_slice(&[kind, VERSION, 0, 0]);
    bytes.extend_from_slice(&u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
    bytes.extend_from_slice(&seq.to_le_bytes());
    bytes
}

/// Encodes a frame of sections, each with the mask of its parts that have samples.
pub fn section_frame(seq: u64, sections: &[(SectionRecord, u64)]) -> Vec<u8> {
    let mut bytes = frame(SECTIONS, sections.len(), seq, SECTION_BYTES);
    for (section, seen) in sections {
        section.put(*seen, &mut bytes);
    }
    bytes
}

/// Encodes a frame of samples.
pub fn sample_frame(seq: u64, samples: &[SampleRecord]) -> Vec<u8> {
    let mut bytes = frame(SAMPLES, samples.len(), seq, SAMPLE_BYTES);
    for sample in samples {
        sample.put(&mut bytes);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_the_documented_layout() {
        let mut section = SectionRecord::blank(-3);
        (section.verdict, section.flags, section.hole) = (2, 3, [0.5, 0.01, 1.25, 7.0]);
        let bytes = section_frame(9, &[(section, 1 << 63 | 1)]);
        assert_eq!(bytes.len(), 16 + 32);
        assert_eq!(bytes[..16], [1, 1, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(bytes[16..24], [253, 255, 255, 255, 2, 255, 255, 3]);
        assert_eq!(bytes[24..28], 0.5_f32.to_le_bytes());
        assert_eq!(bytes[40..48], [1, 0, 0, 0, 0, 0, 0, 0x80]);
        let sample =
            SampleRecord { t_ms: 258, x_m: 1.5, y_m: 0.0, z_m: 2.0, arc: 0x8001, head: 3, outcome: 1 };
        let bytes = sample_frame(1, &[sample]);
        assert_eq!((bytes.len(), bytes[0]), (36, 2));
        assert_eq!(bytes[16..20], [2, 1, 0, 0]);
        assert_eq!(bytes[32..], [1, 0x80, 3, 1]);
    }

    #[test]
    fn arc_length_is_encoded_in_16_bits_and_sets_one_of_64_mask_bits() {
        assert_eq!(
            [0.0, 5.0, 9.999_99, 10.0].map(|arc_m| SampleRecord::arc_of(arc_m, 10.0)),
            [0, 32_768, 65_535, 65_535]
        );
        let at = |arc| SampleRecord { t_ms: 0, x_m: 0.0, y_m: 0.0, z_m: 0.0, arc, head: 0, outcome: 0 };
        assert_eq!([at(0).seen(), at(1023).seen(), at(1024).seen(), at(65_535).seen()], [1, 1, 2, 1 << 63]);
        assert_eq!(SampleRecord { outcome: 1, ..at(0) }.seen(), 0, "a sample that isn't wall sets no bit");
    }
}
