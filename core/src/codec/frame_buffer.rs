//! Framing with rescanning, written once for every codec.

use super::CodecCounts;

/// What a candidate at the front of the buffer turned out to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No frame begins here. The byte is skipped without counting a bad frame.
    NotAStart,
    /// A frame may begin here, and needs at least this many bytes in all before more can be said.
    Need(usize),
    /// A whole frame of this many bytes.
    Frame(usize),
    /// A start marker was followed by something that is no frame. One byte is skipped and the rest is looked at again.
    Bad,
}

/// Holds an incomplete frame between pushes and finds frames in whatever comes.
///
/// `N` is the longest frame. After a failed candidate the scan goes on from its second byte, so that a frame hidden
/// inside a false one is found. Allocates: never.
#[derive(Debug, Clone)]
pub struct FrameBuffer<const N: usize> {
    held: [u8; N],
    len: usize,
    counts: CodecCounts,
}

impl<const N: usize> Default for FrameBuffer<N> {
    fn default() -> Self {
        Self { held: [0; N], len: 0, counts: CodecCounts::default() }
    }
}

impl<const N: usize> FrameBuffer<N> {
    /// Frames and bytes seen so far.
    pub fn counts(&self) -> CodecCounts {
        self.counts
    }

    /// Bytes held for a frame that isn't complete; always below `N`.
    pub fn held_bytes(&self) -> usize {
        self.len
    }

    /// Appends `bytes`; `judge` looks at the front of what is held, `take` receives each whole frame.
    ///
    /// `judge` must be a function of the bytes alone, and must not ask for more than `N` bytes: such a candidate is
    /// treated as bad.
    pub fn push(&mut self, mut bytes: &[u8], judge: impl Fn(&[u8]) -> Verdict, mut take: impl FnMut(&[u8])) {
        while !bytes.is_empty() {
            let room = N - self.len;
            let (now, later) = bytes.split_at(room.min(bytes.len()));
            if let Some(free) = self.held.get_mut(self.len..self.len + now.len()) {
                free.copy_from_slice(now);
            }
            self.len += now.len();
            bytes = later;
            self.scan(&judge, &mut take, false);
        }
    }

    /// Gives up the incomplete frame at the front and looks through what it swallowed.
    pub fn flush(&mut self, judge: impl Fn(&[u8]) -> Verdict, mut take: impl FnMut(&[u8])) {
        self.scan(&judge, &mut take, true);
    }

    fn scan(&mut self, judge: &impl Fn(&[u8]) -> Verdict, take: &mut impl FnMut(&[u8]), give_up: bool) {
        let mut start = 0;
        while start < self.len {
            let front = self.held.get(start..self.len).unwrap_or_default();
            match judge(front) {
                Verdict::Frame(n) if n >= 1 && n <= front.len() => {
                    take(front.get(..n).unwrap_or_default());
                    self.counts.good_frames += 1;
                    start += n;
                }
                Verdict::Need(n) if n <= N && n > front.len() && !give_up => break,
                Verdict::NotAStart => {
                    self.counts.skipped_bytes += 1;
                    start += 1;
                }
                Verdict::Need(_) | Verdict::Frame(_) | Verdict::Bad => {
                    self.counts.bad_frames += 1;
                    self.counts.skipped_bytes += 1;
                    start += 1;
                }
            }
        }
        self.held.copy_within(start..self.len, 0);
        self.len -= start;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames: 0xA5, length n, n bytes, 0x5A.
    fn judge(b: &[u8]) -> Verdict {
        match b {
            [0xA5] => Verdict::Need(2),
            [0xA5, n, rest @ ..] if *n <= 5 => {
                let body = usize::from(*n);
                match rest.get(body) {
                    None => Verdict::Need(body + 3),
                    Some(0x5A) => Verdict::Frame(body + 3),
                    Some(_) => Verdict::Bad,
                }
            }
            [0xA5, ..] => Verdict::Bad,
            _ => Verdict::NotAStart,
        }
    }

    #[test]
    fn a_frame_inside_a_false_one_is_found() {
        let mut buffer = FrameBuffer::<8>::default();
        let mut frames = Vec::new();
        buffer.push(&[0xA5, 5, 0xA5, 1, 7, 0x5A, 0, 0], judge, |f| frames.push(f.to_vec()));
        assert_eq!(frames, [vec![0xA5, 1, 7, 0x5A]]);
        assert_eq!(buffer.counts(), CodecCounts { good_frames: 1, bad_frames: 1, skipped_bytes: 4 });
    }

    #[test]
    fn silence_frees_a_frame_that_a_false_start_held_back() {
        let mut buffer = FrameBuffer::<8>::default();
        let mut frames = 0;
        buffer.push(&[0xA5, 5, 0xA5, 0, 0x5A], judge, |_| frames += 1);
        assert_eq!((frames, buffer.held_bytes()), (0, 5));
        buffer.flush(judge, |_| frames += 1);
        assert_eq!((frames, buffer.held_bytes()), (1, 0));
    }
}
