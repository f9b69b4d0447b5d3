//! A custom sensor: a depth sensor that sends lines of text. The example feeds three packets to a loop.
//!
//! A line is "P 590000 10.5": pressure in Pa and temperature in degrees Celsius.
//!
//! Run: `cargo run --example own_sensor`. A device of the product also needs a `DeviceKind`, which reads the device's
//! table in the vehicle file, and a test with `codec_contract!`. CONTRIBUTING.md describes both under "Adding a
//! device".

use std::error::Error;

use headrace_fusion::direct::DirectNavigation;
use headrace_monitor::App;
use headrace_sensor::codec::{Codec as _, CodecCounts, Framed, Framing, LineClock, Verdict};
use headrace_sensor::device::{
    Decoder, Device, Direction, Emulated, Emulator, EmulatorSetup, LineSink, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup, Listener};
use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::geometry::tunnel::shapes;
use headrace_sensor::measurement::Pressure;
use headrace_sensor::reading::{Decoded, Packet, Reading, WaterPressure};
use headrace_sensor::{SensorConfig, stateful};
use headrace_vehicle::Mission;

const LONGEST_LINE: usize = 32;
const PERIOD: DurNs = DurNs::from_millis(100);
/// Longest pause between two bytes of a line.
const SILENCE: DurNs = DurNs::from_millis(200);

/// The format of a line, as a codec.
#[derive(Clone, Copy, Default)]
struct Lines;

impl Framing for Lines {
    type Value = WaterPressure;

    fn judge(&self, front: &[u8]) -> Verdict {
        match front.iter().position(|byte| *byte == b'\n') {
            _ if front.first() != Some(&b'P') => Verdict::NotAStart,
            None => Verdict::Need(front.len() + 1),
            Some(end) => Verdict::on(front, end + 1, |line| self.read(line).is_some()),
        }
    }

    fn read(&self, frame: &[u8]) -> Option<WaterPressure> {
        let text = core::str::from_utf8(frame).ok()?.strip_prefix("P ")?.trim_end();
        let (pressure_pa, temperature_degc) = text.split_once(' ')?;
        let (pressure_pa, temperature_degc) = (pressure_pa.parse().ok()?, temperature_degc.parse().ok()?);
        let water = WaterPressure { pressure_pa, resolution_pa: 1.0, temperature_degc };
        Reading::Pressure(water).is_finite().then_some(water)
    }
}

/// Decodes bytes to readings; the receive time of a line is that of its first byte.
///
/// The saved state includes a partial line, so that a dive can be restored in the middle of a line. The saved state
/// excludes settings.
struct LineDecoder {
    codec: Framed<Lines, LONGEST_LINE>,
    clock: LineClock,
    latency: DurNs,
}

stateful!(LineDecoder { state: codec, clock; fixed: latency; });

impl Decoder for LineDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, latency } = self;
        clock.push(codec, packet.received, packet.bytes, |received, line| {
            if let Some(water) = Lines.read(line) {
                sink(Decoded { valid_at: received - *latency, reading: Reading::Pressure(water) });
            }
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }
}

/// The device's side of the line, for simulations. It sends one line every [`PERIOD`], the first at `next`.
struct LineEmulator {
    next: MonoNs,
    latency: DurNs,
}

impl Emulator<Pressure> for LineEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Pressure>) {
        while self.next < until {
            due.push(Pressure::due(self.next));
            self.next = self.next + PERIOD;
        }
    }

    fn tell(&mut self, measured: &Pressure, line: LineSink<'_>) {
        let text = format!("P {:.0} 10.0\n", measured.pressure_pa);
        line(Direction::Received, measured.at + self.latency, text.as_bytes());
    }
}

struct LineDepth(SensorConfig);

impl Device for LineDepth {
    fn specification(&self) -> SensorSpec {
        let (codec, clock) = (Framed::default(), LineClock::new(SILENCE));
        let decoder = Box::new(LineDecoder { codec, clock, latency: self.0.latency });
        let sensor = self.0.clone();
        SensorSpec { sensor, kind: SensorKind::Depth, decoder, ring_bytes: 1 << 14 }
    }

    fn sense(&self) -> Sense {
        Sense::Depth
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::Depth(Box::new(LineEmulator { next: setup.start, latency: self.0.latency }))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &[Carrier::Serial, Carrier::Tcp, Carrier::Udp]
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(Listener::<Lines, LONGEST_LINE>::new(Lines, SILENCE, DurNs::from_millis(5_000)))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let depth = LineDepth(SensorConfig {
        id: "depth".to_owned(),
        plugin: "line_depth".to_owned(),
        connect: "serial:/dev/ttyUSB0".to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: DurNs::from_millis(20),
    });
    let mission = Mission::new(shapes::circle(3.0)?, 0.5);
    let navigation = DirectNavigation::new(mission.profile.clone(), mission.site);
    let mut app = App::new(mission);
    app.add_device(&depth)?;
    let mut dive = app.arm(Box::new(navigation))?;
    let mut port = dive.take_port(0).ok_or("the port is taken")?;

    // Packets needn't coincide with lines: the second packet ends in the middle of a line.
    for (number, bytes) in (1..).zip(["P 590000 10.5\n", "P 591250 10.5\nP 5925", "00 10.6\n"]) {
        let received = MonoNs(number * 100_000_000);
        port.send(received, bytes.as_bytes())?;
        dive.tick(received);
        println!("packet {number}: {bytes:?}");
        for event in dive.view().readings() {
            println!("    valid at {:.2} s: {:?}", event.valid_at.as_secs_f64(), event.reading);
        }
    }
    println!("{:?}", dive.decoder_counts());
    Ok(())
}
