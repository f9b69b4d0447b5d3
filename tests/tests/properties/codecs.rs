//! Device bytes with changed, lost and inserted bytes. All readings must be finite, and must not depend on how the
//! bytes are split into packets. The counts of bytes and frames must add up.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Direction;
use headrace_sensor::reading::{Decoded, Packet};
use headrace_simulator::Simulation;
use headrace_tests::scenes;
use headrace_vehicle::VehicleConfig;

use crate::cases::{Case, few, many};

/// A vehicle, and the bytes that each of its sensors sends in a short dive.
struct Lines {
    vehicle: VehicleConfig,
    messages: Vec<Vec<Vec<u8>>>,
}

fn lines() -> [Lines; 2] {
    [headrace_tests::VEHICLE.to_owned(), headrace_tests::other_vehicle()].map(|text| {
        let scene = scenes::scene_from(headrace_tests::SCENE, &|_| Ok(text.clone().into_bytes()));
        let vehicle =
            VehicleConfig::parse(Document::new("vehicle.toml", &text), &KINDS, &|name| Err(name.to_owned()));
        let mut messages = vec![Vec::new(); scene.vehicle.sensors.len()];
        let mut simulation = Simulation::new(&scene).unwrap();
        while let Some(message) = simulation.next_message() {
            let line = &mut messages[usize::from(message.source)];
            if message.direction == Direction::Received && line.len() < 200 {
                line.push(message.bytes.to_vec());
            }
        }
        Lines { vehicle: vehicle.unwrap(), messages }
    })
}

/// All parts of the byte stream have the same receive time, so that readings can't depend on the times at which bytes
/// arrive.
const AT: MonoNs = MonoNs(1_000_000_000);

fn decoding(case: &mut Case, lines: &[Lines; 2]) -> Result<(), String> {
    let Lines { vehicle, messages } = &lines[case.below(2)];
    let number = case.below(messages.len());
    let line = &messages[number];
    let first = case.below(line.len());
    let mut bytes: Vec<u8> = line[first..(first + 1 + case.below(4)).min(line.len())].concat();
    for _ in 0..case.below(4) {
        let at = case.below(bytes.len());
        match case.below(4) {
            0 => bytes[at] ^= 1 << case.below(8),
            1 => drop(bytes.drain(at..(at + case.below(6)).min(bytes.len()))),
            2 => bytes.insert(at, case.byte()),
            _ => bytes.truncate(at),
        }
        if bytes.is_empty() {
            return Ok(());
        }
    }
    let device = &vehicle.sensors[number];
    let decode = |pieces: &mut dyn Iterator<Item = usize>| {
        let mut decoder = device.specification().decoder;
        let (mut rest, mut said) = (bytes.as_slice(), Vec::<Decoded>::new());
        while !rest.is_empty() {
            let (now, later) = rest.split_at(pieces.next().unwrap_or(usize::MAX).clamp(1, rest.len()));
            decoder.decode(Packet { received: AT, bytes: now }, &mut |decoded| said.push(decoded));
            rest = later;
        }
        (said, decoder.counts())
    };
    let (whole, counts) = decode(&mut core::iter::empty());
    let sizes: Vec<usize> = (0..bytes.len()).map(|_| 1 + case.below(12)).collect();
    let (split, split_counts) = decode(&mut sizes.into_iter());
    if counts.skipped_bytes > bytes.len() as u64 {
        return Err(format!("{counts:?} of {} bytes", bytes.len()));
    }
    if let Some(wrong) = whole.iter().find(|decoded| !decoded.reading.is_finite()) {
        return Err(format!("{wrong:?} of {bytes:02X?}"));
    }
    // CAN frames, HID reports and I2C transactions arrive whole, so their devices send no byte streams.
    let is_stream =
        !matches!(vehicle.sensor_configs[number].plugin.as_str(), "imu_can" | "tether_hid" | "bar100");
    if is_stream && (format!("{whole:?}") != format!("{split:?}") || counts != split_counts) {
        return Err(format!(
            "{} split: {whole:?} and {split:?} of {bytes:02X?}",
            vehicle.sensor_configs[number].id
        ));
    }
    Ok(())
}

#[test]
fn readings_are_finite_and_do_not_depend_on_byte_splits() {
    let lines = lines();
    few("codecs", &|case| decoding(case, &lines));
}

#[test]
#[ignore = "long; see the module's description"]
fn readings_are_finite_and_do_not_depend_on_byte_splits_in_a_long_run() {
    let lines = lines();
    many("codecs", &|case| decoding(case, &lines));
}
