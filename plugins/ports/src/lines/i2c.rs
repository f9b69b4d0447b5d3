//! I2C buses, accessed through embedded-hal's trait.

use std::io;
use std::thread;
use std::time::Duration;

use embedded_hal::i2c::I2c;
use headrace_geometry::time::{DurNs, MonoNs};
use linux_embedded_hal::I2cdev;

use super::line::{Line, READ_BYTES};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

/// A device at an address on a bus.
struct Bus<B> {
    bus: B,
    address: u8,
}

pub(super) fn open(bus: &str, address: u8) -> Result<Box<dyn Line>, OpenError> {
    let opened =
        I2cdev::new(bus).map_err(|error| diagnosis::opening(bus, &io::Error::other(error.to_string())));
    // The I2C crate hides the kind of an error. The file is therefore opened directly to get this kind.
    let opened = opened.map_err(|trouble| match std::fs::File::open(bus) {
        Err(error) => diagnosis::opening(bus, &error),
        Ok(_) => trouble,
    })?;
    Ok(Box::new(Bus { bus: opened, address }))
}

impl<B: I2c + Send> Line for Bus<B> {
    /// A bus has only transactions, so there is nothing to read between transactions.
    fn read(&mut self, wait: Duration, _: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        thread::sleep(wait);
        Ok(None)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bus.write(self.address, bytes).map_err(|error| failed(&error))
    }

    /// Write and read are separate transfers, because the sensor doesn't support a repeated start.
    fn exchange(
        &mut self,
        write: &[u8],
        settle: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        self.write(write)?;
        thread::sleep(clock::duration(settle));
        let began = clock::now();
        let mut transaction = write.to_vec();
        transaction.resize(write.len() + read_bytes, 0);
        let into = transaction.get_mut(write.len()..).unwrap_or_default();
        self.bus.read(self.address, into).map_err(|error| failed(&error))?;
        Ok(Some((began, transaction)))
    }
}

fn failed(error: &impl core::fmt::Debug) -> io::Error {
    io::Error::other(format!("the device doesn't answer: {error:?}"))
}

#[cfg(test)]
mod tests {
    use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};

    use super::*;

    /// A bus with one device, which answers with the first byte of the latest write.
    struct Echo(Vec<u8>);

    impl ErrorType for Echo {
        type Error = ErrorKind;
    }

    impl I2c for Echo {
        fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
            if address != 0x40 {
                return Err(ErrorKind::Other);
            }
            for operation in operations {
                match operation {
                    Operation::Write(bytes) => self.0 = bytes.to_vec(),
                    Operation::Read(into) => into.fill(self.0[0]),
                }
            }
            Ok(())
        }
    }

    #[test]
    fn i2c_transaction_returns_written_bytes_then_read_bytes() {
        let mut line = Bus { bus: Echo(Vec::new()), address: 0x40 };
        let (_, bytes) = line.exchange(&[0xAC], DurNs(0), 5).unwrap().unwrap();
        assert_eq!(bytes, [0xAC; 6]);
        let mut nobody = Bus { bus: Echo(Vec::new()), address: 0x41 };
        assert!(nobody.exchange(&[0xAC], DurNs(0), 5).unwrap_err().to_string().contains("doesn't answer"));
    }
}
