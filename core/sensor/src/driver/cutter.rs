//! A row of bytes cut into the device's frames, so that each message of a log is one, stamped with its first byte.

use std::collections::VecDeque;

use crate::codec::{Codec as _, CodecCounts, Framed, Framing};
use headrace_geometry::time::{DurNs, MonoNs};

/// Cuts what a port delivers, in whatever pieces, into frames; what stands between them is handed on too.
///
/// Nothing is left out and nothing is put in another order: whoever gets the pieces gets the same bytes.
#[derive(Debug, Clone)]
pub struct Cutter<F, const N: usize> {
    codec: Framed<F, N>,
    silence: DurNs,
    last: MonoNs,
    /// What hasn't been handed on.
    pending: Vec<u8>,
    /// Receive time of the bytes pending and how many came with it, oldest first.
    parts: VecDeque<(MonoNs, usize)>,
}

/// A piece of what came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece<'a> {
    /// When its first byte came.
    pub received: MonoNs,
    /// Its bytes.
    pub bytes: &'a [u8],
    /// Whether it is a frame; else it is what stood before one.
    pub is_frame: bool,
}

impl<F: Framing, const N: usize> Cutter<F, N> {
    /// For a line on which a frame's bytes follow one another: after more than `silence` no more belong to the one begun.
    pub fn new(framing: F, silence: DurNs) -> Self {
        let (pending, parts) = (Vec::with_capacity(2 * N), VecDeque::new());
        Self { codec: Framed::new(framing), silence, last: MonoNs(0), pending, parts }
    }

    /// Takes bytes as they came; `take` gets the pieces that they complete.
    pub fn push(&mut self, received: MonoNs, bytes: &[u8], take: &mut dyn FnMut(Piece<'_>)) {
        if received.since(self.last) > self.silence {
            self.flush(take);
        }
        self.last = received;
        if bytes.is_empty() {
            return;
        }
        self.pending.extend_from_slice(bytes);
        self.parts.push_back((received, bytes.len()));
        let mut found = Vec::new();
        self.codec.push_frames(bytes, |frame, behind| found.push((behind, frame.len())));
        self.hand_on(&found, take);
    }

    /// Gives up a frame that was begun: the line has been silent, or was closed.
    pub fn flush(&mut self, take: &mut dyn FnMut(Piece<'_>)) {
        let mut found = Vec::new();
        self.codec.flush_frames(|frame, behind| found.push((behind, frame.len())));
        self.hand_on(&found, take);
    }

    /// When a frame that has begun would be given up, if one has.
    pub fn gives_up(&self) -> Option<MonoNs> {
        (!self.pending.is_empty()).then(|| self.last + self.silence + DurNs(1))
    }

    /// What has been seen so far.
    pub fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Hands on all that is pending but what the codec holds; `found` has for each frame how far from the end it begins, and
    /// its length.
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

    /// Hands on the first `count` bytes.
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

    /// Frames: 0xA5, length n up to 5, n bytes, 0x5A.
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
    fn frames_come_apart_from_what_is_between_them_each_with_its_first_byte_s_time() {
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
    fn silence_hands_on_what_was_begun_and_a_frame_inside_it() {
        let mut cutter = cutter();
        assert!(pushed(&mut cutter, &[(1, &[0xA5, 5, 0xA5, 0, 0x5A])]).is_empty());
        assert_eq!(cutter.gives_up(), Some(MonoNs(52)));
        let pieces = pushed(&mut cutter, &[(52, &[])]);
        assert_eq!(pieces, [(1, vec![0xA5, 5], false), (1, vec![0xA5, 0, 0x5A], true)]);
        assert_eq!(cutter.gives_up(), None);
    }

    proptest! {
        /// However bytes come, all of them are handed on, in order, no later than they came, and the frames are the codec's.
        #[test]
        fn nothing_is_lost_or_changed(
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
