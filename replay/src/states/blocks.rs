//! Where bytes are cut into blocks, so that two states share what they have in common.
//!
//! By what the bytes are and not by where they stand (content-defined chunking with a gear hash: Xia et al., "FastCDC",
//! USENIX ATC 2016): bytes put in somewhere change the blocks there and none behind. Most of a dive's state is what was
//! seen of the wall behind the vehicle, which doesn't change any more.

/// No block is shorter, but the last.
const LEAST_BYTES: usize = 8 << 10;
/// No block is longer.
const MOST_BYTES: usize = 128 << 10;
/// A cut where these bits of the hash are zero: every 24 KiB beyond the least.
const CUT_MASK: u64 = 0x7fff << 48;

/// One number for each byte, as splitmix64 gives them.
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

/// The blocks of some bytes, in order; together they are the bytes.
pub(super) fn blocks(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = bytes;
    core::iter::from_fn(move || {
        let (block, later) = rest.split_at_checked(first_len(rest)?)?;
        rest = later;
        Some(block)
    })
}

/// Length of the first block.
fn first_len(bytes: &[u8]) -> Option<usize> {
    if bytes.len() <= LEAST_BYTES {
        return (!bytes.is_empty()).then_some(bytes.len());
    }
    let most = bytes.len().min(MOST_BYTES);
    let mut hash = 0_u64;
    let sought = bytes.iter().enumerate().take(most).skip(LEAST_BYTES - 64);
    for (place, byte) in sought {
        hash = (hash << 1).wrapping_add(GEAR.get(usize::from(*byte)).copied().unwrap_or(0));
        if place >= LEAST_BYTES && hash & CUT_MASK == 0 {
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
    fn blocks_are_of_a_size_and_make_up_the_whole() {
        let bytes = noise(4 << 20, 1);
        let cut: Vec<&[u8]> = blocks(&bytes).collect();
        assert_eq!(cut.concat(), bytes);
        let (last, others) = cut.split_last().unwrap();
        assert!(others.iter().all(|block| (LEAST_BYTES..=MOST_BYTES).contains(&block.len())));
        assert!(last.len() <= MOST_BYTES);
        let mean = bytes.len() / cut.len();
        assert!((24 << 10..56 << 10).contains(&mean), "{mean}");
    }

    #[test]
    fn what_is_put_in_changes_a_few_blocks_alone() {
        let bytes = noise(4 << 20, 2);
        let mut longer = bytes.clone();
        longer.splice(1_000_000..1_000_000, noise(777, 3));
        let before: Vec<&[u8]> = blocks(&bytes).collect();
        let new = blocks(&longer).filter(|block| !before.contains(block)).count();
        assert!((1..=3).contains(&new), "{new} of {}", before.len());
    }

    proptest! {
        #[test]
        fn any_bytes_are_cut_and_put_together_again(bytes in proptest::collection::vec(any::<u8>(), 0..40_000)) {
            prop_assert_eq!(blocks(&bytes).collect::<Vec<_>>().concat(), bytes);
        }
    }
}
