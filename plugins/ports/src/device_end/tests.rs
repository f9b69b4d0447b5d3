//! Round trips between the emulated device end and the host end of real ports.

use std::net::Ipv4Addr;
use std::time::Duration;

use super::*;
use crate::lines::{self, Line};

const LOCAL: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
const WAIT: Duration = Duration::from_secs(10);

fn heard(line: &mut dyn Line, count: usize) -> Vec<u8> {
    let (mut all, mut buffer) = (Vec::new(), [0; READ_BYTES]);
    while all.len() < count {
        let (_, got) = line.read(WAIT, &mut buffer).unwrap().expect("nothing has come in ten seconds");
        all.extend_from_slice(&buffer[..got]);
    }
    all
}

fn received(stand: &mut EmulatedPort, count: usize) -> Vec<u8> {
    let mut all = Vec::new();
    for _ in 0..10_000 {
        match stand.read().unwrap() {
            Some(bytes) => all.extend(bytes),
            None => wait_for_any(std::slice::from_ref(stand), 1_000_000),
        }
        if all.len() >= count {
            break;
        }
    }
    all
}

#[test]
fn bytes_pass_both_ways_on_every_available_carrier() {
    let all: Vec<u8> = (0..=255).collect();
    for carrier in [Carrier::Serial, Carrier::Tcp, Carrier::Udp] {
        let mut stand = EmulatedPort::new(carrier, LOCAL).unwrap();
        let mut line = lines::open(stand.connect()).unwrap();
        line.write(&all).unwrap();
        assert_eq!(received(&mut stand, 256), all, "{carrier:?} to the device");
        assert!(stand.is_called());
        stand.write(&all).unwrap();
        assert_eq!(heard(line.as_mut(), 256), all, "{carrier:?} to the host");
    }
}

#[test]
fn reconnected_host_is_served_again() {
    for carrier in [Carrier::Serial, Carrier::Tcp, Carrier::Udp] {
        let mut stand = EmulatedPort::new(carrier, LOCAL).unwrap();
        for round in 0..3 {
            let mut line = lines::open(stand.connect()).unwrap();
            line.write(&[round]).unwrap();
            assert_eq!(received(&mut stand, 1), [round]);
            stand.write(&[round, 9]).unwrap();
            assert_eq!(heard(line.as_mut(), 2), [round, 9]);
            drop(line);
        }
    }
}

#[test]
fn disappearing_device_is_detected() {
    for carrier in [Carrier::Serial, Carrier::Tcp] {
        let stand = EmulatedPort::new(carrier, LOCAL).unwrap();
        let mut stand = stand;
        let mut line = lines::open(stand.connect()).unwrap();
        line.write(&[1]).unwrap();
        assert_eq!(received(&mut stand, 1), [1]);
        drop(stand);
        let error = line.read(WAIT, &mut [0; READ_BYTES]).unwrap_err();
        assert!(error.kind() != io::ErrorKind::TimedOut, "{carrier:?}: {error}");
    }
}
