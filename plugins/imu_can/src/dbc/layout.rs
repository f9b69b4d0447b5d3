//! Position of a signal in a frame's data, and conversion of its bits.
//!
//! Bits are numbered as in DBC files: bit b is bit b mod 8 (0 the least significant) of byte b / 8. An Intel signal
//! starts at its least significant bit and goes up. A Motorola signal starts at its most significant bit, goes down to
//! bit 0 of the byte, and continues at bit 7 of the next byte.
//! Source: Vector, DBC file format 1.0; the sawtooth numbering of Motorola signals.

/// Data bytes of a classic frame.
pub const DATA_BYTES: usize = 8;

/// Byte order of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Least significant byte first (`@1`).
    Intel,
    /// Most significant byte first (`@0`).
    Motorola,
}

/// Number format of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bits {
    /// Unsigned integer.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float32,
    /// IEEE 754, 64 bits.
    Float64,
}

/// Position of a signal: 1 to 64 bits within eight bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Shift of the least significant bit, if the eight bytes are read as one number in the signal's byte order.
    shift: u32,
    bits: u32,
    order: Order,
}

impl Layout {
    /// Creates the layout of a signal of `size` bits that starts at bit `start`.
    ///
    /// `None` if the signal extends beyond `data_bytes`, or has no bits or more than 64.
    pub fn new(start: u64, size: u64, order: Order, data_bytes: usize) -> Option<Self> {
        let all = 8 * u32::try_from(data_bytes.min(DATA_BYTES)).ok()?;
        let start = u32::try_from(start).ok().filter(|start| *start < all)?;
        let bits = u32::try_from(size).ok().filter(|bits| (1..=all).contains(bits))?;
        // Number of bits that precede the signal in the frame's data, counted in the signal's bit order.
        let before = match order {
            Order::Intel => start,
            Order::Motorola => start - start % 8 + (7 - start % 8),
        };
        if before + bits > all {
            return None;
        }
        let shift = match order {
            Order::Intel => before,
            Order::Motorola => 64 - before - bits,
        };
        Some(Self { shift, bits, order })
    }

    /// Number of bits of the signal.
    pub fn bits(self) -> u32 {
        self.bits
    }

    /// Raw bits of the signal, from bit 0 up.
    /// Allocates: never.
    pub fn extract(self, data: [u8; DATA_BYTES]) -> u64 {
        let all = match self.order {
            Order::Intel => u64::from_le_bytes(data),
            Order::Motorola => u64::from_be_bytes(data),
        };
        (all >> self.shift) & self.mask()
    }

    /// Writes the signal's bits into the data. Excess bits of `raw` are ignored.
    pub fn insert(self, data: [u8; DATA_BYTES], raw: u64) -> [u8; DATA_BYTES] {
        let put = |all: u64| all & !(self.mask() << self.shift) | (raw & self.mask()) << self.shift;
        match self.order {
            Order::Intel => put(u64::from_le_bytes(data)).to_le_bytes(),
            Order::Motorola => put(u64::from_be_bytes(data)).to_be_bytes(),
        }
    }

    fn mask(self) -> u64 {
        u64::MAX >> (64 - self.bits)
    }
}

impl Bits {
    /// Value of the number that the lowest `bits` bits of `raw` represent. Integers of more than 53 bits are
    /// rounded to the nearest double.
    pub fn value(self, raw: u64, bits: u32) -> f64 {
        let unused = 64 - bits.clamp(1, 64);
        match self {
            Self::Unsigned => raw as f64,
            Self::Signed => (((raw << unused) as i64) >> unused) as f64,
            Self::Float32 => f64::from(f32::from_bits((raw & 0xFFFF_FFFF) as u32)),
            Self::Float64 => f64::from_bits(raw),
        }
    }

    /// Raw bits of the number nearest to `value` that `bits` bits can represent.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a double beyond the range of the signal saturates, as intended"
    )]
    pub fn raw(self, value: f64, bits: u32) -> u64 {
        let bits = bits.clamp(1, 64);
        match self {
            Self::Unsigned => (libm_round(value).max(0.0) as u64).min(u64::MAX >> (64 - bits)),
            Self::Signed => {
                let most = i64::MAX >> (64 - bits);
                (libm_round(value) as i64).clamp(-most - 1, most) as u64
            }
            Self::Float32 => u64::from((value as f32).to_bits()),
            Self::Float64 => value.to_bits(),
        }
    }
}

fn libm_round(value: f64) -> f64 {
    // Above 2^53 every double is an integer. Below 2^53, an i64 can hold the rounded value.
    if value.abs() < 9e15 { headrace_sensor::geometry::math::round_to_i64(value) as f64 } else { value }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The signal's bit numbers, most significant first, in DBC numbering.
    fn walk(start: u64, size: u64, order: Order) -> Vec<u64> {
        let mut bits: Vec<u64> = match order {
            Order::Intel => (start..start + size).rev().collect(),
            Order::Motorola => Vec::new(),
        };
        let mut bit = start;
        while order == Order::Motorola && (bits.len() as u64) < size {
            bits.push(bit);
            bit = if bit.is_multiple_of(8) { bit + 15 } else { bit - 1 };
        }
        bits
    }

    fn bit(data: [u8; 8], bit: u64) -> u64 {
        u64::from(data[usize::try_from(bit / 8).unwrap()] >> (bit % 8) & 1)
    }

    fn order() -> impl Strategy<Value = Order> {
        prop_oneof![Just(Order::Intel), Just(Order::Motorola)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        #[test]
        fn extracted_bits_match_a_bit_by_bit_reading_of_the_signal(
            data: [u8; 8], start in 0_u64..70, size in 0_u64..70, order in order(), bytes in 0_usize..=8,
        ) {
            let bits = walk(start, size, order);
            let fits = size >= 1 && bits.iter().all(|bit| *bit < 8 * bytes as u64);
            let layout = Layout::new(start, size, order, bytes);
            prop_assert_eq!(layout.is_some(), fits);
            if let Some(layout) = layout {
                let expected = bits.iter().fold(0, |raw, place| raw << 1 | bit(data, *place));
                prop_assert_eq!(layout.extract(data), expected);
            }
        }

        #[test]
        fn bit_insertion_changes_no_other_bit(
            data: [u8; 8], raw: u64, start in 0_u64..64, size in 1_u64..=64, order in order(),
        ) {
            let Some(layout) = Layout::new(start, size, order, 8) else { return Ok(()) };
            let put = layout.insert(data, raw);
            prop_assert_eq!(layout.extract(put), raw & (u64::MAX >> (64 - size)));
            let own = walk(start, size, order);
            for place in (0..64).filter(|place| !own.contains(place)) {
                prop_assert_eq!(bit(put, place), bit(data, place));
            }
        }

        #[test]
        fn signed_numbers_are_twos_complement(raw: u64, bits in 1_u32..=64) {
            let raw = raw & (u64::MAX >> (64 - bits));
            let negative = raw >> (bits - 1) == 1;
            let expected = i128::from(raw) - if negative { 1_i128 << bits } else { 0 };
            prop_assert_eq!(Bits::Signed.value(raw, bits).to_bits(), (expected as f64).to_bits());
            prop_assert_eq!(Bits::Unsigned.value(raw, bits).to_bits(), (raw as f64).to_bits());
        }

        #[test]
        fn numbers_round_trip_through_their_bits(raw: u64, bits in 1_u32..=53, float: f32, double: f64) {
            let raw = raw & (u64::MAX >> (64 - bits));
            for kind in [Bits::Unsigned, Bits::Signed] {
                prop_assert_eq!(kind.raw(kind.value(raw, bits), bits) & (u64::MAX >> (64 - bits)), raw);
            }
            let came = Bits::Float32.value(Bits::Float32.raw(f64::from(float), 32), 32);
            prop_assert_eq!(came.to_bits(), f64::from(float).to_bits());
            prop_assert_eq!(Bits::Float64.value(Bits::Float64.raw(double, 64), 64).to_bits(), double.to_bits());
        }
    }

    #[test]
    fn value_out_of_range_is_encoded_as_the_nearest_allowed_value() {
        assert_eq!(Bits::Unsigned.raw(-3.0, 8), 0);
        assert_eq!(Bits::Unsigned.raw(1e30, 8), 255);
        assert_eq!(Bits::Signed.raw(1e30, 8), 127);
        assert_eq!(Bits::Signed.raw(-1e30, 8) & 0xFF, 0x80);
        assert_eq!(Bits::Signed.raw(f64::NAN, 8), 0);
    }

    /// Example of Motorola start bits in the DBC format: `7|16@0` is bytes 0 and 1, and `39|16@0` is bytes 4 and 5,
    /// most significant first.
    #[test]
    fn motorola_start_bit_is_the_most_significant_bit() {
        let data = [1, 2, 3, 4, 5, 6, 7, 8];
        let extract = |start, order| Layout::new(start, 16, order, 8).unwrap().extract(data);
        assert_eq!(extract(7, Order::Motorola), 0x0102);
        assert_eq!(extract(39, Order::Motorola), 0x0506);
        assert_eq!(extract(0, Order::Intel), 0x0201);
    }
}
