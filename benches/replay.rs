//! Replay of a long dive by the program, on one thread and on several, compared with reading its log with `mcap`
//! alone. Prints Markdown.
//!
//! `cargo bench -p headrace_tests --bench replay` uses the first kilometre of `deploy/scenes/seven-kilometres.toml`
//! and takes about a minute; `-- 7` uses the whole scene, and `-- DIVE.mcap ...` uses existing logs. The bench writes
//! its log to the system's temporary folder (145 MB per kilometre) and removes it at the end.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use headrace_replay::threads::MOST_THREADS;
use mcap::sans_io::{LinearReadEvent, LinearReader};

const HEADRACE: &str = env!("CARGO_BIN_EXE_headrace_under_test");

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let folder = std::env::temp_dir().join(format!("headrace-replay-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    println!("| what | figure | yardstick in the same run | ratio |\n|---|---|---|---|");
    let km = words.iter().find_map(|word| word.parse::<u32>().ok());
    let logs: Vec<&String> = words.iter().filter(|word| word.parse::<u32>().is_err()).collect();
    if let Some(km) = km.or(logs.is_empty().then_some(1)) {
        let km = km.clamp(1, 7);
        compare(&simulated(&folder, km), &format!("{km} km of four heads"), &folder);
    }
    for log in logs {
        compare(Path::new(log), log, &folder);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Prints the replay times of a log beside the time to read the log with `mcap` alone.
fn compare(log: &Path, name: &str, folder: &Path) {
    let report_file = folder.join("report.json");
    let (messages, _, first) = bare_read(log);
    let replays = [1, MOST_THREADS].map(|threads| (threads, replayed(log, &report_file, threads)));
    let (_, bytes, second) = bare_read(log);
    let bare = first.min(second);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report_file).unwrap()).unwrap();
    std::fs::remove_file(&report_file).unwrap();
    let (data_s, packets) =
        (report["dive"]["duration_s"].as_f64().unwrap(), report["log"]["messages"].as_f64().unwrap());
    for (threads, replay) in replays {
        let took_s = replay.took.as_secs_f64();
        println!(
            "| replay of {name}, {:.1} hours, {packets} packets, {} samples, --threads {threads} | {:.0} x real time, \
             {:.2} M packets/s | the bare mcap read of {messages} messages, {:.0} MB: {:.0} x real time | {:.1} |",
            data_s / 3600.0,
            report["dive"]["samples_valid"],
            data_s / took_s,
            packets / took_s / 1e6,
            bytes as f64 / 1e6,
            data_s / bare.as_secs_f64(),
            took_s / bare.as_secs_f64()
        );
        println!(
            "| memory of that replay, at most | {:.1} MiB, and {:.1} MiB of the program's own file | | |",
            replay.own_mib, replay.file_mib
        );
    }
}

/// Simulates a log of the scene's first kilometres.
fn simulated(folder: &Path, km: u32) -> PathBuf {
    let root = headrace_tests::root();
    let text = std::fs::read_to_string(root.join("deploy/scenes/seven-kilometres.toml")).unwrap();
    let vehicle = root.join("deploy/vehicles/vita2-4.toml");
    let text = text
        .replace("../vehicles/vita2-4.toml", &vehicle.display().to_string())
        .replace("distance_m = 6990", &format!("distance_m = {}", km * 1000 - 10));
    let (scene, log) = (folder.join("scene.toml"), folder.join("dive.mcap"));
    std::fs::write(&scene, text).unwrap();
    let done = Command::new(HEADRACE).arg("simulate").arg(&scene).arg("-o").arg(&log).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    log
}

struct Replayed {
    took: Duration,
    own_mib: f64,
    file_mib: f64,
}

fn replayed(log: &Path, report: &Path, threads: usize) -> Replayed {
    let started = Instant::now();
    let mut command = Command::new(HEADRACE);
    let command = command.arg("replay").arg(log).arg("--report").arg(report);
    let command = command.arg("--threads").arg(threads.to_string());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let (mut own_mib, mut file_mib) = (0.0_f64, 0.0_f64);
    while child.try_wait().unwrap().is_none() {
        own_mib = own_mib.max(mib_of(&child, "RssAnon:"));
        file_mib = file_mib.max(mib_of(&child, "RssFile:"));
        std::thread::sleep(Duration::from_millis(10));
    }
    Replayed { took: started.elapsed(), own_mib, file_mib }
}

/// One of the memory figures that the system reports for a process, MiB; zero if it isn't available.
fn mib_of(child: &Child, key: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let words = status.lines().find_map(|line| line.strip_prefix(key)).unwrap_or("0");
    words.trim().trim_end_matches(" kB").parse::<f64>().unwrap_or(0.0) / 1024.0
}

/// Number of messages, file size in bytes, and the time to read the file with the `mcap` crate.
fn bare_read(log: &Path) -> (u64, u64, Duration) {
    let started = Instant::now();
    let mut file = std::fs::File::open(log).unwrap();
    let mut reader = LinearReader::new();
    let (mut messages, mut sum) = (0, 0_u64);
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let got = file.read(reader.insert(wanted)).unwrap();
                reader.notify_read(got);
            }
            LinearReadEvent::Record { opcode: mcap::records::op::MESSAGE, data } => {
                messages += 1;
                sum += data.len() as u64;
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    std::hint::black_box(sum);
    (messages, file.metadata().unwrap().len(), started.elapsed())
}
