//! A full ring drops packets, and the reported number of dropped packets is exact.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use headrace_fusion::direct::DirectNavigation;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::shapes;
use headrace_monitor::{App, SourceSpec};
use headrace_ports::{Connection, Supervisor};
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::connect::Connect;
use headrace_sensor::device::Decoder;
use headrace_sensor::driver::{DeviceHealth, Driver, Wire};
use headrace_sensor::reading::{Decoded, Packet};
use headrace_vehicle::Mission;

/// A decoder that decodes nothing.
struct Nothing;

impl Stateful for Nothing {
    fn save(&self, _: &mut Saver) {}

    fn restore(&mut self, _: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        Ok(())
    }
}

impl Decoder for Nothing {
    fn decode(&mut self, _: Packet<'_>, _: &mut dyn FnMut(Decoded)) {}

    fn counts(&self) -> CodecCounts {
        CodecCounts::default()
    }
}

/// A driver that passes on received packets and counts them.
struct Counting(Arc<AtomicU64>);

impl Driver for Counting {
    fn accepts(&self, _: &[u8]) -> bool {
        true
    }

    fn opened(&mut self, _: MonoNs, _: &mut dyn Wire) {}

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        wire.deliver(received, bytes);
        self.0.fetch_add(1, Ordering::Release);
    }

    fn due(&self) -> Option<MonoNs> {
        None
    }

    fn wake(&mut self, _: MonoNs, _: &mut dyn Wire) {}

    fn health(&self) -> DeviceHealth {
        DeviceHealth { good_frames: self.0.load(Ordering::Relaxed), ..DeviceHealth::default() }
    }
}

#[test]
fn every_packet_dropped_by_a_full_ring_is_counted() {
    let profile = shapes::circle(3.0).unwrap();
    let navigation = DirectNavigation::new(profile.clone(), Site::default());
    let mut app = App::new(Mission::new(profile, 1.0));
    let [id, plugin, connect] = ["flood", "none", "none"].map(str::to_owned);
    // The smallest ring has room for exactly one packet of the longest kind.
    app.add_source(SourceSpec { id, plugin, connect, decoder: Box::new(Nothing), ring_bytes: 0 }).unwrap();
    let mut dive = app.arm(Box::new(navigation)).unwrap();
    let ours = UdpSocket::bind("127.0.0.1:0").unwrap();
    let place = ours.local_addr().unwrap();
    drop(ours);
    let count = Arc::new(AtomicU64::new(0));
    let connection = Connection {
        source: 0,
        connect: Connect::parse(&format!("udp-listen:{place}")),
        port: dive.take_port(0).unwrap(),
        driver: Box::new(Counting(count.clone())),
    };
    let supervisor = Supervisor::start(vec![connection], None).unwrap();
    // The loop doesn't tick here, so nothing empties the ring. Some datagrams are lost, either in the kernel or because
    // the port isn't open yet, so the test sends until 20 have arrived.
    let device = UdpSocket::bind("127.0.0.1:0").unwrap();
    while count.load(Ordering::Acquire) < 20 {
        device.send_to(&[7; 1000], place).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut taken = 0;
    let lines = supervisor.stop(&mut dive, &mut |dive| taken = dive.view().placed().packets());
    let heard = count.load(Ordering::Acquire);
    assert!((1..=4).contains(&taken), "{taken} packets of 1000 bytes in a ring for 4096");
    assert_eq!(lines[0].dropped + taken, heard, "{:?}", lines[0]);
}
