//! Measures memory, open files, threads, CPU time and dropped data in a long rehearsal in which devices freeze now and
//! then.
//!
//! `HEADRACE_SOAK_MINUTES=60 cargo test -p headrace_tests --test ports soak -- --ignored --nocapture`

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::Duration;

use headrace_tests::Folder;

use super::rehearsal::{Running, headrace, interrupt, report, scene};

/// Default duration of a soak test (a long run that watches resources), minutes.
const MINUTES: f64 = 10.0;
/// Interval between two samples of the process's resources.
const LOOK: Duration = Duration::from_secs(5);
const LOOKS_A_FAULT: usize = 7;
/// Duration of each freeze of a device.
const FREEZE: Duration = Duration::from_millis(1_500);
/// Number of resource samples at the start of the test that the checks of open files and threads ignore.
const WARM_UP: usize = 12;

/// Resources that a process uses at a moment.
#[derive(Debug, Clone, Copy)]
struct Look {
    resident_kib: f64,
    files: usize,
    threads: f64,
    cpu_ticks: f64,
}

fn look(pid: u32) -> Option<Look> {
    let proc = format!("/proc/{pid}");
    let status = std::fs::read_to_string(format!("{proc}/status")).ok()?;
    let field = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse::<f64>().ok()
    };
    let stat = std::fs::read_to_string(format!("{proc}/stat")).ok()?;
    let words: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    // In `/proc/PID/stat`, user time and system time are the 12th and 13th words after the process name.
    let cpu_ticks = words.get(11)?.parse::<f64>().ok()? + words.get(12)?.parse::<f64>().ok()?;
    let files = std::fs::read_dir(format!("{proc}/fd")).ok()?.count();
    Some(Look { resident_kib: field("VmRSS:")?, files, threads: field("Threads:")?, cpu_ticks })
}

/// Slope of the straight line that fits equally spaced values best, per step.
fn slope(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let (mean_at, mean) = ((count - 1.0) / 2.0, values.iter().sum::<f64>() / count);
    let (mut along, mut square) = (0.0, 0.0);
    for (at, value) in values.iter().enumerate() {
        let at = at as f64 - mean_at;
        along += at * (value - mean);
        square += at * at;
    }
    along / square
}

fn signal(pid: u32, name: &str) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

#[test]
#[ignore = "takes ten minutes and more: HEADRACE_SOAK_MINUTES"]
fn soak_neither_leaks_nor_drops() {
    let minutes = std::env::var("HEADRACE_SOAK_MINUTES").map_or(MINUTES, |text| text.parse().unwrap());
    let looks = (minutes * 60.0 / LOOK.as_secs_f64()).ceil();
    let folder = Folder::new();
    folder.write("scene.toml", scene(0.09 * minutes * 60.0 + 20.0));
    let mut emulate = headrace();
    emulate
        .args(["emulate", "--stand", "0", "--out"])
        .arg(folder.path("rehearsal"))
        .arg(folder.path("scene.toml"));
    let mut emulate = Running(emulate.stdout(Stdio::piped()).spawn().unwrap());
    let mut said = BufReader::new(emulate.0.stdout.take().unwrap()).lines().map(Result::unwrap);
    let vehicle = said.find_map(|line| line.strip_prefix("vehicle ").map(str::to_owned)).unwrap();
    let mut run = headrace();
    run.args(["run", &vehicle, "--rotate", "5min", "--record"]).arg(folder.path("live.mcap"));
    let mut run =
        Running(run.arg("--report").arg(folder.path("live.json")).stdout(Stdio::null()).spawn().unwrap());
    let pid = run.0.id();
    let mut taken = Vec::new();
    let mut freezes = 0;
    for number in 0.. {
        if f64::from(number) >= looks {
            break;
        }
        std::thread::sleep(LOOK);
        taken.push(look(pid).unwrap_or_else(|| panic!("the dive has ended after {} looks", taken.len())));
        if taken.len().is_multiple_of(LOOKS_A_FAULT) {
            freezes += 1;
            signal(emulate.0.id(), "-STOP");
            std::thread::sleep(FREEZE);
            signal(emulate.0.id(), "-CONT");
        }
    }
    interrupt(&run.0);
    let status = run.0.wait().unwrap();
    let report = report(&folder.path("live.json"));
    let warm = &taken[WARM_UP.min(taken.len() / 2)..];
    let an_hour = 3600.0 / LOOK.as_secs_f64();
    let resident: Vec<f64> = warm.iter().map(|look| look.resident_kib / 1024.0).collect();
    let tenths: Vec<String> =
        (0..=10).map(|tenth| format!("{:.1}", resident[tenth * (resident.len() - 1) / 10])).collect();
    // Memory growth is checked only in the second half of the soak test. In the first half, memory of rings, lists and
    // sections becomes resident. This memory is allocated at the start of the dive, but becomes resident only when it
    // is first used.
    let later = &resident[resident.len() / 2..];
    let (first, last) = (warm[0], warm[warm.len() - 1]);
    // Linux counts CPU time in ticks of 10 ms.
    let core = (last.cpu_ticks - first.cpu_ticks) / 100.0 / ((warm.len() - 1) as f64 * LOOK.as_secs_f64());
    let dropped: u64 = report["sources"]
        .as_array()
        .unwrap()
        .iter()
        .map(|source| source["line"]["dropped_packets"].as_u64().unwrap())
        .sum();
    println!(
        "{minutes} min, {freezes} freezes of {FREEZE:?}: exit {status}; MiB {}, in the second half {:+.1} an hour; {} to {} files; \
         {} to {} threads; {:.2} % of a core; {dropped} packets dropped; way {} m; losses {}",
        tenths.join(" "),
        slope(later) * an_hour,
        first.files,
        last.files,
        first.threads,
        last.threads,
        core * 100.0,
        report["coverage_extent"]["length_m"],
        report["log"]["losses"],
    );
    assert_eq!(dropped, 0);
    assert_eq!(report["log"]["losses"], serde_json::json!([]));
    assert!(last.files <= first.files + 2 && last.threads <= first.threads, "{first:?} {last:?}");
}
