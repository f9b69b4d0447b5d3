//! Merges the sources' rings into one total order of packets.

use bevy_ecs::prelude::Resource;

use super::ring::{PacketHeader, PortReader};
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::{MAX_SOURCES, Packet, SourceId};

/// Maximum number of packets per tick. Further packets wait for the next tick.
pub const MAX_TICK_PACKETS: usize = 4096;
/// Maximum bytes of packets per tick.
pub const MAX_TICK_BYTES: usize = 256 * 1024;

/// Packets of the current tick, in the order of consumption.
#[derive(Debug, Default, Resource)]
pub struct Inbox {
    packets: Vec<Received>,
    bytes: Vec<u8>,
    /// Header of the next packet in each source's ring.
    heads: Vec<Option<PacketHeader>>,
}

#[derive(Debug, Clone, Copy)]
struct Received {
    source: SourceId,
    received: MonoNs,
    from: usize,
    to: usize,
}

impl Inbox {
    /// Creates a packet list with room for a tick of any size. Allocates: all memory of the lists.
    pub(super) fn with_room() -> Self {
        Self {
            packets: Vec::with_capacity(MAX_TICK_PACKETS),
            bytes: Vec::with_capacity(MAX_TICK_BYTES),
            // One header slot for each sensor, and one for the console.
            heads: Vec::with_capacity(MAX_SOURCES + 1),
        }
    }

    /// Total size of the packets, bytes.
    pub(super) fn byte_len(&self) -> usize {
        self.bytes.len()
    }

    /// Packets of the tick, in order.
    pub fn iter(&self) -> impl Iterator<Item = (SourceId, Packet<'_>)> {
        self.packets.iter().map(|packet| {
            let bytes = self.bytes.get(packet.from..packet.to).unwrap_or_default();
            (packet.source, Packet { received: packet.received, bytes })
        })
    }

    /// Number of packets of the tick.
    pub fn len(&self) -> usize {
        self.packets.len()
    }

    /// Whether the tick has no packets.
    pub fn is_empty(&self) -> bool {
        self.packets.is_empty()
    }

    /// Takes waiting packets, at most `allowance_bytes` in total. They are sorted by recorded order, then by
    /// receive time, source and sequence.
    ///
    /// Packets of one source stay in order of arrival, whatever their timestamps. Allocates: never.
    pub(super) fn fill(&mut self, readers: &mut [PortReader], allowance_bytes: usize) {
        self.packets.clear();
        self.bytes.clear();
        self.heads.clear();
        // A ring's next packet is looked at only after its first packet has been taken.
        self.heads.extend(readers.iter().map(PortReader::peek));
        let limit = allowance_bytes.min(MAX_TICK_BYTES);
        while self.packets.len() < MAX_TICK_PACKETS {
            let Some((source, header)) = first(&self.heads) else { return };
            let from = self.bytes.len();
            let to = from + header.len;
            if to > limit {
                return;
            }
            self.bytes.resize(to, 0);
            let number = usize::from(source);
            if let (Some(reader), Some(head), Some(into)) =
                (readers.get_mut(number), self.heads.get_mut(number), self.bytes.get_mut(from..to))
            {
                reader.take(into);
                *head = reader.peek();
            }
            self.packets.push(Received { source: SourceId(source), received: header.received, from, to });
        }
    }
}

/// The source whose next packet is the earliest.
fn first(heads: &[Option<PacketHeader>]) -> Option<(u16, PacketHeader)> {
    (0_u16..)
        .zip(heads)
        .filter_map(|(source, head)| head.map(|header| (source, header)))
        .min_by_key(|(source, header)| (header.order, header.received, *source))
}

#[cfg(test)]
mod tests {
    use super::super::ring::{Port, ring};
    use super::*;
    use proptest::prelude::*;

    fn ports(count: usize) -> (Vec<Port>, Vec<PortReader>) {
        (0..count).map(|_| ring(1 << 16)).unzip()
    }

    fn drain(inbox: &mut Inbox, readers: &mut [PortReader]) -> Vec<(u16, u64, Vec<u8>)> {
        inbox.fill(readers, MAX_TICK_BYTES);
        inbox.iter().map(|(s, p)| (s.0, p.received.0, p.bytes.to_vec())).collect()
    }

    proptest! {
        /// The packet order is the same wherever the stream is cut into ticks.
        #[test]
        fn packet_order_does_not_depend_on_ticks(
            packets in proptest::collection::vec((0u64..200, 0u16..4), 1..80),
            tick in 1u64..60,
        ) {
            let mut packets: Vec<_> =
                packets.iter().enumerate().map(|(i, (t, s))| (*t, *s, vec![i as u8])).collect();
            packets.sort_by_key(|p| p.0);
            let expected = {
                let mut sorted: Vec<_> = packets.iter().map(|(t, s, b)| (*s, *t, b.clone())).collect();
                sorted.sort_by_key(|(s, t, _)| (*t, *s));
                sorted
            };
            let (mut to, mut readers) = ports(4);
            let mut inbox = Inbox::default();
            let mut got = Vec::new();
            let mut next = packets.iter().peekable();
            let mut until = 0;
            while next.peek().is_some() {
                until += tick;
                while let Some((t, s, b)) = next.next_if(|p| p.0 < until) {
                    to[usize::from(*s)].send(MonoNs(*t), b).unwrap();
                }
                got.extend(drain(&mut inbox, &mut readers));
            }
            prop_assert_eq!(got, expected);
        }
    }

    #[test]
    fn recorded_order_takes_precedence_over_timestamps() {
        let (mut to, mut readers) = ports(2);
        to[0].send_in_order(MonoNs(5), 1, &[1]).unwrap();
        to[1].send_in_order(MonoNs(9), 0, &[2]).unwrap();
        let order: Vec<_> = drain(&mut Inbox::default(), &mut readers).iter().map(|p| p.0).collect();
        assert_eq!(order, [1, 0]);
    }

    #[test]
    fn packets_exceeding_the_inbox_allowance_are_delayed_but_not_lost() {
        let (mut to, mut readers) = ports(1);
        for i in 0..10 {
            to[0].send(MonoNs(i), &[i as u8; 10]).unwrap();
        }
        let mut inbox = Inbox::default();
        inbox.fill(&mut readers, 35);
        assert_eq!(inbox.len(), 3);
        assert_eq!(drain(&mut inbox, &mut readers).len(), 7);
    }
}
