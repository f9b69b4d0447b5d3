//! UDP: to a bridge that answers only clients that have sent first, or from senders to a local port.

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
    /// Destination: the bridge, or the last sender.
    peer: Option<SocketAddr>,
    /// True if the host sends first.
    calls: bool,
}

pub(super) fn open(address: &str) -> Result<Box<dyn Line>, OpenError> {
    let calling = || {
        let none = || io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        let peer = address.to_socket_addrs()?.next().ok_or_else(none)?;
        let own = if peer.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(own)?;
        // A connected socket receives from the bridge only, and reports its absence.
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
            // No sender yet, so no destination.
            None => Ok(()),
        }
    }

    /// Emulated bus: sends a datagram of the bytes to write and the read length; the answer is the transaction.
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
