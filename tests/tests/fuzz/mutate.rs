//! Damages files: flipped bits, missing ends, lost, doubled or foreign parts, and wrong lengths.

use headrace_tests::random::Random;

/// A random range within `len` bytes. Short ranges are more frequent than long ones.
fn part(random: &mut Random, len: usize) -> core::ops::Range<usize> {
    let start = random.below(len);
    let most = match random.below(3) {
        0 => 16,
        1 => 1024,
        _ => len,
    };
    start..(start + random.below(most)).min(len)
}

/// Returns a false length or count to replace the true one, `truth`. The false numbers are those that are likely to
/// cause trouble.
fn lie(random: &mut Random, truth: u64) -> u64 {
    match random.below(9) {
        0 => 0,
        1 => truth.wrapping_add(1),
        2 => truth.wrapping_sub(1),
        3 => truth.wrapping_mul(2),
        4 => u64::MAX,
        5 => i64::MAX as u64,
        6 => u64::from(u32::MAX),
        7 => 1 << random.below(64),
        _ => random.bits(),
    }
}

/// Damages the file `bytes` one to eight times. Parts of `other` may be inserted.
pub(crate) fn broken(random: &mut Random, bytes: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) * random.below(3) {
        once(random, &mut bytes, other);
    }
    bytes
}

fn once(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let len = bytes.len();
    let at = random.below(len);
    match random.below(9) {
        0 | 1 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
        2 => {
            let value = random.byte();
            bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = value);
        }
        3 => bytes.truncate(at),
        4 => drop(bytes.drain(part(random, len))),
        5 => {
            let piece = bytes[part(random, len)].to_vec();
            drop(bytes.splice(at..at, piece));
        }
        6 => {
            let piece = other[part(random, other.len())].to_vec();
            let to = if random.below(2) == 0 { at } else { (at + piece.len()).min(len) };
            drop(bytes.splice(at..to, piece));
        }
        7 => {
            let place = part(random, len);
            let value = if random.below(2) == 0 { 0 } else { random.byte() };
            bytes[place].fill(value);
        }
        _ => lengths(random, bytes, at),
    }
}

/// Replaces a number of four or eight bytes in either byte order by a false number. Prefers small numbers, because
/// these are often lengths.
fn lengths(random: &mut Random, bytes: &mut [u8], at: usize) {
    let width = if random.below(2) == 0 { 4 } else { 8 };
    let big_endian = random.below(4) == 0;
    let number = |field: &[u8]| {
        let fold = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        if big_endian { field.iter().fold(0, fold) } else { field.iter().rev().fold(0, fold) }
    };
    let likely = bytes[at.min(bytes.len())..]
        .windows(width)
        .take(256)
        .position(|field| (1..1 << 20).contains(&number(field)));
    let at = at + likely.unwrap_or(0);
    let Some(field) = bytes.get_mut(at..at + width) else { return };
    let wrong = lie(random, number(field));
    for (place, byte) in field.iter_mut().enumerate() {
        let shift = if big_endian { width - 1 - place } else { place };
        *byte = wrong.to_le_bytes()[shift];
    }
}
