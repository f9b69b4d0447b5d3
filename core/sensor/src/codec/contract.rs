//! The contract of all codecs, as a macro that generates the tests of one codec.
//!
//! Enable the feature `contract` in a plugin's dev-dependencies and call [`codec_contract!`](crate::codec_contract)
//! once per codec.

use proptest::test_runner::{Config, RngSeed};

use super::interface::Codec;

/// Seed of the random values in contract tests; an arbitrary number.
const SEED: u64 = 881;

/// Proptest configuration of the contract's tests, which draw the same values on every run.
///
/// Garbage may pass a weak checksum by chance, and then the test fails although the codec is correct. With a fixed
/// seed, such a failure occurs on every run or never. Set `PROPTEST_RNG_SEED` to try other values.
pub fn config() -> Config {
    let from_environment = Config::default();
    let rng_seed = match from_environment.rng_seed {
        RngSeed::Random => RngSeed::Fixed(SEED),
        chosen @ RngSeed::Fixed(_) => chosen,
    };
    Config { rng_seed, failure_persistence: None, ..from_environment }
}

/// Decodes `bytes`, pushed into the codec in pieces of the given lengths, without a flush. The last piece contains the
/// bytes that remain.
pub fn decode_pieces<C: Codec>(codec: &mut C, bytes: &[u8], pieces: &[usize]) -> Vec<C::Value> {
    let mut values = Vec::new();
    let mut rest = bytes;
    for piece in pieces {
        let (now, later) = rest.split_at((*piece).min(rest.len()));
        codec.push(now, &mut |value| values.push(value));
        assert!(codec.held_bytes() <= C::MAX_FRAME_BYTES, "holds {} bytes", codec.held_bytes());
        rest = later;
    }
    codec.push(rest, &mut |value| values.push(value));
    assert!(codec.held_bytes() <= C::MAX_FRAME_BYTES, "holds {} bytes", codec.held_bytes());
    values
}

/// Decodes `bytes`, pushed into the codec in one piece, and flushes the codec.
pub fn decode_all<C: Codec>(codec: &mut C, bytes: &[u8]) -> Vec<C::Value> {
    let mut values = decode_pieces(codec, bytes, &[]);
    codec.flush(&mut |value| values.push(value));
    values
}

/// Decodes garbage followed by a good frame. A correct codec decodes that frame's value last.
pub fn decode_after_garbage<C: Codec>(codec: &mut C, garbage: &[u8], frame: &[u8]) -> Vec<C::Value> {
    let mut values = Vec::new();
    codec.push(garbage, &mut |value| values.push(value));
    if C::WHOLE_MESSAGES {
        codec.flush(&mut |value| values.push(value));
    }
    codec.push(frame, &mut |value| values.push(value));
    codec.flush(&mut |value| values.push(value));
    values
}

/// Whether `bytes` decodes as exactly one good frame.
fn is_one_frame<C: Codec>(codec: &mut C, bytes: &[u8]) -> bool {
    let values = decode_all(codec, bytes);
    let counts = codec.counts();
    values.len() == 1 && counts.bad_frames == 0 && counts.skipped_bytes == 0
}

/// Sets two bytes, from index `at` on, so that `bytes` decodes as one frame. Returns `false` if no values do this.
fn made_to_match<C: Codec>(new: &impl Fn() -> C, bytes: &mut [u8], at: usize) -> bool {
    let Some(before) = bytes.get(at..at + 2).map(<[u8]>::to_vec) else { return false };
    if bytes.len() > MOST_MATCHED {
        return false;
    }
    for pair in 0..=u16::MAX {
        bytes[at..at + 2].copy_from_slice(&pair.to_le_bytes());
        if is_one_frame(&mut new(), bytes) {
            return true;
        }
    }
    bytes[at..at + 2].copy_from_slice(&before);
    false
}

/// Positions in a frame to corrupt, each with the mask to XOR into the byte. They are the same on every run.
///
/// Every second mask is 1, which turns most digits into other digits.
fn attempts(len: usize) -> impl Iterator<Item = (usize, u8)> {
    const TURNS: [u8; 6] = [0x5B, 0x80, 0x24, 0xFF, 0x11, 0xC2];
    (0..12_usize).map(move |k| {
        ((k * 7 + 3) % len, if k % 2 == 0 { 1 } else { TURNS.get(k / 2).copied().unwrap_or(1) })
    })
}

/// Longest frame for which all values of two bytes are tried, because this takes long. Frames that are longer have no
/// checksum.
const MOST_MATCHED: usize = 100;

/// Returns corrupted frames that decode as good frames by chance.
///
/// One byte of a good frame is changed. If the frame has a checksum, the checksum is changed to match.
pub fn matching_by_chance<C: Codec>(new: &impl Fn() -> C, frame: &[u8]) -> Vec<Vec<u8>> {
    let wrong = attempts(frame.len()).filter_map(|(at, turn)| {
        let mut wrong = frame.to_vec();
        wrong[at] ^= turn;
        // A checksum is near the end of a frame, possibly written in digits.
        let places = (0..frame.len().saturating_sub(1))
            .rev()
            .take(6)
            .filter(|place| !(*place..place + 2).contains(&at));
        let is_one = is_one_frame(&mut new(), &wrong);
        (is_one || places.into_iter().any(|place| made_to_match(new, &mut wrong, place))).then_some(wrong)
    });
    wrong.collect()
}

/// Returns truncated frames. Each of them decodes as one frame together with the first bytes of the next good frame.
pub fn matching_into_the_next<C: Codec>(new: &impl Fn() -> C, frame: &[u8]) -> Vec<Vec<u8>> {
    let len = frame.len();
    let cut = (2..len).rev().step_by(len.div_ceil(6)).filter_map(|keep| {
        let mut both = [&frame[..keep], &frame[..len - keep]].concat();
        made_to_match(new, &mut both, keep - 2).then(|| both[..keep].to_vec())
    });
    cut.collect()
}

/// Generates a module of tests that check a codec against its contract.
///
/// - `codec` is an expression that creates a new codec.
/// - `values` is a proptest strategy of all values that can be encoded.
/// - `encode` is a function from `&Value` to its bytes.
/// - `frames` are one or more good frames as the device sends them.
///
/// On a byte stream, only the protocol's framing distinguishes a frame from garbage. If the last bytes of garbage and
/// the first bytes of a frame form a valid frame, every decoder loses the real frame. The tests draw random garbage, so
/// the protocol determines how likely this is. All values come from one fixed seed (see
/// [`contract::config`](crate::codec::contract::config)). So such a match appears only after a test or strategy has
/// changed, and then on every run.
#[macro_export]
macro_rules! codec_contract {
    ($module:ident, codec: $codec:expr, values: $values:expr, encode: $encode:expr, frames: $frames:expr $(,)?) => {
        mod $module {
            #[allow(unused_imports)]
            use super::*;
            use proptest::prelude::*;
            #[allow(unused_imports)]
            use $crate::codec::Codec as _;
            use $crate::codec::contract::{
                decode_after_garbage, decode_all, decode_pieces, matching_by_chance, matching_into_the_next,
            };

            proptest! {
                #![proptest_config($crate::codec::contract::config())]

                #[test]
                fn flush_releases_all_bytes_of_arbitrary_input(
                    bytes in proptest::collection::vec(any::<u8>(), 0..2000),
                    pieces in proptest::collection::vec(0usize..40, 0..60),
                ) {
                    let mut codec = $codec;
                    let _ = decode_pieces(&mut codec, &bytes, &pieces);
                    codec.flush(&mut |_| ());
                    prop_assert_eq!(codec.held_bytes(), 0);
                    prop_assert!(codec.counts().skipped_bytes <= bytes.len() as u64);
                }

                #[test]
                fn split_input_gives_the_same_values(
                    values in proptest::collection::vec($values, 1..6),
                    noise in proptest::collection::vec(any::<u8>(), 0..30),
                    pieces in proptest::collection::vec(0usize..25, 0..200),
                ) {
                    let mut bytes = Vec::new();
                    for (i, value) in values.iter().enumerate() {
                        if i == values.len() / 2 {
                            bytes.extend_from_slice(&noise);
                        }
                        bytes.extend_from_slice(&($encode)(value));
                    }
                    let (mut whole, mut split) = ($codec, $codec);
                    let expected = decode_all(&mut whole, &bytes);
                    let mut got = decode_pieces(&mut split, &bytes, &pieces);
                    split.flush(&mut |value| got.push(value));
                    prop_assert_eq!(got, expected);
                    prop_assert_eq!(split.counts(), whole.counts());
                }

                #[test]
                fn frame_after_garbage_is_found(
                    garbage in proptest::collection::vec(any::<u8>(), 0..100),
                    value in $values,
                ) {
                    let frame = ($encode)(&value);
                    let got = decode_after_garbage(&mut $codec, &garbage, &frame);
                    prop_assert_eq!(got.last(), Some(&value), "after garbage {:02X?}", garbage);
                }

                #[test]
                fn frame_after_a_truncated_one_is_found(
                    cut in $values,
                    keep in any::<prop::sample::Index>(),
                    value in $values,
                ) {
                    let whole = ($encode)(&cut);
                    let part = &whole[..keep.index(whole.len())];
                    let got = decode_after_garbage(&mut $codec, part, &($encode)(&value));
                    prop_assert_eq!(got.last(), Some(&value), "after {:02X?}", part);
                }

                #[test]
                fn decoding_an_encoded_value_returns_it(value in $values) {
                    prop_assert_eq!(decode_all(&mut $codec, &($encode)(&value)), vec![value]);
                }
            }

            #[test]
            fn frame_split_at_any_byte_gives_the_same_value() {
                for frame in $frames {
                    let frame: &[u8] = frame.as_ref();
                    let expected = decode_all(&mut $codec, frame);
                    assert_eq!(expected.len(), 1, "{frame:02X?}");
                    for at in 0..=frame.len() {
                        assert_eq!(decode_pieces(&mut $codec, frame, &[at]), expected, "split at {at}");
                    }
                }
            }

            /// A corrupted frame with a matching checksum decodes to a value, but hides no frame after it.
            #[test]
            fn corrupted_frame_with_matching_checksum_hides_no_other_frame() {
                let mut tried = 0;
                for frame in $frames {
                    let frame: &[u8] = frame.as_ref();
                    for wrong in matching_by_chance(&|| $codec, frame) {
                        let mut codec = $codec;
                        let got = decode_after_garbage(&mut codec, &wrong, frame);
                        assert_eq!(got.len(), 2, "after {wrong:02X?}");
                        assert_eq!(got.get(1), decode_all(&mut $codec, frame).first(), "after {wrong:02X?}");
                        assert_eq!((codec.counts().good_frames, codec.counts().skipped_bytes), (2, 0));
                        tried += 1;
                    }
                }
                assert!(tried > 0);
            }

            /// A truncated frame and the first bytes of the next frame may form a valid frame. Then only this next
            /// frame is lost.
            #[test]
            fn truncated_frame_completed_by_the_next_frame_hides_only_that_frame() {
                for frame in $frames {
                    let frame: &[u8] = frame.as_ref();
                    for cut in matching_into_the_next(&|| $codec, frame) {
                        let mut codec = $codec;
                        let got = decode_after_garbage(&mut codec, &cut, &[frame, frame].concat());
                        assert_eq!(got.last(), decode_all(&mut $codec, frame).first(), "after {cut:02X?}");
                        assert!(got.len() >= 2 && codec.held_bytes() == 0, "after {cut:02X?}: {got:?}");
                    }
                }
            }
        }
    };
}
