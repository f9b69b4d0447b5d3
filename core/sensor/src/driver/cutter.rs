//! Splits a device's byte stream into frames.
//!
//! Each log message then contains one frame, stamped with the receive time of its first byte.

use std::collections::VecDeque;

use crate::codec::{Codec as _, CodecCounts, Framed, Framing};
use headrace_geometry::time::{DurNs, MonoNs};

/// Splits a byte stream that arrives in arbitrary parts into frames. The bytes between frames are passed on too.
///
/// No byte is dropped or reordered: the concatenated pieces equal the input. The frames do not depend on how the stream
/// is split and when its parts arrive. A frame has the receive time of the part that contains its first byte. Its last
/// byte may arrive much later, for instance through a bridge that sends blocks.
#[derive(Debug, Clone)]
pub struct Cutter<F, const N: usize> {
    codec: Framed<F, N>,
    silence: DurNs,
    /// Receive time of the latest bytes.
    last: MonoNs,
    /// Whether the silence since the latest bytes has been handled.
    settled: bool,
    /// Bytes that have not been passed on yet.
    pending: Vec<u8>,
    /// Receive time and byte count of each received part of the pending bytes, oldest first.
    parts: VecDeque<(MonoNs, usize)>,
}

/// A piece of the byte stream: a frame, or bytes between frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece<'a> {
    /// Receive time of the piece's first byte.
    pub received: MonoNs,
    /// Bytes of the piece.
    pub bytes: &'a [u8],
    /// Whether the piece is a frame.
    pub is_frame: bool,
}

impl<F: Framing, const N: usize> Cutter<F, N> {
    /// Creates a cutter. `silence` is the longest usual gap within a frame.
    ///
    /// After a longer gap, the cutter checks whether a false start of a frame holds back real frames
    /// ([`Framed::settle_frames`]).
    pub fn new(framing: F, silence: DurNs) -> Self {
        let (pending, parts) = (Vec::with_capacity(2 * N), VecDeque::new());
        Self { codec: Framed::new(framing), silence, last: MonoNs(0), settled: true, pending, parts }
    }

    /// Processes received bytes; `take` receives the completed pieces.
    pub fn push(&mut self, received: MonoNs, bytes: &[u8], take: &mut dyn FnMut(Piece<'_>)) {
        if !self.settled && received.since(self.last) > self.silence {
            self.settled = true;
            let mut found = Vec::new();
            self.codec.settle_frames(bytes, |frame, behind| found.push((behind, frame.len())));
            self.hand_on(&found, take);
        }
        if bytes.is_empty() {
            return;
        }
        (self.last, self.settled) = (received, false);
        self.pending.extend_from_slice(bytes);
        self.parts.push_back((received, bytes.len()));
        let mut found = Vec::new();
        self.codec.push_frames(bytes, |frame, behind| found.push((behind, frame.len())));
        self.hand_on(&found, take);
    }

    /// Handles the closing of the line. Gives up an incomplete frame, and passes on all pending bytes.
    pub fn flush(&mut self, take: &mut dyn FnMut(Piece<'_>)) {
        let mut found = Vec::new();
        self.codec.flush_frames(|frame, behind| found.push((behind, frame.len())));
        self.hand_on(&found, take);
    }

    /// Returns the time at which to push an empty slice. Then an incomplete frame no longer holds back other frames.
    ///
    /// `None` if no bytes are pending, or if the silence has been handled.
    pub fn settles(&self) -> Option<MonoNs> {
        (!self.settled && !self.pending.is_empty()).then(|| self.last + self.silence + DurNs(1))
    }

    /// Whether these bytes alone contain a complete frame of this device. `one_of_its` returns whether a frame is one
    /// of the device's.
    pub fn accepts(&self, bytes: &[u8], one_of_its: impl Fn(&[u8]) -> bool) -> bool {
        let (mut codec, mut found) = (Framed::<F, N>::new(*self.codec.framing()), false);
        codec.push_frames(bytes, |frame, _| found |= one_of_its(frame));
        codec.flush_frames(|frame, _| found |= one_of_its(frame));
        found
    }

    /// Counters of frames and bytes so far.
    pub fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Passes on all pending bytes except those that the codec holds.
    ///
    /// For each frame, `found` contains the number of bytes from the frame's start to the end of the input, and the
    /// frame's length.
    fn hand_on(&mut self, found: &[(usize, usize)], take: &mut dyn FnMut(Piece<'_>)) {
        let total = self.pending.len();
        let mut handed = 0;
        for (behind, len) in found {
            let start = total.saturating_sub(*behind);
            self.give(start.saturating_sub(handed), false, take);
            self.give(*len, true, take);
            handed = start + len;
        }
        let held = self.codec.held_bytes();
        self.give(self.pending.len().saturating_sub(held), false, take);
    }

    /// Passes on the first `count` pending bytes as one piece.
    fn give(&mut self, count: usize, is_frame: bool, take: &mut dyn FnMut(Piece<'_>)) {
        let count = count.min(self.pending.len());
        if count == 0 {
            return;
        }
        let received = self.parts.front().map_or(self.last, |part| part.0);
        take(Piece { received, bytes: self.pending.get(..count).unwrap_or_default(), is_frame });
        self.pending.drain(..count);
        let mut left = count;
        while let Some((_, bytes)) = self.parts.front_mut() {
            if *bytes > left {
                *bytes -= left;
                break;
            }
            left -= *bytes;
            self.parts.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::codec::Verdict;

    /// Framing for tests: 0xA5, length n up to 5, n bytes, 0x5A.
    #[derive(Debug, Clone, Copy, Default)]
    struct Marked;

    impl Framing for Marked {
        type Value = ();

        fn judge(&self, front: &[u8]) -> Verdict {
            match *front {
                [0xA5] => Verdict::Need(2),
                [0xA5, n, ..] if n <= 5 => {
                    Verdict::on(front, usize::from(n) + 3, |frame| frame.last() == Some(&0x5A))
                }
                [0xA5, ..] => Verdict::Bad,
                _ => Verdict::NotAStart,
            }
        }

        fn read(&self, _: &[u8]) -> Option<()> {
            Some(())
        }
    }

    const SILENCE: DurNs = DurNs(50);

    type Pieces = Vec<(u64, Vec<u8>, bool)>;

    fn pushed(cutter: &mut Cutter<Marked, 8>, parts: &[(u64, &[u8])]) -> Pieces {
        let mut pieces = Vec::new();
        for (at, bytes) in parts {
            cutter
                .push(MonoNs(*at), bytes, &mut |p| pieces.push((p.received.0, p.bytes.to_vec(), p.is_frame)));
        }
        pieces
    }

    fn cutter() -> Cutter<Marked, 8> {
        Cutter::new(Marked, SILENCE)
    }

    #[test]
    fn frames_are_separated_and_have_the_time_of_their_first_byte() {
        let parts: [(u64, &[u8]); 4] =
            [(1, &[7, 0xA5]), (2, &[1]), (3, &[9, 0x5A, 8, 8, 0xA5, 0]), (4, &[0x5A, 6])];
        let expected: Pieces = vec![
            (1, vec![7], false),
            (1, vec![0xA5, 1, 9, 0x5A], true),
            (3, vec![8, 8], false),
            (3, vec![0xA5, 0, 0x5A], true),
            (4, vec![6], false),
        ];
        assert_eq!(pushed(&mut cutter(), &parts), expected);
    }

    #[test]
    fn silence_releases_an_incomplete_frame_and_the_frame_inside_it() {
        let mut cutter = cutter();
        assert!(pushed(&mut cutter, &[(1, &[0xA5, 5, 0xA5, 0, 0x5A])]).is_empty());
        assert_eq!(cutter.settles(), Some(MonoNs(52)));
        let pieces = pushed(&mut cutter, &[(52, &[])]);
        assert_eq!(pieces, [(1, vec![0xA5, 5], false), (1, vec![0xA5, 0, 0x5A], true)]);
        assert_eq!(cutter.settles(), None);
    }

    #[test]
    fn frame_completed_late_has_the_time_of_its_first_byte() {
        let parts: [(u64, &[u8]); 3] =
            [(1, &[0xA5, 1, 9]), (1 + 66, &[0x5A, 0xA5, 1, 8]), (1 + 2 * 66, &[0x5A, 0xA5])];
        let expected: Pieces = vec![(1, vec![0xA5, 1, 9, 0x5A], true), (67, vec![0xA5, 1, 8, 0x5A], true)];
        let mut cutter = cutter();
        assert_eq!(pushed(&mut cutter, &parts), expected);
        // A pending start of a frame wakes the driver only once.
        assert!(pushed(&mut cutter, &[(133 + 52, &[])]).is_empty());
        assert_eq!(cutter.settles(), None);
    }

    #[test]
    fn whole_frame_after_silence_releases_a_truncated_frame() {
        let parts: [(u64, &[u8]); 2] = [(1, &[0xA5, 5, 1]), (100, &[0xA5, 0, 0x5A])];
        let expected: Pieces = vec![(1, vec![0xA5, 5, 1], false), (100, vec![0xA5, 0, 0x5A], true)];
        assert_eq!(pushed(&mut cutter(), &parts), expected);
    }

    #[test]
    fn pushes_without_bytes_do_not_extend_the_silence() {
        let mut cutter = cutter();
        let lure: [(u64, &[u8]); 3] = [(1, &[0xA5, 5, 0xA5, 0, 0x5A]), (30, &[]), (51, &[])];
        assert!(pushed(&mut cutter, &lure).is_empty());
        assert_eq!(pushed(&mut cutter, &[(52, &[])]).len(), 2);
    }

    proptest! {
        /// However the input is split, the cutter passes on all bytes in order, and times never decrease. The frames
        /// equal those that the codec alone finds.
        #[test]
        fn pieces_concatenate_to_the_input_for_any_split_of_the_byte_stream(
            bytes in proptest::collection::vec(prop_oneof![Just(0xA5u8), Just(0x5A), 0u8..7], 0..200),
            cuts in proptest::collection::vec(1usize..20, 1..40),
        ) {
            let mut codec = Framed::<Marked, 8>::default();
            let mut frames = Vec::new();
            codec.push_frames(&bytes, |frame, _| frames.push(frame.to_vec()));
            codec.flush_frames(|frame, _| frames.push(frame.to_vec()));
            let mut cutter = cutter();
            let mut pieces: Pieces = Vec::new();
            let (mut rest, mut at) = (&bytes[..], 0);
            for cut in cuts.iter().cycle() {
                let (now, later) = rest.split_at((*cut).min(rest.len()));
                at += 1;
                pieces.extend(pushed(&mut cutter, &[(at, now)]));
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
            cutter.flush(&mut |p| pieces.push((p.received.0, p.bytes.to_vec(), p.is_frame)));
            let all: Vec<u8> = pieces.iter().flat_map(|piece| piece.1.clone()).collect();
            prop_assert_eq!(all, bytes);
            let cut_out: Vec<_> = pieces.iter().filter(|piece| piece.2).map(|piece| piece.1.clone()).collect();
            prop_assert_eq!(cut_out, frames);
            prop_assert!(pieces.windows(2).all(|two| two[0].0 <= two[1].0));
            prop_assert_eq!(cutter.counts(), codec.counts());
        }
    }
}
