//! UDP to a bridge, which sends only to clients that have sent to it first. The kernel drops datagrams of other
//! senders.

use std::io;
use std::net::{ToSocketAddrs as _, UdpSocket};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};

use super::line::{Line, READ_BYTES, ReadTimeout, exchange_by_datagram, waited};
use super::socket_drops::SocketDrops;
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

struct Udp {
    socket: UdpSocket,
    timeout: ReadTimeout,
    drops: SocketDrops,
}

pub(super) fn open(address: &str) -> Result<Box<dyn Line>, OpenError> {
    let calling = || {
        let none = || io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        let peer = address.to_socket_addrs()?.next().ok_or_else(none)?;
        let own = if peer.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(own)?;
        // A connected socket receives only from the bridge, and reports an error if the bridge is absent.
        socket.connect(peer)?;
        let mut line = Udp { socket, timeout: ReadTimeout::default(), drops: SocketDrops::default() };
        line.knock()?;
        Ok(line)
    };
    calling().map(|line| Box::new(line) as Box<dyn Line>).map_err(|error| diagnosis::opening(address, &error))
}

impl Line for Udp {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let socket = &self.socket;
        self.timeout.set(wait, |wait| socket.set_read_timeout(Some(wait)))?;
        let count = waited(self.socket.recv(into))?;
        Ok(count.filter(|count| *count > 0).map(|count| (clock::now(), count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.socket.send(bytes).map(|_| ())
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

    fn knock(&mut self) -> io::Result<()> {
        self.socket.send(&[]).map(|_| ())
    }
}
