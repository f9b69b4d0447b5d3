//! UDP from a device that sends to a local port, where any machine may send.
//!
//! Only one sender is accepted, by address and port. It is the sender given by `?from=`, or the first sender whose
//! message a driver of the line accepts. Drivers get no data of other senders, and other senders get no commands. A
//! device that falls silent may return from another port, but not from another address.

use std::collections::VecDeque;
use std::io;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs as _, UdpSocket};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};

use super::line::{IsValid, Line, READ_BYTES, ReadTimeout, Senders, exchange_by_datagram, waited};
use super::socket_drops::SocketDrops;
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

/// Maximum number of senders whose bytes are kept until one sends a valid message. If there are more, the oldest sender
/// is forgotten.
const MAX_CANDIDATES: usize = 8;

struct UdpListen {
    socket: UdpSocket,
    timeout: ReadTimeout,
    drops: SocketDrops,
    from: From,
    /// Sender that was accepted as the device, and to which commands are sent.
    peer: Option<SocketAddr>,
    candidates: VecDeque<Candidate>,
}

/// The sender that the key `?from=` of `connect` allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum From {
    Anybody,
    Host(IpAddr),
    Port(SocketAddr),
}

/// A sender that has not sent a valid message yet. Its frames may arrive in several datagrams.
struct Candidate {
    from: SocketAddr,
    first: MonoNs,
    messages: u64,
    bytes: Vec<u8>,
}

pub(super) fn open(address: &str, from: Option<&str>) -> Result<Box<dyn Line>, OpenError> {
    let from = from.map_or(Ok(From::Anybody), |from| {
        resolved(from).map_err(|error| diagnosis::opening(&format!("{address}?from={from}"), &error))
    })?;
    let socket = UdpSocket::bind(address).map_err(|error| diagnosis::opening(address, &error))?;
    let peer = if let From::Port(peer) = from { Some(peer) } else { None };
    let (timeout, drops) = (ReadTimeout::default(), SocketDrops::default());
    Ok(Box::new(UdpListen { socket, timeout, drops, from, peer, candidates: VecDeque::new() }))
}

fn resolved(from: &str) -> io::Result<From> {
    let none = || io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    if let Ok(host) = from.parse::<IpAddr>() {
        return Ok(From::Host(host));
    }
    if from.contains(':') {
        return from.to_socket_addrs()?.next().map(From::Port).ok_or_else(none);
    }
    (from, 0).to_socket_addrs()?.next().map(|found| From::Host(found.ip())).ok_or_else(none)
}

impl UdpListen {
    /// Whether this sender may be the device, judged by address and port only.
    fn may_be(&self, from: SocketAddr, senders: &Senders) -> bool {
        match (self.from, senders.believed) {
            (From::Port(peer), _) => from == peer,
            (From::Host(host), _) => from.ip() == host,
            // After the line was reopened, the accepted sender's address stays fixed, but its port may change.
            (From::Anybody, Some(before)) => from.ip() == before.ip(),
            (From::Anybody, None) => true,
        }
    }

    /// Handles a datagram of a sender that may be the device.
    ///
    /// The sender is accepted once the datagram is valid, alone or together with the sender's earlier bytes. The valid
    /// bytes are then in `into`.
    fn introduce(
        &mut self,
        (received, from, count): (MonoNs, SocketAddr, usize),
        into: &mut [u8; READ_BYTES],
        senders: &mut Senders,
        is_valid: IsValid<'_>,
    ) -> Option<(MonoNs, usize)> {
        let bytes = into.get(..count).unwrap_or_default();
        let heard = if is_valid(bytes) {
            Some((received, count))
        } else {
            self.hold(received, from, bytes, is_valid)
        };
        let Some((first, count)) = heard else {
            if self.candidates.len() > MAX_CANDIDATES {
                self.candidates.pop_front().into_iter().for_each(|other| dismiss(&other, senders));
            }
            return None;
        };
        let held = self.candidates.iter().position(|held| held.from == from);
        if let Some(own) =
            held.and_then(|place| self.candidates.remove(place)).filter(|own| own.bytes.len() == count)
        {
            into.iter_mut().zip(&own.bytes).for_each(|(to, byte)| *to = *byte);
        }
        self.candidates.drain(..).for_each(|other| dismiss(&other, senders));
        tracing::info!(%from, "this sender is accepted as the device; others are ignored");
        (self.peer, senders.believed) = (Some(from), Some(from));
        Some((first, count))
    }

    /// Adds bytes to the earlier bytes of a possible sender. If all of them together contain a valid message, returns
    /// their receive time and length.
    fn hold(
        &mut self,
        received: MonoNs,
        from: SocketAddr,
        bytes: &[u8],
        is_valid: IsValid<'_>,
    ) -> Option<(MonoNs, usize)> {
        let place = self.candidates.iter().position(|held| held.from == from).unwrap_or_else(|| {
            let (messages, bytes) = (0, Vec::new());
            self.candidates.push_back(Candidate { from, first: received, messages, bytes });
            self.candidates.len() - 1
        });
        let candidate = self.candidates.get_mut(place)?;
        if candidate.bytes.len() + bytes.len() > READ_BYTES {
            candidate.bytes.clear();
            candidate.first = received;
        }
        candidate.messages += 1;
        candidate.bytes.extend_from_slice(bytes);
        is_valid(&candidate.bytes).then_some((candidate.first, candidate.bytes.len()))
    }
}

fn dismiss(candidate: &Candidate, senders: &mut Senders) {
    refuse(candidate.from, candidate.messages, senders);
}

fn refuse(from: SocketAddr, messages: u64, senders: &mut Senders) {
    if senders.strangers.note(messages, &from.to_string()) {
        tracing::warn!(%from, "a sender that isn't the device");
    }
}

impl Line for UdpListen {
    /// Accepts any sender. Only probing calls this.
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        self.read_device(wait, into, &mut Senders::default(), &|_| true)
    }

    fn read_device(
        &mut self,
        wait: Duration,
        into: &mut [u8; READ_BYTES],
        senders: &mut Senders,
        is_valid: IsValid<'_>,
    ) -> io::Result<Option<(MonoNs, usize)>> {
        let socket = &self.socket;
        self.timeout.set(wait, |wait| socket.set_read_timeout(Some(wait)))?;
        let mut sender = None;
        let received = self.socket.recv_from(into).map(|(count, from)| {
            sender = Some(from);
            count
        });
        let Some((count, from)) = waited(received)?.zip(sender) else { return Ok(None) };
        let now = clock::now();
        if count == 0 {
            return Ok(None);
        }
        if self.peer == Some(from) {
            senders.believed = Some(from);
            return Ok(Some((now, count)));
        }
        if self.peer.is_some() || !self.may_be(from, senders) {
            refuse(from, 1, senders);
            return Ok(None);
        }
        Ok(self.introduce((now, from, count), into, senders, is_valid))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        // Before a sender is accepted, commands have no destination.
        self.peer.map_or(Ok(()), |peer| self.socket.send_to(bytes, peer).map(|_| ()))
    }

    fn exchange(
        &mut self,
        write: &[u8],
        _: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        exchange_by_datagram(self, write, read_bytes)
    }

    fn dropped(&mut self) -> u64 {
        self.drops.new_ones(&self.socket)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAIT: Duration = Duration::from_secs(10);
    const NONE: Duration = Duration::from_millis(20);

    /// In these tests bytes are valid if they contain an `M` and, somewhere after it, a `!`.
    fn is_valid(bytes: &[u8]) -> bool {
        bytes.iter().position(|b| *b == b'M').is_some_and(|at| bytes[at..].contains(&b'!'))
    }

    struct Place {
        line: Box<dyn Line>,
        address: String,
        senders: Senders,
    }

    impl Place {
        fn new(option: &str) -> Self {
            let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
            let from = (!option.is_empty()).then_some(option);
            Self { line: open(&free, from).unwrap(), address: free, senders: Senders::default() }
        }

        fn again(&mut self) {
            self.line = Box::new(Closed);
            self.line = open(&self.address, None).unwrap();
        }

        fn tell(&self, from: &UdpSocket, text: &str) {
            from.send_to(text.as_bytes(), &self.address).unwrap();
        }

        /// Returns the next datagram if it is accepted; `None` if it is rejected or none arrives.
        fn heard(&mut self, wait: Duration) -> Option<String> {
            let mut into = [0; READ_BYTES];
            let read = self.line.read_device(wait, &mut into, &mut self.senders, &is_valid).unwrap();
            read.map(|(_, count)| String::from_utf8_lossy(&into[..count]).into_owned())
        }
    }

    struct Closed;

    impl Line for Closed {
        fn read(&mut self, _: Duration, _: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
            Ok(None)
        }

        fn write(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }
    }

    fn sender() -> UdpSocket {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(WAIT)).unwrap();
        socket
    }

    fn got(socket: &UdpSocket) -> Vec<u8> {
        let mut buffer = [0; 64];
        let count = socket.recv(&mut buffer).unwrap();
        buffer[..count].to_vec()
    }

    #[test]
    fn only_the_first_valid_sender_is_accepted_and_gets_commands() {
        let (mut place, device, stranger) = (Place::new(""), sender(), sender());
        place.tell(&stranger, "x");
        assert_eq!(place.heard(WAIT), None);
        place.line.write(b"nobody").unwrap();
        place.tell(&device, "M1!");
        assert_eq!(place.heard(WAIT).unwrap(), "M1!");
        for text in ["x", "M2!"] {
            place.tell(&stranger, text);
            assert_eq!(place.heard(WAIT), None);
            place.line.write(b"command").unwrap();
            assert_eq!(got(&device), b"command");
        }
        place.tell(&device, "in any way");
        assert_eq!(place.heard(WAIT).unwrap(), "in any way");
        let strangers = &place.senders.strangers;
        let name = stranger.local_addr().unwrap();
        assert_eq!((strangers.messages(), strangers.words().unwrap()), (3, format!("ignored: {name}")));
        stranger.set_read_timeout(Some(NONE)).unwrap();
        assert!(stranger.recv(&mut [0; 64]).is_err(), "something was sent to a stranger");
    }

    #[test]
    fn device_with_split_frames_is_accepted_despite_other_senders() {
        let (mut place, device, stranger) = (Place::new(""), sender(), sender());
        for (from, text) in [(&device, "..M"), (&stranger, "M"), (&device, "1"), (&stranger, "2")] {
            place.tell(from, text);
            assert_eq!(place.heard(WAIT), None);
        }
        place.tell(&device, "3!");
        assert_eq!(place.heard(WAIT).unwrap(), "..M13!");
        assert_eq!(place.senders.strangers.messages(), 2);
    }

    #[test]
    fn device_may_return_from_another_port_of_its_address() {
        let (mut place, device) = (Place::new(""), sender());
        place.tell(&device, "M1!");
        assert!(place.heard(WAIT).is_some());
        place.again();
        let restarted = sender();
        place.tell(&restarted, "M2!");
        assert_eq!(place.heard(WAIT).unwrap(), "M2!");
        let elsewhere = UdpSocket::bind("127.0.0.2:0").unwrap();
        place.again();
        place.tell(&elsewhere, "M3!");
        assert_eq!(place.heard(WAIT), None);
        assert_eq!(place.senders.strangers.messages(), 1);
    }

    #[test]
    fn only_the_configured_sender_is_accepted() {
        let device = sender();
        let mut place = Place::new(&device.local_addr().unwrap().to_string());
        let stranger = sender();
        place.tell(&stranger, "M1!");
        assert_eq!(place.heard(WAIT), None);
        place.line.write(b"command").unwrap();
        assert_eq!(got(&device), b"command");
        place.tell(&device, "M2!");
        assert_eq!(place.heard(WAIT).unwrap(), "M2!");
        let mut place = Place::new("127.0.0.2");
        place.tell(&stranger, "M1!");
        assert_eq!(place.heard(WAIT), None);
        let device = UdpSocket::bind("127.0.0.2:0").unwrap();
        place.tell(&device, "M2!");
        assert_eq!(place.heard(WAIT).unwrap(), "M2!");
    }

    #[test]
    fn device_is_accepted_after_any_number_of_other_senders() {
        let (mut place, device) = (Place::new(""), sender());
        for _ in 0..3 * MAX_CANDIDATES {
            place.tell(&sender(), "M");
            assert_eq!(place.heard(WAIT), None);
        }
        place.tell(&device, "M!");
        assert_eq!(place.heard(WAIT).unwrap(), "M!");
        assert_eq!(place.senders.strangers.messages(), 3 * MAX_CANDIDATES as u64);
    }
}
