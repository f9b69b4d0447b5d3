//! TCP connections that we open.

use std::io::{self, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::Duration;

use headrace_core::time::MonoNs;

use super::{Line, READ_BYTES, waited};
use crate::clock;
use crate::trouble::Trouble;

const CONNECT_TIME: Duration = Duration::from_secs(2);
const WRITE_TIME: Duration = Duration::from_millis(500);

struct Tcp(TcpStream);

pub(super) fn open(address: &str) -> Result<Box<dyn Line>, Trouble> {
    connect(address)
        .map(|line| Box::new(line) as Box<dyn Line>)
        .map_err(|error| Trouble::opening(address, &error))
}

fn connect(address: &str) -> io::Result<Tcp> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_TIME) {
            Ok(stream) => {
                // A command is a few bytes that the head waits for.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_TIME))?;
                return Ok(Tcp(stream));
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

impl Line for Tcp {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        // A timeout of zero would be none.
        self.0.set_read_timeout(Some(wait.max(Duration::from_micros(1))))?;
        match waited(self.0.read(into))? {
            Some(0) => Err(io::Error::new(io::ErrorKind::BrokenPipe, "the device has closed the connection")),
            Some(count) => Ok(Some((clock::now(), count))),
            None => Ok(None),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}
