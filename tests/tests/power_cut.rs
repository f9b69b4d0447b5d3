//! `kill -9` at random moments. After each kill, the log is readable, and at most the last second is lost.
//!
//! The log contains everything that was displayed more than a second before the kill. The log's replay gives the same
//! dive up to the log's end, bit for bit.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use headrace_tests::{Folder, VEHICLE};
use serde_json::Value;

/// Number of dives that are killed.
const KILLS: usize = 200;
/// Number of dives that the test runs at the same time.
const AT_ONCE: usize = 6;
/// Longest time from the start of a dive to its kill, ms.
const LONGEST_MS: u64 = 2200;
/// Longest span of data that a kill may lose.
const MAY_COST: Duration = Duration::from_secs(1);

/// A dive of a minute and a half. In a part of it the vehicle is too fast, so that there are flags that a kill could
/// lose.
const SCENE: &str = r#"name = "a dive to kill"
vehicle = "vehicle.toml"

[trajectory]
start_m = 3

[[trajectory.legs]]
distance_m = 4
speed_mps = 0.2

[[trajectory.legs]]
distance_m = 20
speed_mps = 0.8

[[trajectory.legs]]
distance_m = 10
speed_mps = 0.2
"#;

#[expect(
    clippy::disallowed_methods,
    reason = "the loss in a power cut is wall time, and no result depends on it"
)]
fn wall_clock() -> Instant {
    Instant::now()
}

/// Counts of kills and results over all killed dives.
#[derive(Default)]
struct Count {
    /// Number of kills before the log had a header.
    before: AtomicUsize,
    /// Number of kills after the dive had ended by itself.
    after: AtomicUsize,
    /// Number of lines displayed more than a second before the kill.
    lines: AtomicUsize,
    /// Number of recorded results that a replay of the log reproduced bit for bit.
    same: AtomicU64,
    /// Longest time for which the test waited for the machine's disk or processor, ns. Other work on the machine may
    /// use them.
    late_ns: AtomicU64,
}

/// Element `n` of a fixed sequence of pseudorandom numbers.
fn random(n: u64) -> u64 {
    let mut word = (n + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}

/// Starts a dive and kills it. Returns the lines displayed more than a second before the kill, and whether the dive
/// had ended by itself.
fn killed(folder: &Folder, arguments: &[&str], after: Duration, count: &Count) -> (Vec<String>, bool) {
    let mut dive = headrace_tests::program()
        .args(arguments)
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let out = BufReader::new(dive.stdout.take().unwrap());
    let reading = std::thread::spawn(move || {
        out.lines().map_while(Result::ok).map(|line| (wall_clock(), line)).collect::<Vec<_>>()
    });
    std::thread::sleep(after);
    // The kill takes effect a little later than this moment. Counting the second before the kill from this moment is
    // therefore on the safe side.
    let moment = wall_clock();
    let ended = dive.try_wait().unwrap().is_some();
    dive.kill().ok();
    dive.wait().unwrap();
    let may_cost = MAY_COST + Duration::from_nanos(count.late_ns.load(Ordering::Relaxed));
    let known = reading.join().unwrap().into_iter().filter(|(read, _)| *read + may_cost <= moment);
    (known.map(|(_, line)| line).collect(), ended)
}

/// Whether all lines of `lines` occur in `others`, in the same order.
fn is_subsequence(lines: &[String], others: &str) -> bool {
    let mut rest = others.lines();
    lines.iter().all(|line| rest.any(|other| other == line))
}

fn kill(folder: &Folder, number: usize, count: &Count) {
    let seed = random(number as u64);
    let after = Duration::from_millis(20 + seed % LONGEST_MS);
    let (out, log) = (format!("out-{number}"), format!("killed-{number}.mcap"));
    let is_demo = number.is_multiple_of(2);
    let (arguments, log): (Vec<&str>, String) = if is_demo {
        (vec!["demo", "--speed", "20x", "--out", &out], format!("{out}/dive.mcap"))
    } else {
        (
            vec!["run", "vehicle.toml", "--source", "dive.mcap", "--record", &log, "--speed", "20x"],
            log.clone(),
        )
    };
    let (mut lines, ended) = killed(folder, &arguments, after, count);
    // The demonstration's first line is its title.
    lines.retain(|line| !line.ends_with("a simulated dive"));
    count.after.fetch_add(usize::from(ended), Ordering::Relaxed);
    count.lines.fetch_add(lines.len(), Ordering::Relaxed);
    let which = format!("kill {number} after {after:?} ({arguments:?})");

    let answer = folder.headrace(&["verify", "--json", &log]);
    let Ok(report) = serde_json::from_str::<Value>(&answer.stdout) else {
        // The log or its header didn't exist yet at the kill, so the dive hadn't begun.
        assert!(lines.is_empty(), "{which}: {}, but the pilot had read {lines:?}", answer.stderr);
        let early = ["could not open", "is not an MCAP file", "no vehicle file can be read"];
        assert!(early.iter().any(|words| answer.stderr.contains(words)), "{which}: {}", answer.stderr);
        count.before.fetch_add(1, Ordering::Relaxed);
        return;
    };
    let same = report["same_records"].as_u64().unwrap();
    assert_eq!(report["differences"], Value::Array(Vec::new()), "{which}: {report}");
    match answer.code {
        Some(0) => assert!(ended, "{which}: no loss is reported: {report}"),
        Some(3) => assert!(same > 0 && report["losses"][0].is_string(), "{which}: {report}"),
        // In this case, the killed dive had not published any result yet.
        code => assert!(code == Some(1) && same == 0 && lines.is_empty(), "{which}: {code:?}, {report}"),
    }
    count.same.fetch_add(same, Ordering::Relaxed);
    let replayed = folder.headrace(&["replay", &log]).stdout;
    assert!(
        is_subsequence(&lines, &replayed),
        "{which}: the pilot had read {lines:#?}, but the replay shows {replayed}"
    );
    let log = folder.path(&log);
    std::fs::remove_file(&log).unwrap_or_else(|error| panic!("{}: {error}", log.display()));
}

#[test]
fn two_hundred_kills_lose_at_most_the_last_second() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("scene.toml", SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    let (count, next, over) = (Count::default(), AtomicUsize::new(0), AtomicBool::new(false));
    let begun = wall_clock();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let nap = Duration::from_millis(10);
            let mut beside = std::fs::File::create(folder.path("beside")).unwrap();
            while !over.load(Ordering::Relaxed) {
                let slept = wall_clock();
                std::thread::sleep(nap);
                beside.write_all(&[0; 4096]).unwrap();
                beside.sync_data().unwrap();
                let late = u64::try_from(slept.elapsed().saturating_sub(nap).as_nanos()).unwrap();
                count.late_ns.fetch_max(late, Ordering::Relaxed);
            }
        });
        let dives = || {
            while let number @ ..KILLS = next.fetch_add(1, Ordering::Relaxed) {
                kill(&folder, number, &count);
            }
        };
        let workers: Vec<_> = (0..AT_ONCE).map(|_| scope.spawn(dives)).collect();
        let results: Vec<_> = workers.into_iter().map(std::thread::ScopedJoinHandle::join).collect();
        over.store(true, Ordering::Relaxed);
        if let Some(panic) = results.into_iter().find_map(Result::err) {
            std::panic::resume_unwind(panic);
        }
    });
    let [before, after, lines] =
        [&count.before, &count.after, &count.lines].map(|n| n.load(Ordering::Relaxed));
    let same = count.same.load(Ordering::Relaxed);
    eprintln!(
        "{KILLS} kills in {:.0} s: {before} before there was a log, {after} after the end, {lines} lines that were read a \
         second before, {same} results the same; disk and processor up to {:.0} ms late",
        begun.elapsed().as_secs_f64(),
        count.late_ns.load(Ordering::Relaxed) as f64 / 1e6,
    );
    assert!(before < KILLS / 4 && after < KILLS / 4, "most kills are in the middle of a dive");
    assert!(lines > KILLS / 4 && same > 10_000, "there was something to lose");
}
