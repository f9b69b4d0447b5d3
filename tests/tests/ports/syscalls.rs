//! An armed tick makes no system call, checked with strace.

use std::process::Command;

use headrace_geometry::time::DurNs;
use headrace_monitor::App;
use headrace_monitor::notice_outlet::NoticeOutlet;
use headrace_replay::log::{LogHeader, Recorder, SourceInfo};
use headrace_replay::record::{QUEUE_BYTES, RecorderOutlet, result_channels};
use headrace_sensor::device::Direction;
use headrace_simulator::{START, Simulation};
use headrace_tests::{Folder, scenes, skipped};
use rustix::process::{getpgrp, getppid, getuid};

const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\n
[[trajectory.legs]]\ndistance_m = 40\nspeed_mps = 0.2\n
[[trajectory.legs]]\ndistance_m = 40\nspeed_mps = 0.4\n";
const PACKETS: usize = 40_000;

/// Runs the traced work between two system calls that mark its start and end. No other code makes these calls.
fn marked<T>(work: impl FnOnce() -> T) -> T {
    std::hint::black_box(getppid());
    let done = work();
    std::hint::black_box(getpgrp());
    done
}

/// System calls that occur between the marking calls in the trace, and the number of marked intervals.
fn calls(trace: &str) -> (Vec<&str>, usize) {
    let (mut within, mut calls, mut parts) = (None, Vec::new(), 0);
    for line in trace.lines() {
        let Some((thread, call)) = line.split_once(' ').map(|(thread, call)| (thread, call.trim_start()))
        else {
            continue;
        };
        if call.starts_with("getppid(") {
            within = Some(thread);
        } else if within == Some(thread) && call.starts_with("getpgrp(") {
            within = None;
            parts += 1;
        } else if within == Some(thread)
            // Signals in the trace don't count. The line for the end of an interrupted call doesn't count either,
            // because the call may be a mark.
            && !call.starts_with("---")
            && !call.starts_with("<... ")
        {
            calls.push(call);
        }
    }
    (calls, parts)
}

#[test]
fn tick_of_a_running_loop_makes_no_system_call() {
    let folder = Folder::new();
    let trace = folder.path("trace");
    let traced = |program: &std::path::Path, arguments: &[&str]| {
        let mut strace = Command::new("strace");
        strace.args(["-f", "-qq", "-o"]).arg(&trace).arg(program).args(arguments).output()
    };
    if !traced("true".as_ref(), &[]).is_ok_and(|output| output.status.success()) {
        skipped("strace isn't there, or may not trace");
        return;
    }
    let ticks =
        ["--exact", "syscalls::ticks_run_under_the_system_call_trace", "--ignored", "--test-threads=1"];
    let output = traced(&std::env::current_exe().unwrap(), &ticks).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let trace = std::fs::read_to_string(&trace).unwrap();
    let (calls, ticks) = calls(&trace);
    // The traced work calls `getuid` on purpose, to prove that the trace shows system calls.
    assert!(calls.len() == 1 && calls[0].starts_with("getuid("), "in {ticks} ticks: {calls:#?}");
    assert!(ticks > 1000, "{ticks} ticks");
}

#[test]
#[ignore = "tick_of_a_running_loop_makes_no_system_call runs it"]
fn ticks_run_under_the_system_call_trace() {
    let scene = scenes::scene(SCENE);
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let (outlet, _notices) = NoticeOutlet::new(1000);
    app.add_plugin(&outlet).unwrap();
    let sources = vehicle.sensor_configs.iter().map(|sensor| SourceInfo {
        id: sensor.id.clone(),
        plugin: sensor.plugin.clone(),
        connect: sensor.connect.clone(),
    });
    let header = LogHeader {
        vehicle_toml: scene.vehicle_text.clone(),
        sources: sources.collect(),
        ticks: true,
        results: result_channels(),
        ..LogHeader::default()
    };
    let (port, recorder) = Recorder::start(std::io::sink(), &header, QUEUE_BYTES).unwrap();
    app.add_plugin(&RecorderOutlet::new([port])).unwrap();
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let mut ports: Vec<_> =
        (0..vehicle.sensors.len()).map(|source| dive.take_port(source).unwrap()).collect();
    let mut simulation = Simulation::new(&scene).unwrap();
    let (mut until, mut packets) = (START, 0);
    while packets < PACKETS {
        until = until + DurNs(20_000_000);
        while simulation.peek_message().is_some_and(|message| message.at < until) {
            let message = simulation.next_message().unwrap();
            if message.direction == Direction::Received {
                ports[usize::from(message.source)].send(message.at, message.bytes).unwrap();
            }
        }
        while dive.has_waiting() {
            let consumed = marked(|| dive.tick(until));
            packets += consumed;
            if consumed == 0 {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
    }
    marked(getuid);
    drop(dive);
    recorder.finish().unwrap();
}
