//! UDP: to a bridge that answers those who have sent first, or from those who send to us.

use std::io;
use std::net::{SocketAddr, ToSocketAddrs as _, UdpSocket};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};

use super::line::{Line, READ_BYTES, ReadTimeout, waited};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

struct Udp {
    socket: UdpSocket,
    timeout: ReadTimeout,
    /// Where to: the bridge, or who sent last.
    peer: Option<SocketAddr>,
    /// Whether we are the one who sends first.
    calls: bool,
}

pub(super) fn open(address: &str) -> Result<Box<dyn Line>, OpenError> {
    let calling = || {
        let none = || io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        let peer = address.to_socket_addrs()?.next().ok_or_else(none)?;
        let own = if peer.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(own)?;
        // Connected, so that only the bridge is heard and its absence is noticed.
        socket.connect(peer)?;
        let mut line = Udp { socket, timeout: ReadTimeout::default(), peer: Some(peer), calls: true };
        line.knock()?;
        Ok(line)
    };
    calling().map(|line| Box::new(line) as Box<dyn Line>).map_err(|error| diagnosis::opening(address, &error))
}

pub(super) fn listen(address: &str) -> Result<Box<dyn Line>, OpenError> {
    let socket = UdpSocket::bind(address).map_err(|error| diagnosis::opening(address, &error))?;
    Ok(Box::new(Udp { socket, timeout: ReadTimeout::default(), peer: None, calls: false }))
}

impl Line for Udp {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let socket = &self.socket;
        self.timeout.set(wait, |wait| socket.set_read_timeout(Some(wait)))?;
        let mut peer = self.peer;
        let received = self.socket.recv_from(into).map(|(count, from)| {
            peer = Some(from);
            count
        });
        let count = waited(received)?;
        self.peer = peer;
        Ok(count.filter(|count| *count > 0).map(|count| (clock::now(), count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.peer {
            Some(_) if self.calls => self.socket.send(bytes).map(|_| ()),
            Some(peer) => self.socket.send_to(bytes, peer).map(|_| ()),
            // Nobody has been heard yet whom it could be for.
            None => Ok(()),
        }
    }

    /// In place of a bus: a datagram of what is to be written and how much is to be read; the answer is the transaction.
    fn exchange(
        &mut self,
        write: &[u8],
        _: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        let count = u8::try_from(read_bytes).unwrap_or(u8::MAX);
        self.write(&[write, &[count]].concat())?;
        Ok(None)
    }

    fn knock(&mut self) -> io::Result<()> {
        if self.calls { self.socket.send(&[]).map(|_| ()) } else { Ok(()) }
    }
}
