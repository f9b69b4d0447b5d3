//! Outgoing TCP connections.

use std::io::{self, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::Duration;

use headrace_geometry::time::MonoNs;

use super::line::{Line, READ_BYTES, ReadTimeout, waited};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

const CONNECT_TIME: Duration = Duration::from_secs(2);
const WRITE_TIME: Duration = Duration::from_millis(500);

struct Tcp {
    stream: TcpStream,
    timeout: ReadTimeout,
}

pub(super) fn open(address: &str) -> Result<Box<dyn Line>, OpenError> {
    connect(address)
        .map(|line| Box::new(line) as Box<dyn Line>)
        .map_err(|error| diagnosis::opening(address, &error))
}

fn connect(address: &str) -> io::Result<Tcp> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_TIME) {
            Ok(stream) => {
                // Commands to the device are short. Without TCP_NODELAY, the kernel delays them.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_TIME))?;
                return Ok(Tcp { stream, timeout: ReadTimeout::default() });
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

impl Line for Tcp {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let stream = &self.stream;
        self.timeout.set(wait, |wait| stream.set_read_timeout(Some(wait)))?;
        match waited(self.stream.read(into))? {
            Some(0) => Err(io::Error::new(io::ErrorKind::BrokenPipe, "the device has closed the connection")),
            Some(count) => Ok(Some((clock::now(), count))),
            None => Ok(None),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }
}
