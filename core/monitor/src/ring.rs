//! Bounded lock-free ring of packets from a port's thread to the loop: one writer, one reader.

use ringbuf::traits::Split as _;
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::byte_ring::{ByteConsumer, ByteProducer};
use headrace_geometry::time::MonoNs;

/// Size of each packet's header, bytes: receive time, order, length.
const HEADER_BYTES: usize = 20;

/// Maximum packet length, bytes.
pub const MAX_PACKET_BYTES: usize = 4096;

/// Value of `order` in live packets. In a replayed packet, `order` is the packet's place in the recorded order of
/// consumption.
pub const NO_ORDER: u64 = u64::MAX;

/// Reason for which a packet was not written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RingError {
    /// The packet ring is full. Try again after a tick, or count the packet as dropped.
    #[error("a packet needs {needed} bytes and the ring has {free} free; try again after a tick")]
    Full {
        /// Free bytes in the ring.
        free: usize,
        /// Bytes that the packet needs, header included.
        needed: usize,
    },
    /// The packet has more than [`MAX_PACKET_BYTES`].
    #[error("writing a packet of {len} bytes: at most {MAX_PACKET_BYTES} bytes are allowed")]
    TooLong {
        /// Length of the packet, bytes.
        len: usize,
    },
}

/// Writing end of a packet ring, used by a port's thread, a player or a simulator.
pub struct Port<R: ByteProducer = HeapProd<u8>> {
    ring: R,
}

/// Reading end of a packet ring, used by the loop.
pub(super) struct PortReader<R: ByteConsumer = HeapCons<u8>> {
    ring: R,
}

/// Header of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PacketHeader {
    pub(super) received: MonoNs,
    pub(super) order: u64,
    pub(super) len: usize,
}

/// Makes a ring of `capacity_bytes`, at least large enough for the longest packet.
pub(super) fn ring(capacity_bytes: usize) -> (Port, PortReader) {
    let (producer, consumer) = HeapRb::new(capacity_bytes.max(HEADER_BYTES + MAX_PACKET_BYTES)).split();
    (Port::on(producer), PortReader::on(consumer))
}

impl<R: ByteProducer> Port<R> {
    /// Makes a port from the writing end of a byte ring.
    pub(super) fn on(ring: R) -> Self {
        Self { ring }
    }

    /// Writes a packet received at `received`. Never blocks.
    ///
    /// Errors: the ring is full, or the packet is too long. Nothing was written.
    pub fn send(&mut self, received: MonoNs, bytes: &[u8]) -> Result<(), RingError> {
        self.send_in_order(received, NO_ORDER, bytes)
    }

    /// Writes a packet like [`Port::send`], with its recorded order of consumption.
    ///
    /// Errors: see [`Port::send`].
    pub fn send_in_order(&mut self, received: MonoNs, order: u64, bytes: &[u8]) -> Result<(), RingError> {
        let len = u32::try_from(bytes.len()).ok().filter(|_| bytes.len() <= MAX_PACKET_BYTES);
        let len = len.ok_or(RingError::TooLong { len: bytes.len() })?;
        let needed = HEADER_BYTES + bytes.len();
        let free = self.ring.vacant();
        if free < needed {
            return Err(RingError::Full { free, needed });
        }
        let mut header = [0; HEADER_BYTES];
        let (time, rest) = header.split_at_mut(8);
        let (place, length) = rest.split_at_mut(8);
        time.copy_from_slice(&received.0.to_le_bytes());
        place.copy_from_slice(&order.to_le_bytes());
        length.copy_from_slice(&len.to_le_bytes());
        // The reader waits until the whole packet is present, so header and bytes may be written separately.
        self.ring.push(&header);
        self.ring.push(bytes);
        Ok(())
    }

    /// Whether a packet of `len` bytes fits into the ring now.
    pub fn has_room(&self, len: usize) -> bool {
        self.ring.vacant() >= HEADER_BYTES + len
    }
}

impl<R: ByteConsumer> PortReader<R> {
    /// Makes a port reader from the reading end of a byte ring.
    pub(super) fn on(ring: R) -> Self {
        Self { ring }
    }

    /// Header of the next packet, once the whole packet is present.
    pub(super) fn peek(&self) -> Option<PacketHeader> {
        let mut header = [0; HEADER_BYTES];
        if self.ring.peek(&mut header) < HEADER_BYTES {
            return None;
        }
        let word = |at: usize| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(header.get(at..at + 8).unwrap_or(&[0; 8]));
            u64::from_le_bytes(bytes)
        };
        let len = (word(12) >> 32) as usize;
        let whole = self.ring.occupied() >= HEADER_BYTES + len;
        whole.then_some(PacketHeader { received: MonoNs(word(0)), order: word(8), len })
    }

    /// Discards all waiting packets.
    pub(super) fn clear(&mut self) {
        self.ring.skip(usize::MAX);
    }

    /// Reads the packet whose header [`PortReader::peek`] returned. `into` must have the packet's length.
    pub(super) fn take(&mut self, into: &mut [u8]) {
        self.ring.skip(HEADER_BYTES);
        self.ring.pop(into);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_read_as_written() {
        let (mut port, mut reader) = ring(8192);
        for round in 0..1000_u64 {
            let bytes: Vec<u8> = (0..round % 97).map(|i| (i ^ round) as u8).collect();
            port.send_in_order(MonoNs(round), round * 3, &bytes).unwrap();
            let header = reader.peek().unwrap();
            assert_eq!(header, PacketHeader { received: MonoNs(round), order: round * 3, len: bytes.len() });
            let mut got = vec![0; header.len];
            reader.take(&mut got);
            assert_eq!(got, bytes);
        }
        assert_eq!(reader.peek(), None);
    }

    #[test]
    fn full_ring_refuses_packets_and_keeps_its_contents() {
        let (mut port, reader) = ring(0);
        port.send(MonoNs(1), &[0; MAX_PACKET_BYTES]).unwrap();
        assert!(matches!(port.send(MonoNs(2), &[1]), Err(RingError::Full { free: 0, .. })));
        assert!(matches!(port.send(MonoNs(2), &[0; MAX_PACKET_BYTES + 1]), Err(RingError::TooLong { .. })));
        assert_eq!(reader.peek().unwrap().received, MonoNs(1));
    }
}

#[cfg(test)]
mod model_tests {
    use super::*;
    use crate::byte_ring::model::{Hasty, ModelConsumer, explore, packets_by};

    /// Lengths of two test packets, bytes. The ring has room for one packet and the header of the other.
    const LENGTHS: [usize; 2] = [3, 5];
    const CAPACITY: usize = 2 * HEADER_BYTES + 5;

    fn bytes(number: usize) -> Vec<u8> {
        (0..LENGTHS[number]).map(|at| (16 * number + at + 1) as u8).collect()
    }

    /// Explores all interleavings of a writer and a reader of two packets with different lengths and
    /// contents.
    fn explored<R: ByteConsumer + 'static>(name: &str, reading: fn(ModelConsumer) -> R) -> usize {
        explore(name, Some(4), move || {
            let (mut port, mut reader) = packets_by(CAPACITY, reading);
            let writer = loom::thread::spawn(move || {
                let sent = |number: &usize| port.send(MonoNs(*number as u64), &bytes(*number)).is_ok();
                (0..LENGTHS.len()).filter(sent).collect::<Vec<_>>()
            });
            let mut taken: Vec<_> = (0..2).filter_map(|_| reader.take_next()).collect();
            let sent = writer.join().unwrap();
            taken.extend(std::iter::from_fn(|| reader.take_next()));
            let sent: Vec<_> = sent.into_iter().map(|number| (number as u64, bytes(number))).collect();
            assert_eq!(taken, sent);
        })
    }

    /// In every interleaving the reader gets packets whole and in order. A packet is either read or was refused by the
    /// ring.
    #[test]
    fn packets_are_read_whole_or_refused() {
        let executions = explored("header then body in the loop's ring", |consumer| consumer);
        assert!(executions > 50, "{executions}");
    }

    #[test]
    #[should_panic = "assertion `left == right` failed"]
    fn model_detects_a_reader_that_ignores_missing_bytes() {
        explored("the loop's ring, a body not waited for", Hasty);
    }
}
