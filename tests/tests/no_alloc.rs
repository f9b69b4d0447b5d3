//! The armed loop allocates nothing. The test feeds a million packets of a dive with four heads to a loop with a
//! recorder and a notice outlet.
//!
//! The allocator counts calls on the loop's thread. This test doesn't check locks, because clippy.toml forbids lock
//! types in the whole workspace.

#![expect(clippy::unwrap_used, reason = "a failed step ends the test")]
#![expect(
    unsafe_code,
    reason = "a global allocator is an unsafe trait; this one counts and calls the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use headrace_a50::decoder::{self as a50, A50Decoder};
use headrace_a50::report::{Against, Velocity};
use headrace_fusion::smooth::journal::Journal;
use headrace_fusion::smooth::two_filters::TwoFilterNavigation;
use headrace_geometry::time::DurNs;
use headrace_mavlink::MavHeader;
use headrace_mavlink::decoder::{self as mavlink, MavlinkDecoder, Part};
use headrace_mavlink::message::{Imu, ImuMessage, Message};
use headrace_monitor::App;
use headrace_monitor::notice_outlet::NoticeOutlet;
use headrace_replay::log::{LogHeader, Recorder, SourceInfo};
use headrace_replay::record::{QUEUE_BYTES, RecorderOutlet, result_channels};
use headrace_sensor::device::{Decoder, Direction};
use headrace_sensor::reading::Packet;
use headrace_simulator::{START, Simulation};
use headrace_tests::scenes;
use headrace_vehicle::Mission;
use headrace_vehicle::NavigationConfig;

struct Counting;

thread_local! {
    static COUNTED: Cell<Option<u64>> = const { Cell::new(None) };
}

fn count() {
    // The counter is const-initialised and has no destructor, so reading it allocates nothing.
    COUNTED.with(|counted| counted.set(counted.get().map(|n| n + 1)));
}

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number of allocator calls that this thread makes while `work` runs.
fn allocations(work: impl FnOnce()) -> u64 {
    COUNTED.with(|counted| counted.set(Some(0)));
    work();
    COUNTED.with(|counted| counted.replace(None)).unwrap()
}

/// The vehicle goes forward, is too fast over a stretch, and goes back over this stretch and forward again, so that
/// flags are raised and cleared. All heads are silent for a while.
const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\n
[[trajectory.legs]]\ndistance_m = 120\nspeed_mps = 0.197\n
[[trajectory.legs]]\ndistance_m = 40\nspeed_mps = 0.4\n
[[trajectory.legs]]\ndistance_m = 60\nspeed_mps = -0.2\n
[[trajectory.legs]]\ndistance_m = 200\nspeed_mps = 0.35\n
[[effects.device_faults]]\nkind = \"die\"\nsensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]\nfrom_s = 820\nfor_s = 40\n";

/// Operator actions, one per second. The last one is an invalid command.
const COMMANDS: [&str; 9] = [
    r#"{"do":"silence","by":"AB"}"#,
    r#"{"do":"note","text":"rubble \u006ceft","by":"AB"}"#,
    r#"{"do":"voice","id":7,"by":"AB"}"#,
    r#"{"do":"voiced","id":7,"seconds":60}"#,
    r#"{"do":"limits","battery_pct":19.5}"#,
    r#"{"do":"recording","fails":true}"#,
    r#"{"do":"acknowledge","alert":0,"by":"AB"}"#,
    r#"{"do":"recording","fails":false}"#,
    r#"{"do":"time","by":"AB"}"#,
];

#[test]
fn million_packets_need_no_allocation() {
    assert!(allocations(|| drop(vec![1])) > 0, "the counter counts");

    let scene = scenes::scene(SCENE);
    let vehicle = &scene.vehicle;
    let mut app = App::new(Mission { length_m: 1000.0, ..vehicle.mission() });
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    // Nobody empties this outlet, so it becomes full and drops its oldest notices. Dropping them must not allocate
    // either.
    let (outlet, notices) = NoticeOutlet::new(1000);
    app.add_plugin(&outlet).unwrap();
    let header = LogHeader {
        vehicle_toml: scene.vehicle_text.clone(),
        sources: vehicle
            .sensor_configs
            .iter()
            .map(|s| SourceInfo { id: s.id.clone(), plugin: s.plugin.clone(), connect: s.connect.clone() })
            .collect(),
        ticks: true,
        results: result_channels(),
        ..LogHeader::default()
    };
    let (port, recorder) = Recorder::start(std::io::sink(), &header, QUEUE_BYTES).unwrap();
    app.add_plugin(&RecorderOutlet::new([port])).unwrap();
    // Nobody empties the journal of the filter's steps either. It becomes full and drops its oldest entries.
    let (journal, steps) = Journal::new(1000);
    let NavigationConfig::Filter(settings) = vehicle.navigation else { panic!("no filter") };
    let profile = vehicle.tunnel.profile.clone();
    let filters = TwoFilterNavigation::new(profile, vehicle.site, settings, journal);
    let mut dive = app.arm(Box::new(filters)).unwrap();
    let mut ports: Vec<_> =
        (0..vehicle.sensors.len()).map(|source| dive.take_port(source).unwrap()).collect();
    let mut console = dive.take_console().unwrap();

    let mut simulation = Simulation::new(&scene).unwrap();
    let mut until = START;
    let (mut packets, mut allocated, mut waited) = (0_usize, 0, 0_u64);
    while packets < 1_000_000 {
        until = until + DurNs(20_000_000);
        while simulation.peek_message().is_some_and(|message| message.at < until) {
            let message = simulation.next_message().unwrap();
            if message.direction == Direction::Received {
                ports[usize::from(message.source)].send(message.at, message.bytes).unwrap();
            }
        }
        if until.0.is_multiple_of(1_000_000_000) {
            let command = COMMANDS[usize::try_from(until.0 / 1_000_000_000).unwrap() % COMMANDS.len()];
            console.send(until, command.as_bytes()).unwrap();
        }
        while dive.has_waiting() {
            let mut consumed = 0;
            allocated += allocations(|| consumed = dive.tick(until));
            packets += consumed;
            if consumed == 0 {
                // The recorder has fallen behind, so the loop holds packets back, and no packet is lost.
                waited += 1;
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
        assert!(simulation.peek_message().is_some(), "the scene is too short: {packets} packets");
    }
    assert_eq!(allocated, 0, "allocator calls in {packets} packets");
    let (list, counts) = (dive.view().alert_list(), dive.view().console_counts());
    assert!(list.raised() > 5 && dive.view().notes().iter().count() > 5, "{} alerts", list.raised());
    assert!(list.iter().any(|alert| alert.acknowledged.is_some()) && counts.invalid > 5, "{counts:?}");
    assert!(notices.dropped() > 0, "the notice queue has overflowed");
    assert!(steps.dropped() > 0, "the journal has overflowed");
    drop(dive);
    let written = recorder.finish().unwrap();
    println!("{packets} packets, {} messages recorded, waited {waited} times", written.messages);
    assert!(written.messages >= packets as u64, "recorded input is never dropped");
}

/// The decoders get the bytes of their devices in pieces. Some of the bytes are damaged.
#[test]
fn decoders_of_other_vehicles_allocate_nothing() {
    let header = MavHeader { system_id: 1, component_id: 1, sequence: 0 };
    let imu = Imu {
        message: ImuMessage::Raw,
        time_us: 1,
        force_mg: [0, 0, -1000],
        rate_mradps: [1, 2, 3],
        unit: 0,
    };
    let frames = Message::Imu(imu).to_frame(header).raw_bytes().repeat(500);
    let reports: Vec<u8> = (0..500)
        .flat_map(|number| {
            let velocity = Velocity {
                against: Against::Bottom,
                velocity_mps: [0.2, 0.001 * f64::from(number), 0.0],
                fom_mps: 0.002,
                altitude_m: 1.0,
                valid_beams: 4,
                is_valid: true,
                status: 0,
                times_us: Some([i64::from(number), i64::from(number) + 1000]),
            };
            velocity.encode()
        })
        .collect();
    let part = Part::Imu { message: Some(ImuMessage::Raw) };
    let meaning = mavlink::DecoderSettings { part, system_id: None, component_id: None, latency: DurNs(0) };
    let mut autopilot = MavlinkDecoder::new(meaning);
    let mut log =
        A50Decoder::new(a50::DecoderSettings { fom_max_mps: 0.4, max_speed_mps: 3.0, latency: DurNs(0) });
    let devices: [(&mut dyn Decoder, Vec<u8>); 2] = [(&mut autopilot, frames), (&mut log, reports)];
    for (decoder, mut bytes) in devices {
        bytes.iter_mut().step_by(3001).for_each(|byte| *byte ^= 0x55);
        let (mut at, mut readings) = (START, 0);
        let allocated = allocations(|| {
            for piece in bytes.chunks(97) {
                at = at + DurNs(1_000_000);
                decoder.decode(Packet { received: at, bytes: piece }, &mut |_| readings += 1);
            }
        });
        let counts = decoder.counts();
        assert_eq!(allocated, 0, "{readings} readings, {counts:?}");
        assert!(readings > 400 && counts.bad_frames > 0, "{readings} readings, {counts:?}");
    }
}
