//! All steps from a device's bytes to readings, without ports. As long as no byte is lost, readings and their times
//! don't depend on how the bytes are split and delayed.
//!
//! A reading gets the time at which the first byte of its frame arrived.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::frames::Vec3;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{Device, Direction, Emulated, Emulator, EmulatorSetup};
use headrace_sensor::driver::{Driver, DriverSetup, Wire};
use headrace_sensor::measurement::Measurement;
use headrace_sensor::reading::Packet;
use headrace_tests::random::Random;
use headrace_tests::rig::HEADING;
use headrace_vehicle::VehicleConfig;

const START: MonoNs = MonoNs(1_000_000_000);
const FRAMES: usize = 60;

/// Sensor tables of devices that send byte streams, which can be split anywhere.
const STREAMS: [&str; 7] = [
    "plugin = \"imagenex881\"\nmode = \"fastest\"\nrange_m = 5\n",
    "plugin = \"imagenex881\"\nmode = \"fastest\"\nrange_m = 5\nreturns = \"imx\"\n",
    "plugin = \"imagenex881\"\nmode = \"fastest\"\nrange_m = 5\nreturns = \"igx\"\n",
    "plugin = \"ping1d\"\ninterval_ms = 66\n",
    "plugin = \"tether_hid\"\nkind = \"lci90\"\n",
    "plugin = \"a50\"\n",
    "plugin = \"mavlink\"\npart = \"imu\"\nsystem_id = 1\n",
];
/// Sensor tables of devices on carriers (such as CAN) that keep messages whole. Their messages may arrive late, but
/// never in pieces.
const MESSAGES: [&str; 3] = [
    "plugin = \"imu_can\"\npreset = \"xsens_mti600\"\n",
    "plugin = \"bar100\"\n",
    "plugin = \"tether_hid\"\ncounts_per_metre = 2000\n",
];

/// Collects the packets that a driver delivers to the loop.
#[derive(Default)]
struct Delivered(Vec<(MonoNs, Vec<u8>)>);

impl Wire for Delivered {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.0.push((received, bytes.to_vec()));
    }
}

fn device(text: &str) -> Box<dyn Device> {
    let text = format!("{HEADING}\n[[sensors]]\nid = \"s0\"\n{text}");
    let vehicle = VehicleConfig::parse(Document::new("v.toml", &text), &KINDS, &|_| unreachable!("no file"));
    vehicle.unwrap().sensors.remove(0)
}

fn packets_of<M: Measurement>(device: &mut dyn Emulator<M>, mut feel: impl FnMut(&mut M)) -> Vec<Vec<u8>> {
    let (mut due, mut frames, mut until) = (Vec::new(), Vec::new(), START);
    while frames.len() < FRAMES {
        until = until + DurNs::from_millis(10);
        device.begin(until, &mut due);
        for mut measured in due.drain(..) {
            feel(&mut measured);
            device.tell(&measured, &mut |direction, _, bytes| {
                if direction == Direction::Received {
                    frames.push(bytes.to_vec());
                }
            });
        }
    }
    frames
}

/// Frames that the emulated device sends.
fn frames(device: &dyn Device, random: &mut Random) -> Vec<Vec<u8>> {
    let setup = EmulatorSetup {
        start: START,
        head: None,
        site: headrace_geometry::site::Site::default(),
        polled: true,
    };
    let mut some = |least: f64, most: f64| least + (most - least) * (random.below(1000) as f64) / 1000.0;
    match device.emulator(&setup) {
        Emulated::Head(mut d) | Emulated::Echosounder(mut d) => {
            packets_of(d.as_mut(), |sounding| sounding.range_m = Some(some(0.5, 4.5)))
        }
        Emulated::Depth(mut d) => packets_of(d.as_mut(), |felt| felt.pressure_pa = some(1.0e5, 2.0e5)),
        Emulated::Inertial(mut d) => packets_of(d.as_mut(), |felt| {
            felt.rate_radps = Vec3::new(some(-0.1, 0.1), some(-0.1, 0.1), some(-0.1, 0.1));
        }),
        Emulated::VelocityLog(mut d) => packets_of(d.as_mut(), |felt| {
            felt.velocity_mps = Vec3::new(some(0.0, 0.2), some(-0.1, 0.1), some(-0.1, 0.1));
        }),
        Emulated::Tether(mut d) => {
            let mut chainage_m = 0.0;
            packets_of(d.as_mut(), |payout| {
                chainage_m += some(0.0, 0.01);
                payout.chainage_m = chainage_m;
            })
        }
    }
}

/// Passes the parts of a stream through driver and decoder, and wakes the driver at the driver's deadlines. Returns the
/// readings.
fn readings(device: &dyn Device, parts: &[(MonoNs, &[u8])]) -> Vec<String> {
    let mut driver = device.driver(&DriverSetup { begun: START, head: None });
    let mut wire = Delivered::default();
    for (at, bytes) in parts {
        wake_until(driver.as_mut(), *at, &mut wire);
        driver.heard(*at, bytes, &mut wire);
    }
    driver.closed(&mut wire);
    let mut decoder = device.specification().decoder;
    let mut readings = Vec::new();
    for (received, bytes) in &wire.0 {
        decoder.decode(Packet { received: *received, bytes }, &mut |decoded| {
            readings.push(format!("{decoded:?}"));
        });
    }
    readings
}

/// Passes the parts of a stream through the decoder without a driver, as for a foreign log. Returns the readings.
fn decoded(device: &dyn Device, parts: &[(MonoNs, &[u8])]) -> Vec<String> {
    let (mut decoder, mut readings) = (device.specification().decoder, Vec::new());
    for (received, bytes) in parts {
        decoder.decode(Packet { received: *received, bytes }, &mut |decoded| {
            readings.push(format!("{decoded:?}"));
        });
    }
    readings
}

fn wake_until(driver: &mut dyn Driver, at: MonoNs, wire: &mut dyn Wire) {
    while let Some(due) = driver.due().filter(|due| *due < at) {
        driver.wake(due.max(START), wire);
        if driver.due().is_some_and(|next| next <= due) {
            return;
        }
    }
}

/// Draws the delay of one part of a stream. The delay is usually typical of a good line. Sometimes it is typical of a
/// serial bridge, of a slow network, or of a network that fails for seconds.
fn delay(random: &mut Random) -> DurNs {
    let ms = [1, 1, 3, 20, 66, 66, 120, 250, 1500, 4000];
    DurNs::from_millis(ms[random.below(ms.len())])
}

/// Each complete frame, with the receive time of the part that contains the frame's first byte.
fn whole<'a>(frames: &'a [Vec<u8>], parts: &[(MonoNs, &[u8])]) -> Vec<(MonoNs, &'a [u8])> {
    let mut ends = Vec::new();
    for (at, part) in parts {
        ends.push((ends.last().map_or(0, |(end, _)| *end) + part.len(), *at));
    }
    let mut from = 0;
    let stamped = frames.iter().map(|frame| {
        let at = ends.iter().find(|(end, _)| *end > from).unwrap().1;
        from += frame.len();
        (at, frame.as_slice())
    });
    stamped.collect()
}

fn compare(text: &str, frames: &[Vec<u8>], parts: &[(MonoNs, &[u8])], how: &str) {
    let device = device(text);
    let expected = readings(device.as_ref(), &whole(frames, parts));
    assert!(expected.len() >= FRAMES / 2, "{text}: {} readings", expected.len());
    let lengths = || parts.iter().map(|part| part.1.len()).collect::<Vec<_>>();
    assert_eq!(readings(device.as_ref(), parts), expected, "{text}, {how}: {:?}", lengths());
    assert_eq!(decoded(device.as_ref(), parts), expected, "{text}, {how}, decoder alone: {:?}", lengths());
}

#[test]
fn splits_and_delays_of_a_stream_do_not_change_readings_or_times() {
    let mut random = Random(20);
    for text in STREAMS {
        let frames = frames(device(text).as_ref(), &mut random);
        let stream = frames.concat();
        for round in 0..40 {
            let longest = [1, 2, 7, 64, 300, 2000][round % 6];
            let (mut parts, mut rest, mut at) = (Vec::new(), stream.as_slice(), START);
            while !rest.is_empty() {
                let (now, later) = rest.split_at((1 + random.below(longest)).min(rest.len()));
                // If parts are short, only some of them get a long delay, because otherwise the transmission of the
                // data takes hours.
                at = at
                    + if longest > 2 || random.one_in(50) {
                        delay(&mut random)
                    } else {
                        DurNs::from_millis(1)
                    };
                parts.push((at, now));
                rest = later;
            }
            compare(text, &frames, &parts, &format!("round {round}"));
        }
    }
}

#[test]
fn frames_completed_by_the_next_read_are_all_used() {
    let mut random = Random(21);
    for text in STREAMS {
        let frames = frames(device(text).as_ref(), &mut random);
        let stream = frames.concat();
        let (mut parts, mut from, mut end, mut at) = (Vec::new(), 0, 0, START);
        for frame in &frames {
            end += frame.len();
            at = at + DurNs::from_millis(66);
            parts.push((at, &stream[from..end - 1]));
            from = end - 1;
        }
        parts.push((at + DurNs::from_millis(66), &stream[from..]));
        compare(text, &frames, &parts, "last bytes late");
    }
}

#[test]
fn stream_read_in_blocks_of_64_bytes_loses_no_frame() {
    let mut random = Random(22);
    for text in STREAMS {
        let frames = frames(device(text).as_ref(), &mut random);
        let (mut parts, mut at) = (Vec::new(), START);
        let stream = frames.concat();
        for block in stream.chunks(64) {
            at = at + DurNs::from_millis(66);
            parts.push((at, block));
        }
        compare(text, &frames, &parts, "blocks of 64");
    }
}

#[test]
fn delays_between_messages_do_not_change_the_readings() {
    let mut random = Random(23);
    for text in MESSAGES {
        let frames = frames(device(text).as_ref(), &mut random);
        let mut at = START;
        let mut parts = Vec::new();
        for frame in &frames {
            at = at + delay(&mut random);
            parts.push((at, frame.as_slice()));
        }
        let device = device(text);
        let all = readings(device.as_ref(), &parts);
        assert_eq!(all, decoded(device.as_ref(), &parts), "{text}");
        let soon: Vec<_> = parts
            .iter()
            .zip(0..)
            .map(|((_, bytes), n)| (START + DurNs::from_millis(n * 10), *bytes))
            .collect();
        assert_eq!(all.len(), readings(device.as_ref(), &soon).len(), "{text}");
        assert!(!all.is_empty(), "{text}");
    }
}
