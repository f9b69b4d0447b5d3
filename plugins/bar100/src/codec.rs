//! I2C transactions with the sensor. Each message holds the bytes written to the sensor, then the bytes read from it.
//!
//! ```text
//!   measure      AC | status  pressure (2)  temperature (2)      6 bytes
//!   memory read  cell | status  word (2)                         4 bytes, cells 0x00 to 0x7F
//! ```
//! Words are most significant byte first. The status byte is `0 1 busy mode(2) memory-error x x`.
//! Source: Keller, Communication Protocol 4LD...9LD, v2.6.

use headrace_sensor::codec::{Framed, Framing, Verdict};

/// Command that starts a conversion of pressure and temperature.
pub const MEASURE: u8 = 0xAC;

/// Smallest command byte. Smaller first bytes are addresses of memory cells. The first byte therefore determines a
/// transaction's length.
const FIRST_COMMAND: u8 = 0x80;

/// Length of a measurement transaction.
pub const MEASURE_BYTES: usize = 6;
/// Length of a memory read transaction.
pub const MEMORY_BYTES: usize = 4;

/// Status byte of a successful transaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status(u8);

/// The result of a conversion of pressure and temperature, in counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measurement {
    /// Status byte of the sensor.
    pub status: Status,
    /// Pressure in counts: 16384 at the lower limit, 49152 at the upper limit. Never 0, because a sensor returns 0
    /// before the conversion is done.
    pub pressure_counts: u16,
    /// Temperature in counts. One count is 0.05 degrees Celsius / 16. Never 0, because a sensor returns 0 before the
    /// conversion is done.
    pub temperature_counts: u16,
}

/// One word of the sensor's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryWord {
    /// Cell address, 0x00 to 0x7F.
    pub cell: u8,
    /// Status byte of the sensor.
    pub status: Status,
    /// Content of the memory cell.
    pub word: u16,
}

/// A successful transaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transaction {
    /// The result of a conversion of pressure and temperature.
    Measurement(Measurement),
    /// A word of the sensor's memory.
    Memory(MemoryWord),
}

/// A reason why a transaction has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TransactionError {
    /// The status is 0x00: the result was not ready.
    #[error("reading the status: 0x00, the sensor isn't ready; a good one is 0x40")]
    NotReady,
    /// The status is 0xFF: no device answered.
    #[error("reading the status: 0xFF, the bus is held high or no device answers; a good one is 0x40")]
    BusHigh,
    /// Bits 7 and 6 of the status are not 01.
    #[error("reading the status: {0:#04X}, bits 7 and 6 must be 01")]
    FixedBits(u8),
    /// The sensor isn't in normal mode.
    #[error("reading the status: {0:#04X}, mode (bits 4 and 3) must be 00, normal")]
    Mode(u8),
    /// The sensor's memory is corrupt, and with it the calibration.
    #[error("reading the status: {0:#04X}, bit 2 says that the memory's checksum is wrong; it must be 0")]
    Memory(u8),
    /// The measurement has a pressure or temperature of zero counts, which means no result.
    #[error(
        "reading a measurement: pressure {pressure} and temperature {temperature} counts; 0 means no result"
    )]
    Empty {
        /// Counts of pressure.
        pressure: u16,
        /// Counts of temperature.
        temperature: u16,
    },
    /// The first byte is neither the measure command nor a memory cell, or the length doesn't match the first byte.
    #[error(
        "reading a transaction of {len} bytes that begins with {first:#04X}: allowed are AC with 6 bytes, and 00 to 7F with 4"
    )]
    Unknown {
        /// First byte of the transaction; 0 if it is empty.
        first: u8,
        /// Length of the transaction.
        len: usize,
    },
}

impl Status {
    /// Status of a sensor that is ready, in normal mode, and has sound memory.
    pub const IDLE: Self = Self(0x40);

    /// Checks a status byte. Busy is accepted, because this sensor nearly always reports busy.
    ///
    /// Errors: not ready, bus high, or wrong constant, mode or memory bits.
    /// Source: status checks of Blue Robotics' `KellerLD` library.
    pub fn new(byte: u8) -> Result<Self, TransactionError> {
        match byte {
            0x00 => Err(TransactionError::NotReady),
            0xFF => Err(TransactionError::BusHigh),
            _ if byte & 0xC0 != 0x40 => Err(TransactionError::FixedBits(byte)),
            _ if byte & 0x18 != 0 => Err(TransactionError::Mode(byte)),
            _ if byte & 0x04 != 0 => Err(TransactionError::Memory(byte)),
            _ => Ok(Self(byte)),
        }
    }

    /// Whether the sensor reports a conversion in progress.
    pub fn is_busy(self) -> bool {
        self.0 & 0x20 != 0
    }

    /// The status as a byte.
    pub fn byte(self) -> u8 {
        self.0
    }
}

impl Measurement {
    /// Temperature in degrees Celsius. The low four bits of the counts carry no information.
    pub fn temperature_degc(&self) -> f64 {
        (f64::from(self.temperature_counts >> 4) - 24.0) * 0.05 - 50.0
    }

    /// Encodes the whole transaction.
    pub fn encode(&self) -> [u8; MEASURE_BYTES] {
        let [p1, p0] = self.pressure_counts.to_be_bytes();
        let [t1, t0] = self.temperature_counts.to_be_bytes();
        [MEASURE, self.status.0, p1, p0, t1, t0]
    }
}

impl MemoryWord {
    /// Encodes the whole transaction.
    pub fn encode(&self) -> [u8; MEMORY_BYTES] {
        let [high, low] = self.word.to_be_bytes();
        [self.cell, self.status.0, high, low]
    }
}

impl Transaction {
    /// Length, in bytes, of the transaction that begins with `first`; `None` if unknown.
    pub fn length(first: u8) -> Option<usize> {
        match first {
            MEASURE => Some(MEASURE_BYTES),
            _ if first < FIRST_COMMAND => Some(MEMORY_BYTES),
            _ => None,
        }
    }

    /// Decodes one whole transaction.
    ///
    /// Errors: an unknown transaction, a bad status, or a measurement of zeros.
    pub fn decode(bytes: &[u8]) -> Result<Self, TransactionError> {
        match *bytes {
            [MEASURE, status, p1, p0, t1, t0] => {
                let status = Status::new(status)?;
                let pressure_counts = u16::from_be_bytes([p1, p0]);
                let temperature_counts = u16::from_be_bytes([t1, t0]);
                if pressure_counts == 0 || temperature_counts == 0 {
                    let (pressure, temperature) = (pressure_counts, temperature_counts);
                    return Err(TransactionError::Empty { pressure, temperature });
                }
                Ok(Self::Measurement(Measurement { status, pressure_counts, temperature_counts }))
            }
            [cell, status, high, low] if cell < FIRST_COMMAND => {
                let status = Status::new(status)?;
                Ok(Self::Memory(MemoryWord { cell, status, word: u16::from_be_bytes([high, low]) }))
            }
            _ => {
                let first = bytes.first().copied().unwrap_or_default();
                Err(TransactionError::Unknown { first, len: bytes.len() })
            }
        }
    }
}

/// Separates transactions. Each message is one transaction, and a transaction with a bad status counts as a bad frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Transactions;

/// Decodes bytes into transactions.
pub type Bar100Codec = Framed<Transactions, MEASURE_BYTES>;

impl Framing for Transactions {
    type Value = Transaction;

    const WHOLE_MESSAGES: bool = true;

    fn judge(&self, front: &[u8]) -> Verdict {
        let length = front.first().copied().and_then(Transaction::length);
        let is_good = |frame: &[u8]| Transaction::decode(frame).is_ok();
        length.map_or(Verdict::NotAStart, |length| Verdict::on(front, length, is_good))
    }

    fn read(&self, frame: &[u8]) -> Option<Transaction> {
        Transaction::decode(frame).ok()
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::{Codec as _, CodecCounts};

    use super::*;

    fn measured(bytes: [u8; 5]) -> Measurement {
        let [status, p1, p0, t1, t0] = bytes;
        match Transaction::decode(&[MEASURE, status, p1, p0, t1, t0]) {
            Ok(Transaction::Measurement(measurement)) => measurement,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn worked_examples_2_to_4_give_counts_and_temperature() {
        let examples = [
            ([0x40, 0x40, 0x04, 0x59, 0x00], 16_388, 22_784, 20.0),
            ([0x40, 0x46, 0x46, 0x4F, 0xA0], 17_990, 20_384, 12.5),
            ([0x40, 0x65, 0x90, 0x45, 0x00], 26_000, 17_664, 4.0),
        ];
        for (bytes, pressure, temperature, degc) in examples {
            let measurement = measured(bytes);
            assert_eq!(measurement.pressure_counts, pressure);
            assert_eq!(measurement.temperature_counts, temperature);
            assert!((measurement.temperature_degc() - degc).abs() < 1e-9, "{bytes:02X?}");
            assert_eq!(measurement.encode()[1..], bytes);
        }
    }

    #[test]
    fn bad_status_bytes_of_worked_example_5_are_refused_with_their_reasons() {
        let measure = |status| Transaction::decode(&[MEASURE, status, 0x46, 0x46, 0x4F, 0xA0]);
        assert_eq!(Transaction::decode(&[MEASURE, 0, 0, 0, 0, 0]), Err(TransactionError::NotReady));
        let high = [MEASURE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF];
        assert_eq!(Transaction::decode(&high), Err(TransactionError::BusHigh));
        assert_eq!(measure(0x44), Err(TransactionError::Memory(0x44)));
        assert_eq!(measure(0x48), Err(TransactionError::Mode(0x48)));
        assert_eq!(measure(0xC0), Err(TransactionError::FixedBits(0xC0)));
    }

    #[test]
    fn measurement_with_zero_counts_is_refused() {
        assert!(measured([0x60, 0x46, 0x46, 0x4F, 0xA0]).status.is_busy());
        assert!(matches!(
            Transaction::decode(&[MEASURE, 0x40, 0, 0, 0x4F, 0xA0]),
            Err(TransactionError::Empty { pressure: 0, .. })
        ));
    }

    #[test]
    fn memory_read_inside_a_refused_message_is_ignored() {
        let mut codec = Bar100Codec::default();
        let mut none = |transaction| panic!("{transaction:?}");
        codec.push(&[MEASURE, 0x44, 0x12, 0x40, 0x5B, 0x3D], &mut none);
        codec.flush(&mut none);
        codec.push(&[0x90, 0x12, 0x40, 0x5B, 0x3D, 0x00], &mut none);
        codec.flush(&mut none);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 0, bad_frames: 2, skipped_bytes: 12 });
    }

    fn any_status() -> impl proptest::strategy::Strategy<Value = Status> {
        use proptest::prelude::*;
        any::<u8>().prop_map(|byte| Status(0x40 | (byte & 0x23)))
    }

    fn any_transaction() -> impl proptest::strategy::Strategy<Value = Transaction> {
        use proptest::prelude::*;
        prop_oneof![
            (any_status(), 1..=u16::MAX, 1..=u16::MAX).prop_map(
                |(status, pressure_counts, temperature_counts)| {
                    Transaction::Measurement(Measurement { status, pressure_counts, temperature_counts })
                }
            ),
            (0u8..0x80, any_status(), any::<u16>())
                .prop_map(|(cell, status, word)| Transaction::Memory(MemoryWord { cell, status, word })),
        ]
    }

    fn encode(transaction: Transaction) -> Vec<u8> {
        match transaction {
            Transaction::Measurement(measurement) => measurement.encode().to_vec(),
            Transaction::Memory(word) => word.encode().to_vec(),
        }
    }

    headrace_sensor::codec_contract!(
        contract,
        codec: Bar100Codec::default(),
        values: any_transaction(),
        encode: |transaction: &Transaction| encode(*transaction),
        frames: [
            &[0xAC, 0x40, 0x46, 0x46, 0x4F, 0xA0][..],
            &[0xAC, 0x60, 0x40, 0x04, 0x59, 0x00],
            &[0x12, 0x40, 0x5B, 0x3D],
            &[0x15, 0x40, 0x42, 0xC8],
        ],
    );
}
