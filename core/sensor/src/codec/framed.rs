//! Search for frames in received bytes, shared by all codecs. If a candidate fails, its bytes are searched again.

use super::interface::{Codec, CodecCounts};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// Verdict on received bytes that may begin with a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No frame begins at this byte.
    NotAStart,
    /// A frame may begin here. At least this many bytes in total are needed to decide.
    Need(usize),
    /// A complete frame of this many bytes begins here.
    Frame(usize),
    /// A start marker is here, but no valid frame.
    Bad,
}

impl Verdict {
    /// Returns the verdict on a frame candidate of `len` bytes. `is_good` checks the candidate once it is complete.
    pub fn on(front: &[u8], len: usize, is_good: impl FnOnce(&[u8]) -> bool) -> Self {
        match front.get(..len) {
            None => Self::Need(len),
            Some(frame) if is_good(frame) => Self::Frame(len),
            Some(_) => Self::Bad,
        }
    }
}

/// Frame format of one protocol; [`Framed`] turns it into a codec.
pub trait Framing: Copy {
    /// Value of one frame; see [`Codec::Value`].
    type Value: Clone + PartialEq + core::fmt::Debug;

    /// Whether the transport delivers whole messages; see [`Codec::WHOLE_MESSAGES`].
    const WHOLE_MESSAGES: bool = false;

    /// Returns the verdict on a frame at the start of `front`, which has at least one byte. It depends only on `front`.
    fn judge(&self, front: &[u8]) -> Verdict;

    /// Returns the value of a frame accepted by [`Framing::judge`]; `None` if the frame carries nothing useful.
    fn read(&self, frame: &[u8]) -> Option<Self::Value>;
}

/// Codec of a [`Framing`]. It keeps an incomplete frame between pushes, and finds frames in arbitrary input.
///
/// `N` is the maximum frame length; a candidate that needs more bytes is bad. On a byte stream, scanning resumes at the
/// second byte of a failed candidate, so that a real frame inside it is found. A byte that starts no frame is skipped,
/// and does not count as a bad frame. If a whole message has a byte outside its frames, all bytes from there to the
/// message's end count as one bad frame, and apparent frames among them are ignored.
///
/// Allocates: never.
#[derive(Debug, Clone)]
pub struct Framed<F, const N: usize> {
    framing: F,
    held: [u8; N],
    len: usize,
    /// Whether a bad frame was found in the current message. The rest of this message is then skipped.
    astray: bool,
    counts: CodecCounts,
}

impl<F: Default, const N: usize> Default for Framed<F, N> {
    fn default() -> Self {
        Self::new(F::default())
    }
}

impl<F, const N: usize> Framed<F, N> {
    /// Creates a codec that has received no bytes yet.
    pub fn new(framing: F) -> Self {
        Self { framing, held: [0; N], len: 0, astray: false, counts: CodecCounts::default() }
    }
}

impl<F, const N: usize> Framed<F, N> {
    /// Returns the frame format of the codec.
    pub fn framing(&self) -> &F {
        &self.framing
    }
}

/// Saves and restores the codec's incomplete frame and its counters.
impl<F, const N: usize> Stateful for Framed<F, N> {
    fn save(&self, to: &mut Saver) {
        to.value(&(self.astray, self.counts));
        to.raw(self.held.get(..self.len).unwrap_or_default());
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        (self.astray, self.counts) = from.value()?;
        let held = from.raw()?;
        let Some(place) = self.held.get_mut(..held.len()) else {
            return Err(from.unfit(format!("{} bytes of a frame of at most {N}", held.len())));
        };
        place.copy_from_slice(held);
        self.len = held.len();
        Ok(())
    }
}

impl<F: Framing, const N: usize> Framed<F, N> {
    /// Like [`Codec::push`], but passes the bytes of each frame to `take`.
    ///
    /// The second argument of `take` counts the bytes from the frame's start to the last received byte.
    pub fn push_frames(&mut self, mut bytes: &[u8], mut take: impl FnMut(&[u8], usize)) {
        while !bytes.is_empty() && !self.astray {
            let (now, later) = bytes.split_at(bytes.len().min(N - self.len));
            if let Some(free) = self.held.get_mut(self.len..self.len + now.len()) {
                free.copy_from_slice(now);
            }
            self.len += now.len();
            bytes = later;
            self.scan(bytes.len(), 0, &mut take);
        }
        self.counts.skipped_bytes += bytes.len() as u64;
    }

    /// Like [`Codec::flush`], but passes frames to `take` as [`Framed::push_frames`] does.
    pub fn flush_frames(&mut self, mut take: impl FnMut(&[u8], usize)) {
        self.scan(0, usize::MAX, &mut take);
        self.astray = false;
    }

    /// Handles a silence of the device that ends with the bytes `next`, which are not pushed yet. Drops held bytes only
    /// if they are provably no frame.
    ///
    /// The proof is a whole frame inside the held bytes or at the start of `next`. Without it, the held bytes are kept
    /// for any time, because a frame on a slow line looks the same as a false start. Frames go to `take` as in
    /// [`Framed::push_frames`]. If the transport delivers whole messages, the message ends with the silence.
    pub fn settle_frames(&mut self, next: &[u8], mut take: impl FnMut(&[u8], usize)) {
        if F::WHOLE_MESSAGES || self.is_whole_frame(next) {
            return self.flush_frames(take);
        }
        let held = self.held.get(..self.len).unwrap_or_default();
        let inside =
            (1..held.len()).rev().find(|start| self.is_whole_frame(held.get(*start..).unwrap_or_default()));
        if let Some(start) = inside {
            self.scan(0, start, &mut take);
        }
    }

    fn is_whole_frame(&self, front: &[u8]) -> bool {
        !front.is_empty()
            && matches!(self.framing.judge(front), Verdict::Frame(n) if (1..=front.len().min(N)).contains(&n))
    }

    /// Extracts frames from the held bytes. Gives up incomplete candidates that begin before the index
    /// `give_up_before`.
    fn scan(&mut self, later: usize, give_up_before: usize, take: &mut impl FnMut(&[u8], usize)) {
        let mut start = 0;
        while start < self.len {
            let front = self.held.get(start..self.len).unwrap_or_default();
            start += match self.framing.judge(front) {
                Verdict::Frame(n) if (1..=front.len()).contains(&n) => {
                    self.counts.good_frames += 1;
                    take(front.get(..n).unwrap_or_default(), front.len() + later);
                    n
                }
                Verdict::Need(n) if n <= N && n > front.len() && start >= give_up_before => break,
                verdict => {
                    self.astray = F::WHOLE_MESSAGES;
                    self.counts.bad_frames += u64::from(self.astray || verdict != Verdict::NotAStart);
                    let skipped = if self.astray { front.len() } else { 1 };
                    self.counts.skipped_bytes += skipped as u64;
                    skipped
                }
            };
        }
        self.held.copy_within(start..self.len, 0);
        self.len -= start;
    }
}

impl<F: Framing, const N: usize> Codec for Framed<F, N> {
    type Value = F::Value;

    const MAX_FRAME_BYTES: usize = N;
    const WHOLE_MESSAGES: bool = F::WHOLE_MESSAGES;

    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(F::Value)) {
        let framing = self.framing;
        self.push_frames(bytes, |frame, _| framing.read(frame).into_iter().for_each(&mut *sink));
    }

    fn flush(&mut self, sink: &mut dyn FnMut(F::Value)) {
        let framing = self.framing;
        self.flush_frames(|frame, _| framing.read(frame).into_iter().for_each(&mut *sink));
    }

    fn counts(&self) -> CodecCounts {
        self.counts
    }

    fn held_bytes(&self) -> usize {
        self.len
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Framing for tests: 0xA5, length n up to 5, n bytes, 0x5A.
    #[derive(Debug, Clone, Copy, Default)]
    pub(crate) struct Marked<const WHOLE_MESSAGES: bool>;

    impl<const WHOLE_MESSAGES: bool> Framing for Marked<WHOLE_MESSAGES> {
        type Value = Vec<u8>;

        const WHOLE_MESSAGES: bool = WHOLE_MESSAGES;

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

        fn read(&self, frame: &[u8]) -> Option<Vec<u8>> {
            Some(frame[2..frame.len() - 1].to_vec())
        }
    }

    fn pushed(codec: &mut impl Codec<Value = Vec<u8>>, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut values = Vec::new();
        codec.push(bytes, &mut |value| values.push(value));
        values
    }

    #[test]
    fn frame_inside_a_false_frame_is_found() {
        let mut codec = Framed::<Marked<false>, 8>::default();
        assert_eq!(pushed(&mut codec, &[0xA5, 5, 0xA5, 1, 7, 0x5A, 0, 0]), [[7]]);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 1, bad_frames: 1, skipped_bytes: 4 });
    }

    #[test]
    fn flush_releases_a_frame_after_a_false_start() {
        let mut codec = Framed::<Marked<false>, 8>::default();
        assert!(pushed(&mut codec, &[0xA5, 5, 0xA5, 0, 0x5A]).is_empty());
        assert_eq!(codec.held_bytes(), 5);
        let mut frames = 0;
        codec.flush(&mut |_| frames += 1);
        assert_eq!((frames, codec.held_bytes()), (1, 0));
    }

    #[test]
    fn distance_from_frame_start_to_input_end_is_reported() {
        let mut codec = Framed::<Marked<false>, 8>::default();
        let mut behind = Vec::new();
        codec.push_frames(&[0, 0xA5, 5, 0xA5], |_, back| behind.push(back));
        // The codec holds a false start marker and the first byte of a frame. The next push exceeds its buffer.
        codec.push_frames(&[1, 7, 0x5A, 0, 0, 0xA5, 0, 0x5A, 0], |_, back| behind.push(back));
        assert_eq!(behind, [10, 4]);
    }

    #[test]
    fn frame_candidate_longer_than_the_buffer_is_bad() {
        let mut codec = Framed::<Marked<false>, 7>::default();
        assert_eq!(pushed(&mut codec, &[0xA5, 5, 0xA5, 1, 7, 0x5A]), [[7]]);
    }

    #[test]
    fn bad_message_is_skipped_to_its_end() {
        let good = [0xA5, 1, 7, 0x5A];
        let mut codec = Framed::<Marked<true>, 8>::default();
        for start in [&[0xA5, 5, 1][..], &[0x11], &[0xA5, 9], &[0xA5, 0, 0]] {
            let bad = [start, &good, &good].concat();
            assert!(pushed(&mut codec, &bad[..2]).is_empty());
            assert!(pushed(&mut codec, &bad[2..]).is_empty());
            codec.flush(&mut |value| panic!("{value:?}"));
            assert_eq!(codec.held_bytes(), 0);
            assert_eq!(pushed(&mut codec, &good), [[7]], "after {start:02X?}");
        }
        assert_eq!(codec.counts(), CodecCounts { good_frames: 4, bad_frames: 4, skipped_bytes: 41 });
    }

    #[test]
    fn frame_inside_a_truncated_message_is_ignored() {
        let mut codec = Framed::<Marked<true>, 8>::default();
        assert!(pushed(&mut codec, &[0xA5, 5, 0xA5, 0, 0x5A]).is_empty());
        codec.flush(&mut |value| panic!("{value:?}"));
        assert_eq!(codec.counts(), CodecCounts { good_frames: 0, bad_frames: 1, skipped_bytes: 5 });
    }

    #[cfg(feature = "contract")]
    crate::codec_contract!(
        contract_of_messages,
        codec: Framed::<Marked<true>, 8>::default(),
        values: proptest::collection::vec(any::<u8>(), 0..=5),
        encode: |body: &Vec<u8>| [&[0xA5, u8::try_from(body.len()).unwrap()][..], body, &[0x5A]].concat(),
        frames: [[0xA5, 1, 7, 0x5A]],
    );
}
