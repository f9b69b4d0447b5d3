//! Receive times of the frames in a byte stream.

use serde::{Deserialize, Serialize};

use super::framed::{Framed, Framing};
use super::interface::Codec as _;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Number of packets that a [`LineClock`] tracks: enough for 1 kB from a port that delivers 32 bytes at a time.
const MAX_PARTS: usize = 32;

/// Stamps each frame of a byte stream with the receive time of the packet that contained its first byte.
///
/// A frame may begin in one packet and end in a much later one. If the bytes of an incomplete frame come from more than
/// `MAX_PARTS` packets, the packets just before the newest one are merged. If that incomplete frame then proves to be a
/// false start, a real frame that begins in a merged packet is stamped too early.
///
/// Allocates: never.
#[derive(Debug, Clone)]
pub struct LineClock {
    silence: DurNs,
    last: MonoNs,
    /// Packets that contained the bytes held by the codec, oldest first.
    parts: [Part; MAX_PARTS],
    len: usize,
}

#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Part {
    received: MonoNs,
    bytes: usize,
}

stateful!(LineClock { state: last, len; slots: parts; fixed: silence; });

impl LineClock {
    /// Creates a clock. `silence` is the longest usual gap within a frame.
    ///
    /// After a longer gap between two packets, the clock checks whether a false start of a frame holds back real frames
    /// ([`Framed::settle_frames`]).
    pub fn new(silence: DurNs) -> Self {
        Self { silence, last: MonoNs(0), parts: [Part::default(); MAX_PARTS], len: 0 }
    }

    /// Pushes a packet's bytes into `codec`. `take` receives each complete frame with its receive time.
    pub fn push<F: Framing, const N: usize>(
        &mut self,
        codec: &mut Framed<F, N>,
        received: MonoNs,
        bytes: &[u8],
        mut take: impl FnMut(MonoNs, &[u8]),
    ) {
        if received.since(self.last) > self.silence {
            codec.settle_frames(bytes, |frame, behind| take(self.received(behind), frame));
            self.keep(codec.held_bytes());
        }
        self.last = received;
        self.note(Part { received, bytes: bytes.len() });
        codec.push_frames(bytes, |frame, behind| take(self.received(behind), frame));
        self.keep(codec.held_bytes());
    }

    fn parts(&self) -> &[Part] {
        self.parts.get(..self.len).unwrap_or_default()
    }

    fn note(&mut self, part: Part) {
        if let Some(free) = self.parts.get_mut(self.len) {
            *free = part;
            self.len += 1;
        } else {
            let [.., before, last] = &mut self.parts;
            before.bytes += last.bytes;
            *last = part;
        }
    }

    /// Returns the receive time of the byte that is `behind` bytes before the end of the input.
    fn received(&self, behind: usize) -> MonoNs {
        let mut after = 0;
        let holds = |part: &&Part| {
            after += part.bytes;
            after >= behind
        };
        self.parts().iter().rev().find(holds).map_or(self.last, |part| part.received)
    }

    /// Drops the records of packets that contain none of the input's last `held` bytes.
    fn keep(&mut self, held: usize) {
        let mut after = 0;
        let needed = self.parts().iter().rev().take_while(|part| {
            let before = after;
            after += part.bytes;
            before < held
        });
        let first = self.len - needed.count();
        self.parts.copy_within(first..self.len, 0);
        self.len -= first;
    }
}

#[cfg(test)]
mod tests {
    use super::super::framed::tests::Marked;
    use super::*;

    /// Returns the receive times of the frames in `packets`, which arrive one per millisecond from 1 ms on.
    fn times(clock: &mut LineClock, packets: &[&[u8]]) -> Vec<u64> {
        let mut codec = Framed::<Marked<false>, 8>::default();
        let mut times = Vec::new();
        for (packet, ms) in packets.iter().zip(1..) {
            let received = MonoNs(ms * 1_000_000);
            clock.push(&mut codec, received, packet, |at, _| times.push(at.0 / 1_000_000));
        }
        times
    }

    fn clock(silence_ms: i64) -> LineClock {
        LineClock::new(DurNs::from_millis(silence_ms))
    }

    #[test]
    fn frame_received_in_pieces_has_the_time_of_its_first_byte() {
        let packets: [&[u8]; 4] = [&[0xA5], &[2, 8], &[9, 0x5A, 0xA5, 0, 0x5A, 0xA5], &[0, 0x5A]];
        assert_eq!(times(&mut clock(5), &packets), [1, 3, 3]);
    }

    #[test]
    fn frame_after_a_false_start_has_the_time_of_its_first_byte() {
        let packets: [&[u8]; 4] = [&[0xA5, 5], &[0xA5], &[1, 7], &[0x5A, 0, 0]];
        assert_eq!(times(&mut clock(5), &packets), [2]);
    }

    #[test]
    fn frame_released_by_silence_has_the_time_of_its_first_byte() {
        let false_start = [&[0xA5, 5][..], &[0xA5, 0, 0x5A]];
        let mut codec = Framed::<Marked<false>, 8>::default();
        let mut clock = clock(5);
        for (packet, received) in false_start.iter().zip([MonoNs(1), MonoNs(2)]) {
            clock.push(&mut codec, received, packet, |at, _| panic!("at {at:?}"));
        }
        let mut times = Vec::new();
        let after = MonoNs(2) + DurNs::from_millis(5);
        clock.push(&mut codec, after, &[], |at, _| panic!("the frame was released too early, at {at:?}"));
        clock.push(&mut codec, after + DurNs(5_000_001), &[0xA5, 0, 0x5A], |at, _| times.push(at));
        assert_eq!(times, [MonoNs(2), after + DurNs(5_000_001)]);
    }

    #[test]
    fn packets_beyond_the_tracked_number_share_a_receive_time() {
        let mut clock = clock(5);
        let mut packets: Vec<&[u8]> = vec![&[]; 100];
        packets[0] = &[0xA5, 5];
        packets[99] = &[0xA5, 0, 0x5A, 0, 0, 0];
        assert_eq!(times(&mut clock, &packets), [100]);
        packets[0] = &[0xA5, 3, 1, 2, 3];
        packets[99] = &[0x5A, 0xA5, 0, 0x5A];
        assert_eq!(times(&mut self::clock(5), &packets), [1, 100]);
        packets[0] = &[0xA5, 5];
        packets[60] = &[0xA5];
        packets[99] = &[1, 7, 0x5A, 0, 0, 0];
        assert_eq!(times(&mut self::clock(5), &packets), [31]);
    }
}
