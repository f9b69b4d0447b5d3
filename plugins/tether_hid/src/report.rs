//! HID reports. Their layout is given in the vehicle file, because no cable counter with a published report is known.
//!
//! The reference layout is defined by this project, for emulated counters:
//! ```text
//!   byte   0    1         2       3 .. 6             7 .. 10
//!          id   sequence  status  count, i32 little  auxiliary, i32 little
//! ```

use headrace_sensor::codec::{Framed, Framing, Verdict};

/// Maximum length of a report, bytes: an id and the payload of a full-speed interrupt transfer.
pub const MAX_REPORT_BYTES: usize = 65;

/// Report descriptor of the reference layout: vendor page 0xFF00, usage 1, report id 1, 80 bits of input.
pub const REFERENCE_DESCRIPTOR: [u8; 59] = [
    0x06, 0x00, 0xFF, // usage page: vendor
    0x09, 0x01, // usage 1
    0xA1, 0x01, // collection: application
    0x85, 0x01, // report id 1
    0x09, 0x02, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x95, 0x02, 0x81, 0x02, // 2 x u8
    0x09, 0x03, 0x17, 0x00, 0x00, 0x00, 0x80, 0x27, 0xFF, 0xFF, 0xFF, 0x7F, 0x75, 0x20, 0x95, 0x01, 0x81,
    0x02, 0x09, 0x04, 0x17, 0x00, 0x00, 0x00, 0x80, 0x27, 0xFF, 0xFF, 0xFF, 0x7F, 0x75, 0x20, 0x95, 0x01,
    0x81, 0x02, 0xC0, // end of collection
];

/// Number of bits of a counter that wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// A count of one byte.
    Bits8,
    /// A count of two bytes.
    Bits16,
    /// A count of four bytes.
    Bits32,
}

/// Byte order of a counter's reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Layout of a report. Offsets are counted from the report's first byte, which is the id if the device has ids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReportLayout {
    /// Report id; `None` for a device without ids.
    pub report_id: Option<u8>,
    /// Length of the whole report, id included; 1 to 65.
    pub report_bytes: usize,
    /// Offset of the count.
    pub offset: usize,
    /// Width of the count.
    pub width: Width,
    /// Whether the count is in two's complement.
    pub signed: bool,
    /// Byte order of the count.
    pub endian: Endian,
    /// Offset of a sequence byte, which increases by one with each report.
    pub sequence_offset: Option<usize>,
    /// Offset of a status byte, whose meaning depends on the device.
    pub status_offset: Option<usize>,
    /// Offset of a little-endian i32, whose meaning depends on the device.
    pub auxiliary_offset: Option<usize>,
}

/// One report of a HID counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Report {
    /// Sequence number, if the layout has one.
    pub sequence: Option<u8>,
    /// Status, if the layout has one.
    pub status: Option<u8>,
    /// Raw count, within the layout's width and sign.
    pub count: i64,
    /// Auxiliary value, if the layout has one.
    pub auxiliary: Option<i32>,
}

/// A reason why a report layout is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// The report length is invalid.
    #[error("laying out a report of {0} bytes; allowed are 1 to {MAX_REPORT_BYTES}")]
    Length(usize),
    /// A field extends beyond the end of the report.
    #[error("laying out {what} at offset {offset}, {bytes} bytes: the report has {report_bytes}")]
    Outside {
        /// Name of the field.
        what: &'static str,
        /// Offset of the field.
        offset: usize,
        /// Length of the field.
        bytes: usize,
        /// Length of the report.
        report_bytes: usize,
    },
    /// Two fields overlap.
    #[error("laying out {what} at offset {offset}, {bytes} bytes: it overlaps {other}")]
    Overlap {
        /// Name of the field.
        what: &'static str,
        /// Offset of the field.
        offset: usize,
        /// Length of the field.
        bytes: usize,
        /// Name of the second field.
        other: &'static str,
    },
}

impl Width {
    /// Number of bits of the count: 8, 16 or 32.
    pub fn bits(self) -> u32 {
        match self {
            Self::Bits8 => 8,
            Self::Bits16 => 16,
            Self::Bits32 => 32,
        }
    }

    fn bytes(self) -> usize {
        self.bits() as usize / 8
    }

    /// Returns `count`, wrapped to the width of the counter.
    pub fn wrapped(self, count: i64, signed: bool) -> i64 {
        let modulus = 1_i64 << self.bits();
        let above = count.rem_euclid(modulus);
        if signed && above >= modulus / 2 { above - modulus } else { above }
    }

    /// Difference from `before` to `after`, taken the short way round the wrap.
    pub fn difference(self, before: i64, after: i64) -> i64 {
        self.wrapped(after.wrapping_sub(before), true)
    }
}

impl ReportLayout {
    /// Layout of the reports that [`REFERENCE_DESCRIPTOR`] describes.
    pub const REFERENCE: Self = Self {
        report_id: Some(1),
        report_bytes: 11,
        offset: 3,
        width: Width::Bits32,
        signed: true,
        endian: Endian::Little,
        sequence_offset: Some(1),
        status_offset: Some(2),
        auxiliary_offset: Some(7),
    };

    /// Report descriptor of a vendor-defined device with one report of this layout's length and id.
    ///
    /// Source: USB HID 1.11, 6.2.2. The items are usage page, usage, collection, id, usage, limits, size, count, input,
    /// end.
    pub fn descriptor(&self) -> Vec<u8> {
        if *self == Self::REFERENCE {
            return REFERENCE_DESCRIPTOR.to_vec();
        }
        let mut descriptor = vec![0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01];
        descriptor.extend(self.report_id.iter().flat_map(|id| [0x85, *id]));
        let count = self.report_bytes - usize::from(self.report_id.is_some()).min(self.report_bytes);
        descriptor.extend([0x09, 0x02, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x95]);
        descriptor.push(u8::try_from(count).unwrap_or(u8::MAX));
        descriptor.extend([0x81, 0x02, 0xC0]);
        descriptor
    }

    /// Checks that every field lies within the report and that no fields overlap.
    ///
    /// Errors: the report length is invalid, a field lies outside the report, or two fields overlap.
    pub fn check(&self) -> Result<(), LayoutError> {
        let report_bytes = self.report_bytes;
        if !(1..=MAX_REPORT_BYTES).contains(&report_bytes) {
            return Err(LayoutError::Length(report_bytes));
        }
        let fields = [
            ("the report id", self.report_id.map(|_| 0), 1),
            ("the count", Some(self.offset), self.width.bytes()),
            ("the sequence", self.sequence_offset, 1),
            ("the status", self.status_offset, 1),
            ("the auxiliary value", self.auxiliary_offset, 4),
        ];
        let mut owner = [None; MAX_REPORT_BYTES];
        for (what, offset, bytes) in fields {
            let Some(offset) = offset else { continue };
            let end = offset.saturating_add(bytes);
            let place = owner.get_mut(offset..end).filter(|_| end <= report_bytes);
            let place = place.ok_or(LayoutError::Outside { what, offset, bytes, report_bytes })?;
            if let Some(other) = place.iter().find_map(|owner| *owner) {
                return Err(LayoutError::Overlap { what, offset, bytes, other });
            }
            place.fill(Some(what));
        }
        Ok(())
    }

    /// Decodes a whole report; `None` if the length or the id differs from the layout's.
    pub fn decode(&self, bytes: &[u8]) -> Option<Report> {
        if bytes.len() != self.report_bytes || self.report_id.is_some_and(|id| bytes.first() != Some(&id)) {
            return None;
        }
        let byte = |offset: Option<usize>| offset.and_then(|offset| bytes.get(offset)).copied();
        let auxiliary = self.auxiliary_offset.and_then(|offset| bytes.get(offset..)?.first_chunk());
        Some(Report {
            sequence: byte(self.sequence_offset),
            status: byte(self.status_offset),
            count: self.count(bytes)?,
            auxiliary: auxiliary.map(|bytes| i32::from_le_bytes(*bytes)),
        })
    }

    /// Encodes a whole report. Fields outside the layout are omitted, and fields without a value are zero.
    pub fn encode(&self, report: &Report) -> Vec<u8> {
        let mut bytes = vec![0; self.report_bytes];
        let mut put = |offset: usize, value: &[u8]| {
            for (place, byte) in bytes.iter_mut().skip(offset).zip(value) {
                *place = *byte;
            }
        };
        if let Some(id) = self.report_id {
            put(0, &[id]);
        }
        if let Some(offset) = self.sequence_offset {
            put(offset, &[report.sequence.unwrap_or(0)]);
        }
        if let Some(offset) = self.status_offset {
            put(offset, &[report.status.unwrap_or(0)]);
        }
        if let Some(offset) = self.auxiliary_offset {
            put(offset, &report.auxiliary.unwrap_or(0).to_le_bytes());
        }
        let mut count = report.count.to_le_bytes();
        let count = count.get_mut(..self.width.bytes()).unwrap_or_default();
        if self.endian == Endian::Big {
            count.reverse();
        }
        put(self.offset, count);
        bytes
    }

    fn count(&self, bytes: &[u8]) -> Option<i64> {
        let field = bytes.get(self.offset..self.offset + self.width.bytes())?;
        let join = |count: i64, byte: &u8| count << 8 | i64::from(*byte);
        let count = match self.endian {
            Endian::Big => field.iter().fold(0, join),
            Endian::Little => field.iter().rev().fold(0, join),
        };
        Some(self.width.wrapped(count, self.signed))
    }
}

/// Header of a `uhid_event` that passes a report to the kernel: the type `UHID_INPUT2` and the report's length.
///
/// Source: linux/uhid.h, `struct uhid_input2_req`, native byte order.
pub fn uhid_input2_header(report_bytes: u16) -> [u8; 6] {
    const UHID_INPUT2: u32 = 12;
    let [t0, t1, t2, t3] = UHID_INPUT2.to_ne_bytes();
    let [n0, n1] = report_bytes.to_ne_bytes();
    [t0, t1, t2, t3, n0, n1]
}

/// Decodes bytes into reports. A report with another id is skipped entirely.
pub type ReportCodec = Framed<ReportLayout, MAX_REPORT_BYTES>;

impl Framing for ReportLayout {
    type Value = Report;

    const WHOLE_MESSAGES: bool = true;

    fn judge(&self, front: &[u8]) -> Verdict {
        Verdict::on(front, self.report_bytes, |report| self.decode(report).is_some())
    }

    fn read(&self, frame: &[u8]) -> Option<Report> {
        self.decode(frame)
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::{Codec as _, CodecCounts};

    use super::*;

    const EXAMPLE: [u8; 11] = [0x01, 0x2A, 0x01, 0xC0, 0x1D, 0xFE, 0xFF, 0xDC, 0x05, 0x00, 0x00];

    #[test]
    fn wrapping_works_for_extreme_counts() {
        for width in [Width::Bits8, Width::Bits16, Width::Bits32] {
            assert_eq!([i64::MAX, i64::MIN].map(|count| width.wrapped(count, true)), [-1, 0]);
            let most = (1 << width.bits()) - 1;
            assert_eq!([i64::MAX, i64::MIN].map(|count| width.wrapped(count, false)), [most, 0]);
            assert_eq!(width.difference(i64::MAX, i64::MIN), 1);
            let half = 1 << (width.bits() - 1);
            assert_eq!(
                [half - 1, half, -half, -half - 1].map(|count| width.wrapped(count, true)),
                [half - 1, -half, -half, half - 1]
            );
        }
    }

    #[test]
    fn worked_example_1_is_read_and_written() {
        let report = ReportLayout::REFERENCE.decode(&EXAMPLE).unwrap();
        assert_eq!(
            report,
            Report { sequence: Some(42), status: Some(1), count: -123_456, auxiliary: Some(1500) }
        );
        assert_eq!(ReportLayout::REFERENCE.encode(&report), EXAMPLE);
    }

    #[test]
    fn worked_example_2_gives_the_uhid_header_of_a_report() {
        let event = [&uhid_input2_header(11)[..], &EXAMPLE].concat();
        if cfg!(target_endian = "little") {
            assert_eq!(event[..8], [0x0C, 0x00, 0x00, 0x00, 0x0B, 0x00, 0x01, 0x2A]);
            assert_eq!(event.len(), 17);
        }
    }

    #[test]
    fn worked_example_3_wraps_to_the_smaller_difference() {
        assert_eq!(Width::Bits16.difference(65_530, 4), 10);
        assert_eq!(Width::Bits16.difference(3, 65_533), -6);
        assert_eq!(Width::Bits8.difference(250, 6), 12);
        assert_eq!(Width::Bits32.difference(i64::from(i32::MAX), i64::from(i32::MIN)), 1);
    }

    #[test]
    fn reference_descriptor_matches_the_reference_report() {
        let (mut size, mut count, mut bits, mut at) = (0, 0, 0, 0);
        while at < REFERENCE_DESCRIPTOR.len() {
            let prefix = REFERENCE_DESCRIPTOR[at];
            let bytes = [0, 1, 2, 4][usize::from(prefix & 3)];
            let data = REFERENCE_DESCRIPTOR[at + 1..=at + bytes].iter().rev();
            let value = data.fold(0_usize, |value, byte| value << 8 | usize::from(*byte));
            match prefix & 0xFC {
                0x74 => size = value,
                0x94 => count = value,
                0x80 => bits += size * count,
                _ => (),
            }
            at += 1 + bytes;
        }
        assert_eq!(bits, 80);
        assert_eq!(1 + bits / 8, ReportLayout::REFERENCE.report_bytes);
    }

    #[test]
    fn impossible_layouts_are_refused() {
        let base = ReportLayout::REFERENCE;
        assert_eq!(base.check(), Ok(()));
        let long = ReportLayout { report_bytes: 66, ..base };
        assert_eq!(long.check(), Err(LayoutError::Length(66)));
        let outside = ReportLayout { offset: 8, auxiliary_offset: None, ..base };
        assert!(matches!(outside.check(), Err(LayoutError::Outside { what: "the count", .. })));
        let on_id = ReportLayout { offset: 0, ..base };
        assert!(matches!(on_id.check(), Err(LayoutError::Overlap { other: "the report id", .. })));
        let on_count = ReportLayout { status_offset: Some(4), ..base };
        assert!(matches!(on_count.check(), Err(LayoutError::Overlap { other: "the count", .. })));
    }

    #[test]
    fn report_with_another_id_is_skipped_completely() {
        let mut codec = ReportCodec::new(ReportLayout::REFERENCE);
        let mut message = vec![0x02];
        message.extend_from_slice(&EXAMPLE);
        codec.push(&message, &mut |report| panic!("{report:?}"));
        codec.flush(&mut |report| panic!("{report:?}"));
        assert_eq!(codec.counts(), CodecCounts { good_frames: 0, bad_frames: 1, skipped_bytes: 12 });
    }

    /// A layout with a count of two bytes, big-endian, unsigned and without an id. It differs from the reference layout
    /// as much as the keys of a vehicle file allow.
    const PLAIN: ReportLayout = ReportLayout {
        report_id: None,
        report_bytes: 5,
        offset: 2,
        width: Width::Bits16,
        signed: false,
        endian: Endian::Big,
        sequence_offset: None,
        status_offset: Some(0),
        auxiliary_offset: None,
    };

    #[test]
    fn byte_order_and_sign_follow_the_layout() {
        let report = PLAIN.decode(&[7, 0, 0xFF, 0xFA, 0]).unwrap();
        assert_eq!((report.count, report.status), (65_530, Some(7)));
        let signed = ReportLayout { signed: true, endian: Endian::Little, ..PLAIN };
        assert_eq!(signed.decode(&[7, 0, 0xFA, 0xFF, 0]).unwrap().count, -6);
    }

    headrace_sensor::codec_contract!(
        reference_contract,
        codec: ReportCodec::new(ReportLayout::REFERENCE),
        values: (any::<u8>(), any::<u8>(), any::<i32>(), any::<i32>()).prop_map(
            |(sequence, status, count, auxiliary)| Report {
                sequence: Some(sequence),
                status: Some(status),
                count: i64::from(count),
                auxiliary: Some(auxiliary),
            }
        ),
        encode: |report: &Report| ReportLayout::REFERENCE.encode(report),
        frames: [EXAMPLE],
    );

    headrace_sensor::codec_contract!(
        plain_contract,
        codec: ReportCodec::new(PLAIN),
        values: (any::<u8>(), any::<u16>()).prop_map(|(status, count)| Report {
            sequence: None,
            status: Some(status),
            count: i64::from(count),
            auxiliary: None,
        }),
        encode: |report: &Report| PLAIN.encode(report),
        frames: [[7, 0, 0xFF, 0xFA, 0]],
    );
}
