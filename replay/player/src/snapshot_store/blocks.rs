//! Content-defined chunking: cuts bytes into blocks, so that two snapshots share most of their blocks.
//!
//! The place of a cut depends on the surrounding bytes, not on their offset (gear hash: Xia et al., "FastCDC", USENIX
//! ATC 2016). An insertion therefore changes only the blocks around it.

/// Minimum length of a block, bytes. Only the last block may be shorter.
const MIN_BYTES: usize = 8 << 10;
/// Maximum length of a block, bytes.
const MAX_BYTES: usize = 128 << 10;
/// A block ends where these bits of the hash are zero. Beyond the minimum length this happens every 32 KiB on
/// average.
const CUT_MASK: u64 = 0x7fff << 48;

/// A pseudorandom number for each value of a byte (splitmix64).
const GEAR: [u64; 256] = gear();

const fn gear() -> [u64; 256] {
    let mut table = [0; 256];
    let mut state = 0_u64;
    let mut byte = 0;
    while byte < table.len() {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        table[byte] = mixed ^ (mixed >> 31);
        byte += 1;
    }
    table
}

/// Cuts bytes into blocks, in order. The blocks' concatenation is `bytes`.
pub(super) fn blocks(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = bytes;
    core::iter::from_fn(move || {
        let (block, later) = rest.split_at_checked(first_len(rest)?)?;
        rest = later;
        Some(block)
    })
}

/// Returns the length of the first block; `None` for no bytes.
fn first_len(bytes: &[u8]) -> Option<usize> {
    if bytes.len() <= MIN_BYTES {
        return (!bytes.is_empty()).then_some(bytes.len());
    }
    let most = bytes.len().min(MAX_BYTES);
    let mut hash = 0_u64;
    let sought = bytes.iter().enumerate().take(most).skip(MIN_BYTES - 64);
    for (place, byte) in sought {
        hash = (hash << 1).wrapping_add(GEAR.get(usize::from(*byte)).copied().unwrap_or(0));
        if place >= MIN_BYTES && hash & CUT_MASK == 0 {
            return Some(place + 1);
        }
    }
    Some(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn noise(len: usize, seed: u64) -> Vec<u8> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        (0..len).map(|_| next()).collect()
    }

    #[test]
    fn block_lengths_are_bounded_and_their_mean_is_as_designed() {
        let bytes = noise(4 << 20, 1);
        let cut: Vec<&[u8]> = blocks(&bytes).collect();
        assert_eq!(cut.concat(), bytes);
        let (last, others) = cut.split_last().unwrap();
        assert!(others.iter().all(|block| (MIN_BYTES..=MAX_BYTES).contains(&block.len())));
        assert!(last.len() <= MAX_BYTES);
        let mean = bytes.len() / cut.len();
        assert!((24 << 10..56 << 10).contains(&mean), "{mean}");
    }

    #[test]
    fn insertion_of_bytes_changes_only_the_blocks_around_it() {
        let bytes = noise(4 << 20, 2);
        let mut longer = bytes.clone();
        longer.splice(1_000_000..1_000_000, noise(777, 3));
        let before: Vec<&[u8]> = blocks(&bytes).collect();
        let new = blocks(&longer).filter(|block| !before.contains(block)).count();
        assert!((1..=3).contains(&new), "{new} of {}", before.len());
    }

    proptest! {
        #[test]
        fn blocks_concatenate_to_the_original_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..40_000)) {
            prop_assert_eq!(blocks(&bytes).collect::<Vec<_>>().concat(), bytes);
        }
    }
}
